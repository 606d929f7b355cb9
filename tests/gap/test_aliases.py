"""The chance that an effect beats its rival is that of redrawn blocks."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from whsklearn.gap import evidence as rules
from whsklearn.gap.aliases import rivals_of
from whsklearn.gap.evidence import bootstrap_share
from whsklearn.gap.plant import ModelErrors
from whsklearn.gap.plants.servo import ServoPlant

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


@pytest.mark.parametrize(
    ("rival", "behind", "lead", "named"),
    [("coupling", 30.0, 0.1, True), ("coupling", 300.0, 0.1, False), ("drag", 30.0, 0.0, False)],
    ids=["a coupling close behind a play", "far behind it", "any other effect"],
)
def test_what_must_lead_by_a_share_of_its_evidence_is_ambiguous_below_it(rival, behind, lead, named):
    errors = {"play": 0.5, rival: 0.6}

    def trial(name):
        return SimpleNamespace(name=name, delta_bic=1000.0 - (0.0 if name == "play" else behind),
                               trial=SimpleNamespace(model=SimpleNamespace(name=name, terms=(name,))))  # fmt: skip

    def compare(models, best):
        return [ModelErrors(np.full(400, errors[m.name]), np.zeros(0), np.zeros(0), 400.0) for m in models]

    view = SimpleNamespace(compare=compare, objection=lambda m, i: "", same_signature=lambda a, b: False)
    plant = SimpleNamespace(aliases=lambda n: (), commoner=lambda n: (), must_lead=lambda a, b: lead)
    play = trial("play")
    found = SimpleNamespace(taken=[play], rivals=[[play, trial(rival)]], views=[view])
    names, _, _ = rivals_of(plant, found, np.random.default_rng(0))
    assert names == [[rival] if named else []]


def test_effects_of_a_transmission_must_lead_each_other_and_no_others():
    plant = object.__new__(ServoPlant)
    assert plant.must_lead("backlash", "flexible_coupling") == rules.PLAY_OR_DAMPER
    assert plant.must_lead("backlash", "backlash") == plant.must_lead("backlash", "coulomb") == 0.0
