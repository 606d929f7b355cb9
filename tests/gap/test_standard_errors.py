"""Standard errors are those of linear regression, carried to amplitude and phase."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.stats import chi2, norm

from whsklearn.effects import Cogging
from whsklearn.gap import Diagnosis, NamedEffect
from whsklearn.gap.plant import Linearised
from whsklearn.gap.standard_errors import covariance, errors_of, labelled_errors, p_of_zero, with_drive_error

RNG = np.random.default_rng(0)
J = RNG.normal(size=(500, 2)) * [1.0, 100.0]
R = 0.3 * RNG.normal(size=500)
FREE = np.full(2, -1e6), np.full(2, 1e6)


def fit(rebuild, x=(0.3, -0.4), jac=J):
    return Linearised(x=np.array(x), residual=R, jacobian=jac, low=FREE[0], high=FREE[1], rebuild=rebuild)


def test_the_covariance_is_that_of_least_squares():
    expected = np.linalg.inv(J.T @ J) * (R @ R) / 498
    np.testing.assert_allclose(covariance(fit(None)), expected, rtol=1e-9)


def test_a_number_that_moves_nothing_has_no_variance():
    assert covariance(fit(None, jac=J * [1.0, 0.0]))[1, 1] == 0.0


def one_term(linear, neutral=0.0):
    kind = SimpleNamespace(linear=linear, cls=SimpleNamespace(neutral=neutral))
    return lambda x: SimpleNamespace(terms=[SimpleNamespace(q=tuple(x), kind=kind)])


def test_one_number_is_absent_by_the_normal_distribution():
    error = np.sqrt(covariance(fit(None))[0, 0])
    for size in (0.0, 1.0, 2.5):
        p = p_of_zero(fit(lambda x: one_term(1)(x[:1]), (size * error, 0.7)), 0)
        assert p == pytest.approx(2.0 * norm.sf(size), rel=1e-9)


def test_a_limit_is_absent_at_the_end_of_its_range_and_not_at_zero():
    """All numbers of an axis that is always at its limit may be small together; the limit is there all the same."""
    error = np.sqrt(covariance(fit(None))[0, 0])
    limit = fit(lambda x: one_term(1, np.inf)(x[:1]), (0.3 * error, 0.7))._replace(high=np.array([2.3 * error, 1e6]))
    assert p_of_zero(limit, 0) == pytest.approx(2.0 * norm.sf(2.0), rel=1e-9)


def test_two_weights_are_absent_only_together_whatever_the_phase_counts_from():
    """One of them is well determined, the other is not, as beside a term of the base law that looks like it."""
    weights = np.array([0.001, 0.1])
    assert p_of_zero(fit(lambda x: one_term(1)(x[:1]), weights, J), 0) > 0.9
    assert p_of_zero(fit(one_term(2), weights, J), 0) < 1e-9
    turn = np.array([[np.cos(0.7), -np.sin(0.7)], [np.sin(0.7), np.cos(0.7)]])
    few = 1e-4 * np.array([1.0, 1.0])
    turned = p_of_zero(fit(one_term(2), turn @ few, J @ turn.T), 0)
    assert turned == pytest.approx(p_of_zero(fit(one_term(2), few, J), 0), rel=1e-6)


def test_a_shape_that_is_hardly_determined_does_not_make_an_effect_absent():
    """The sizes of two columns that look alike are uncertain; that of one with the other as its held shape is not."""
    alike = np.column_stack([J[:, 0], J[:, 0] + 1e-3 * J[:, 1]])
    both = fit(lambda x: one_term(1)(x[:1]), jac=alike)
    held = fit(one_term(1), jac=alike)
    error = 1.0 / np.linalg.norm(alike[:, 0]) * np.sqrt(R @ R / 498)
    assert p_of_zero(held, 0) == pytest.approx(2.0 * norm.sf(0.3 / error), rel=1e-6)
    assert p_of_zero(both, 0) > p_of_zero(held, 0)


@pytest.mark.parametrize("scale", [1.0, 1e-8])
def test_what_a_limit_keeps_another_number_from_is_told_to_be_there(scale):
    """The age of a drive, at most a sample and a half, cannot stand for a lag of two samples, which looks alike."""
    alike = np.column_stack([J[:, 0], J[:, 0] + 1e-3 * J[:, 1] / 100.0])
    free = fit(lambda x: one_term(1)(x[:1] * scale), jac=alike)
    held = free._replace(low=np.array([-1e6, -0.6]), high=np.array([1e6, -0.2]))
    assert p_of_zero(free, 0) > 0.5
    # without the first number the second would have to be -0.1
    assert p_of_zero(held, 0) == pytest.approx(chi2.sf(0.1**2 * (J[:, 0] @ J[:, 0]) * 498 / (R @ R), 1), rel=0.1)


def test_a_limit_that_the_fit_has_left_does_not_hold_its_errors():
    inside = fit(lambda x: {"inertia": x[0]})
    outside = inside._replace(low=np.array([-9.0, -9.0]), high=np.array([-8.0, 9.0]))
    assert errors_of(outside, lambda m: m) == errors_of(inside, lambda m: m)


def test_errors_of_labels_follow_from_those_of_the_numbers():
    read = fit(lambda x: {"plain": x[0], "double": 2 * x[0], "text": "inertia"})
    errors = errors_of(read, lambda m: m)
    assert errors["double"] == pytest.approx(2 * errors["plain"], rel=1e-9)
    assert errors["plain"] == pytest.approx(np.sqrt(covariance(read)[0, 0]), rel=0.25)  # 64 draws
    assert "text" not in errors


def test_amplitude_and_phase_of_a_wave():
    even = RNG.normal(size=(500, 2))

    def rebuild(x):
        return SimpleNamespace(terms=[SimpleNamespace(effect=Cogging.from_coefficients(list(x), order=12.0))])

    errors = labelled_errors(fit(rebuild, jac=even), 0)
    one = np.sqrt(covariance(fit(rebuild, jac=even))[0, 0])
    assert errors["amplitude_nm"] == pytest.approx(one, rel=0.3)
    assert errors["phase_rad"] == pytest.approx(one / 0.5, rel=0.3)  # the arc over the amplitude
    assert "order" not in errors  # nothing moved it


def found():
    effect = NamedEffect(Cogging(0.05, 12.0), {"amplitude_nm": 0.003, "order": 0.01, "phase_rad": 0.2}, 90.0, 1.0)
    effect.orders = [NamedEffect(Cogging(0.02, 24.0), {"amplitude_nm": 0.001}, 50.0, 1.0)]
    rows = [
        {"name": "inertia", "before": 0.04, "after": 0.05, "before_error": None, "after_error": 0.001, "unit": "kg m²"},
        {"name": "age", "before": 2.0, "after": 2.0, "before_error": 0.1, "after_error": 0.1, "unit": ""},
    ]
    return Diagnosis("named", "", effects=[effect], base_parameters=rows)


def test_torques_and_inertia_are_widened_orders_and_phases_are_not():
    d = found()
    with_drive_error(d, 0.1)
    errors = d.effects[0].standard_errors
    assert errors["amplitude_nm"] == pytest.approx(np.hypot(0.003, 0.005))
    assert (errors["order"], errors["phase_rad"]) == (0.01, 0.2)
    assert d.effects[0].orders[0].standard_errors["amplitude_nm"] == pytest.approx(np.hypot(0.001, 0.002))
    assert d.base_parameters[0]["after_error"] == pytest.approx(np.hypot(0.001, 0.005))
    assert d.base_parameters[0]["before_error"] == pytest.approx(0.004)
    assert d.base_parameters[1]["after_error"] == 0.1
    assert "known to 10 %" in d.notes[0]


def test_without_an_uncertainty_nothing_changes():
    d = found()
    with_drive_error(d, 0.0)
    assert d == found()


def test_a_number_whose_derivative_overflows_has_no_variance_and_spoils_no_other():
    jac = np.random.default_rng(0).standard_normal((50, 2))
    sound = covariance(Linearised(np.zeros(1), -np.ones(1), np.ones(1), np.ones(50), jac[:, :1], None))
    jac[3, 1] = np.inf
    both = covariance(Linearised(np.zeros(2), -np.ones(2), np.ones(2), np.ones(50), jac, None))
    assert both[0, 0] == pytest.approx(sound[0, 0], rel=0.05)
    assert both[1, 1] == 0.0
