"""All displays share axes, colours and refusals."""

from __future__ import annotations

import matplotlib.pyplot as plt
import numpy as np
import pytest

from whsklearn.plot.look import COLOURS, Z95, Display


def test_the_95_percent_point_and_the_palette():
    inside = np.abs(np.random.default_rng(0).normal(size=200_000)) < Z95
    assert inside.mean() == pytest.approx(0.95, abs=0.002)
    assert len(set(COLOURS)) == len(COLOURS)


def test_given_axes_are_drawn_on_and_too_few_refused():
    display = Display()
    _, grid = plt.subplots(2, 1)
    assert display._axes(grid, 2, 1, (4, 3)) == list(grid)
    assert display.figure_ is grid[0].figure
    with pytest.raises(ValueError, match="got 2 axes, expected 3"):
        display._axes(grid, 3, 1, (4, 3))
