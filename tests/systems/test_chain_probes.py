"""Generic functions at the law's port of a chain."""

from __future__ import annotations

import numpy as np
import pytest

from whsklearn.systems import chain_probes as probes

V = np.arange(10.0)


def at(code, number=0.0, *, x=0.0, dx=0.0, u=0.0, t=0, s=0.0):
    return probes.probe(code, number, 0.5, x, dx, u, t, V, s)


@pytest.mark.parametrize("value", np.linspace(-2, 2, 9))
def test_hats_one_width_apart_sum_to_one(value):
    assert sum(probes.hat(value, centre, 0.5) for centre in np.arange(-3, 3.5, 0.5)) == pytest.approx(1.0)


@pytest.mark.parametrize(("code", "signal"), [(probes.HAT_X, "x"), (probes.HAT_DX, "dx"), (probes.HAT_T, "t")])
def test_a_hat_looks_at_its_own_signal_only(code, signal):
    everything = {"x": 3.0, "dx": 3.0, "t": 3}
    assert at(code, 3.0, **everything) == 1.0
    assert at(code, 3.0, **everything | {signal: 5}) == 0.0
    assert at(code, 3.0, **{signal: 3}) == 1.0


def test_a_lag_is_zero_before_the_record():
    assert at(probes.LAG_V, 2.0, t=5) == V[3]
    assert at(probes.LAG_V, 2.0, t=1) == 0.0


def test_products_are_those_of_their_numbers():
    x, dx, u, t, s = 2.0, -3.0, -5.0, 7, -1.0
    wanted = [x * dx, x * s, u * dx, abs(u) * s, t * dx, t * s, x * u, x * abs(dx)]
    assert [at(probes.PRODUCT, float(i), x=x, dx=dx, u=u, t=t, s=s) for i in range(8)] == wanted
