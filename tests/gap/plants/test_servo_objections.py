"""Limits of the drive that a record offers falsely."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from whsklearn.effects import codes
from whsklearn.effects.base import rms
from whsklearn.gap.plants.servo_inverse import always_limited, beside_its_sign

T = np.arange(4000) / 100


@pytest.mark.parametrize("unit", [1.0, -3.0])
@pytest.mark.parametrize(
    ("limit", "mean", "missing", "refused"),
    [
        (0.6, 0.0, 0.5, False),
        (0.6, 0.0, 2.0, True),
        (0.01, 0.0, 0.5, False),  # a square wave, of which even the edges are explained
        (0.9, 2.0, 0.5, True),  # under a speed controller: a constant drive says nothing
    ],
)
def test_a_limit_is_none_if_what_it_leaves_is_not_explained(limit, mean, missing, refused, unit):
    """``missing``: the gap, as a share of what the limit leaves of the drive beside its mean and sign."""
    drive = unit * (mean + np.sin(2 * np.pi * 0.7 * T))
    limit *= abs(unit)
    left = beside_its_sign(limit, drive)
    grown = 4.0  # of all that reaches the axis, a gap is the same share as of the drive as logged
    gap = grown * (missing * left + 1e-9 * drive)
    model = SimpleNamespace(terms=[SimpleNamespace(kind=SimpleNamespace(code=codes.SATURATION), q=(limit,))])
    view = SimpleNamespace(
        record=SimpleNamespace(drive=drive), gap=lambda m: gap, rms=rms, blur=lambda x: x, at=slice(None),
        target=lambda m: (drive, grown),
    )  # fmt: skip
    assert bool(always_limited(view, model, 0)) == refused
