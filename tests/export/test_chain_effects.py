"""A chain with any effect of the whole table is the same free run here, from a file and in C."""

from __future__ import annotations

import numpy as np
import pytest

from whsklearn import WienerHammersteinSystem
from whsklearn import effects as fx
from whsklearn.effects.chain import CHAIN_FORMS
from whsklearn.export import export_model
from whsklearn.export.code import code_losses
from whsklearn.export.model import as_exported
from whsklearn.gap.report import as_model
from whsklearn.models import load_model, save_model

DT = 0.01
NUMBERS = {"delay": 0.013, "time_constant": 0.02, "frequency": 7.0, "time": 1.1, "order": 1.7, "angle": 1.2}


def sized(cls, options):
    """An effect with sizes that show in the record below."""
    fields = {f: NUMBERS[f] for f in cls.quantities if f in NUMBERS}
    if cls.size not in fields and cls.name != "saturation":
        fields[cls.size] = 0.3 if (cls.name, options.get("at")) != ("hardening_spring", "input") else 1e-3  # stable
    return cls(**fields, **options)


EFFECTS = [
    sized(cls, options)
    for name in fx.effect_names()
    for cls in [CHAIN_FORMS.get(name, fx.get_effect(name))]
    for options in cls.variants()
    if cls.evaluate is None and name != "early_reversal"  # which takes an inertia
]


def system(*effects, law="viscous,coulomb"):
    blocks = ([1.0, 2.2], [1.0, 0.5], [1.0, 0.2], [0.15, 0.4])
    return WienerHammersteinSystem(*blocks, law=law, effects=effects, dt=DT)


@pytest.fixture(scope="module")
def u():
    return np.random.default_rng(0).normal(size=400)


@pytest.mark.parametrize("effect", EFFECTS, ids=lambda e: "-".join([e.name, *e.options.values()]))
def test_the_whole_table_runs_the_same_here_from_a_file_and_in_c(effect, u, tmp_path, replay):
    made = system(effect)
    wanted = made.simulate(u)
    assert np.abs(wanted - system().simulate(u)).max() > 1e-3  # the effect is there
    save_model(as_model(made, ("", "")), tmp_path / "repaired.json")
    loaded = load_model(tmp_path / "repaired.json")
    assert loaded.effects == (effect,)
    np.testing.assert_allclose(loaded.simulate(u), wanted, rtol=0, atol=1e-9)
    export_model(tmp_path / "repaired.json", to="c", out=tmp_path)
    np.testing.assert_allclose(replay(u), wanted, rtol=0, atol=1e-9)
    assert code_losses(as_exported(made), "model") == []


def test_several_effects_run_together_in_c(u, tmp_path, replay):
    made = system(
        fx.ChainPlay(0.4, "input"), fx.InputDelay(0.025), fx.ChainResonance(9.0, 0.1, "output"), fx.LuGre(0.3)
    )
    export_model(made, to="c", out=tmp_path)
    np.testing.assert_allclose(replay(u), made.simulate(u), rtol=0, atol=1e-9)


def test_effects_beside_a_direct_path_are_told_as_lost():
    blocks = ([1.0, 2.2], [1.0, 0.5], [1.0, 0.2], [0.15, 0.4])
    made = WienerHammersteinSystem(*blocks, law="viscous", effects=[fx.Cogging(0.1, 2.0)], direct=1)
    assert [loss.name for loss in code_losses(as_exported(made), "model")] == ["cogging"]
