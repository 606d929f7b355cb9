"""From what was found to a verdict."""

from __future__ import annotations

from types import SimpleNamespace

import pytest

from whsklearn.gap.conclude import verdict_of

NAMELESS = SimpleNamespace(name="", p_value=1e-6, size=0.2)


def verdict(after, run, *, taken=("stribeck",), rivals=(), remainder=(), floor=0.01, exact=False):
    """Of a record with a gap of one, ``after`` of which is left where noise alone leaves ``floor``."""
    plant = SimpleNamespace(
        tolerance=0.004, scale=1.0, exact=exact,
        figures=lambda base, model, nameless: (1.0, after, floor, nameless),
    )  # fmt: skip
    found = SimpleNamespace(
        base=None,
        model=None,
        taken=[SimpleNamespace(name=n, rivals=rivals) for n in taken],
        remainder=list(remainder),
        steps=[None],
    )
    return verdict_of(plant, found, 0.01, run)


@pytest.mark.parametrize(
    ("after", "run", "expected"),
    [(0.02, 0.99, "named"), (0.8, 0.9, "partial"), (0.02, 0.3, "partial"), (0.9, 0.9, "unknown")],
    ids=["all", "a third of the gap's power", "the run hardly closes", "next to nothing"],
)
def test_a_name_for_sure_explains_most_of_the_gap_and_closes_most_of_the_run(after, run, expected):
    assert verdict(after, run) == expected


def test_rivals_make_it_ambiguous_and_what_follows_the_motion_partial():
    assert verdict(0.02, 0.99, rivals=["lugre"]) == "ambiguous"
    assert verdict(0.02, 0.99, remainder=[NAMELESS]) == "partial"


def test_without_a_name_it_is_unknown_where_something_follows_the_motion():
    assert verdict(1.0, 0.0, taken=(), remainder=[NAMELESS]) == "unknown"
    assert verdict(1.0, 0.0, taken=()) == "coloured_noise"


def test_where_own_records_are_exact_the_errors_are_the_run_and_what_is_shown_is_no_noise():
    assert verdict(0.02, 0.3, exact=True) == "named"
    assert verdict(1.0, 0.0, taken=(), floor=0.999, remainder=[NAMELESS], exact=True) == "unknown"
    assert verdict(1.0, 0.0, taken=(), exact=True) == "coloured_noise"
