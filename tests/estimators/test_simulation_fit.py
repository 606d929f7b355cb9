"""A fitted chain and its natural parameters are the same system."""

from __future__ import annotations

import numpy as np
import pytest

from whsklearn.effects import FrictionLaw, Hinge, NaturalSpline, Power, as_law
from whsklearn.estimators._simulation_fit import law_of, monic, natural_of, rescaled, scale_free, to_chain
from whsklearn.recursion.batch.simulation_error import FittedChain, run
from whsklearn.recursion.batch.simulation_search import record

RNG = np.random.default_rng(5)
U = RNG.normal(size=(600, 1))
DATA = record(U, RNG.normal(size=600), np.arange(600) == 0, None)
CUBIC = FrictionLaw([Power(1.0, float(d)) for d in (1, 2, 3)])
KINKED = FrictionLaw([Power(1.0, 0.0), Power(1.0, 1.0), Hinge(1.0, -0.3), Hinge(1.0, 0.4)])
SPLINE = FrictionLaw([Power(1.0, 0.0), Power(1.0, 1.0), *(NaturalSpline(1.0, k, 0.9, 1.5) for k in (-1.5, -0.5, 0.2))])


def example(law, gain=(2.0, -0.7)):
    """A stable chain of orders 2, 2, 2, 2 whose numerators do not begin with one."""
    b1 = gain[0] * np.array([[1.0, 0.4]])
    b2 = gain[1] * np.array([1.0, -0.3])
    return FittedChain(b1, np.array([1.0, -0.9, 0.2]), b2, np.array([1.0, -0.5, 0.1]), law, RNG.normal(size=len(law)))


def output(chain):
    return run(chain, DATA).y


@pytest.mark.parametrize("law", [CUBIC, KINKED, SPLINE], ids=["cubic", "hinges", "spline"])
@pytest.mark.parametrize("gain", [(2.0, -0.7), (-0.5, 3.0)])
def test_a_monic_chain_is_the_same_system(law, gain):
    chain = example(law, gain)
    plain = monic(chain)
    assert (plain.b1[0, 0], plain.b2[0]) == (1.0, 1.0)
    np.testing.assert_allclose(output(plain), output(chain), atol=1e-8 * np.abs(output(chain)).max())


@pytest.mark.parametrize("law", [CUBIC, KINKED, SPLINE], ids=["cubic", "hinges", "spline"])
@pytest.mark.parametrize("factor", [0.2, 3.0, -1.7])
def test_a_rescaled_law_is_the_law_of_a_multiple(law, factor):
    weights = RNG.normal(size=len(law))
    new, at = rescaled(law, weights, factor)
    x = np.linspace(-1.0, 1.0, 301) / abs(factor)
    np.testing.assert_allclose(new.regressors(x, 0.0) @ at, law.regressors(factor * x, 0.0) @ weights, atol=1e-9)


def test_a_natural_vector_is_its_chain():
    plain = monic(example(CUBIC))
    natural, at = natural_of(plain)
    assert len(np.unique(at)) == natural.size
    again = to_chain(natural, np.array([2, 2, 2, 2, 3]), 1, CUBIC)
    np.testing.assert_allclose(output(again), output(plain), atol=1e-12)


def test_poles_outside_the_circle_are_drawn_inside():
    natural = natural_of(monic(example(CUBIC)))[0].copy()
    natural[1:3] = (-2.1, 1.1)  # poles at 1.05 and more
    roots = np.roots(to_chain(natural, np.array([2, 2, 2, 2, 3]), 1, CUBIC).a1)
    assert np.all(np.abs(roots) < 1.0)


def test_only_a_law_of_every_scale_leaves_the_scale_of_x_open():
    assert all(scale_free(law) for law in (CUBIC, KINKED, SPLINE))
    assert not scale_free(as_law("viscous,coulomb"))
    assert law_of(None).labels == as_law("cubic_spline").labels
