"""Several logs of one axis: what each has of its own is found, and nothing where they do not differ."""

from __future__ import annotations

import numpy as np
import pytest

from whsklearn import ServoAxis
from whsklearn.datasets import make_servo_log
from whsklearn.effects import Coulomb, InputOffset, Viscous
from whsklearn.identification import identify
from whsklearn.identification.drive_lead import earlier
from whsklearn.identification.logs_together import own_offsets, together
from whsklearn.identification.view import view

AXIS = ServoAxis(inertia=0.05, law=[Viscous(0.1), Coulomb(0.2)], sample_rate=200.0)


def log_with(offset, seed, late=0):
    log = make_servo_log([InputOffset(offset)], axis=AXIS, duration=12.0, random_state=seed)
    return earlier(log["torque_nm"].to_numpy(), -late), log["position_rad"].to_numpy()


def test_each_log_has_its_offset_and_its_timing():
    logs = {"a": log_with(0.05, 0), "b": log_with(-0.15, 1, late=8)}
    both, own = together({k: view(*log, 0.005, "position") for k, log in logs.items()})
    assert [log.label for log in own] == ["a", "b"]
    assert [log.offset for log in own] == pytest.approx([0.1, -0.1], abs=0.01)
    assert own[0].lead == 0
    assert own[1].lead == pytest.approx(8, abs=1)
    assert both.starts == (logs["a"][1].size,)


def test_equal_logs_stay_as_they_are():
    logs = {str(k): view(*log_with(0.05, k), 0.005, "position") for k in range(3)}
    assert own_offsets(list(logs.values())) == (0.0, 0.0, 0.0)
    both, _ = together(logs)
    np.testing.assert_array_equal(both.u, np.concatenate([log.u for log in logs.values()]))


def test_offsets_are_found_in_the_unit_of_the_log():
    u, y = zip(*(log_with(offset, k) for k, offset in enumerate((0.1, -0.1))), strict=True)
    millis = {str(k): view(1e3 * u[k], y[k], 0.005, "position") for k in range(2)}
    _, own = together(millis, si=(1e-3, 1.0))
    assert own[0].offset - own[1].offset == pytest.approx(200.0, rel=0.05)


def test_all_structures_see_the_logs_together_and_it_is_told():
    (u, y), (v, z) = (tuple(x[:580:4] for x in log_with(offset, k)) for k, offset in enumerate((0.1, -0.1)))
    records = np.repeat(["a", "b"], [y.size, z.size])  # too short for a chain
    found = identify(np.r_[u, v], np.r_[y, z], dt=0.02, logged="position", records=records)
    assert found.recommended.kind == "axis"
    assert [log.offset for log in found.own] == pytest.approx([0.1, -0.1], abs=0.01)
    assert "The drive of b lies" in found.on_drive
