"""Parameters by name, and their paths."""

from __future__ import annotations

import matplotlib.pyplot as plt
import numpy as np
import pytest

from tests.plot.first_order import FirstOrder
from whsklearn import ServoAxis
from whsklearn.effects import Coulomb, FlexibleCoupling, FrictionLaw, InputDelay, InputOffset, OutputOffset, Viscous
from whsklearn.metrics import nmse
from whsklearn.plot import (
    ConvergenceDisplay,
    EffectDisplay,
    HorizonDisplay,
    ResidualDisplay,
    TrackingDisplay,
    flat_parameters,
    parameter_paths,
)


def test_parameters_are_named_in_the_order_of_the_chain():
    given = {"d": [0.15, 0.4], "viscous": 0.05, "c": [1, 0.2], "coulomb": 0.7, "b": [1.0, 0.5], "a": [1, 2.2]}
    assert list(flat_parameters(given)) == ["a2", "b1", "b2", "viscous", "coulomb", "c2", "d1", "d2"]


def test_parameters_of_several_inputs_are_numbered_by_input():
    named = flat_parameters({"a": [[1.0, 0.5], [0.3, 0.2]], "b": [0.1]})
    assert named == {"a1_2": 0.5, "a2_1": 0.3, "a2_2": 0.2, "b1": 0.1}


def test_paths_end_at_the_fit_of_the_whole_record(record):
    steps, paths = parameter_paths(FirstOrder(), *record, every=64)
    assert steps[-1] == 600
    # blocks hide the products across their borders from this simple learner, so the end is near, not equal
    assert paths["d1"][-1] == pytest.approx(FirstOrder().fit(*record).parameters_["d"][0], abs=0.02)
    assert all(len(p) == len(steps) for p in paths.values())


def test_paths_leave_the_estimator_alone(record):
    model = FirstOrder()
    parameter_paths(model, *record)
    assert not hasattr(model, "parameters_")


def test_tracking_error_panel_is_the_difference(model, record):
    X, y = record
    shown = TrackingDisplay.from_estimator(model, X, y, time=np.arange(600) / 100)
    (line,) = [li for li in shown.axes_[1].lines if len(li.get_xdata()) == 600]
    np.testing.assert_allclose(line.get_ydata(), y - model.predict(X))
    assert shown.axes_[1].get_xlabel() == "time in s"


def test_tracking_legend_judges_the_samples_that_the_tables_judge():
    y = np.r_[np.ones(50) * 9.0, np.sin(np.arange(200))]
    y_hat = np.r_[np.zeros(50), 0.9 * np.sin(np.arange(200))]
    label = TrackingDisplay(y, {"m": y_hat}, skip=50).plot().axes_[0].get_legend_handles_labels()[1][1]
    assert label == f"m, NMSE {nmse(y, y_hat, skip=50):.2g}" == "m, NMSE 0.01"


def test_too_few_axes_are_refused(model, record):
    _, ax = plt.subplots()
    with pytest.raises(ValueError, match="got 1 axes, expected 2"):
        TrackingDisplay.from_estimator(model, *record, axes=ax)


def test_convergence_shows_the_error_of_the_paper():
    paths = {"b1": np.array([0.0, 3.0]), "c2": np.array([0.0, 4.0])}
    shown = ConvergenceDisplay({"m": ([1, 2], paths)}, truth={"b1": 3.0, "c2": 4.0})
    np.testing.assert_allclose(shown.errors()["m"], [1.0, 0.0])


def test_convergence_without_truth_has_no_error_panel(record):
    shown = ConvergenceDisplay.from_estimator(FirstOrder(), *record)
    assert len(shown.axes_) == 3
    assert shown.errors() == {}


def test_wild_first_estimates_do_not_set_the_scale():
    path = np.r_[np.full(10, 1e9), np.linspace(0, 1, 990)]
    shown = ConvergenceDisplay({"m": (np.arange(1000), {"d1": path})}, truth={"d1": 1.0}).plot()
    assert shown.axes_[2].get_ylim()[1] < 3


def test_horizon_curve_rises_to_the_free_run(model, record):
    shown = HorizonDisplay.from_estimator(model, *record, horizons=[1, 2, 5, 40])
    error = shown.errors["FirstOrder"]
    assert error[0] < error[1] < error[2]
    assert error[-1] == pytest.approx(shown.free_run["FirstOrder"], rel=0.02)


def test_residual_band_is_exceeded_by_white_noise_one_time_in_twenty():
    rng = np.random.default_rng(2)
    shown = [ResidualDisplay(rng.normal(size=500)) for _ in range(200)]
    outside = [np.mean(np.abs(d.whiteness.r) > d.band) for d in shown]
    assert 0.035 < np.mean(outside) < 0.06


def test_residuals_of_a_missed_delay_show_at_its_lag():
    u, e = np.random.default_rng(3).normal(size=(2, 2000))
    shown = ResidualDisplay(0.1 * e + np.roll(u, 3), u, max_lag=10)
    assert shown.dependence.lags[np.argmax(np.abs(shown.dependence.r))] == 3


def test_residual_panels_count_what_is_outside(model, record):
    shown = ResidualDisplay.from_estimator(model, *record)
    assert "of 25 outside 95 %" in shown.axes_[0].get_title()


DRIVE = np.sin(np.arange(2000) / 100)


def drawn(effect):
    axis = ServoAxis(0.05, FrictionLaw([Viscous(0.1)])).with_effect(effect)
    return EffectDisplay.from_run(effect, axis.simulate_drive(DRIVE, noise=False))


def test_friction_over_velocity_is_its_equation():
    shown = drawn(Coulomb(0.2))
    assert shown.xlabel == "velocity, rad/s"
    np.testing.assert_allclose(shown.values, 0.2 * np.sign(shown.x), atol=1e-12)


def test_a_constant_keeps_zero_in_sight():
    low, high = drawn(InputOffset(-0.1)).axes_[0].get_ylim()
    assert low < -0.1 < 0.0 <= high


def test_a_sensor_is_drawn_in_radians_and_a_twist_over_time():
    assert drawn(OutputOffset(0.01)).ylabel == "position, rad"
    assert drawn(FlexibleCoupling(1e-3)).ylabel == "twist, mrad"


def test_a_late_drive_is_drawn_beside_the_command():
    shown = drawn(InputDelay(0.005))
    assert shown.values[5:] == pytest.approx(shown.before[:-5])
