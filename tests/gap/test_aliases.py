"""The chance that an effect beats its rival is that of redrawn blocks."""

from __future__ import annotations

import numpy as np
import pytest

from whsklearn.gap.evidence import bootstrap_share

RNG = np.random.default_rng(0)


def test_a_clear_winner_wins_every_draw_and_equals_about_half():
    small, large = RNG.normal(size=2000), 3.0 * RNG.normal(size=2000)
    assert bootstrap_share(small, large, np.random.default_rng(1)) > 0.99
    assert bootstrap_share(large, small, np.random.default_rng(1)) < 0.01
    near = bootstrap_share(small, RNG.permutation(small), np.random.default_rng(1))
    assert 0.1 < near < 0.9


def test_the_share_grows_with_the_difference():
    e = RNG.normal(size=1000)
    shares = [bootstrap_share(e, (1.0 + d) * RNG.normal(size=1000), np.random.default_rng(2)) for d in (0.0, 0.05, 0.3)]
    assert shares[0] <= shares[1] + 0.2 <= shares[2] + 0.4
    assert shares[2] == pytest.approx(1.0, abs=0.05)
