"""From what was found to a verdict: which closure counts."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from whsklearn.gap import evidence as rules
from whsklearn.gap.old_conclude import _verdict


@pytest.mark.parametrize(("left", "verdict"), [(0.7, "partial"), (0.95, "partial"), (0.3, "named")])
def test_a_free_run_closes_no_gap_that_is_still_there(left, verdict):
    """A run whose restarts alone make as much error as is left looks closed, whatever the model leaves."""
    base, model = SimpleNamespace(gap=1.0), SimpleNamespace(gap=left, n_base=0, terms=(SimpleNamespace(name="drag"),))
    view = SimpleNamespace(
        gap=lambda m: np.full(4, m.gap), rms=lambda g: float(g[0]), floor=lambda m: 0.1, limits=rules.WHITENED,
        quiet=lambda m, least: False, demand=lambda m: 0.0,
    )  # fmt: skip
    plant = SimpleNamespace(
        verdict_view=lambda m: view,
        tolerance=0.004,
        scale=1.0,
        headline=0.5,
        follows=lambda m: 0.0,
        aliases=lambda n: (),
    )
    taken = SimpleNamespace(name="drag")
    found = SimpleNamespace(base=base, model=model, taken=[taken], rivals=[[taken]], views=[view])
    assert _verdict(plant, found, [{"horizon": 0.5, "closure": 1.0}], np.random.default_rng(0))[0] == verdict
