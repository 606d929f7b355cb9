"""Which candidates the search fits before it decides."""

from __future__ import annotations

from dataclasses import dataclass, replace
from types import SimpleNamespace

import numpy as np
import pytest

from whsklearn.gap import evidence as rules
from whsklearn.gap.old_search import Found, Round, Search
from whsklearn.gap.plant import ViewDefaults
from whsklearn.gap.values import CandidateFit, Look, ModelErrors

CAPPED = rules.Limits(per_sample=0.0, least=30.0, most=30.0, over_chance=2.0, price=1.0, blocks=0.5)
LIMITS = replace(CAPPED, few_refined=rules.FEW_REFINED)


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


@dataclass(frozen=True)
class Parts:
    """A model of named effects, each of which leaves a share of the gap."""

    terms: tuple
    n_base: int = 0

    def without(self, index):
        return Parts(self.terms[:index] + self.terms[index + 1 :])

    def with_terms(self, terms):
        return Parts(terms)


def part(name, left, covers=()):
    return SimpleNamespace(name=name, left=left, effect=SimpleNamespace(covers=covers))


class PartsView(QuietView):
    """A view in which what is left is the product of the shares that the effects leave."""

    def gap(self, model):
        return np.full(400, float(np.prod([t.left for t in model.terms])))

    def fit(self, model):
        return model

    def quiet(self, model, least):
        return False

    def look(self, model):
        return [Look(t.name, 1 - t.left, t) for t in self.candidates if t.name not in {o.name for o in model.terms}]

    def refine(self, model, look):
        return Parts((*model.terms, look.start))

    def objection(self, model, index):
        return ""

    def demand(self, model):
        return 0.0

    def replaceable(self, model, index):
        return True

    def trimmed(self, model):
        return self


def search_of(*candidates, view=PartsView):
    view = view([])
    view.candidates, view.floor = candidates, lambda model: 0.01
    plant = SimpleNamespace(tolerance=0.004, scale=1.0, commoner=lambda name: ())
    return view, Search(plant, lambda v, m: 0.0), Found(Parts(()), Parts(()))


def add(search, view, found, name):
    evidence = search.try_all(view, found.model)[1]
    found.add(next(e for e in evidence if e.name == name), evidence, view)


@pytest.mark.parametrize(
    ("covers", "holds", "left"),
    [((), 0.15, ["offset", "spring"]), (("offset",), 0.15, ["spring"]), (("offset",), 0.3, ["offset", "spring"])],
    ids=["covers nothing", "holds both", "cannot hold both"],
)
def test_what_the_last_effect_says_already_is_taken_back(covers, holds, left):
    view, search, found = search_of(part("offset", 0.3), part("spring", 0.5, covers))
    add(search, view, found, "offset")
    add(search, view, found, "spring")
    view.absorbed = lambda model, index: Parts((part("spring", holds),))
    search._absorb(view, found)
    assert [e.name for e in found.taken] == [t.name for t in found.model.terms] == left


def test_a_search_whose_exchanges_give_everything_back_ends():
    class Forgetful(Search):
        def _exchange(self, view, found, chance):
            found.model = found.model.without(1)
            found.drop(1)

    view, search, found = search_of(part("a", 0.2), part("b", 0.1), part("c", 0.1))
    forgetful = Forgetful(search.plant, search.by_chance)
    forgetful._through(view, found)
    assert len(found.rounds) == rules.ROUNDS_A_NAME * forgetful.max_effects


def test_an_effect_holds_its_place_with_the_numbers_that_it_has_by_now():
    class Coarse(PartsView):
        def refine(self, model, look):
            return Parts((*model.terms, part(look.name, 0.9 if look.name == "spring" else look.start.left)))

    view, search, found = search_of(part("spring", 0.9), part("wave", 0.2), part("offset", 0.5), view=Coarse)
    add(search, view, found, "spring")
    add(search, view, found, "wave")
    found.model = Parts((part("spring", 0.1), part("wave", 0.2)))  # polished beside the wave
    search._exchange(view, found, 0.0)
    assert [e.name for e in found.taken] == ["spring", "wave"]


def test_an_elementary_effect_pushes_no_better_one_out_of_its_place():
    class Common(PartsView):
        def look(self, model):
            return [replace(k, elementary=k.name == "offset") for k in super().look(model)]

        def gap(self, model):
            return 0.5 + super().gap(model)  # something else is missing, so that no name reaches the floor

    view, search, found = search_of(part("wave", 0.2), part("spring", 0.05), part("offset", 0.2), view=Common)
    add(search, view, found, "wave")
    add(search, view, found, "spring")
    evidence = search.try_all(view, Parts((part("wave", 0.2),)))[1]
    assert search.first_sound(view, evidence, 0.0).name == "offset"
    search._exchange(view, found, 0.0)
    assert [e.name for e in found.taken] == ["wave", "spring"]


def test_an_effect_that_the_others_leave_nothing_for_is_dropped(monkeypatch):
    least = lambda self, m: np.full(400, min([1.0, *(t.left for t in m.terms)]))  # noqa: E731
    monkeypatch.setattr(PartsView, "gap", least)  # beside the second the first is worth nothing
    view, search, found = search_of(part("coulomb", 0.5), part("load", 0.1))
    view.limits = replace(CAPPED, drops=True)
    add(search, view, found, "coulomb")
    add(search, view, found, "load")
    search._exchange(view, found, 0.0)
    search._prune(view, found)
    assert [e.name for e in found.taken] == ["load"]


def test_an_effect_found_anew_keeps_the_better_numbers():
    class Coarse(PartsView):
        def refine(self, model, look):
            return Parts((*model.terms, part(look.name, 2 * look.start.left)))

    view, search, found = search_of(part("a", 0.2), part("b", 0.1), view=Coarse)
    add(search, view, found, "a")
    add(search, view, found, "b")
    polished = found.model = Parts((part("a", 0.2), part("b", 0.1)))
    search._exchange(view, found, 0.0)
    assert found.model is polished


@pytest.mark.parametrize(
    ("beside", "times"), [(False, 0), (True, 1)], ids=["the same model", "a view that looks beside"]
)
def test_rivals_of_the_last_effect_are_not_fitted_twice_beside_the_same_model(beside, times):
    view, search, found = search_of(part("a", 0.2), part("b", 0.5), part("c", 0.97))
    view.looks_beside = beside
    for n in range(2):
        evidence = search.try_all(view, found.model)[1]
        base = found.model
        found.add(evidence[0], evidence, view)
        found.rounds.append(Round(n + 1, view.rms(view.gap(base)), evidence, [], evidence[0], base, view))
    assert [e.name for e in found.taken] == ["a", "b"]
    tried: list = []
    view.refine = lambda model, look: tried.append(model) or Parts((*model.terms, look.start))
    search._exchange(view, found, 0.0)
    assert sum(m.terms[0].name == "a" for m in tried) == times * 2  # b and c in the place of b
    assert sum(m.terms[0].name == "b" for m in tried) == 2  # a and c in the place of a: nobody has looked there
    assert all(found.rivals)


@pytest.mark.parametrize(("left", "taken"), [(0.05, True), (0.1995, False)], ids=["earned", "not earned"])
def test_numbers_held_at_first_are_set_free_where_they_earn_it(left, taken):
    view, search, found = search_of(part("bristles", 0.2))
    add(search, view, found, "bristles")
    before = found.taken[0]
    wide = Parts((part("bristles", left),))
    view.widened = lambda model: CandidateFit(Look("bristles", 1.0, n_numbers=2), wide)
    search._widen(view, found, 0.0)
    assert [e.name for e in found.taken] == ["bristles"]
    assert (found.model is wide) == taken
    if taken:
        assert found.taken[0].delta_bic > before.delta_bic
        assert found.taken[0].fitted.look.n_numbers == before.fitted.look.n_numbers + 2
    else:
        assert found.taken[0] is before
