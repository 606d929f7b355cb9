"""The command line as a whole: its list, its help, and that help compiles nothing."""

from __future__ import annotations

import importlib
import importlib.util
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


@pytest.mark.parametrize("name", [n for n in COMMANDS if importlib.util.find_spec(f"whsklearn.cli.{n}")])
def test_every_command_has_help_with_an_example_and_needs_no_compiler_for_it(name):
    done = helped(name)
    assert "whsklearn " + name in done.stdout
    assert "'numba'" not in done.stdout
    assert "'pandas'" not in done.stdout


def test_an_unknown_command_is_a_wrong_option():
    assert CliRunner().invoke(whsklearn_command, ["cook"]).exit_code == 2


def test_help_of_every_command_compiles_nothing():
    code = "import importlib, sys; from whsklearn.cli import COMMANDS, WIDTH; "
    code += "[importlib.import_module('whsklearn.cli.' + c) for c in COMMANDS]; "
    code += "print({'numba', 'mlflow'} & set(sys.modules))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "set()"


@pytest.mark.parametrize("name", sorted(COMMANDS))
def test_help_is_quick_and_clean(name):
    shown = CliRunner().invoke(main, [name, "--help"])
    assert shown.exit_code == 0
    assert "\\b" not in shown.output  # click's mark for lines that are not to be wrapped
    assert max(map(len, shown.output.splitlines())) <= WIDTH
    assert shown.output.startswith("Usage: main ")


def test_all_commands_are_in_the_list_of_the_group():
    assert set(COMMANDS) == set(main.list_commands(click.Context(main)))
    assert CliRunner().invoke(main, ["unknown"]).exit_code == 2
