"""Where a search may look, from the quantity and the scales of the record."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from whsklearn.effects import Quantity, Scales, effect_names, get_effect

scales = st.builds(
    Scales, torque=st.floats(1e-3, 100), peak=st.floats(1e-3, 300), speed=st.floats(1e-3, 100),
    reach=st.floats(1e-3, 100), centre=st.floats(-10, 10), duration=st.floats(2, 1000), inertia=st.floats(1e-5, 10),
)  # fmt: skip


@pytest.mark.parametrize("name", effect_names())
@given(scales)
def test_ranges_are_not_empty_and_starts_lie_inside(name, record):
    cls = get_effect(name)
    for field in cls.searched():
        q = cls.quantities[field]
        low, high = q.bounds(record)
        assert low < high
        assert all(low <= s <= high for s in q.grid(record))


def test_a_label_holds_the_unit_in_letters_of_a_column():
    assert Quantity("Nm s2/rad2", 0, 1).labelled("drag") == "drag_nm_s2_per_rad2"
    assert Quantity("1", 0, 1).labelled("order") == "order"


def test_ratios_are_spanned_in_ratios():
    grid = Quantity("1", 1e-4, 1.0, log=True).grid(Scales())
    assert np.allclose(np.diff(np.log(grid)), np.diff(np.log(grid))[0])
    even = Quantity("1", 0.0, 1.0).grid(Scales())
    assert np.allclose(np.diff(even), np.diff(even)[0])


def test_a_positive_quantity_is_one_whose_range_is():
    assert Quantity("Nm", 0.0, 1.0).positive
    assert not Quantity("Nm", -1.0, 1.0).positive


@given(scales)
def test_a_wave_over_position_comes_round_within_the_travel(record):
    low, _ = get_effect("cogging").quantities["order"].bounds(record)
    assert low * 2.0 * record.reach >= 2.0 * np.pi * (1.0 - 1e-12)


@given(scales)
def test_friction_that_varies_over_the_travel_may_vary_more_slowly_than_a_wave(record):
    """No slower effect takes its place, as gravity takes that of a slow cogging."""
    slow, fast = (get_effect(name).quantities["order"] for name in ("position_friction", "cogging"))
    assert slow.open_below
    assert not fast.open_below
    assert slow.bounds(record)[0] <= fast.bounds(record)[0]


# --- The scales of a record, by unit and by name --------------------------------------------------------------------
def test_units_name_their_scale():
    s = Scales(torque=2.0, speed=3.0, reach=0.5, centre=1.0, duration=30.0)
    assert s.of("Nm") == (2.0, 0.0)
    assert s.of("rad/s") == (3.0, 0.0)
    assert s.of("rad") == (0.5, 1.0)  # positions count from the middle of the travel
    assert s.of("1") == (None, 0.0)
    assert s.of("Nm", "peak") == (1.5, 0.0)


def test_what_follows_from_them():
    s = Scales(reach=0.5, centre=-1.0, duration=30.0, inertia=0.04, resonance=50.0)
    assert s.extent == 1.5
    assert s.slowest == pytest.approx(0.1)  # three periods in the record
    # two equal halves of the inertia on this compliance ring at the resonance
    reduced = 0.04 / 4
    assert np.sqrt(1 / (s.compliance * reduced)) / (2 * np.pi) == pytest.approx(50.0)
