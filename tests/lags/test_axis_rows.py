"""Rows of an axis: the effects of the catalogue as columns, each group a record of its own."""

from __future__ import annotations

import numpy as np
import pytest
from sklearn.base import clone

from tests.lags.smooth_axis import RATE, TRUTH, smooth_axis, solve
from whsklearn.effects import Cogging, Coulomb, LoadFriction, Saturation, Viscous
from whsklearn.lags import InverseDynamicsLags


@pytest.mark.parametrize("causal", [False, True])
def test_rows_give_back_the_axis(causal):
    X, y = smooth_axis()
    lags = InverseDynamicsLags(sample_rate=RATE, cutoff=50, border=50, causal=causal)
    theta = dict(zip(lags.fit(X).get_feature_names_out(), solve(*lags.rows(X, y)), strict=True))
    assert theta == pytest.approx(TRUTH, rel=0.01)


def test_a_record_is_turned_into_the_effects_of_the_catalogue():
    X, y = smooth_axis()
    ripple = Cogging(0.05, 6.0, 0.4)
    phi_names = InverseDynamicsLags(
        sample_rate=RATE, cutoff=50, border=50, effects=("input_offset", Cogging(1.0, 6.0)), law=[Viscous(), Coulomb()]
    )
    y = y + 0.05 * np.cos(6.0 * X[:, 0] + 0.4)
    theta = solve(*phi_names.rows(X, y))
    inertia, effects = phi_names.interpret(theta)
    found = {e.name: e for e in effects}
    assert inertia == pytest.approx(TRUTH["inertia"], rel=0.01)
    assert found["coulomb"].torque == pytest.approx(0.4, rel=0.01)
    assert found["cogging"].amplitude == pytest.approx(ripple.amplitude, rel=0.02)
    assert found["cogging"].phase == pytest.approx(ripple.phase, abs=0.02)
    assert list(phi_names.get_feature_names_out())[-2:] == ["cogging_cos", "cogging_sin"]


def test_effects_of_the_drive_take_it_from_x_or_from_y():
    X, y = smooth_axis(seconds=2.0)
    lags = InverseDynamicsLags(sample_rate=RATE, effects=[LoadFriction(1.0)]).fit(X)
    two = clone(lags).fit(np.column_stack([X, y]))
    assert np.array_equal(lags.transform(X, y), two.transform(np.column_stack([X, y])))
    with pytest.raises(ValueError, match="load_friction is a function of the drive"):
        lags.transform(X)


def test_standstill_leaves_out_slow_rows_of_records_and_streams():
    X, y = smooth_axis(seconds=4.0)
    for causal in (False, True):
        lags = InverseDynamicsLags(sample_rate=RATE, causal=causal, standstill=0.5)
        phi, _ = lags.rows(X, y)
        assert np.abs(phi[:, 1]).min() >= 0.5
        assert len(phi) < len(X)
    pieces = [clone(lags).partial_rows(X, y)[0]]
    piecewise = clone(lags)
    pieces.append(
        np.concatenate([piecewise.partial_rows(X[i : i + 100], y[i : i + 100])[0] for i in range(0, 2000, 100)])
    )
    for p in pieces:
        assert np.array_equal(p, phi)


def test_saturation_has_a_column_too():
    X, y = smooth_axis(seconds=2.0)
    lags = InverseDynamicsLags(sample_rate=RATE, effects=[Saturation(0.3)])
    assert np.isfinite(lags.fit(X).transform(X, y)).all()
