"""Every command is listed, helps, and knows its seed."""

from __future__ import annotations

import click
import pytest
from click.testing import CliRunner

from whsklearn.cli import COMMANDS, main


@pytest.mark.parametrize("name", sorted(COMMANDS))
def test_help_is_quick_and_clean(name):
    shown = CliRunner().invoke(main, [name, "--help"])
    assert shown.exit_code == 0
    assert "\\b" not in shown.output  # click's mark for lines that are not to be wrapped
    assert shown.output.startswith("Usage: main ")


def test_all_commands_are_in_the_list_of_the_group():
    assert set(COMMANDS) == set(main.list_commands(click.Context(main)))
    assert CliRunner().invoke(main, ["unknown"]).exit_code == 2
