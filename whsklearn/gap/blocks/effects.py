"""From fitted numbers to the catalogue's effects, with standard errors."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from whsklearn.gap.blocks.candidates import Scales, effect_of
from whsklearn.gap.blocks.fit import rms_dx, weights_of
from whsklearn.gap.blocks.model import BlockModel, Setting, Term, bounds_of, coloured, free_slots, jacobian, raw_errors

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]


@dataclass(frozen=True)
class FoundEffect:
    """An effect of a u-y record: catalogue name, place, equation and numbers in the units of the log."""

    name: str
    place: str
    equation: str
    parameters: dict[str, float]

    def labelled(self) -> dict[str, float]:
        """The numbers by name; a u-y record has no units of its own."""
        return dict(self.parameters)


def found_effect(term: Term) -> FoundEffect:
    """What a report says of a fitted effect."""
    from whsklearn.effects import get_effect

    equation, named = effect_of(term.kind, term.q)
    named.update(term.kind.options)  # type: ignore[arg-type]
    return FoundEffect(term.kind.name, get_effect(term.kind.name).place, equation, named)


def library_effect(term: Term) -> Any:
    """The catalogue's own effect, or None where a chain has it in another form."""
    from whsklearn.effects import get_effect

    _, named = effect_of(term.kind, term.q)
    if term.kind.name in ("flexible_coupling",) or term.kind.variant == "at the input":
        return None
    fields = get_effect(term.kind.name).__dataclass_fields__  # type: ignore[attr-defined]
    return get_effect(term.kind.name)(**{k: v for k, v in named.items() if k in fields}, **term.kind.options)


def covariance(s: Setting, m: BlockModel, z: Scales) -> Array:
    """Covariance of the vector of `whsklearn.gap.blocks.model.to_vector`."""
    soft = m.at(min(m.kappa, 30.0 / rms_dx(s, m)))
    w, variance = weights_of(coloured(raw_errors(s, m), m.ar)[s.fit])
    rows = jacobian(s, soft, z, raw_errors(s, soft))[s.fit] * np.sqrt(w)[:, None]
    scale = np.maximum(np.linalg.norm(rows, axis=0), 1e-300)
    inverse = np.linalg.pinv((rows / scale).T @ (rows / scale), rcond=1e-12, hermitian=True)
    return variance * inverse / np.outer(scale, scale)


def standard_errors(s: Setting, m: BlockModel, z: Scales) -> list[dict[str, float]]:
    """For every effect, the standard errors of its numbers."""
    cov = covariance(s, m, z)
    slots = free_slots(m)
    p = m.theta.size
    out: list[dict[str, float]] = []
    for i, term in enumerate(m.terms):
        errors: dict[str, float] = {}
        for at, (effect, j) in enumerate(slots):
            if effect != i:
                continue
            low, _ = bounds_of(term, j, z)
            factor = term.q[j] if np.isfinite(low) and low > 0 else 1.0
            errors[term.kind.fields[j]] = abs(factor) * float(np.sqrt(max(cov[p + at, p + at], 0.0)))
        if term.kind.linear == 2:
            first = next(at for at, (effect, j) in enumerate(slots) if effect == i and j == 0)
            block = cov[p + first : p + first + 2, p + first : p + first + 2]
            size = max(float(np.hypot(term.q[0], term.q[1])), 1e-300)
            along = np.array([term.q[0], term.q[1]]) / size
            across = np.array([-along[1], along[0]]) / size
            errors.pop("cosine"), errors.pop("sine")
            amplitude = "torque" if term.kind.name == "position_friction" else "amplitude"
            errors = {
                amplitude: float(np.sqrt(max(float(along @ block @ along), 0.0))),
                "phase": float(np.sqrt(max(float(across @ block @ across), 0.0))),
                **errors,
            }
        out.append(errors)
    return out
