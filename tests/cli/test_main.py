"""The command line as a whole: its list, its help, and that help compiles nothing."""

from __future__ import annotations

import subprocess
import sys

import click
import pytest
from click.testing import CliRunner

from whsklearn.cli import COMMANDS, WIDTH, main
from whsklearn.cli import main as whsklearn_command


def helped(*words):
    """The output of a command's help, and the modules that it took."""
    code = "import sys; from whsklearn.cli import main; main(sys.argv[1:], standalone_mode=False); print(sys.modules)"
    return subprocess.run([sys.executable, "-c", code, *words, "--help"], capture_output=True, text=True, check=True)


def test_the_command_lists_its_commands_without_importing_them():
    done = helped()
    assert all(name in done.stdout for name in ("gap", "tune", "stream", "export"))
    assert "'numba'" not in done.stdout
    assert "'sklearn'" not in done.stdout


def test_no_command_needs_a_compiler_for_its_help():
    code = "import sys; from whsklearn.cli import COMMANDS, main; "
    code += "[main([name, '--help'], standalone_mode=False) for name in COMMANDS]; "
    code += "print({'numba', 'pandas', 'mlflow'} & set(sys.modules))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.splitlines()[-1] == "set()"


def test_an_unknown_command_is_a_wrong_option():
    assert CliRunner().invoke(whsklearn_command, ["cook"]).exit_code == 2


@pytest.mark.parametrize("name", sorted(COMMANDS))
def test_help_is_quick_and_clean(name):
    shown = CliRunner().invoke(main, [name, "--help"])
    assert shown.exit_code == 0
    assert "\\b" not in shown.output  # click's mark for lines that are not to be wrapped
    assert max(map(len, shown.output.splitlines())) <= WIDTH
    assert shown.output.startswith("Usage: main ")
    assert "whsklearn " + name in shown.output, "an example"


def test_all_commands_are_in_the_list_of_the_group():
    assert set(COMMANDS) == set(main.list_commands(click.Context(main)))
    assert CliRunner().invoke(main, ["unknown"]).exit_code == 2
