"""A diagnosis in the units of its log: the engine reckons in SI, a person reads what the drive logs."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from typing import Any

from whsklearn.gap.diagnosis import Curve
from whsklearn.gap.localisation import Place
from whsklearn.logs.units import respelled

CURVE_UNITS = {"velocity": "{1}/s", "speed": "{1}/s", "drive": "{0}"}  # of a signal by drive and motion; else a motion


def place_in(place: Place, gap: str, own: Mapping[str, str]) -> Place:
    """A range of a signal, the means of the gap (of the SI unit ``gap``) over it too."""
    by, unit = respelled(place.unit, own)
    size = respelled(gap, own)[0]
    return dataclasses.replace(
        place, low=place.low / by, high=place.high / by, unit=unit, centres=place.centres / by,
        means=place.means / size, errors=place.errors / size,
    )  # fmt: skip


def curve_in(curve: Curve, units: tuple[str, str], own: Mapping[str, str]) -> Curve:
    """A learned torque over its signal; ``units`` are the SI symbols of drive and motion."""
    by = respelled(CURVE_UNITS.get(curve.signals[0], "{1}").format(*units), own)[0]
    size = respelled(units[0], own)[0]
    return curve._replace(x=curve.x / by, y=curve.y / size, band=curve.band / size)


def pictures_in(pictures: dict[str, Any], gap: str, own: Mapping[str, str]) -> dict[str, Any]:
    """Series of the page: the motion and its runs, the gap and its spectra, and the signals it may follow."""
    p = dict(pictures)
    drive, motion = p["units"]
    far, size = respelled(motion, own)[0], respelled(gap, own)[0]
    p["measured"] = p["measured"] / far
    p["runs"] = {k: y / far for k, y in p["runs"].items()}
    for name in ("gap_before", "gap_after", "floor"):
        p[name] = p[name] / size
    for name in ("spectrum", "order_spectrum"):
        p[name] = tuple(a / size for a in p[name])
    p["axes"] = {k: (x / respelled(u, own)[0], respelled(u, own)[1]) for k, (x, u) in p["axes"].items()}
    return p | {"units": (own.get(drive, drive), own.get(motion, motion)), "gap_unit": own.get(gap, gap)}


def rows_in(rows: list[dict[str, Any]], unit: str, own: Mapping[str, str], *names: str) -> list[dict[str, Any]]:
    """Rows of a table with the named numbers, of one SI unit, brought over."""
    by = respelled(unit, own)[0]
    return [r | {k: r[k] / by for k in names if r.get(k) is not None} for r in rows]
