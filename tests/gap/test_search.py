"""Which candidates the search fits before it decides."""

from __future__ import annotations

from dataclasses import dataclass, replace
from types import SimpleNamespace

import numpy as np
import pytest

from whsklearn.gap import evidence as rules
from whsklearn.gap.plant import Look, ModelErrors, ViewDefaults
from whsklearn.gap.search import Search

LIMITS = replace(rules.CAPPED, few_refined=rules.FEW_REFINED)


@dataclass
class QuietView(ViewDefaults):
    """A view of 400 samples at their floor; a candidate leaves the share of them that its start says."""

    refined: list[str]
    limits: rules.Limits = LIMITS

    def gap(self, model):
        return np.full(400, float(model))

    def rms(self, gap):
        return float(np.sqrt(np.mean(gap**2)))

    def floor(self, model):
        return 1.0

    def quiet(self, model, least):
        return True

    def look(self, model):
        return [Look(name, gain, start) for name, gain, start in self.candidates]

    def refine(self, model, look):
        self.refined.append(look.name)
        return look.start

    def explained(self, before, after):
        return 0.1

    def compare(self, models, best):
        block = np.repeat(np.arange(5), 80)
        return [ModelErrors(self.gap(m), self.gap(m), block, 400.0) for m in models]


@pytest.mark.parametrize(("left", "tried"), [([0.99, 0.99, 0.8, 0.99], rules.FEW_REFINED), ([0.9, 0.99, 0.8, 0.99], 4)])
def test_at_the_floor_few_are_fitted_unless_one_of_them_would_earn_a_name(left, tried):
    view = QuietView([])
    view.candidates = [(name, gain, x) for name, gain, x in zip("abcd", (0.4, 0.38, 0.36, 0.34), left, strict=True)]
    search = Search(SimpleNamespace(tolerance=0.004, scale=1.0), lambda v, m: 0.0)
    _, evidence = search.try_all(view, 1.0)
    assert len(view.refined) == tried
    if tried == 4:
        assert evidence[0].name == "c"  # behind in the linear look, ahead in the fit
