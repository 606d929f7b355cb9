"""A variant's numbers in the order of a fit are those of the library's effect."""

import numpy as np
import pytest

from whsklearn.effects import Scales
from whsklearn.gap.plants.servo_candidates import catalogue


@pytest.mark.parametrize("kind", catalogue(), ids=lambda k: k.label)
def test_the_effect_of_a_variant_has_its_numbers_options_and_code(kind):
    q = np.array([*(0.05, -0.03)[: kind.linear], *kind.starts(Scales())[0]])
    effect = kind.effect(q)
    assert len(kind.fields) == q.size
    assert np.asarray(effect.row)[: q.size] == pytest.approx(q)
    assert (effect.name, effect.code, effect.options) == (kind.name, kind.code, kind.options)
