"""Options that commands share: each value is read once, and a wrong one is one sentence."""

from __future__ import annotations

import click
import pytest
from click.testing import CliRunner

from whsklearn import ServoAxis
from whsklearn.cli.options import build_model, given, load_effects, model_options, units_of
from whsklearn.effects import base as registry
from whsklearn.effects import effect_names, get_effect
from whsklearn.gap.report import as_model
from whsklearn.models import load_model, save_model


@click.command()
@click.option("--seed", default=3)
@model_options
def built(**options):
    click.echo(repr(build_model(options).get_params()))


def test_a_model_has_what_its_options_say():
    done = CliRunner().invoke(
        built, ["--estimator", "rls", "--orders", "3,1,2,1", "--law", "viscous,coulomb", "--p", "9"]
    )
    assert done.exit_code == 0, done.output
    assert "'lags__n_a': 3" in done.output
    assert "'lags__law': 'viscous,coulomb'" in done.output
    assert "'random_state': 3" in done.output
    assert "'p':" not in done.output  # least squares has none
    assert "'lags__law': None" in CliRunner().invoke(built, []).output  # (4)


@pytest.mark.parametrize("text", ["2,2", "2,2,2,x", "2,2,2,-1", "2,2,2,2,2", ""])
def test_wrong_orders_are_a_wrong_option(text):
    done = CliRunner().invoke(built, ["--orders", text])
    assert done.exit_code == 2
    assert "expected four whole numbers" in done.output


def test_units_need_a_role_and_a_record_leaves_out_what_was_not_given():
    assert units_of(("position = deg", "drive=mNm")) == {"position": "deg", "drive": "mNm"}
    with pytest.raises(ValueError, match="ROLE=UNIT"):
        units_of(("deg",))
    assert given({"a": None, "b": (), "c": False, "d": 0, "e": "x"}) == {"d": 0, "e": "x"}


# --- a file with effects of one's own ------------------------------------------------------------------------------
FILE = """
import math
from dataclasses import dataclass
from typing import ClassVar
from whsklearn.effects import Effect, Quantity

@dataclass(frozen=True)
class Magnet(Effect):
    torque: float = 0.1
    width: float = 0.2
    name: ClassVar[str] = "NAME"
    place: ClassVar[str] = "position"
    equation: ClassVar[str] = "c exp(-(q/w)^2)"
    size: ClassVar[str] = "torque"
    quantities: ClassVar = {"torque": Quantity("Nm", -1, 1), "width": Quantity("rad", 0.01, 1, log=True)}
    signature: ClassVar[str] = "a bump over the position"
    needs: ClassVar[str] = "slow passes"

    @staticmethod
    def evaluate(p, time, position, velocity, drive):
        return BODY
"""
BODY = "p[0] * math.exp(-((position / p[1]) ** 2))"


@pytest.fixture
def write(tmp_path, monkeypatch):
    """A file of effects, and the catalogue as it was when the test is over; other tests may have made a magnet too."""
    monkeypatch.setattr(registry, "_REGISTRY", {k: v for k, v in registry._REGISTRY.items() if k != "magnet"})

    def written(name: str = "magnet", body: str = BODY, text: str = FILE):
        path = tmp_path / "my_own_effects.py"
        path.write_text(text.replace("NAME", name).replace("BODY", body), encoding="utf-8")
        return path

    return written


def test_a_file_is_loaded_and_a_model_with_its_effect_read_again(write, tmp_path):
    load_effects(write())
    assert "magnet" in effect_names()
    axis = ServoAxis(effects=[get_effect("magnet")(0.3, 0.1)])
    save_model(as_model(axis), tmp_path / "repaired.json")
    assert load_model(tmp_path / "repaired.json").effects == axis.effects
    del registry._REGISTRY["magnet"]
    with pytest.raises(ValueError, match="--effects"):
        load_model(tmp_path / "repaired.json")


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        ({"text": "x = 1"}, "defines no effect"),
        ({"text": "import nothing_of_that_name"}, "cannot be run: ModuleNotFoundError"),
        ({"name": "cogging"}, "the library already has"),
        ({"body": "p[0] * unknown(position)"}, "cannot be compiled"),
    ],
)
def test_what_is_wrong_is_said(write, change, sentence):
    with pytest.raises(ValueError, match=sentence):
        load_effects(write(**change))
