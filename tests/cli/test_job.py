"""What every job's command line promises."""

from __future__ import annotations

import errno
import importlib
import importlib.util
import os
import signal
import time
from pathlib import Path

import click
import pytest
from click.testing import CliRunner

from whsklearn.cli.job import Ended, job, root, table, writable_file, writable_folder
from whsklearn.effects.base import ArgumentError
from whsklearn.logs import ColumnError, LogError
from whsklearn.logs.files import atomic_write

JOBS = ["simulated_example", "reproduce", "turntable", "tune", "stream", "fleet", "close_gap"]


def test_runs_are_kept_where_the_command_is_called(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert root() == tmp_path
    monkeypatch.chdir(Path(__file__).parent)
    assert root() == Path(__file__).parents[2]


@pytest.mark.parametrize("name", JOBS)
def test_help_names_the_common_options(name):
    command = importlib.import_module(f"pipelines.{name}").main
    done = CliRunner().invoke(command, ["--help"])
    assert done.exit_code == 0
    assert {"--seed", "--no-track"} <= {word for line in done.output.splitlines() for word in line.split()}


@pytest.mark.parametrize(("name", "hidden"), [("identify", {"--seed"}), ("simulate", {"--seed", "--no-track"})])
def test_what_changes_nothing_is_taken_and_not_shown(name, hidden):
    command = importlib.import_module(f"pipelines.{name}").main
    words = set(CliRunner().invoke(command, ["--help"]).output.split())
    assert {"--seed", "--no-track"} - words == hidden
    done = CliRunner().invoke(command, ["no.file", "no.file", "--seed", "1", "--no-track"])
    assert "no.file" in done.output
    assert "No such option" not in done.output


def test_the_common_options_come_behind_the_own_ones():
    @job
    @click.option("--own")
    def main(**options):
        """Do nothing."""

    assert [p.name for p in main.params] == ["own", "seed", "track"]


@pytest.mark.parametrize("error", [ValueError("bad p"), OSError("no such log"), ImportError("no extra")])
def test_expected_errors_are_one_sentence(error):
    @job
    def main(**options):
        """Fail."""
        raise error

    done = CliRunner().invoke(main)
    assert done.exit_code == 1
    assert done.output == f"Error: {error}\n"


def test_a_reader_that_has_ended_is_told_nothing():
    """As in ``whsklearn compare a.csv b.csv | head -1``."""

    @job
    def main(**options):
        """Fail."""
        raise BrokenPipeError(errno.EPIPE, "Broken pipe")

    done = CliRunner().invoke(main)
    assert done.exit_code == 1
    assert not done.output


@pytest.mark.parametrize(
    ("error", "status"),
    [
        (ArgumentError("bad"), 2),
        (LogError("bad"), 3),
        (ColumnError("bad"), 2),
        (KeyboardInterrupt(), 130),
        (Ended(), 143),
    ],
)
def test_the_exit_status_tells_the_kind_of_failure(error, status):
    @job
    def main(**options):
        """Fail."""
        raise error

    assert CliRunner().invoke(main).exit_code == status


def test_sigterm_is_an_interruption_that_closes_what_is_open():
    closed = []

    @job
    def main(**options):
        """Wait to be ended."""
        try:
            os.kill(os.getpid(), signal.SIGTERM)
            time.sleep(5)
        finally:
            closed.append(True)

    before = signal.getsignal(signal.SIGTERM)
    assert CliRunner().invoke(main).exit_code == 143
    assert closed
    assert signal.getsignal(signal.SIGTERM) == before


def test_an_output_is_looked_at_before_the_work(tmp_path):
    assert writable_file(tmp_path / "new" / "table.csv").parent.is_dir()
    with pytest.raises(ValueError, match="is a folder"):
        writable_file(tmp_path)
    assert list((tmp_path / "new").iterdir()) == []


@pytest.mark.parametrize("writes", [False, True])
def test_a_folder_in_which_nothing_was_written_is_removed(tmp_path, writes):
    def refused(out, **_):
        folder = writable_folder(out)
        if writes:
            (folder / "page.html").write_text("")
        raise LogError("the log is empty")

    command = job(click.argument("out")(refused))
    (tmp_path / "there").mkdir()
    for out in ("new/model", "there"):
        assert CliRunner().invoke(command, [str(tmp_path / out), "--no-track"]).exit_code == 3
    assert (tmp_path / "there").is_dir()
    assert (tmp_path / "new").exists() == writes


def test_a_file_that_does_not_fit_is_told_and_none_is_left(tmp_path):
    resource = pytest.importorskip("resource", reason="no limits here")
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)

    @job
    def main(**options):
        """Write more than is allowed."""
        resource.setrlimit(resource.RLIMIT_FSIZE, (1000, limits[1]))
        try:
            atomic_write(tmp_path / "gap.html", bytes(2000))
        finally:
            resource.setrlimit(resource.RLIMIT_FSIZE, limits)

    done = CliRunner().invoke(main)
    assert done.exit_code == 1
    assert done.output == (
        f"Error: {tmp_path / 'gap.html'} cannot be written (File too large); make room or name another folder.\n"
    )
    assert list(tmp_path.iterdir()) == []


def test_defects_are_not_hidden():
    @job
    def main(**options):
        """Fail."""
        raise ZeroDivisionError

    assert isinstance(CliRunner().invoke(main).exception, ZeroDivisionError)
    assert isinstance(main, click.Command)


def test_a_wide_table_is_wrapped_in_its_first_column():
    names = ["x" * 200, "a name of more words than there is room for beside eight columns of numbers with digits"]
    lines = table(["name", *"abcdefgh"], [[name, *[0.123456] * 8] for name in names]).splitlines()
    assert max(map(len, lines)) == 100
    column = "".join(line.partition("  0.123")[0] for line in lines[2:])
    assert "".join(column.split()) == "".join("".join(names).split())  # nothing of a name is lost
