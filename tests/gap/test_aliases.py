"""The chance that an effect beats its rival is that of redrawn blocks."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from whsklearn.gap.aliases import rivals_of
from whsklearn.gap.evidence import bootstrap_share
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
