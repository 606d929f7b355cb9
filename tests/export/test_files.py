"""From a model file to the files of a format, as the command line does it."""

from __future__ import annotations

import pytest
from click.testing import CliRunner

from whsklearn.effects import Cogging, as_law
from whsklearn.export import FORMATS
from whsklearn.models import AxisModel, save_model


@pytest.mark.parametrize("to", FORMATS)
def test_the_command_writes_every_format(to, tmp_path):
    from whsklearn.cli.export import main

    save_model(
        AxisModel(0.05, as_law("viscous,coulomb"), (Cogging(0.1, 12.0),), dt=0.001, logged="position"),
        tmp_path / "model.json",
    )
    done = CliRunner().invoke(main, [str(tmp_path / "model.json"), "--to", to, "--out", str(tmp_path / "out")])
    assert done.exit_code == 0, done.output
    assert any((tmp_path / "out").iterdir())
    assert ("cogging" in done.output.replace("cogging.csv", "")) == (to in ("urdf", "isaac"))


def test_a_file_that_is_no_model_is_one_sentence(tmp_path):
    from whsklearn.cli.export import main

    (tmp_path / "model.json").write_text("{}")
    done = CliRunner().invoke(main, [str(tmp_path / "model.json"), "--to", "c", "--out", str(tmp_path)])
    assert done.exit_code == 1
    assert "model" in done.output
    assert "Traceback" not in done.output
