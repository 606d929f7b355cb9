"""The simulation-error fit: sensitivities, start, search."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import lfilter

from whsklearn.effects import Coulomb, FrictionLaw, Tanh, Viscous, cubic_spline_law
from whsklearn.recursion.batch.best_linear import IOData, best_linear, delayed_rows, filter_rows
from whsklearn.recursion.batch.simulation_error import FittedChain, refine, run, sensitivities, solve_law
from whsklearn.recursion.batch.simulation_search import Orders, divisions, padded, squared_error

RNG = np.random.default_rng(0)
BOUNDS = np.array([0, 150, 400])


def data_of(u, y, bounds):
    return IOData(np.atleast_2d(u), y, np.asarray(bounds), np.ones(y.size, bool))


def test_filters_are_scipys_and_restart():
    rows, b, a = RNG.standard_normal((3, 400)), np.array([0.5, 0.2, 0.1]), np.array([1.0, -0.5])
    out = filter_rows(b, a, rows, BOUNDS)
    for s, e in ((0, 150), (150, 400)):
        np.testing.assert_allclose(out[:, s:e], lfilter(b, a, rows[:, s:e]), atol=1e-12)
        np.testing.assert_array_equal(delayed_rows(rows[0], 3, BOUNDS)[2, s + 2 : e], rows[0, s : e - 2])
    assert not delayed_rows(rows[0], 3, BOUNDS)[2, 150:152].any()


@pytest.mark.parametrize(
    "law",
    [
        cubic_spline_law([-2.0, -0.5, 0.4, 2.0], [1.0, 0.2, -0.1, 1.5]),
        FrictionLaw([Viscous(0.4), Tanh(0.7, 0.5)]),
    ],
)
def test_sensitivities_are_the_derivatives(law):
    u = RNG.standard_normal((2, 400))
    one = np.ones(1)
    chain = FittedChain(
        np.array([[1.0, 0.3], [0.2, -0.1]]), np.r_[one, -0.6], np.r_[one, 0.4], np.r_[one, -0.3, 0.1], law, law.weights
    )
    data = data_of(u, np.zeros(400), BOUNDS)
    rows = sensitivities(chain, data)[1]
    n = chain.linear_part.size
    for i in range(len(rows)):
        step = np.zeros(len(rows))
        step[i] = 1e-6
        up, down = (
            run(chain.moved(s * step[:n])._replace(weights=chain.weights + s * step[n:]), data).y for s in (1, -1)
        )
        np.testing.assert_allclose(rows[i], (up - down) / 2e-6, atol=2e-4)


def test_the_best_linear_model_of_a_linear_system_is_the_system():
    u = RNG.standard_normal(1500)
    b, a = [0.3, 0.1, 0.05], [1.0, -1.4, 0.6]
    found = best_linear(data_of(u, lfilter(b, a, u), [0, 1500]), 2, 2)
    np.testing.assert_allclose(found.b, b, atol=1e-6)
    np.testing.assert_allclose(found.a, a, atol=1e-6)
    for first, second in divisions(found, Orders(2, 2, 2, 2)):
        np.testing.assert_allclose(np.convolve(first.a, second.a)[:3], a, atol=1e-6)
        assert padded(first, 3, 3).a.size == 4


def test_dry_friction_on_dx_is_refined_with_its_scale_held():
    law = FrictionLaw([Viscous(0.3), Coulomb(0.8)])
    one, u = np.ones(1), RNG.standard_normal((1, 800))
    true = FittedChain(np.array([[1.0, 0.4]]), np.r_[one, -0.5], one, np.r_[one, -0.3], law, law.weights)
    data = data_of(u, run(true, data_of(u, np.zeros(800), [0, 800])).y, [0, 800])
    near = true._replace(a1=np.r_[one, -0.4], a2=np.r_[one, -0.2])
    fitted = refine(near, data, 40, free=False)
    assert fitted.chain.b1[0, 0] == 1.0
    assert fitted.cost < 0.02 * squared_error(near, data)


def test_a_refinement_never_ends_above_its_start():
    """Knots that happen to stand on a kink are not given away for knots that follow x."""
    u = RNG.standard_normal(1500)
    x = lfilter([1.0, 0.5], [1.0, -0.6], u)
    y = lfilter([1.0, 0.3], [1.0, -0.4], np.abs(x))
    law = cubic_spline_law([-4.0, -0.03, -0.02, 0.0, 0.02, 0.03, 4.0], [4.0, 0.03, 0.02, 0.0, 0.02, 0.03, 4.0])
    chain = FittedChain(
        np.array([[1.0, 0.5]]), np.array([1.0, -0.6]), np.array([1.0, 0.3]), np.array([1.0, -0.4]), law, law.weights
    )
    data = data_of(u, y, [0, 1500])
    given = solve_law(chain, data).cost
    for iterations in (0, 3, 6, 40):
        assert refine(chain, data, iterations).cost <= given * (1 + 1e-12)
