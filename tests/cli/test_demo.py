"""The demonstration: three commands in a row, of which the last reads what the second wrote."""

from __future__ import annotations

import click
import pytest
from click.testing import CliRunner

from whsklearn.cli import demo, gap, hidden_effect, simulated_example


@pytest.fixture
def called(monkeypatch):
    """What each command was called with, in turn."""
    calls = []

    def stands_for(name):
        return click.command()(lambda **options: calls.append((name, options)))

    for module in (simulated_example, hidden_effect, gap):
        monkeypatch.setattr(module, "main", stands_for(module.__name__.rpartition(".")[2]))
    return calls


def test_the_commands_run_in_turn_and_hand_on_seed_record_and_log(called, tmp_path):
    out = tmp_path / "new" / "reports"
    done = CliRunner().invoke(demo.main, ["--seed", "7", "--no-track", "--out", str(out)], catch_exceptions=False)
    assert done.exit_code == 0
    assert [name for name, _ in called] == ["simulated_example", "hidden_effect", "gap"]
    options = dict(called)
    assert all(o["seed"] == 7 for o in options.values())
    assert options["simulated_example"]["track"] is options["gap"]["track"] is False
    assert options["hidden_effect"]["out"] == options["gap"]["log_file"] == str(out / "hidden.csv")
    assert str(out / "gap") == options["gap"]["report"]
    assert str(out / "gap" / "gap.html") in done.output
    assert out.is_dir()


def test_a_folder_that_cannot_be_written_is_one_sentence_before_any_work(called, tmp_path):
    (tmp_path / "file").write_text("")
    done = CliRunner().invoke(demo.main, ["--out", str(tmp_path / "file" / "reports")])
    assert done.exit_code == 1
    assert done.output.startswith("Error: Nothing can be written into")
    assert called == []
