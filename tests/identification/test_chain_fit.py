"""Chains: a linear system behind a sensor that loses the sign, and a fit that explains little."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import cont2discrete, lfilter

from benchmarks._twins import make_coupled_drives
from whsklearn.effects import FrictionLaw
from whsklearn.identification import identify
from whsklearn.identification.chain_fit import fit_chain, fit_folded, fit_rectified, loses_sign
from whsklearn.identification.view import View, view
from whsklearn.identification.windows import window_errors


@pytest.mark.parametrize(("kind", "seed"), [("prbs", 1), ("uniform", 2)])
def test_the_signs_of_coupled_drives_are_found(kind, seed):
    u, y = make_coupled_drives(kind=kind, noise=0.02, random_state=seed)
    model = fit_rectified(view(u, y, 0.02, "output"), 3)
    assert np.sqrt(np.mean((y - model.simulate(u)) ** 2)) < 0.022
    poles = np.log(np.roots(model.f1)) / 0.02
    assert np.sort(poles.real)[::2] == pytest.approx([-6.735, -6.6], rel=0.2)
    assert np.abs(poles.imag).max() == pytest.approx(19.4, rel=0.05)


def test_identify_offers_it_where_a_sign_may_be_lost():
    u, y = make_coupled_drives(400, random_state=3)
    found = identify(u[:290], y[:290], dt=0.02, test=(u, y))
    assert found.recommended.structure == {"order": 3, "effects": ["sensor_rectification"]}, found.reason
    assert found.recommended.test["rmse"] < 0.03
    names = [c.name for c in identify(u[:290], y[:290] - 1.0, dt=0.02).models]
    assert not any("without its sign" in name for name in names)


def test_a_signal_that_goes_below_zero_has_its_sign():
    u, y = make_coupled_drives(random_state=0)
    assert loses_sign(view(u, y, 0.02, "output"))
    with pytest.raises(ValueError, match="no sign is lost"):
        fit_rectified(view(u, y - 1.0, 0.02, "output"), 3)


def test_a_sensor_with_a_lag_an_offset_and_two_gains_is_found():
    u, y = make_coupled_drives(amplitude=1.5, kind="uniform", noise=0.0, random_state=3)
    y = lfilter([0.5], [1.0, -0.5], 0.1 + y) + 0.01 * np.random.default_rng(0).standard_normal(u.size)
    log = view(u - 0.05, y, 0.02, "output")
    plain, folded = (np.std((log.y - f(log, 3).simulate(log.u))[60:]) for f in (fit_rectified, fit_folded))
    assert folded < 0.013 < 0.05 < plain


def test_a_record_that_begins_in_motion_has_the_state_of_its_first_block_fitted():
    """With the sign that the samples before the window ask for."""
    u, y = make_coupled_drives(kind="uniform", noise=0.0, random_state=4)
    model = fit_rectified(view(u, y, 0.02, "output"), 3)
    late = View(u[200:], y[200:], y[200:], 0.02, "output")
    error = window_errors(model, late, 250, 30)[0]
    assert np.sqrt(np.mean(error**2)) < 0.02 * np.std(y)
    from_rest = (late.y - model.simulate(late.u))[30:60]
    assert np.sqrt(np.mean(error[:30] ** 2)) < 0.2 * np.sqrt(np.mean(from_rest**2))


def test_a_weak_chain_is_left_to_the_comparison_and_takes_no_longer(recwarn, monkeypatch):
    """The warning of the estimator names settings and estimators that `identify` does not have.

    A state that follows nothing was fitted in 300 steps, each of which runs the chain once for every number.
    """
    b, a, _ = cont2discrete(([800.0], np.polymul([1.0, 4.5], [1.0, 0.95, 182.0])), 0.02)
    rng = np.random.default_rng(2)
    u = np.repeat(rng.choice([-1.0, 1.0], 70), 5)
    y = np.abs(lfilter(b.ravel(), a, u)) + 0.01 * rng.standard_normal(350)
    chain = fit_chain(View(u, y, y, 0.02, "output"))
    assert np.var(y - chain.simulate(u)) > 0.5 * np.var(y)
    assert not recwarn.list
    runs, call = [], FrictionLaw.__call__
    monkeypatch.setattr(FrictionLaw, "__call__", lambda *a: [runs.append(1), call(*a)][1])
    other = np.cos(0.3 * np.arange(350.0))
    errors = window_errors(chain, View(u, other, other, 0.02, "output"), 25, 30)
    assert len(runs) / len(errors) < 2 * 30 * len(chain.f1)
