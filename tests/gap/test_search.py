"""The search over a plant of plain regression: effects are columns, and nothing here is physics."""

from __future__ import annotations

from dataclasses import dataclass, replace
from types import SimpleNamespace

import numpy as np
import pytest

from whsklearn.effects import effect_names, get_effect
from whsklearn.gap.plant import Plant, WithTerms
from whsklearn.gap.search import MOST_FITTED, Found, Named, Search
from whsklearn.gap.tangent import Family, Look, Tangent, with_p_values

N = 800


@dataclass(frozen=True)
class Regression(WithTerms):
    """A model: names of the columns in it."""

    terms: tuple = ()
    n_base: int = 0
    bent: bool = False  # whether it is at a minimum that is not its best


class Columns(Plant):
    """A plant of columns by name."""

    scale, tolerance, n_effective = 1.0, 0.02, float(N)
    exact = False

    def __init__(self, truth, names="abcdef", seed=0, forbidden=(), places=None, common=None):
        self.places, self.common = places or {}, common or {}
        rng = np.random.default_rng(1000 + seed)
        self.columns = {n: rng.standard_normal(N) for n in names}
        self.columns["twin"] = self.columns["a"] + 1e-3 * rng.standard_normal(N)
        self.y = sum((size * self.columns[n] for n, size in truth.items()), 0.1 * rng.standard_normal(N))
        self.forbidden = forbidden

    def errors(self, model):
        x = np.column_stack([self.columns[t.name] for t in model.terms] + [np.zeros(N)])
        return self.y - x @ np.linalg.lstsq(x, self.y, rcond=None)[0]

    def rms(self, errors):
        return float(np.sqrt(np.mean(errors**2)))

    def looks(self, model, rng, beside=None):
        left = self.errors(model)
        null = self.rms(left) * rng.standard_normal((15, N))
        x = np.column_stack([self.columns[t.name] for t in model.terms] + [np.zeros(N)])
        tangent = Tangent(left, null, x, N)
        present = {t.name for t in model.terms}
        families = (
            Family(
                n,
                lambda _, c=c: [([0], c[:, None, None], 1.0)],
                lambda *_: None,
                place=frozenset(self.places.get(n, "")),
            )
            for n, c in self.columns.items()
            if n not in present
        )
        return with_p_values([tangent.look(f) for f in families])

    def refine(self, model, look):
        effect = SimpleNamespace(name=look.name, commoner=self.common.get(look.name, ()), parent="",
                                 elementary=False, place="column")  # fmt: skip
        return Regression((*model.terms, SimpleNamespace(name=look.name, effect=effect)))

    def settled(self, model):
        return model

    def objection(self, model, grown):
        return "forbidden" if grown.terms[-1].name in self.forbidden else ""

    def aliases(self, name):
        return ()

    def leads(self, taken, other, before, rng):
        return np.zeros(0)


def run(plant, **settings):
    settings = {"alpha": 0.01, "max_effects": 3} | settings
    return Search(plant, np.random.default_rng(0), **settings).run(Regression())


def test_nothing_is_found_in_noise_at_the_stated_level():
    named = [bool(run(Columns({}, seed=s), alpha=0.05).taken) for s in range(100)]
    assert sum(named) <= 11  # 5 expected; a binomial of 100 reaches 12 once in 200


@pytest.mark.parametrize("truth", [{"b": 0.2}, {"b": 0.2, "d": 0.5}, {"c": 0.3, "d": 0.2, "f": 0.1}])
def test_all_that_is_missing_is_found_and_no_more(truth):
    found = run(Columns(truth))
    assert {t.name for t in found.taken} == set(truth)
    assert not any(t.rivals for t in found.taken)
    sizes = {t.name: t.size for t in found.taken}
    assert sizes == pytest.approx(truth, rel=0.15)


def test_a_look_is_compared_with_looks_and_not_with_what_a_polished_shape_explains():
    """A play that was polished to no width kept a flexible coupling, which it then was, from being fitted."""
    plant, rng = Columns({"a": 0.5}, names="ab"), np.random.default_rng(0)
    plant.columns["b"] = plant.columns["a"] + 1e-3 * rng.standard_normal(N)
    polished = dict(plant.columns)
    plant.columns = {n: polished["a"] + far * rng.standard_normal(N) for n, far in (("a", 1.8), ("b", 2.6))}
    looks = plant.looks(Regression(), rng)
    plant.columns = polished
    search = Search(plant, rng, alpha=0.01, max_effects=3)
    assert {f.name for f in search.fitted(Regression(), looks)} == {"a", "b"}


def test_what_two_columns_say_alike_is_ambiguous():
    found = run(Columns({"a": 0.5}))
    assert {found.taken[0].name, *found.taken[0].rivals} == {"a", "twin"}


def test_what_physics_forbids_takes_no_place_among_those_that_are_fitted():
    forbidden = tuple("bcdefgh")
    plant = Columns({"a": 0.3} | dict.fromkeys(forbidden, 0.5), names="abcdefgh", forbidden=forbidden)
    assert len(forbidden) > MOST_FITTED
    assert [t.name for t in run(plant).taken] == ["a"]


def test_what_physics_forbids_is_not_taken_and_sets_no_scale():
    found = run(Columns({"a": 0.5, "b": 0.1}, forbidden=("a", "twin")))
    assert [t.name for t in found.taken] == ["b"]


class Bent(Columns):
    """A base model that only a fit with a candidate brings to its best minimum; until then it lacks a column."""

    exact = True

    def errors(self, model):
        return super().errors(model) - 0.5 * model.bent * self.columns["b"]


def test_no_effect_is_named_for_a_better_minimum_of_the_model_without_it():
    found = Search(Bent({}), np.random.default_rng(0), alpha=0.01, max_effects=3).run(Regression(bent=True))
    assert found.taken == []
    assert not found.base.bent


def test_what_explains_more_beside_the_better_minimum_is_named():
    found = Search(Bent({"d": 0.3}), np.random.default_rng(0), alpha=0.01, max_effects=3).run(Regression(bent=True))
    assert [t.name for t in found.taken] == ["d"]
    assert not found.model.bent


def test_an_effect_below_the_tolerance_gets_no_name():
    assert not run(Columns({"b": 0.015})).taken
    assert run(Columns({"b": 0.03})).taken


@pytest.mark.parametrize("silent", [True, False])
def test_nothing_is_added_to_a_model_that_leaves_nothing_worth_naming(silent):
    class Sharp(Columns):
        def silent(self, model):
            return silent and bool(model.terms)

    found = run(Sharp({"b": 0.5, "d": 0.2}))
    assert [t.name for t in found.taken] == (["b"] if silent else ["b", "d"])
    assert any(look.name == "d" for look in found.remainder) is silent, "the report still has the look"


def test_no_more_names_than_asked_for():
    assert len(run(Columns({"b": 0.2, "c": 0.3, "d": 0.4}), max_effects=2).taken) == 2


def test_an_interruption_keeps_what_is_taken():
    def stop(_):
        raise KeyboardInterrupt

    found = run(Columns({"b": 0.2, "c": 0.3}), on_round=stop)
    assert found.interrupted
    assert [t.name for t in found.taken] == ["c"]


def test_what_acts_elsewhere_is_no_rival_and_is_asked_after_what_physics_forbids():
    truth, places = {"a": 0.5, "b": 0.3}, {"a": "1", "twin": "1", "b": "2"}
    found = run(Columns(truth, places=places))
    assert {t.name for t in found.taken} <= {"a", "twin", "b"}
    assert next(t for t in found.taken if t.name == "b").rivals == []
    found = run(Columns(truth, places=places, forbidden=("a", "twin")))
    assert [t.name for t in found.taken] == ["b"]


@pytest.mark.parametrize("common", ["a", "twin"])
def test_of_two_that_no_record_tells_apart_the_commoner_goes_first(common):
    other = {"a": "twin", "twin": "a"}[common]
    found = run(Columns({"a": 0.4}, names="ab", common={other: (common,)}))
    assert [t.name for t in found.taken] == [common]
    assert other in found.taken[0].rivals


def test_what_the_plant_objects_to_says_so():
    plant = Columns({"a": 0.4, "b": 0.2}, names="ab", forbidden=("a", "twin"))
    found = run(plant)
    assert {t.name for t in found.taken} == {"b"}
    assert {f.reason for f in found.steps[0].fitted if f.name in plant.forbidden} == {"forbidden"}


def test_an_effect_that_settles_at_more_than_was_left_before_is_taken_back_and_the_round_says_so():
    class Unsettled(Columns):
        def settled(self, model):  # all that is taken turns sour as soon as the other numbers move
            self.sour = len(model.terms) > 0
            return model

        def errors(self, model):
            return super().errors(model) * (3.0 if model.terms and getattr(self, "sour", False) else 1.0)

    found = run(Unsettled({"a": 0.2}, names="ab"))
    assert not found.taken
    assert not found.model.terms
    assert found.steps[0].taken is None
    assert len(found.steps) == 1


def test_after_one_that_settles_at_more_the_next_best_is_taken():
    class Unsettled(Columns):
        def settled(self, model):  # the strongest turns sour as soon as the other numbers move
            self.sour = "a" in {t.name for t in model.terms}
            return model

        def errors(self, model):
            sour = getattr(self, "sour", False) and "a" in {t.name for t in model.terms}
            return super().errors(model) * (30.0 if sour else 1.0)

    found = run(Unsettled({"a": 0.4, "c": 0.2}, names="abc", forbidden=("twin",)))
    assert [t.name for t in found.taken] == ["c"]
    assert {f.name for f in found.steps[0].fitted if "all numbers fitted" in f.reason} == {"a"}


def test_the_next_best_is_judged_in_the_view_that_fitted_it():
    """Where the strongest is taken back, its model may have been judged at fewer samples, behind another filter."""

    class Coarser(Columns):
        def settled(self, model):
            if "a" in {t.name for t in model.terms}:  # and no other model asks for the finer one again
                self.every = 2
            return model

        def errors(self, model):
            return super().errors(model)[:: self.every]

        def too_little(self, model):
            return "it is part of a wave" if "a" in {t.name for t in model.terms} else ""

        def leads(self, taken, other, before, rng):
            assert before.size == taken.errors.size == other.errors.size == N
            return super().leads(taken, other, before, rng)

    truth = {"a": 0.4, "b": 0.2, "c": 0.15}
    plant = Coarser(truth, names="abc", forbidden=("twin",))
    plant.every = 1
    plant.columns["b"] = plant.columns["b"] + 0.7 * plant.columns["c"]
    found = run(plant)
    assert found.steps[0].taken.name in "bc"
    assert "a" not in {t.name for t in found.taken}


@pytest.mark.parametrize(("truth", "names"), [
    ({"a": 0.4, "c": 0.2, "d": 0.1}, {"a", "d"}),  # without a, c leaves more than a does without c
    ({"c": 0.4, "d": 0.1}, {"c", "d"}),  # a stood for c, in part
])  # fmt: skip
def test_an_effect_beside_which_others_are_unphysical_has_to_explain_what_they_do(truth, names):
    class Exclusive(Columns):
        """A plant in which physics forbids a beside c, and c is seen only once a is there."""

        def looks(self, model, rng, beside=None):
            there = {t.name for t in model.terms}
            return [k for k in super().looks(model, rng, beside) if k.name != "c" or "a" in there]

        def objection(self, model, grown):
            there = {t.name for t in grown.terms}
            return "c takes it out of its range" if grown.terms[-1].name == "a" and "c" in there else ""

    plant = Exclusive({}, names="abcd")
    del plant.columns["twin"]
    plant.columns["a"] = plant.columns["a"] + ("a" not in truth) * 1.5 * plant.columns["c"]
    plant.y = plant.y + sum(size * plant.columns[n] for n, size in truth.items())
    found = run(plant)
    assert {t.name for t in found.taken} == names
    said = [f.reason for s in found.steps for f in s.fitted if "would be unphysical" in f.reason]
    assert bool(said) is ("a" in names)


def test_what_nameless_functions_show_together_shows_the_names_that_explain_a_share_of_it():
    def look(name, p, size):
        return Look(name, 10.0, np.zeros(3), size=size, p_value=p)

    search = Search(Columns({}), np.random.default_rng(0), alpha=0.01, max_effects=3)
    shown = search._shown([look("", 1e-6, 1.0), look("strong", 0.2, 0.9), look("weak", 0.2, 0.4)])
    assert {k.name: k.p_value for k in shown} == {"": 1e-6, "strong": 1e-6, "weak": 0.2}
    unsure = search._shown([look("", 0.02, 1.0), look("strong", 0.2, 0.9)])
    assert [k.p_value for k in unsure] == [0.02, 0.2]


def test_what_nameless_functions_show_is_lent_to_no_name_that_says_next_to_nothing_itself():
    """Else the whole catalogue would be listed: a gain of seven is within reach of every name."""
    look = Look("weak", 7.0, np.ones(15), size=0.1, p_value=0.6)
    strong, nameless = replace(look, gain=20.0), Look("", 35.0, np.ones(15), size=0.1, p_value=1e-5)
    search = Search(Columns({}), np.random.default_rng(0), 0.01, 3)
    p_values = [search._shown([k, nameless])[0].p_value for k in (look, strong)]
    assert p_values == [0.6, 1e-5]


def test_a_bump_that_leads_with_as_few_numbers_leaves_a_wave_without_a_name():
    plant = Columns({"a": 0.5})
    look = next(k for k in plant.looks(Regression(), np.random.default_rng(0)) if k.name == "a")
    search = Search(plant, np.random.default_rng(0), 0.01, 3)
    alike = 1.001 * look.size  # more, by less than one explanation must lead another
    for numbers, size, refused in ((1, 0.6, True), (9, 0.6, False), (1, 0.3, False), (1, alike, False)):
        bump = Look("", 900.0, np.ones(15), size=size, n_numbers=numbers, p_value=1e-9)
        (found,) = search._fitted(Regression(), [look], [bump])
        assert ("without a name" in found.reason) == refused


def test_a_second_search_at_half_the_level_counts_if_it_finds_something_and_else_leaves_the_first():
    class Sharp(Columns):
        """A plant that shows more, or not, when it is looked at again."""

        def __init__(self, truth):
            super().__init__({})
            self.better, self.calls = Columns(truth).y, []

        def sharpened(self, model):
            self.calls.append("sharp")
            self.y = self.better
            return True

    levels = []

    class Noting(Search):
        """A search that notes its level."""

        def _searched(self, base):
            levels.append(self.alpha)
            return super()._searched(base)

    def run(plant):
        return Noting(plant, np.random.default_rng(0), 0.01, 3).run(Regression())

    found = {size: (plant := Sharp({"b": size}), run(plant)) for size in (0.5, 0.0)}
    assert levels == [0.01, 0.005] * 2
    plant, result = found[0.5]
    assert ([t.name for t in result.taken], plant.calls, plant.y is plant.better) == (["b"], ["sharp"], True)
    plant, result = found[0.0]
    assert (result.taken, plant.calls, plant.y is plant.better) == ([], ["sharp"], False)


def test_a_review_that_changes_nothing_leaves_the_plant_at_the_model_that_it_found():
    class Minding(Columns):
        """A plant whose state is the model that it looked at last."""

        def looks(self, model, rng, beside=None):
            self.seen = model
            return super().looks(model, rng, beside)

    plant = Minding({"b": 1.0, "c": 0.6, "d": 0.4})
    result = Search(plant, np.random.default_rng(0), 0.01, 5).run(Regression())
    assert sorted(t.name for t in result.taken) == ["b", "c", "d"]
    assert plant.seen.terms == result.model.terms


def test_a_model_is_fitted_along_its_run_once_for_every_effect_that_is_added():
    class Running(Columns):
        """A plant that notes what it has fitted along the run."""

        def __init__(self, truth):
            super().__init__(truth)
            self.ran = []

        def along_the_run(self, model):
            self.ran.append({t.name for t in model.terms})
            return replace(model, bent=True)

    plant = Running({"b": 1.0, "c": 0.6})
    result = Search(plant, np.random.default_rng(0), 0.01, 5).run(Regression())
    assert plant.ran == [{"b"}, {"b", "c"}]
    assert result.model.bent


def test_an_effect_is_needed_where_the_others_without_it_would_be_unphysical():
    class Picky(Columns):
        """A plant whose ``b`` is unphysical without ``a``."""

        def objection(self, model, grown):
            names = [t.name for t in grown.terms]
            return "unphysical" if names[-1] == "b" and "a" not in names else ""

    search = Search(Picky({"a": 0.5, "b": 0.5}), np.random.default_rng(0), 0.01, 3)
    terms = tuple(SimpleNamespace(name=n) for n in "ab")
    assert search._sound(Regression(terms))
    assert not search._sound(Regression(terms[1:]))


def test_a_name_that_explains_something_else_is_not_shown_by_nameless_functions():
    plant = Columns({"a": 0.5, "b": 0.5}, names="abc")
    tangent = Tangent(plant.y, np.empty((0, N)), np.zeros((N, 1)), N)

    def look(name, *columns):
        x = np.column_stack([plant.columns[c] for c in columns])
        return tangent.look(Family(name, lambda _: [([0], x[:, None, :], 1.0)], lambda *_: None))

    nameless = replace(look("", "a", "c"), p_value=1e-6)
    same, other = (replace(look(c, c), p_value=0.2) for c in "ab")
    np.testing.assert_allclose(same.explained @ same.explained, N * same.size**2)
    search = Search(plant, np.random.default_rng(0), alpha=0.01, max_effects=3)
    assert [k.p_value for k in search._shown([nameless, same, other])] == [1e-6, 1e-6, 0.2]


def test_a_name_that_explains_as_much_is_a_rival_though_chance_might_explain_it():
    """Of the names that look as good, only the one that fits as well: beside a weight, a spring had looked so."""
    plant = Columns({"a": 0.5}, names="abcd", forbidden="c")
    plant.columns["c"] = plant.columns["twin"]

    def look(name, p, g):
        return Look(name, g, np.zeros(3), p_value=p)

    search, base = Search(plant, np.random.default_rng(0), alpha=0.01, max_effects=3), Regression()
    first = look("a", 1e-6, 40.0)
    taken = replace(search._named(base, first, plant.refine(base, first)), gain=45.0)
    asked = [first, look("twin", 0.1, 41.0), look("b", 0.1, 41.0), look("c", 0.1, 41.0), look("d", 0.1, 20.0),
             look("", 0.1, 45.0)]  # fmt: skip
    assert search._as_good(base, taken, asked) == ["twin"]  # b fits less well, physics forbids c, d is far behind
    # a cubic spring about another centre than that of the travel, found by a weak look
    assert search._as_good(base, replace(taken, gain=330.0), asked) == []


@pytest.mark.parametrize(("exact", "whole", "left", "rivals"), [
    (False, False, 1.3, ["other"]), (False, False, 1.5, []), (False, True, 1.3, []), (True, False, 1.3, []),
])  # fmt: skip
def test_what_neither_explains_may_favour_the_wrong_one(exact, whole, left, rivals):
    """A spring left 0.77 of the power that the gravity of a pendulum left, beside friction that grows with the load."""
    plant = Columns({})
    plant.exact, plant.complete = exact, lambda before, model: whole
    search = Search(plant, np.random.default_rng(0), alpha=0.01, max_effects=3)
    taken, other = (Named(Look(n, 40.0, np.zeros(3)), None, np.ones(9), e * np.ones(9)) for n, e in
                    (("taken", 1.0), ("other", left)))  # fmt: skip
    assert search._unsettled(taken, [taken, other]) == rivals


@pytest.mark.parametrize("exact", [True, False])
@pytest.mark.parametrize("whole", [True, False])
def test_few_instants_tell_two_laws_apart_where_one_leaves_nothing(whole, exact):
    """A stop is touched a few times; gravity in its place leaves what blocks cannot tell from chance."""
    plant, rng = Columns({}), np.random.default_rng(0)
    plant.exact, plant.complete, plant.settled = exact, lambda before, model: whole, lambda model: model
    plant.p_of_all = lambda model, rng: float(whole and model == "end_stop")
    plant.leads = lambda taken, other, before, rng: rng.standard_normal(15)
    noise, touches = rng.standard_normal(N), np.zeros(N)
    touches[[100, 105, 600]] = 60.0
    taken, other = (Named(Look(n, 40.0, np.zeros(3)), n, noise + 2.0 * touches, e, gain=g) for n, e, g in
                    (("end_stop", noise, 900.0), ("gravity", noise + touches, 500.0)))  # fmt: skip
    search = Search(plant, rng, alpha=0.01, max_effects=3)
    assert search._told_apart(taken, other) is whole
    if exact:  # nor do they where the other leaves nothing that could be shown
        plant.p_of_all = lambda model, rng: 1.0
        assert not search._told_apart(taken, other)


@pytest.mark.parametrize(("numbers", "whole", "apart"), [(1, True, False), (1, False, True), (3, True, True)])
def test_what_is_simpler_and_leaves_only_noise_is_not_ruled_out_by_a_better_fit(numbers, whole, apart):
    """A spring, of two numbers, gained a thousandth more than the offset that was missing beside another spring."""
    plant, rng = Columns({}), np.random.default_rng(0)
    noise = rng.standard_normal(N)
    taken, other = (
        Named(Look(n, 40.0, np.zeros(3), n_numbers=k), n, 9.0 * noise, e * noise, gain=g)
        for n, k, e, g in (("spring", 2, 1.0, 900.0), ("offset", numbers, 1.2, 600.0))
    )
    plant.exact, plant.complete = True, lambda before, model: model == "spring" or whole
    assert Search(plant, rng, alpha=0.01, max_effects=3)._told_apart(taken, other) is apart


def fits(plant, *looks):
    search = Search(plant, np.random.default_rng(0), alpha=0.01, max_effects=3)
    return search, [search._named(Regression(), k, plant.refine(Regression(), k)) for k in looks]


@pytest.mark.parametrize(("numbers", "same"), [(3, ["twin"]), (1, [])])
def test_of_two_that_describe_the_same_the_one_with_fewer_numbers_is_taken(numbers, same):
    """A Stribeck curve as wide as all speeds led the quadratic drag of the record by a gain of one."""
    plant = Columns({"a": 0.3})
    plant.exact = True
    null = np.ones(15)
    search, found = fits(plant, Look("twin", 900.0, null, n_numbers=numbers), Look("a", 900.0, null + 0.5))
    assert found[0].score > found[1].score
    taken = search._chosen(Regression(), found, [])
    assert (taken.name, taken.same) == ("a" if same else "twin", same)
    assert taken.rivals == ([] if same else ["a"])


@pytest.mark.parametrize(("chance", "rivals"), [(1.0, ["twin"]), (1e4, [])])
def test_what_explains_no_more_than_of_own_records_is_no_rival(chance, rivals):
    """A tone explained twice as much of a chain's own records, and was told beside the lag that was missing."""
    plant = Columns({"a": 0.3})
    plant.exact = True
    search, (taken,) = fits(plant, Look("a", 900.0, np.ones(15)))
    other = Look("twin", 900.0, np.full(15, chance), p_value=0.5)
    assert search._as_good(Regression(), taken, [other]) == rivals


def test_a_review_leaves_an_effect_that_a_better_one_is_not_told_from():
    plant = Columns({"a": 0.5, "c": 0.3})
    search = Search(plant, np.random.default_rng(0), alpha=0.01, max_effects=3)
    found = search.run(Regression())
    assert found.taken[0].name in ("a", "twin")
    first = found.taken[0].name
    fresh = Search(plant, np.random.default_rng(1), alpha=0.01, max_effects=3)
    fresh._review(found)
    assert found.taken[0].name == first, "a and its twin differ by a thousandth, whichever is better here"


def test_a_review_replaces_nothing_by_what_leaves_more():
    """A Stribeck curve, polished beside others, met its limit; a ripple of friction, with twice the rest, took over."""
    plant = Columns({"a": 0.6, "d": 0.4}, names="abd")
    plant.columns["b"] = plant.columns["a"] + 2.0 * plant.columns["b"]  # a fifth of a's power
    del plant.columns["twin"]
    search = Search(plant, np.random.default_rng(0), alpha=0.01, max_effects=3)
    found = search.run(Regression())
    assert [t.name for t in found.taken] == ["a", "d"]
    as_it_is, left = found.model.terms[0], plant.rms(plant.errors(found.model))
    plant.objection = lambda model, grown: "at its limit" if grown.terms[-1].name == "a" and not stands(grown) else ""
    stands = lambda grown: grown.terms[-1] is as_it_is  # noqa: E731
    search._review(found)
    assert [t.name for t in found.taken] == [t.name for t in found.model.terms] == ["a", "d"]
    stands = lambda grown: False  # noqa: E731
    search._review(found)
    assert [t.name for t in found.taken] == [t.name for t in found.model.terms] == ["b", "d"]
    assert plant.rms(plant.errors(found.model)) > left, "what physics forbids goes, whatever takes its place"


class Weighing(Columns):
    """A plant that divides errors by those of the model fitted last, as an arm does at each joint."""

    weight, tolerance = 1.0, 0.2  # in units of the noise

    def settled(self, model):
        self.weight = 1.0 / self.rms(super().errors(model))
        return model

    def errors(self, model):
        return self.weight * super().errors(model)


@pytest.mark.parametrize("fitted", ["b", "ba"])
@pytest.mark.parametrize("kind", [Columns, Weighing])
@pytest.mark.parametrize(("truth", "names"), [({"a": 0.5}, ["a"]), ({"b": 0.5, "c": 0.2}, ["b", "c"])])
def test_a_rival_that_alone_leaves_as_little_stands_for_all_names_after_it(truth, names, kind, fitted):
    """Gravity and a hardening spring stood for a cable spring, which the first look could not tell from gravity."""
    plant = kind({}, names="abc")
    plant.columns["b"] = plant.columns["a"] - 0.3 * plant.columns["c"]
    plant.y = plant.y + sum(size * plant.columns[n] for n, size in truth.items())
    looks = plant.looks(Regression(), np.random.default_rng(0))
    look = looks[0]
    b, a = (Named(k, plant.refine(Regression(), k), plant.y, plant.y) for k in (replace(look, name=n) for n in "ba"))
    c = replace(look, name="c")
    both = plant.refine(b.model, c)
    taken = [replace(b, rivals=["a"]), Named(c, both, plant.errors(b.model), plant.errors(both))]
    step = SimpleNamespace(taken=taken[0], fitted=[b, a][: len(fitted)], looks=looks)
    found = Found(Regression(), plant.settled(both), taken, [step])
    assert Search(plant, np.random.default_rng(0), alpha=0.01, max_effects=3)._fewer(found) is (names == ["a"])
    assert [t.name for t in found.taken] == [t.name for t in found.model.terms] == names


def test_a_trial_of_a_rival_leaves_the_plant_as_it_was():
    class Minding(Columns):
        """A plant whose state is a view, which fitting a model moves."""

        def settled(self, model):
            self.view.append(model)
            return model

        def snapshot(self):
            return {"view": list(self.view)}

    plant = Minding({"b": 0.5, "c": 0.2}, names="abcd")
    plant.view = ["of the search"]
    look = plant.looks(Regression(), np.random.default_rng(0))[0]
    b, *others = (
        Named(k, plant.refine(Regression(), k), plant.y, plant.y) for k in (replace(look, name=n) for n in "bad")
    )
    both = plant.refine(b.model, replace(look, name="c"))
    taken = [replace(b, rivals=["a", "d"]), Named(replace(look, name="c"), both, plant.y, plant.errors(both))]
    found = Found(Regression(), both, taken, [SimpleNamespace(taken=taken[0], fitted=[b, *others], looks=[])])
    assert not Search(plant, np.random.default_rng(0), alpha=0.01, max_effects=3)._fewer(found)
    assert plant.view == ["of the search"], "after each of two trials"


def test_sizes_are_of_what_each_explains_beside_those_that_explain_more():
    plant = Columns({"a": 0.5, "b": 0.3, "c": 0.2}, names="abc")
    plant.columns["b"] = plant.columns["b"] + 2.0 * plant.columns["a"]  # most of what b explains is a's
    plant.y = 0.5 * plant.columns["a"] + 0.1 * plant.columns["b"] + 0.3 * plant.columns["c"]
    model = Regression()
    for name in "acb":
        model = plant.refine(model, SimpleNamespace(name=name))
    taken = [Named(Look(n, 1.0, np.zeros(3)), model, np.zeros(N), np.zeros(N), size=9.0) for n in "acb"]
    found = Found(Regression(), model, taken)
    Search(plant, np.random.default_rng(0), alpha=0.01, max_effects=3)._sized(found)
    sizes = [t.size for t in found.taken]
    alone = {n: plant.size(plant.y, plant.errors(plant.refine(Regression(), SimpleNamespace(name=n)))) for n in "acb"}
    assert max(sizes) == pytest.approx(max(alone.values()))
    left = plant.errors(model)
    assert sum(s**2 for s in sizes) == pytest.approx(float(plant.y @ plant.y - left @ left) / N)


def test_what_is_no_longer_worth_naming_beside_the_others_goes():
    plant = Columns({"a": 0.5, "b": 0.3}, names="abc")
    model = Regression()
    for name in "acb":
        model = plant.refine(model, SimpleNamespace(name=name))
    taken = [Named(Look(n, 1.0, np.zeros(3)), model, np.zeros(N), np.zeros(N), size=9.0) for n in "acb"]
    found = Found(Regression(), model, taken)
    search = Search(plant, np.random.default_rng(0), alpha=0.01, max_effects=3)
    assert search._sized(found)
    assert search._lost(found)
    assert [t.name for t in found.taken] == [t.name for t in found.model.terms] == ["a", "b"]
    assert not search._lost(found)


def test_what_the_others_say_without_it_goes():
    plant = Columns({"b": 0.3, "d": 0.4})
    search = Search(plant, np.random.default_rng(0), alpha=0.01, max_effects=3)
    found = search.run(Regression())
    look = replace(found.taken[0].look, name="c")  # taken once, and needless beside the others
    model = plant.refine(found.model, look)
    found.model, found.taken = model, [*found.taken, Named(look, model, plant.errors(model), plant.errors(model))]
    search._review(found)
    assert {t.name for t in found.taken} == {t.name for t in found.model.terms} == {"b", "d"}


def test_what_the_others_say_without_it_stays_if_one_of_them_would_be_unphysical():
    class Picky(Columns):
        """A plant whose ``b`` and ``d`` are unphysical without ``c``."""

        def objection(self, model, grown):
            names = [t.name for t in grown.terms]
            return "unphysical" if "c" not in names and len(names) > 1 else ""

    plant = Picky({"b": 0.3, "d": 0.4})
    search = Search(plant, np.random.default_rng(0), alpha=0.01, max_effects=3)
    (first, *_), model = plant.looks(Regression(), np.random.default_rng(0)), Regression()
    taken = []
    for name in "bdc":
        before, model = model, plant.refine(model, replace(first, name=name))
        taken.append(Named(replace(first, name=name), model, plant.errors(before), plant.errors(model)))
    found = Found(Regression(), model, taken, [SimpleNamespace(looks=[first])])
    search._review(found)
    assert "c" in {t.name for t in found.taken}


def test_what_explains_no_more_than_of_its_own_records_is_not_taken():
    plant = Columns({"a": 0.5})
    looks = plant.looks(Regression(), np.random.default_rng(0))
    inflated = [replace(k, null=k.null + 1e4, p_value=1e-6) if k.name == "a" else k for k in looks]
    fitted = Search(plant, np.random.default_rng(0), alpha=0.01, max_effects=3).fitted(Regression(), inflated)
    assert "own records" in next(f.reason for f in fitted if f.name == "a")


def test_an_elementary_law_keeps_its_name_beside_one_of_its_place_that_contains_it():
    """Marginality: Coulomb's friction found first, then presliding; not where the later law acts elsewhere."""
    look = SimpleNamespace(place=frozenset())
    taken = {name: SimpleNamespace(name=name, look=look, effect=get_effect(name)) for name in effect_names()}

    def contained(*names):
        return Search._contained(SimpleNamespace(taken=[taken[n] for n in names]), 0)

    assert contained("coulomb", "presliding_hysteresis")
    assert contained("coulomb", "cogging", "presliding_hysteresis")
    assert not contained("presliding_hysteresis", "coulomb")  # no elementary law
    assert not contained("coulomb", "cogging")  # another place
    assert not contained("coulomb", "viscous")  # neither contains the other
