"""Ranges hold the units they come from, in SI, and only of what MuJoCo's joint has."""

from __future__ import annotations

import json

import numpy as np
import pytest
from click.testing import CliRunner

from whsklearn import ServoAxis
from whsklearn.cli.export import main
from whsklearn.compare.series import spread
from whsklearn.export.ranges import ranges_of
from whsklearn.gap.report import as_model
from whsklearn.models import save_model


def row(name, values, error=0.001, si=1.0):
    mean, apart, p = spread(np.array(values), np.full(len(values), error**2))
    return {"name": name, "unit": "", "values": list(values), "mean": mean, "spread_between": apart,
            "spread_within": error, "p_value_spread": p, "to_si": si}  # fmt: skip


def test_nearly_all_units_of_a_draw_lie_inside():
    rng = np.random.default_rng(0)
    inside = []
    for _ in range(100):
        found = ranges_of({"numbers": [row("coulomb", rng.normal(0.3, 0.03, 12))]})["frictionloss"]
        inside += list((rng.normal(0.3, 0.03, 20) > found["low"]) & (rng.normal(0.3, 0.03, 20) < found["high"]))
    assert 0.88 < np.mean(inside) < 0.99


def test_units_become_si_and_nothing_is_negative():
    found = ranges_of({"numbers": [row("viscous", [10.0, 200.0, 20.0], si=1e-3), row("cogging", [1.0, 1.1, 0.9])]})
    assert set(found) == {"damping"}
    assert found["damping"]["low"] == 0.0
    assert found["damping"]["high"] < 0.5


def test_no_numbers_are_refused():
    with pytest.raises(ValueError, match=r"compare\.json"):
        ranges_of({"verdict": "cannot_tell"})


def test_the_command_writes_them_beside_the_model(tmp_path):
    save_model(as_model(ServoAxis(inertia=0.05, law="coulomb")), tmp_path / "model.json")
    (tmp_path / "compare.json").write_text(json.dumps({"numbers": [row("inertia", [0.05, 0.06])]}), encoding="utf-8")
    model, spread_file = str(tmp_path / "model.json"), str(tmp_path / "compare.json")
    arguments = [model, "--out", str(tmp_path / "axis.xml"), "--spread", spread_file]
    result = CliRunner().invoke(main, [*arguments, "--to", "mjcf"])
    assert result.exit_code == 0, result.output
    assert "inertia" in json.loads((tmp_path / "axis.ranges.json").read_text(encoding="utf-8"))
    assert CliRunner().invoke(main, [*arguments, "--to", "urdf"]).exit_code == 2
