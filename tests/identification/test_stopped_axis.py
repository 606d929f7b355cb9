"""An axis that strikes an end of its travel."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from benchmarks.end_stops import record
from whsklearn import ServoAxis
from whsklearn.effects import CableSpring, ContactStop, GravityImbalance, InputOffset, as_law
from whsklearn.identification import identify
from whsklearn.identification.axis_fit import fit_rigid_axis
from whsklearn.identification.axis_numbers import axis_theta
from whsklearn.identification.stopped_axis import fit_stopped_axis
from whsklearn.identification.view import view
from whsklearn.models import AxisModel
from whsklearn.recursion.batch.axis_free_run import AxisLog, axis_motion, sensitivities
from whsklearn.systems import PIDController

LAW = as_law("viscous,coulomb").reweighted([0.12, 0.1])
TRUTH = {"inertia": 0.05, "viscous": 0.12, "coulomb": 0.1}
UPPER, BOTH = ContactStop(600.0, 0.35, 0.003), ContactStop(600.0, 0.3, 0.003, 0.05, "both")


def driven(*effects):
    """Ten seconds in closed loop, up to 0.7 rad either way; an encoder of 16 bits."""
    axis = ServoAxis(0.05, LAW, effects, controller=PIDController(20.0, 0.0, 1.4), sample_rate=500.0, substeps=40)
    t, count = np.arange(5000) / 500.0, 2.0 * np.pi / 2**16
    waves = [(0.2, 0.23), (0.25, 0.61), (0.2, 0.97), (0.1, 1.31)]
    record = axis.simulate(sum(a * np.sin(2.0 * np.pi * f * t) for a, f in waves))
    return record.drive, count * np.round(record.position / count)


@pytest.mark.parametrize("stop", [UPPER, BOTH], ids=["upper", "both"])
@pytest.mark.parametrize("weight", [[], [GravityImbalance(0.6, -1.2)]], ids=["level", "hanging"])
def test_the_axis_between_stops_is_known_as_well_as_its_intervals_say_and_the_stop_is_there(stop, weight):
    log = view(*driven(stop, *weight), 0.002, "position")
    model = fit_stopped_axis(log, hangs=bool(weight))
    truth = TRUTH | dict.fromkeys(["gravity_imbalance"] * len(weight), 0.6)
    for name, value in truth.items():
        assert abs(model.parameters[name] - value) < 4.0 * model.standard_errors[name], name
    assert model.standard_errors["inertia"] < 0.1 * TRUTH["inertia"]
    (found,) = (e for e in model.effects if isinstance(e, ContactStop))
    assert found.side == stop.side
    ends = [(a, b) for a, b in zip(found.ends, stop.ends, strict=True) if np.isfinite(b)]
    assert max(abs(a - b) for a, b in ends) < 0.01
    assert found.stiffness == pytest.approx(stop.stiffness, rel=0.5)  # over in ten samples
    assert {"end_stop", "end_stop__angle", "end_stop__relaxation"} <= model.standard_errors.keys()


def test_a_stop_bends_the_numbers_of_an_axis_that_does_not_know_it():
    log = view(*driven(BOTH), 0.002, "position")
    assert abs(fit_rigid_axis(log).parameters["inertia"] / 0.05 - 1.0) > 0.1


@pytest.mark.parametrize("effects", [[], [CableSpring(2.0)], [GravityImbalance(0.6, -1.2)]], ids=str)
def test_no_stop_is_found_where_there_is_none(effects):
    log = view(*driven(*effects), 0.002, "position")
    for hangs in (False, True):
        with pytest.raises(ValueError, match="does not strike an end"):
            fit_stopped_axis(log, hangs=hangs)


def test_a_weight_that_is_little_once_the_offset_is_dropped_is_none():
    """With the offset it was 1 % of the drive and more; it was kept at 0.5 %."""
    u, y, dt, truth, *_ = record(112)
    assert "gravity_imbalance" not in truth
    with pytest.raises(ValueError, match="% of the drive, so the axis without it is equivalent"):
        fit_stopped_axis(view(u, y, dt, "position"), hangs=True)


@pytest.mark.parametrize("stop", [UPPER, BOTH], ids=["upper", "both"])
def test_the_run_of_the_kernel_is_that_of_the_model_with_a_stop(stop):
    """Up to the step in which a contact begins."""
    model = AxisModel(0.05, LAW, (InputOffset(0.0), GravityImbalance(0.3, 0.2), stop), dt=0.001, logged="position")
    (theta, form), u, steps = axis_theta(model), 1.5 * np.sin(np.arange(4000) * 0.004), 256
    known = model.system(substeps=steps).simulate_drive(u).position
    assert np.sum(known > stop.ends[1]) > 100
    log = AxisLog(
        np.repeat(u[:, None], steps, axis=1), known, np.ones(u.size, dtype=bool), np.array([0, u.size]),
        np.zeros((1, 2)), 0.001, form, of_position=True,
    )  # fmt: skip
    assert np.abs(axis_motion(theta, log) - known).max() < 1e-4 * np.ptp(known)


def test_the_state_before_an_impact_has_exact_sensitivities():
    model = AxisModel(0.05, LAW, (InputOffset(0.0), BOTH), dt=0.001, logged="position")
    theta, form = axis_theta(model)
    log = AxisLog(
        np.full((60, 16), 0.4), np.zeros(60), np.ones(60, dtype=bool), np.array([0, 60]),
        np.array([[2.0, 0.3]]), 0.001, form, of_position=True,
    )  # fmt: skip
    run, rows = sensitivities(theta, log, of_states=True)
    assert run.max() > BOTH.ends[1] + 0.005
    for k, (row, step) in enumerate(zip(rows, itertools.repeat(1e-7), strict=False)):
        moved = [log._replace(start=log.start + sign * step * np.eye(2)[k]) for sign in (1.0, -1.0)]
        differences = (axis_motion(theta, moved[0]) - axis_motion(theta, moved[1])) / (2.0 * step)
        np.testing.assert_allclose(row, differences, atol=1e-4 * np.abs(differences).max())


def test_an_axis_with_stops_is_recommended():
    u, y = (x[:3000] for x in driven(UPPER))
    found = identify(u, y, dt=0.002, units={"input": "Nm", "output": "rad"})
    assert found.recommended.name == "axis with end stops", found.reason
    assert found.recommended.test["nmse"] < 1e-3
