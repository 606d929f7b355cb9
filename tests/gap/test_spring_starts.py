"""A spring is seen wherever in the travel it is at rest."""

from __future__ import annotations

import numpy as np
import pytest

from whsklearn.effects import CableSpring, Scales


@pytest.mark.parametrize("rest", np.linspace(-1.0, 1.0, 9))
def test_some_start_shows_a_spring_at_rest_anywhere_in_the_travel(rest):
    scales = Scales(reach=0.9, centre=0.8)
    q = scales.centre + scales.reach * np.sin(np.linspace(0.0, 20.0, 2000))
    wanted = q - (scales.centre + rest * scales.reach)
    shares = [
        (wanted @ (q - c)) ** 2 / ((wanted @ wanted) * ((q - c) @ (q - c))) for (c,) in CableSpring.starts(scales)
    ]
    assert max(shares) > 0.9
