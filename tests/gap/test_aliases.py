"""The chance that an effect beats its rival is that of redrawn blocks."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from whsklearn.gap.aliases import rivals_of
from whsklearn.gap.evidence import bootstrap_share
from whsklearn.gap.plants import servo_free_run
from whsklearn.gap.plants.servo import ServoPlant
from whsklearn.gap.values import ModelErrors

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


@pytest.mark.parametrize("doubtful", [True, False], ids=["a doubtful rival", "one that nothing speaks for"])
def test_a_rival_far_behind_is_named_where_the_plant_cannot_tell_it_apart(doubtful):
    errors = {"play": 0.5, "coupling": 0.6}

    def weighed(name, delta_bic):
        model = SimpleNamespace(name=name, terms=(name,))
        return SimpleNamespace(name=name, delta_bic=delta_bic, fitted=SimpleNamespace(model=model))

    def compare(models, best):
        return [ModelErrors(np.full(400, errors[m.name]), np.zeros(0), np.zeros(0), 400.0) for m in models]

    view = SimpleNamespace(compare=compare, objection=lambda m, i: "", same_signature=lambda a, b: False)
    plant = SimpleNamespace(aliases=lambda n: (), commoner=lambda n: (), doubtful=lambda m, i, a, b: doubtful)
    play = weighed("play", 1000.0)
    found = SimpleNamespace(
        taken=[play], rivals=[[play, weighed("coupling", 900.0)]], views=[view], model=SimpleNamespace(n_base=0)
    )
    assert rivals_of(plant, found, np.random.default_rng(0))[0] == [["coupling"] if doubtful else []]


@pytest.mark.parametrize(
    ("names", "evidence", "runs", "doubtful"),
    [
        (("backlash", "flexible_coupling"), 970.0, 1.02, True),
        (("backlash", "flexible_coupling"), 970.0, 1.5, False),
        (("backlash", "flexible_coupling"), 700.0, 1.02, False),
        (("coulomb", "stribeck"), 970.0, 1.02, False),
    ],
    ids=["runs as well", "runs worse once it is fitted", "far behind", "not of a transmission"],
)
def test_play_and_coupling_are_told_apart_by_the_free_run_of_both(monkeypatch, names, evidence, runs, doubtful):
    monkeypatch.setattr(servo_free_run, "train_error", lambda view, m, h: {names[0]: 1.0, names[1]: runs}[m.terms[0]])

    def model(name):
        return SimpleNamespace(terms=(name,), with_terms=lambda terms: model(terms[0]))

    plant = object.__new__(ServoPlant)
    plant.observer = SimpleNamespace(fit=lambda m: m)
    taken, rival = (
        SimpleNamespace(name=n, delta_bic=e, fitted=SimpleNamespace(model=model(n)))
        for n, e in zip(names, (1000.0, evidence), strict=True)
    )
    assert plant.doubtful(model(names[0]), 0, taken, rival) == doubtful
