"""The numbers of a servo axis under flat names, so that fitters can vary them."""

from __future__ import annotations

import dataclasses
from collections import Counter
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from whsklearn.effects import Effect, FrictionLaw

if TYPE_CHECKING:
    from whsklearn.systems.servo import ServoAxis

PARTS = ("drive", "transmission", "sensor", "controller")


def effect_labels(axis: ServoAxis) -> tuple[str, ...]:
    """One label an effect: its name, numbered from the second of a name on (the law's terms count)."""
    seen = Counter(t.name for t in axis.law.terms)
    labels = []
    for e in axis.effects:
        seen[e.name] += 1
        labels.append(e.name if seen[e.name] == 1 else f"{e.name}{seen[e.name]}")
    return tuple(labels)


def _numbers(label: str, effect: Effect) -> dict[str, float]:
    """Size and shape of an effect under flat names."""
    return {label: effect.magnitude} | {f"{label}__{k}": v for k, v in effect.shape.items()}


def flatten(axis: ServoAxis) -> dict[str, float]:
    """All numbers of an axis by flat name."""
    out = {"inertia": float(axis.inertia)}
    for label, term in zip(axis.law.labels, axis.law.terms, strict=True):
        out |= _numbers(label, term)
    for label, effect in zip(effect_labels(axis), axis.effects, strict=True):
        out |= _numbers(label, effect)
    for name in PARTS:
        part = getattr(axis, name)
        if part is not None:
            numeric = {f.name: getattr(part, f.name) for f in dataclasses.fields(part)}
            out |= {f"{name}__{k}": float(v) for k, v in numeric.items() if not isinstance(v, str)}
    return out | {"smoothing": float(axis.smoothing)}


def _changed(effect: Any, label: str, wanted: dict[str, float]) -> Any:
    """An effect with its own entries of ``wanted`` applied; they are taken out."""
    changes = {}
    for key, name in ((label, effect.size), *((f"{label}__{f}", f) for f in (effect.size, *effect.shape))):
        if key in wanted:
            changes[name] = float(wanted.pop(key))
    return dataclasses.replace(effect, **changes) if changes else effect


def replace(axis: ServoAxis, values: Mapping[str, float]) -> Any:
    """The axis with some numbers changed; the axis given stays as it is."""
    wanted = dict(values)
    changes: dict[str, Any] = {k: float(wanted.pop(k)) for k in ("inertia", "smoothing") if k in wanted}
    if wanted:
        labels = effect_labels(axis)
        terms = [_changed(t, label, wanted) for label, t in zip(axis.law.labels, axis.law.terms, strict=True)]
        if any(new is not old for new, old in zip(terms, axis.law.terms, strict=True)):
            changes["law"] = FrictionLaw(terms)
        effects = tuple(_changed(e, label, wanted) for label, e in zip(labels, axis.effects, strict=True))
        changes["effects"] = effects
    for name in PARTS:
        part = getattr(axis, name)
        keys = [k for k in wanted if k.startswith(f"{name}__")]
        if part is not None and keys:
            fields = {f.name for f in dataclasses.fields(part)}
            known = {k: k.removeprefix(f"{name}__") for k in keys if k.removeprefix(f"{name}__") in fields}
            changes[name] = dataclasses.replace(part, **{f: float(wanted.pop(k)) for k, f in known.items()})
    if wanted:
        raise ValueError(f"Unknown parameters {sorted(wanted)}; expected some of: {', '.join(flatten(axis))}.")
    return dataclasses.replace(axis, **changes)
