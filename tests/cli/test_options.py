"""Options that commands share: each value is read once, and a wrong one is one sentence."""

from __future__ import annotations

import click
import pytest
from click.testing import CliRunner

from whsklearn.cli.options import ORDERS, build_model, given, model_options, units_of


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


def test_orders_that_are_numbers_already_stay():
    assert ORDERS.convert((1, 2, 3, 4), None, None) == (1, 2, 3, 4)


def test_units_need_a_role_and_a_record_leaves_out_what_was_not_given():
    assert units_of(("position = deg", "drive=mNm")) == {"position": "deg", "drive": "mNm"}
    with pytest.raises(ValueError, match="ROLE=UNIT"):
        units_of(("deg",))
    assert given({"a": None, "b": (), "c": False, "d": 0, "e": "x"}) == {"d": 0, "e": "x"}
