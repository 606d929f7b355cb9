"""Tables for drives hold the torque that the model asks for, in the drive's unit, and say what they leave."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest
from click.testing import CliRunner

from whsklearn import ServoAxis
from whsklearn.cli import main
from whsklearn.effects import (
    Cogging,
    Coulomb,
    FrictionLaw,
    GravityImbalance,
    InputDelay,
    InputOffset,
    Stribeck,
    Viscous,
    as_law,
)
from whsklearn.export import Ratings, export_model
from whsklearn.models import AxisModel, save_model

WAVES = [Cogging(0.05, 12.0, phase=0.3), Cogging(0.02, 24.0)]
LAW = FrictionLaw([Viscous(0.02), Coulomb(0.3), Stribeck(0.1)])
RATED, CONSTANT, TOP = 1.3, 0.12, 20.0


def written(axis, out, ratings=Ratings(RATED, CONSTANT, TOP)):  # noqa: B008 - a value
    done = export_model(axis, to="table", out=out, ratings=ratings)
    return done, {p.name: p for p in done.paths}


def force(v):
    return LAW(np.zeros_like(v), v)


@pytest.fixture
def axis():
    return ServoAxis(law=LAW, effects=WAVES)


def test_the_cogging_table_holds_an_axis_still_where_it_would_be_pulled_away(tmp_path):
    free = ServoAxis(law=FrictionLaw([Viscous(0.0)]), effects=WAVES, friction="tanh")
    _, files = written(free, tmp_path)
    table = pd.read_csv(files["cogging.csv"])
    assert len(table) == 3600
    held = free.simulate_drive(np.full(300, table["feedforward_nm"][0]), noise=False)
    pulled = free.simulate_drive(np.zeros(300), noise=False)
    assert np.ptp(held.position) < 1e-3 * np.ptp(pulled.position)


def test_the_friction_table_is_the_law_and_its_sign_is_that_of_a_feed_forward(axis, tmp_path):
    _, files = written(axis, tmp_path)
    table = pd.read_csv(files["friction.csv"])
    v = table["velocity_rad_per_s"].to_numpy()
    assert v.max() == TOP == -v.min()
    assert np.allclose(table["feedforward_nm"], force(v))


def test_what_a_table_leaves_is_what_a_drive_that_reads_it_leaves(axis, tmp_path):
    done, files = written(axis, tmp_path)
    left = {r.name: r for r in done.left}
    rows = pd.read_csv(files["servo_one.csv"])
    current = rows[rows["parameter"] == 380]["value"].to_numpy()
    assert current.size == 250
    angle = np.random.default_rng(0).uniform(0, 2 * np.pi, 20_000)
    torque = sum(w.value(position=angle) for w in WAVES)
    rest = torque - CONSTANT * current[(angle / (2 * np.pi) * 250).astype(int)]
    seen = left["servo_one.csv (P 380)"]
    assert seen.before == pytest.approx(np.std(torque), rel=0.02)
    assert seen.after == pytest.approx(np.std(rest), rel=0.02)
    assert left["cogging.csv"].after < 1e-3 * seen.before


def test_the_list_of_tf5200_is_in_its_units_and_ascends(axis, tmp_path):
    done, files = written(axis, tmp_path)
    entries = dict(line.split() for line in files["tf5200_frict_comp.lis"].read_text().splitlines())
    n = int(entries["frict_comp.table_entries"])
    assert n == 20
    speed = np.array([int(entries[f"frict_comp.table[{i}].in"]) for i in range(n)])
    value = np.array([int(entries[f"frict_comp.table[{i}].out"]) for i in range(n)])
    assert np.all(np.diff(speed) > 0)
    assert speed[0] > 0
    assert np.allclose(value, 1000 * force(np.radians(1e-3 * speed)) / RATED, atol=0.51)
    left = next(r for r in done.left if r.name.startswith("tf5200"))
    assert left.after < 0.02 * left.before


def test_steps_of_servo_one_add_up_to_friction_in_percent_of_the_rated_torque(axis, tmp_path):
    _, files = written(axis, tmp_path)
    rows = pd.read_csv(files["servo_one.csv"]).set_index("parameter")
    speed = rows.loc[387, "value"].to_numpy() * np.pi / 30
    assert np.allclose(rows.loc[386, "value"].cumsum(), 100 * force(speed) / RATED, rtol=1e-4)


def test_what_no_table_holds_is_told_and_ratings_are_not_made_up(tmp_path):
    done, files = written(
        ServoAxis(law=LAW, effects=[*WAVES, GravityImbalance(0.2), Cogging(0.1, 2.5)]), tmp_path, Ratings()
    )
    assert set(files) == {"cogging.csv", "friction.csv"}
    assert [loss.name for loss in done.losses] == ["gravity_imbalance", "cogging"]
    offset, _ = written(ServoAxis(law=LAW, effects=[InputOffset(0.05)]), tmp_path / "offset")
    one_sided = next(r for r in offset.left if r.name.startswith("tf5200"))
    assert one_sided.after == pytest.approx(0.05, rel=0.05)  # a list for both directions cannot hold it


def test_a_model_as_gap_writes_it_with_a_fitted_order_and_a_delay_fits_into_the_tables(tmp_path):
    fitted = [Cogging(0.05, 11.9999, phase=0.3), InputDelay(3e-6)]  # friction was NaN, and the wave left out
    done, files = written(ServoAxis(law=LAW, effects=fitted), tmp_path)
    left = {r.name: r for r in done.left}
    assert all(np.isfinite([r.before, r.after]).all() for r in done.left)
    assert left["cogging.csv"].after < 1e-3 * left["cogging.csv"].before
    assert np.isfinite(pd.read_csv(files["friction.csv"]).to_numpy()).all()
    assert {loss.name for loss in done.losses} == {"cogging", "input_delay"}  # both are told, with their reasons
    assert "whole order" in next(str(loss) for loss in done.losses if loss.name == "cogging")


def test_the_command_says_what_is_left(tmp_path):
    path = tmp_path / "model.json"
    save_model(AxisModel(0.05, as_law("viscous,coulomb"), tuple(WAVES), dt=0.001, logged="position"), path)
    arguments = ["export", str(path), "--to", "table", "--out", str(tmp_path / "out"), "--rated-torque", "1.3"]
    done = CliRunner().invoke(main, arguments, catch_exceptions=False)
    assert done.exit_code == 0, done.output
    assert "Rms drive (Nm) without" in done.output
    assert "predicted by replaying the table against the model" in done.output
    assert (tmp_path / "out" / "tf5200_frict_comp.lis").exists()
    chain = CliRunner().invoke(main, [*arguments[:3], "table", "--out", str(tmp_path / "o2"), "--speed", "-1"])
    assert chain.exit_code == 2


def test_a_model_in_counts_asks_for_its_highest_speed(tmp_path):
    model = AxisModel(1e-5, LAW, dt=0.001, logged="position", units={"input": "Nm", "output": "counts"})
    with pytest.raises(ValueError, match="moves in counts; give the highest speed in counts/s"):
        written(model, tmp_path, Ratings(RATED))
    _, files = written(model, tmp_path, Ratings(RATED, speed=5000.0))
    assert "tf5200_frict_comp.lis" not in files  # in mdeg/s, which counts do not tell
    assert pd.read_csv(files["friction.csv"])["velocity_counts_per_s"].max() == 5000.0


@pytest.mark.parametrize(
    ("unit", "constant", "lists"),
    [("mNm", None, True), ("mA", 0.12, True), ("mA", None, False), ("V", 0.12, False), ("%", 0.12, False)],
)
def test_a_list_in_shares_of_a_torque_is_of_a_torque_or_not_written(tmp_path, unit, constant, lists):
    model = AxisModel(0.05, LAW, dt=0.001, units={"input": unit, "output": "deg"}, logged="position")
    done, files = written(model, tmp_path, Ratings(RATED, constant, TOP))
    assert ("tf5200_frict_comp.lis" in files, "servo_one.csv" in files) == (lists, lists)
    assert any("shares of a rated torque" in str(loss) for loss in done.losses) != lists
    assert {row.unit for row in done.left} == {unit.removeprefix("m")}
