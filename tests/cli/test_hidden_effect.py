"""Writing a log with a hidden effect."""

from __future__ import annotations

import numpy as np
import pandas as pd
from click.testing import CliRunner

from whsklearn.cli.hidden_effect import main
from whsklearn.datasets import make_servo_log


def written(folder, *options):
    out = folder / "new" / "log.csv"
    done = CliRunner().invoke(main, ["--duration", "5", "--out", str(out), *options])
    assert done.exit_code == 0, done.output
    return pd.read_csv(out)


def test_a_seed_is_a_log_and_the_effect_is_in_it(tmp_path):
    plain, same = (written(tmp_path, "--effect", "none", "--seed", "3") for _ in range(2))
    pd.testing.assert_frame_equal(plain, same)
    hidden = written(tmp_path, "--effect", "cogging", "--size", "0.2", "--seed", "3")
    assert list(hidden.columns) == list(plain.columns)
    wanted = make_servo_log("cogging", sizes=0.2, duration=5.0, random_state=3)
    np.testing.assert_allclose(hidden.torque_nm, wanted.torque_nm)
    assert np.abs(hidden.torque_nm - plain.torque_nm).max() > 0.01


def test_an_unknown_effect_is_one_sentence(tmp_path):
    done = CliRunner().invoke(main, ["--effect", "magic", "--out", str(tmp_path / "log.csv")])
    assert done.exit_code == 1
    assert "Unknown effect 'magic'" in done.output
    assert not (tmp_path / "log.csv").exists()
