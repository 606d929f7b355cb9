"""Which plant a model asks for, and what of a log it takes."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from whsklearn import WienerHammersteinSystem
from whsklearn.effects import as_law
from whsklearn.gap.plants import Base, make_plant, sampling
from whsklearn.gap.plants.chain import ChainPlant
from whsklearn.gap.plants.servo import ServoPlant
from whsklearn.gap.plants.simulator import SimulatorPlant
from whsklearn.systems import ServoAxis

T = 0.01 * np.arange(500)
AXIS = pd.DataFrame({"time_s": T, "torque_nm": np.sin(3 * T), "position_rad": np.cos(2 * T)})
PAIR = pd.DataFrame({"time_s": T, "u": np.sin(3 * T), "y": np.cos(2 * T)})


class Simulator:
    """The three methods of a simulator of one's own."""

    def simulate(self, record):
        return np.zeros(len(record))

    def refit(self, record, fitted):
        return self

    def with_effect(self, effect):
        return self


def made(model, log, y=None, **settings):
    columns = settings.pop("columns", {})
    return make_plant(model, log, y, Base(**settings), tolerance=0.004, columns=columns)


@pytest.mark.parametrize(
    ("model", "log", "kind"),
    [
        ("servo", AXIS, ServoPlant), (ServoAxis(), AXIS, ServoPlant), ("wiener-hammerstein", PAIR, ChainPlant),
        (WienerHammersteinSystem.example(), PAIR, ChainPlant), (Simulator(), AXIS, SimulatorPlant),
    ],
)  # fmt: skip
def test_a_model_makes_its_plant(model, log, kind):
    assert isinstance(made(model, log), kind)


def test_what_is_no_model_is_told():
    with pytest.raises(ValueError, match="expected 'servo', 'wiener-hammerstein'"):
        made("turntable", AXIS)


def test_a_system_gives_orders_direct_paths_and_law_unless_told():
    system = WienerHammersteinSystem([1.0, 0.2, 0.1], [0.5], [1.0], [0.2, 0.1], law="coulomb", direct=1)
    plant = made(system, PAIR)
    assert (plant.orders, plant.direct) == ((3, 1, 1, 2), 1)
    assert plant.law == system.law
    told = made(system, PAIR, law="viscous", orders=(1, 0, 1, 0))
    assert (told.orders, told.law) == ((1, 0, 1, 0), as_law("viscous"))


@pytest.mark.parametrize("settings", [{"orders": (2, 2, 2)}, {"orders": (0, 1, 1, 1)}, {"direct": 3}])
def test_orders_that_cannot_be_are_refused(settings):
    with pytest.raises(ValueError, match=r"expected n_a|number of blocks"):
        made("wiener-hammerstein", PAIR, **settings)


def test_arrays_are_a_log_and_a_missing_column_is_told():
    plant = made("wiener-hammerstein", np.ones((500, 1)), np.zeros(500))
    assert (plant.u.shape, plant.y.shape) == ((500,), (500,))
    with pytest.raises(ValueError, match="499 of the output"):
        made("wiener-hammerstein", np.ones(500), np.zeros(499))
    with pytest.raises(ValueError, match="takes one input"):
        made("wiener-hammerstein", np.ones((500, 2)), np.zeros(500))
    with pytest.raises(ValueError, match="no column 'torque' for the input"):
        made("wiener-hammerstein", PAIR, columns={"input": "torque"})


@pytest.mark.parametrize(
    ("log", "dt"), [(PAIR, 0.01), (PAIR[["u", "y"]], 1.0), (PAIR.assign(time_s=-T), 1.0), (T, 1.0)]
)
def test_time_counts_where_it_rises(log, dt):
    step, at = sampling(log, {})
    assert step == pytest.approx(dt)
    assert at is None


def test_a_hole_keeps_its_place_on_the_grid():
    log = PAIR[(T < 1.0) | (T >= 1.5)]
    plant = made("wiener-hammerstein", log)
    s = plant.readings()
    assert s.dt == pytest.approx(0.01)
    assert np.array_equal(s.seen, (T < 1.0) | (T >= 1.5))
    np.testing.assert_allclose(s.y[s.seen], log.y)
    assert not s.fit[np.flatnonzero(s.seen)[100:140]].any(), "the state after a hole is not known"


def test_stamps_that_come_in_bursts_are_no_holes():
    bursts = np.repeat(0.1 * np.arange(100), 10) + np.tile(1e-4 * np.arange(10), 100)
    step, at = sampling(pd.DataFrame({"time_s": bursts}), {})
    assert at is None
    assert step == pytest.approx(0.00992, rel=1e-2)
