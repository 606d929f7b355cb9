"""A load behind a spring, from either end of it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.recursion.axis_log import slow_drive
from whsklearn import ServoAxis
from whsklearn.datasets import make_servo_log
from whsklearn.effects import Cogging, FlexibleCoupling, as_law
from whsklearn.identification import identify
from whsklearn.identification.two_masses import fit_two_masses, resonance_starts
from whsklearn.identification.view import view


def behind_a_spring(frequency, share, damping, effects=()):
    """Motor position in open loop with 0.02 mrad of noise, without a load where it has no share; its compliance."""
    rng, law = np.random.default_rng(0), as_law("viscous,coulomb").reweighted([1.0, 0.8])
    compliance = 1.0 / (0.5 * share * (1.0 - share) * (2 * np.pi * frequency) ** 2) if share else 0.0
    effects = [*effects, FlexibleCoupling(compliance, share, damping)] if share else effects
    axis = ServoAxis(0.5, law, effects, sample_rate=250.0, substeps=32)
    u = 2.0 * slow_drive(1200, 5) / 0.4
    position = axis.simulate_drive(u).position + 2e-5 * rng.standard_normal(u.size)
    return view(u, position, 0.004, "position"), compliance


LOADS = pytest.mark.parametrize(
    ("frequency", "share", "damping"), [(8.0, 0.2, 0.05), (20.0, 0.6, 0.02), (5.0, 0.8, 0.02)]
)


@LOADS
def test_a_resonance_is_seen_before_anything_is_fitted(frequency, share, damping):
    start = resonance_starts(behind_a_spring(frequency, share, damping)[0])[0]
    assert start[0] == pytest.approx(0.5, rel=0.05)
    assert start[6] == pytest.approx(frequency, rel=0.04)  # half a step of the grid
    assert start[7] == pytest.approx(share, abs=0.07)


@pytest.mark.parametrize("at_load", [False, True])
@pytest.mark.parametrize("effects", [[], [Cogging(0.2, 7)]])
def test_an_axis_without_a_load_is_refused_before_anything_is_fitted(effects, at_load):
    with pytest.raises(ValueError, match="no resonance of a load"):
        resonance_starts(behind_a_spring(8.0, 0.0, 0.05, effects)[0], at_load=at_load)


def test_a_ripple_in_closed_loop_is_no_resonance():
    """A load would explain some of it, with the right sign, but little."""
    log = make_servo_log(["cogging"], duration=20.0, sizes=0.05, random_state=1)
    record = view(log["torque_nm"], log["position_rad"], 0.001, "position")
    with pytest.raises(ValueError, match="no resonance of a load"):
        resonance_starts(record)


def two_masses(seed, n=2000, dt=0.004, fine=40):
    """Positions of motor and load in open loop, by equations of the test's own, and the truth by name."""
    rng = np.random.default_rng(seed)
    truth = {"inertia": 0.05, "flexible_coupling__load_share": 0.55, "viscous": 0.03, "coulomb": 0.05,
             "load_viscous": 0.03, "flexible_coupling__load_coulomb": 0.04,
             "flexible_coupling__damping_ratio": 0.04}  # fmt: skip
    share, h = truth["flexible_coupling__load_share"], dt / fine
    masses = truth["inertia"] * np.array([1.0 - share, share])
    reduced, turn = masses.prod() / masses.sum(), 2 * np.pi * rng.uniform(8.0, 15.0)
    truth["flexible_coupling"] = 1.0 / (reduced * turn**2)
    k, c = reduced * turn**2, 2 * truth["flexible_coupling__damping_ratio"] * reduced * turn
    u = slow_drive(n, seed + 10)
    x = q = v = w = 0.0
    out = np.empty((2, n))

    def kicked(v, torque, inertia, viscous, coulomb):
        a = 0.5 * h * viscous / inertia
        free, hold = (v * (1.0 - a) + h * torque / inertia) / (1.0 + a), h * coulomb / inertia / (1.0 + a)
        return free - np.clip(free, -hold, hold)

    for t in range(n):
        out[:, t] = x, q
        for _ in range(fine):
            x, q = x + 0.5 * h * v, q + 0.5 * h * w
            torque = k * (x - q) + c * (v - w)
            v = kicked(v, u[t] - torque, masses[0], truth["viscous"], truth["coulomb"])
            w = kicked(w, torque, masses[1], truth["load_viscous"], truth["flexible_coupling__load_coulomb"])
            x, q = x + 0.5 * h * v, q + 0.5 * h * w
    return u, out + 2e-5 * rng.standard_normal((2, n)), truth


@pytest.mark.slow
@pytest.mark.parametrize("at_load", [False, True])
def test_friction_on_either_side_is_found_from_either_end(at_load):
    """The truth in intervals of 3 standard errors; the weak side of friction from the load too, but wider."""
    u, positions, truth = two_masses(3)
    record = view(u, positions[int(at_load)], 0.004, "position")
    model = fit_two_masses(record, at_load=at_load)
    assert model.side == ("load" if at_load else "motor")
    for name, value in truth.items():
        error = model.parameters[name] - value
        assert abs(error) < 3.0 * model.standard_errors[name] + 1e-3 * value, name
    assert model.inertia == pytest.approx(truth["inertia"], rel=1e-3)
    with pytest.raises(ValueError, match="no resonance of a load"):
        resonance_starts(record, at_load=not at_load)  # each end rings in its own direction


@pytest.mark.slow
def test_the_structure_of_a_load_encoder_is_recommended():
    u, positions, _ = two_masses(4, 1200)
    found = identify(u, positions[1], dt=0.004, units={"input": "Nm", "output": "rad"})
    assert found.recommended.structure["output"] == "load"


@LOADS
def test_a_load_behind_a_spring_is_found_from_the_motor_s_side(frequency, share, damping):
    record, compliance = behind_a_spring(frequency, share, damping)
    model = fit_two_masses(record)
    coupling = model.effects[1]
    assert model.inertia == pytest.approx(0.5, rel=1e-3)
    assert coupling.compliance == pytest.approx(compliance, rel=0.01)
    assert coupling.load_share == pytest.approx(share, abs=0.01)
    assert coupling.damping_ratio == pytest.approx(damping, rel=0.05)
    assert model.parameters["coulomb"] == pytest.approx(0.8, rel=0.02)
    with pytest.raises(ValueError, match="from a position only"):
        fit_two_masses(replace(record, logged="velocity"))
