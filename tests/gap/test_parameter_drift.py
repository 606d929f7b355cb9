"""The base number that was changed is the one that drifts, and it follows what it was made to follow."""

from __future__ import annotations

import numpy as np

from benchmarks.blind_logs.servo import COLUMNS, make_case
from whsklearn.gap import GapFinder
from whsklearn.gap.localisation import dependence
from whsklearn.gap.parameter_drift import sentence

SHORT = {"seconds": 16.0, "rate": 500.0, "noise": 1e-4}


def test_a_friction_that_drifts_moves_with_time():
    case = make_case("named", 41, effects=("friction_drift",), size=0.1, **SHORT)
    d = GapFinder("servo").fit(case.frame, **COLUMNS).diagnosis_
    first = d.drifting[0]
    assert (first["name"], first["follows"]) == ("coulomb", "time")
    assert first["taken"] > 0.5
    assert "coulomb" in sentence(d.drifting)


def test_constants_stay_constant_where_nothing_is_missing():
    case = make_case("none", 42, **SHORT)
    d = GapFinder("servo").fit(case.frame, **COLUMNS).diagnosis_
    assert all(r["taken"] < 0.1 and r["spread"] < 0.02 for r in d.drifting)
    assert sentence(d.drifting) == ""


def test_false_alarms_of_dependent_paths_stay_at_their_level():
    rng = np.random.default_rng(0)
    x = np.sin(np.arange(3000) / 90)
    hits = 0
    for _ in range(60):
        path = np.convolve(rng.standard_normal(3200), np.ones(100) / 10, mode="valid")[:3000]
        hits += dependence(x, path, rng)[1] < 0.05
    assert hits <= 9  # 3 expected; 10 or more has a probability below 0.1 %
