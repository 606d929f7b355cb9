"""What every job's command line promises."""

from __future__ import annotations

import importlib

import click
import pytest
from click.testing import CliRunner

from pipelines._cli import job, table
from pipelines.ui import page

JOBS = ["simulated_example", "reproduce", "turntable", "tune", "stream", "fleet", "close_gap"]


@pytest.mark.parametrize("name", JOBS)
def test_help_names_the_common_options(name):
    command = importlib.import_module(f"pipelines.{name}").main
    done = CliRunner().invoke(command, ["--help"])
    assert done.exit_code == 0
    assert {"--seed", "--no-track"} <= {word for line in done.output.splitlines() for word in line.split()}


@pytest.mark.parametrize("error", [ValueError("bad p"), OSError("no such log"), ImportError("no extra")])
def test_expected_errors_are_one_sentence(error):
    @job
    def main(**options):
        """Fail."""
        raise error

    done = CliRunner().invoke(main)
    assert done.exit_code == 1
    assert done.output == f"Error: {error}\n"


def test_defects_are_not_hidden():
    @job
    def main(**options):
        """Fail."""
        raise ZeroDivisionError

    assert isinstance(CliRunner().invoke(main).exception, ZeroDivisionError)
    assert isinstance(main, click.Command)


def test_wide_table_is_cut_in_its_first_column():
    text = table(["name", *"abcdefgh"], [["x" * 200, *[0.123456] * 8]])
    assert {len(line) for line in text.splitlines()} == {100}


def test_page_opens_on_runs_not_on_traces():
    address = page("http://127.0.0.1:5000", "3")
    assert address.startswith("http://127.0.0.1:5000/#/experiments/3/runs?workflowType=machine_learning")
    assert page("http://127.0.0.1:5000", None) == "http://127.0.0.1:5000"
