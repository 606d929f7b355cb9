"""What a candidate would do to the errors, beside what the model itself can do."""

from __future__ import annotations

import numpy as np
import pytest

from tests.gap.plants.example_chain import PLAIN, SCALES, TRUE, kind, setting
from whsklearn.effects import Cogging, QuadraticDrag
from whsklearn.gap.plants.chain_screening import coherence, refine_scan, screen, signature, tangent_of


@pytest.fixture(scope="module")
def tangent():
    return tangent_of(PLAIN, TRUE, SCALES)


def test_what_the_models_own_numbers_can_make_leaves_nothing_over(tangent):
    viscous = signature(PLAIN, tangent, kind("viscous"), (), SCALES)  # a term of the law
    assert np.linalg.norm(tangent.leftover(viscous)) < 1e-3 * np.linalg.norm(viscous)
    drag = signature(PLAIN, tangent, kind("quadratic_drag"), (), SCALES)
    assert np.linalg.norm(tangent.leftover(drag)) > 0.02 * np.linalg.norm(drag)
    again = tangent.leftover(tangent.leftover(drag))
    np.testing.assert_allclose(again, tangent.leftover(drag), atol=1e-12)


def test_a_hidden_effect_gains_most_at_about_its_size():
    s = setting(QuadraticDrag(0.05))
    tangent = tangent_of(s, TRUE, SCALES)
    found = screen(s, tangent, [kind(n) for n in ("quadratic_drag", "load_friction", "output_drift")], SCALES)
    assert found[0].name == "quadratic_drag"
    assert found[0].term.q[0] == pytest.approx(0.05, rel=0.3)
    assert found[0].gain > 2.0 * found[1].gain


def test_an_order_between_those_of_the_grid_is_walked_to():
    order = 2.37 / SCALES.x
    s = setting(Cogging(0.1, order, 0.4))
    tangent = tangent_of(s, TRUE, SCALES)
    best = screen(s, tangent, [kind("cogging")], SCALES)[0]
    walked = refine_scan(s, tangent, best, SCALES)
    assert walked.gain >= best.gain
    assert abs(walked.term.q[2] - order) <= abs(best.term.q[2] - order)
    assert walked.term.q[2] == pytest.approx(order, rel=0.05)


def test_coherence_is_that_of_the_planes():
    rng = np.random.default_rng(0)
    a, b = rng.normal(size=(2, 100, 2))
    assert coherence(a, a @ [[2.0, 1.0], [0.0, 3.0]]) == pytest.approx(1.0)
    assert coherence(a, b) < 0.5
