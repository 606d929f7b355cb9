"""The command writes every format and says what is lost."""

from __future__ import annotations

import pytest
from click.testing import CliRunner

from whsklearn.cli import main
from whsklearn.effects import as_law
from whsklearn.models import AxisModel, save_model


@pytest.fixture
def model(tmp_path):
    path = tmp_path / "model.json"
    save_model(AxisModel(0.05, as_law("viscous,coulomb"), dt=0.001, logged="position"), path)
    return path


@pytest.mark.parametrize(("to", "mark"), [("mjcf", "<mujoco"), ("urdf", "<robot"), ("st", "FUNCTION_BLOCK")])
def test_a_model_is_written_in_its_format(model, tmp_path, to, mark):
    out = tmp_path / f"out.{to}"
    done = CliRunner().invoke(main, ["export", str(model), "--to", to, "--out", str(out)], catch_exceptions=False)
    assert done.exit_code == 0, done.output
    assert mark in out.read_text()


@pytest.mark.parametrize("to", ["c", "mjcf"])
def test_a_place_that_cannot_be_written_is_told_with_what_to_do(model, to):
    done = CliRunner().invoke(main, ["export", str(model), "--to", to, "--out", str(model / "out")])
    assert done.exit_code == 1
    assert "cannot be written (Not a directory); name another --out." in " ".join(done.output.split())


def test_a_wrong_format_is_a_wrong_option(model):
    assert CliRunner().invoke(main, ["export", str(model), "--to", "dwg"]).exit_code == 2
