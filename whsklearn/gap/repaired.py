"""The repaired model as plain data: ``repaired.json``, from which any program can build it again."""

from __future__ import annotations

from typing import Any

import numpy as np


def as_data(model: Any) -> dict[str, Any]:
    """Numbers of a `ServoAxis` or a `WienerHammersteinSystem`; empty for a simulator of the user's own.

    Examples
    --------
    >>> from whsklearn import ServoAxis
    >>> from whsklearn.effects import Cogging
    >>> as_data(ServoAxis(inertia=0.05, law="coulomb", effects=[Cogging(0.2, 12.0)]))["effects"]
    [{'name': 'cogging', 'amplitude_nm': 0.2, 'order': 12.0, 'phase_rad': 0.0}]
    """
    from whsklearn.systems.servo import ServoAxis
    from whsklearn.systems.wiener_hammerstein import WienerHammersteinSystem

    if isinstance(model, ServoAxis):
        return {
            "model": "servo",
            "inertia": float(model.inertia),
            "law": [_effect(t) for t in model.law.terms],
            "effects": [_effect(e) for e in model.effects],
            "drive_delay_s": float(model.drive.delay),
            "sample_rate_hz": float(model.sample_rate),
        }
    if isinstance(model, WienerHammersteinSystem):
        blocks = {k: np.asarray(getattr(model, k), dtype=float).tolist() for k in "abcd"}
        return {
            "model": "wiener-hammerstein",
            **blocks,
            "law": [_plain(t) for t in model.law.terms],
            "effects": [_plain(e) for e in model.effects],
            "sampling_time_s": float(model.dt),
        }
    return {}


def _effect(effect: Any) -> dict[str, Any]:
    return {"name": effect.name, **effect.labelled()}


def _plain(effect: Any) -> dict[str, Any]:
    """The same in a chain, whose numbers have the units of its log and no names of units."""
    return {"name": effect.name, effect.size: effect.magnitude, **effect.shape, **effect.options}
