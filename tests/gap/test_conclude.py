"""From what was found to a verdict."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from whsklearn.gap import conclude
from whsklearn.gap import plant as gap_plant
from whsklearn.gap.conclude import stays_open, verdict_of
from whsklearn.gap.plant import Figures, WithTerms
from whsklearn.gap.search import Found, Named
from whsklearn.gap.tangent import Look

NAMELESS = SimpleNamespace(name="", p_value=1e-6, size=0.2, signal="")


def verdict(
    after, run, *, taken=("stribeck",), remainder=(), floor=0.01, exact=False, floors=1.0, gap=1.0, first=10.0,
    by_run=False, enough=True, fitted=(), **effect,
):  # fmt: skip
    """Of a record with such a gap, ``after`` of which is left where noise alone leaves ``floor``.

    The free run closes by ``run``, begins at ``first`` and ends at so many of its own ``floors``. Of each effect, the
    looks say that it explains ``size``, and that it has ``rivals``.
    """
    plant = SimpleNamespace(
        tolerance=0.004, scale=1.0, exact=exact, enough=lambda model: enough,
        figures=lambda base, model, nameless: Figures(gap, after, floor, nameless, by_run),
    )  # fmt: skip
    effect = {"rivals": (), "size": 0.0} | effect
    look = SimpleNamespace(signal="velocity")
    found = SimpleNamespace(
        base=None,
        model=None,
        taken=[SimpleNamespace(name=n, look=look, **effect) for n in taken],
        remainder=list(remainder),
        steps=[SimpleNamespace(fitted=fitted)],
        interrupted=False,
    )
    return verdict_of(plant, found, 0.01, {"closure": run, "before": first, "after": floors, "floor": 1.0})


@pytest.mark.parametrize(
    ("after", "run", "expected"),
    [(0.02, 0.99, "named"), (0.8, 0.9, "partial"), (0.6, 0.9, "partial"), (0.02, 0.3, "partial")],
    ids=[
        "all",
        "a third of the gap's power",
        "two thirds of the power, but not half of the gap",
        "the run hardly closes",
    ],
)
def test_a_name_for_sure_explains_most_of_the_gap_and_closes_most_of_the_run(after, run, expected):
    assert verdict(after, run) == expected


@pytest.mark.parametrize(("after", "expected"), [(1.2, "partial"), (1.5, "unknown")])
def test_no_name_closes_in_simulation_what_it_opens_in_the_drive(after, expected):
    """A coupling closed half of the run of a slide with nothing missing, and left 1.6 times as much of the drive."""
    assert verdict(after, 0.5, by_run=True) == expected


@pytest.mark.parametrize(
    ("run", "by_run", "expected"), [(0.6, False, "named"), (0.6, True, "partial"), (0.8, True, "named")]
)
def test_a_play_is_certain_only_if_the_run_leaves_little(run, by_run, expected):
    """A play and a delay that was not there closed 0.57 of the run, with certainty."""
    assert verdict(0.02, run, by_run=by_run) == expected


@pytest.mark.parametrize("name", ["", "actuator_lag"], ids=["nameless", "a refused candidate"])
@pytest.mark.parametrize(("rest", "expected"), [(0.0, "partial"), (0.7, "partial"), (0.8, "unknown")])
def test_a_name_explains_a_quarter_of_what_follows_the_motion_whatever_noise_is_beside_it(rest, expected, name):
    other = SimpleNamespace(name=name, p_value=1e-6, size=rest, signal="")
    assert verdict(0.9, 0.9, remainder=[other] if rest else []) == expected  # it explains 0.19


@pytest.mark.parametrize(("first", "expected"), [(1.01, "coloured_noise"), (10.0, "partial")])
def test_a_run_that_noise_explains_already_is_no_evidence(first, expected):
    """A dead zone that was not there explained a fifth of the drive, and 1.00 of a gap of 0.4 % of the run."""
    assert verdict(0.9, 1.0, first=first) == expected


@pytest.mark.parametrize(("rest", "expected"), [(0.0, "coloured_noise"), (0.1, "unknown")])
def test_a_name_that_closes_next_to_nothing_is_not_given(rest, expected):
    """A coupling was given for a play of which it closed 2 % of the run."""
    other = SimpleNamespace(name="", p_value=1e-6, size=rest, signal="")
    assert verdict(0.95, 0.02, remainder=[other] if rest else []) == expected
    assert verdict(0.95, 0.3, remainder=[other] if rest else []) == "partial"  # the run shows it


def test_an_effect_that_noise_nearly_hides_is_certain_where_all_of_it_is_closed():
    assert verdict(1.0, 0.99, gap=1.002, floor=1.0) == "named"


def test_what_a_look_promises_and_no_fit_has_taken_has_no_name():
    """A play was given for a ripple above the cut-off: it took 20.83 to 20.81 % of the drive, and the look said 19."""
    assert verdict(0.999, 0.1, size=0.9) == "coloured_noise"


def test_of_a_play_the_free_run_tells_what_it_explains():
    """An impact that comes a sample early is a large torque for an instant, and hardly changes the path."""
    other = SimpleNamespace(name="", p_value=1e-6, size=0.3, signal="")
    assert [verdict(1.1, 0.4, remainder=[other], by_run=by_run) for by_run in (False, True)] == ["unknown", "partial"]
    assert verdict(1.1, 0.1, remainder=[other], by_run=True) == "unknown"


def test_nothing_is_certain_in_a_record_with_few_samples():
    assert [verdict(0.02, 0.99, enough=enough) for enough in (True, False)] == ["named", "partial"]


def test_rivals_make_it_ambiguous_and_what_follows_the_motion_partial():
    assert verdict(0.02, 0.99, rivals=["lugre"]) == "ambiguous"
    assert verdict(0.02, 0.99, remainder=[NAMELESS]) == "partial"


def test_what_only_a_refused_name_explains_is_missing_too():
    """A load friction of 0.59 of the drive, which no gear has: the two effects beside it were named as if complete."""
    refused = SimpleNamespace(name="load_friction", p_value=1e-6, size=0.2, signal="")
    assert verdict(0.02, 0.99, remainder=[refused]) == "partial"
    refused.p_value = 0.5
    assert verdict(0.02, 0.99, remainder=[refused]) == "named"


@pytest.mark.parametrize(("left", "by_run", "sure"), [(0.012, False, False), (0.012, True, True), (0.016, False, True)])
def test_no_name_is_certain_where_one_that_physics_refuses_leaves_half_the_power(left, by_run, sure):
    """A spring with play was a cable spring and four waves, with certainty; a stop over the travel left less."""
    refused = Named(Look("end_stop", 0.0, np.zeros(1)), None, np.ones(9), left * np.ones(9), reason="a spring")
    assert verdict(0.02, 0.99, fitted=[refused], by_run=by_run) == ("named" if sure else "partial")


def with_rivals(fitted, rivals):
    """What a search found: the first of the ``fitted`` names is taken, with these rivals."""
    fits = [
        Named(SimpleNamespace(name=x, place=frozenset()), Terms(x), np.zeros(1), np.zeros(1), rivals=rivals)
        for x in fitted
    ]
    steps = [SimpleNamespace(looks=[], fitted=fits)]
    return SimpleNamespace(base=Terms(), model=Terms("a"), taken=fits[:1], remainder=[], steps=steps)


def test_a_rival_goes_that_runs_farther_from_the_record_in_its_place():
    """A flexible coupling beside a play that is seen from the load; a spring over little travel stays."""
    noise = np.random.default_rng(0).standard_normal((3, 4000))

    class Plant(Runs):
        headline, horizons = 1.0, (1.0,)

        def measured(self, *models):
            return np.zeros(4000), np.ones(4000, dtype=bool)

        def simulate(self, model, horizon):
            return noise["abc".index(model)] * {"": 1.5, "a": 1.0, "b": 1.0, "c": 1.3}[model]

        def refine(self, model, look):
            return Terms(model + look.name)

    assert conclude._standing_rivals(Plant(None), with_rivals("abc", ["b", "c", "d"]), 0, 0.01) == ["b", "d"]
    found = with_rivals("ab", ["b", "c", "d"])  # a rival that a run has made, as a lag of a delay, was only looked at
    found.steps[0].looks.append(SimpleNamespace(name="c"))
    assert conclude._standing_rivals(Plant(None), found, 0, 0.01) == ["b", "d"]


def test_a_rival_is_simulated_with_all_numbers_settled_beside_it():
    """With the centre of a spring that suited gravity, the true cable ran four times farther off: gravity was certain.

    ``a``: the one taken; the rival is ``b`` as it stands in its place, and ``bb`` when it is settled.
    """
    noise = np.random.default_rng(0).standard_normal((2, 4000))

    class Plant(Runs):
        headline, horizons = 1.0, (1.0,)

        def settled(self, model):
            self.headline = 9.0
            return Terms(2 * model)

        def measured(self, *models):
            return np.zeros(4000), np.ones(4000, dtype=bool)

        def simulate(self, model, horizon):
            return noise[int("b" in model)] * {"": 1.5, "a": 1.0, "b": 4.0, "bb": 1.0}[model]

    plant = Plant(None)
    plant.headline = 2.0
    assert conclude._standing_rivals(plant, with_rivals("ab", ["b"]), 0, 0.01) == ["b"]
    assert plant.headline == 2.0, "what the rival has changed is undone"


@pytest.mark.parametrize(("left", "kept"), [((0.3, 0.6), []), ((0.3, 0.45), ["b"]), ((0.55, 0.8), ["b"])])
def test_a_rival_that_would_be_a_part_of_the_answer_goes_where_the_one_taken_is_most_of_it(left, kept):
    """Both are wrong in one block only, as of a stop that is touched once: blocks do not tell them apart.

    ``left``: rms of the errors with the one taken and with the rival, as shares of that of the base model.
    """
    once = np.where(np.arange(4000) < 100, 1.0, 0.0)

    class Plant(Runs):
        headline, horizons = 1.0, (1.0,)

        def measured(self, *models):
            return np.zeros(4000), np.ones(4000, dtype=bool)

        def simulate(self, model, horizon):
            return once * {"": 1.0, "a": left[0], "b": left[1]}[model]

    assert conclude._standing_rivals(Plant(None), with_rivals("ab", ["b"]), 0, 0.01) == kept


@pytest.mark.parametrize(("complete", "rest", "kept"), [(True, 0.45, []), (True, 0.05, ["b"]), (False, 0.45, ["b"])])
def test_blocks_are_not_asked_about_a_rival_where_the_one_taken_leaves_nothing(complete, rest, kept):
    """A change of friction, which explains 79 % of what a Stribeck curve explains to within noise."""
    noise, once = np.random.default_rng(0).standard_normal(4000), np.where(np.arange(4000) < 400, 1.0, 0.0)

    class Plant(Runs):
        headline, horizons = 1.0, (1.0,)

        def silent(self, model):
            return complete

        def measured(self, *models):
            return np.zeros(4000), np.ones(4000, dtype=bool)

        def simulate(self, model, horizon):
            return once * {"": 1.0, "a": 0.0, "b": rest}[model] + 0.05 * noise

    assert conclude._standing_rivals(Plant(None), with_rivals("ab", ["b"]), 0, 0.01) == kept


def test_what_is_below_the_tolerance_counts_where_the_free_run_shows_it():
    """Friction that grows above a speed, called Stribeck's: of 0.36 of the tolerance, and 2.6 floors of the run."""
    small = SimpleNamespace(name="", p_value=1e-6, size=0.36 * 0.004, signal="")
    assert verdict(0.003, 0.94, gap=0.029, floor=0.0014, remainder=[small], floors=2.6) == "partial"
    assert verdict(0.003, 0.94, gap=0.029, floor=0.0014, remainder=[small], floors=1.1) == "named"


def test_without_a_name_it_is_unknown_where_something_follows_the_motion():
    assert verdict(1.0, 0.0, taken=(), remainder=[NAMELESS]) == "unknown"
    refused = SimpleNamespace(name="gravity_imbalance", p_value=1e-6, size=0.6, signal="position")
    assert verdict(1.0, 0.0, taken=(), remainder=[refused]) == "unknown"
    assert verdict(1.0, 0.0, taken=()) == "coloured_noise"


def test_where_own_records_are_exact_the_errors_are_the_run_and_what_is_shown_is_no_noise():
    assert verdict(0.02, 0.3, exact=True) == "named"
    assert verdict(1.0, 0.0, taken=(), floor=0.999, remainder=[NAMELESS], exact=True) == "unknown"
    assert verdict(1.0, 0.0, taken=(), exact=True) == "coloured_noise"


class Runs:
    """A plant whose models are their terms; ``closes`` says what a model's free run closes at every horizon."""

    headline, exact = 2.0, False
    snapshot, restore = gap_plant.Plant.snapshot, gap_plant.Plant.restore

    def __init__(self, closes, refitted=lambda m: m, objected=""):
        self.closes, self.to_simulate, self.objected, self.looked = closes, refitted, objected, 0

    def half_shown(self, model):
        return ""

    def objection(self, model, grown):
        return "at a limit" if grown[-1] in self.objected else ""

    def looks(self, model, rng):
        self.looked += 1
        return []

    def linearised(self, model):
        return model

    def silent(self, model):
        return False

    def contributes(self, base, model):
        return False

    def settled(self, model):
        return model

    def retold(self, model):
        return Terms(model.replace("k", "p"))


class Letter(str):
    """A term, its effect, and what was taken for it; l and d are the same to first order."""

    __slots__ = ()
    look = SimpleNamespace(place=frozenset())
    rivals = ()

    @property
    def aliases(self):
        return {"l": ("d",), "d": ("l",)}.get(self, ())

    @property
    def effect(self):
        return self

    @property
    def name(self):
        return str(self)

    @property
    def size(self):
        return 1.0 / ord(self)  # a explains most


class Terms(WithTerms, str):
    """A model: a letter a term."""

    __slots__ = ()
    n_base = 0

    @property
    def terms(self):
        return tuple(map(Letter, self))

    def with_terms(self, terms):
        return Terms("".join(terms))


@pytest.fixture
def closing(monkeypatch):
    def rows(plant, base, model, rng, given=None):
        return [{"horizon": h, "closure": c} for h, c in zip((1.0, 2.0), plant.closes(model), strict=True)]

    def run(plant, model="ab", certainty="9" * 9, fitted=(), taken=None, earlier=()):
        monkeypatch.setattr(conclude, "prove", rows)
        absent = {letter: 10.0 ** -float(digit) for letter, digit in zip(model, certainty, strict=False)}
        monkeypatch.setattr(conclude, "p_of_zero", lambda fit, index: absent.get(fit.terms[index], 0.0))
        steps = [SimpleNamespace(looks=[], fitted=list(f)) for f in (*earlier, fitted)]
        taken = [Letter(x) for x in model] if taken is None else list(taken)
        found = SimpleNamespace(base=Terms(), model=Terms(model), taken=taken, remainder=[], steps=steps, refused={})
        return conclude._closing(plant, found, None, None, 0.01), found

    return run


def test_the_last_effects_go_until_the_run_closes(closing):
    _, found = closing(Runs(lambda m: (0.9, 0.9) if m in ("a", "") else (-0.1, -0.1)))
    assert (found.model, found.taken, found.refused) == ("a", ["a"], {"b": conclude.NO_CLOSER})
    _, found = closing(Runs(lambda m: (-0.1, -0.1) if m else (0.0, 0.0)))
    assert (found.model, found.taken) == ("", [])


def test_of_two_that_are_the_same_to_first_order_the_one_whose_run_closes_stays(closing):
    lag, delay = (
        Named(SimpleNamespace(name=x, place=frozenset()), Terms(x), np.zeros(1), np.zeros(1), rivals=["wave"])
        for x in "ld"
    )
    for closes, model, rivals in (("d", "d", [["l", "wave"]]), ("l", "l", [["wave"]]), ("", "", [])):
        plant = Runs(lambda m, closes=closes: (0.9, 0.9) if m in ("", closes) else (-0.1, -0.1))
        _, found = closing(plant, "l", fitted=[lag, delay], taken=[lag])
        assert (found.model, [t.rivals for t in found.taken]) == (model, rivals)


def test_what_explains_most_gives_way_to_the_next_sound_name_and_another_to_a_rival(closing):
    """The name that goes is a rival of the one in its place."""
    x, y, z = (
        Named(SimpleNamespace(name=n, place=frozenset()), Terms(n), np.zeros(1), np.zeros(1), size=size)
        for n, size in (("x", 0.2), ("y", 0.1), ("z", 0.1))
    )
    fails = Runs(lambda m: (-0.1, -0.1) if "x" in m else (0.9, 0.9))
    _, found = closing(fails, "x", fitted=[x, y], taken=[x])
    assert (found.model, found.taken[0].rivals) == ("y", ["x"])
    assert closing(fails, "x", fitted=[x, replace(y, reason="objected to")], taken=[x])[1].model == ""
    stands = Runs(lambda m: (0.9, 0.9))
    assert closing(stands, "xz", "19", [x, y], [x, z])[1].model == "zy"
    for rivals, left in (([], "z"), (["y", "z", "w"], "zy")):
        _, found = closing(stands, "xz", "19", [x, y], [replace(x, size=0.05, rivals=rivals), z])
        assert found.model == left
    assert found.taken[-1].rivals == ["x", "w"]  # no rival of a name that is there


def test_where_a_round_offers_no_other_name_an_earlier_one_does(closing):
    """A review had exchanged y for x, which the run refuses; the round that took y is asked again, the later first."""
    x, y, z = (
        Named(SimpleNamespace(name=n, place=frozenset()), Terms(n), np.zeros(1), np.zeros(1), size=0.1) for n in "xyz"
    )
    fails = Runs(lambda m: (-0.1, -0.1) if "x" in m else (0.9, 0.9))
    for earlier, last, left in (([y, x], [x], "y"), ([y, x], [x, z], "z"), ([y], [x], "")):
        assert closing(fails, "x", fitted=last, taken=[x], earlier=[earlier])[1].model == left
    little = [replace(x, size=0.002), replace(z, size=0.002)]  # where x explained the rest that y had left, so did z
    assert closing(fails, "x", fitted=little, taken=[x], earlier=[[y, x]])[1].model == "y"


def test_an_effect_that_only_a_run_tells_from_the_one_taken_has_its_name_in_the_end(closing):
    coupling = Named(Look("k", 0.0, np.zeros(1)), Terms("k"), np.zeros(1), np.zeros(1), rivals=["p", "wave"])
    _, found = closing(Runs(lambda m: (0.9, 0.9)), "k", taken=[coupling])
    assert (found.model, found.taken[0].name, found.taken[0].rivals) == ("p", "p", ["wave"])


def test_numbers_as_found_stand_in_where_those_refitted_along_the_run_are_worse(closing):
    plant = Runs(lambda m: (0.9, 0.9) if m == "ab" else (-0.1, -0.1), refitted=lambda m: Terms(m.upper()))
    assert closing(plant)[1].model == "ab"


def test_an_effect_that_ends_where_physics_objects_goes_beside_others_and_alone(closing):
    """A fit along the run had lowered a limit of a wheel's drive to the lowest reading; it was named with certainty."""
    _, found = closing(Runs(lambda m: (0.9, 0.9), objected="b"), "abc")
    assert (found.model, found.taken, found.refused) == ("ac", ["a", "c"], {"b": conclude.NOT_SUPPORTED})
    assert closing(Runs(lambda m: (0.9, 0.9), objected="a"), "a")[1].taken == []


def test_of_two_unsound_effects_the_one_that_explains_less_goes_first(closing):
    """An effect that is not there moves the numbers of the others: a spring's rest position went to its limit."""
    plant = Runs(lambda m: (0.9, 0.9))
    plant.objection = lambda model, grown: "at a limit" if grown[-1] == "a" and "c" in grown else ""
    assert closing(plant, "abc", certainty="991")[1].taken == ["a", "b"]


def test_a_name_goes_for_which_the_final_numbers_are_too_little(closing):
    """A wave of one and a half periods had become one of a third beside a spring, for an offset; it was certain."""
    plant = Runs(lambda m: (0.9, 0.9))
    plant.half_shown = lambda m: "less than a period" if m[-1] == "b" else ""
    _, found = closing(plant, "abc")
    assert (found.taken, found.refused) == (["a", "c"], {"b": conclude.NOT_SUPPORTED})


def test_an_effect_goes_where_its_size_may_be_zero(closing):
    closes = Runs(lambda m: (0.9, 0.9))
    assert closing(closes, "abc", certainty="911")[1].taken == ["a"]
    assert closes.looked == 1  # once both are gone
    assert closing(closes, "abc", certainty="333")[1].taken == ["a", "b", "c"]
    assert closing(closes, "a", certainty="1")[1].taken == []
    assert closing(closes, "a", certainty="3")[1].taken == ["a"]


def test_a_run_that_is_useless_at_one_horizon_is_told_at_a_shorter_one(closing):
    plant = Runs(lambda m: (0.6, -0.1))
    rows, found = closing(plant)
    assert (found.model, plant.headline) == ("ab", 1.0)
    assert conclude._headline(plant, rows)["closure"] == 0.6
    assert closing(Runs(lambda m: (0.1, -0.1)))[1].taken == []  # a trace of the gap proves nothing
    assert closing(Runs(lambda m: (0.6, -0.1)), "a", certainty="1")[1].taken == []


def test_an_effect_is_credited_with_nothing_that_other_numbers_of_the_base_close(closing):
    plant = Runs(lambda m: (0.9, 0.9), refitted=lambda m: m or Terms("Z"))
    assert closing(plant, "a")[1].base == "Z"


@pytest.mark.parametrize(("p_value", "status"), [(1e-9, "ruled_out"), (0.5, "not_testable")])
def test_what_the_record_shows_is_not_called_untestable(p_value, status):
    look = Look("a", 5.0, np.full(15, 1e6), size=0.5, p_value=p_value)  # under such noise 2 % would not show
    step = SimpleNamespace(looks=[look], fitted=[], n_effective=1e3, gap=1.0)
    plant = SimpleNamespace(scale=1.0, whole="drive", tolerance=0.004, gap_share=lambda *_: 0.25)
    diagnosis = SimpleNamespace(effects=[])
    found = SimpleNamespace(steps=[step], remainder=[look], refused={})
    assert [c.status for c in conclude.candidates(found, diagnosis, plant, 0.01)] == [status]


def test_the_table_shows_what_an_effect_explains_once_it_is_fitted():
    """To first order presliding friction explained 33 % of a gap, and fitted 74 % of it, with evidence to match."""
    look = Look("a", 60.0, np.full(15, 1.0), size=0.4, p_value=1e-9)
    fit = SimpleNamespace(name="a", size=0.45, gain=900.0, delta_bic=880.0, reason="")
    step = SimpleNamespace(looks=[look], fitted=[fit], n_effective=1e3, gap=1.0)
    plant = SimpleNamespace(scale=2.0, whole="drive", tolerance=0.004, gap_share=lambda k, _: (k.size, k.gain))
    found = SimpleNamespace(steps=[step], remainder=[look], refused={})
    (line,) = conclude.candidates(found, SimpleNamespace(effects=[]), plant, 0.01)
    assert (line.closure, line.delta_bic) == ((0.9, 900.0), 880.0)


def test_an_effect_below_the_tolerance_is_said_to_be_small_and_not_to_be_chance():
    """Its p-value is that of an effect of the tolerance, so it is one."""
    look = Look("a", 800.0, np.full(15, 1.0), size=0.003, p_value=1.0)
    plant = SimpleNamespace(scale=1.0, whole="drive", tolerance=0.004)
    assert "below the tolerance" in conclude._reason(look, None, plant, 0.01)


@pytest.mark.parametrize(("exact", "said"), [(True, "partial"), (False, "named")])
def test_where_own_records_are_exact_a_remainder_above_the_tolerance_is_part_of_the_gap(exact, said):
    rest = SimpleNamespace(name="", p_value=1e-6, size=0.02, signal="")  # 2 % of the gap, five tolerances
    assert verdict(0.02, 0.99, exact=exact, remainder=[rest]) == said
    rest.size = 0.003
    assert verdict(0.02, 0.99, exact=exact, remainder=[rest]) == "named"


def test_a_run_stays_open_where_its_gap_is_seen_and_next_to_nothing_of_it_is_closed_at_any_horizon():
    still = {"closure": 0.03, "before": 2.0, "floor": 1.0}
    closed = {"closure": 0.5, "before": 2.0, "floor": 1.0}
    unseen = {"closure": 0.03, "before": 1.05, "floor": 1.0}  # a floor is not known so well
    assert stays_open([still])
    assert stays_open([unseen, still])
    assert not stays_open([closed])
    assert not stays_open([unseen])
    assert not stays_open([closed, still])  # one step ahead, noise of the record's colour counts for less


def test_names_that_leave_too_much_together_say_so_in_the_table():
    """A play that left a tenth of the missing force was said to explain too little."""
    found = Found("base", "grown", taken=[SimpleNamespace(name="backlash")])
    conclude._give_back(found, conclude.MOST_LEFT)
    assert (found.model, found.taken, found.refused) == ("base", [], {"backlash": conclude.MOST_LEFT})
