"""End stops in inverse dynamics: a few one-sided events that contain nearly all of the residual.

A rigid stop supplies whatever torque holds the axis, with one sign (Signorini's condition; Brogliato 1999, Nonsmooth
Mechanics, ch. 1).  During contact the drive carries no information about inertia and friction, and the residual does
not speak against a stop as long as it pushes back, which `whsklearn.identification.end_stops` checks on the events.
The samples in contact are therefore excluded from the fit and from the gap.  The spring and the damper of
`whsklearn.effects.ContactStop` are fitted to the push afterwards, because simulation needs them; naming does not.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from whsklearn.effects import ContactStop
from whsklearn.effects import codes as k
from whsklearn.filtering.records import CUTOFF_SIGMA
from whsklearn.gap.plants.servo_candidates import TWO_MASS, Candidate, variants
from whsklearn.gap.plants.servo_model import ServoHypothesis, ServoTerm
from whsklearn.gap.record import Array
from whsklearn.identification.end_stops import Region, struck

KINDS = variants(ContactStop)
AROUND = 3.5  # widths of the Gaussian over which a contact is blurred
EDGE_STEP, EDGE_STEPS = 0.4, 7  # of the depth reached; each step shrinks by 0.6, to a hundredth in the end
RELAXATIONS = (0.0, 0.003, 0.01, 0.02, 0.04, 0.08, 0.15)  # s


def regions(view: Any, model: ServoHypothesis) -> list[Region]:
    """The ends of the travel that are struck, none, one or two, beside a model and any slow force over the position.

    Without that force, a weight that the model lacks hides a stop, and a stop the weight.
    """
    x, _ = view.columns(model, view.torque(model))
    q = view.motion.position[:: view.every]
    x = np.column_stack([x, np.sin(q), np.cos(q), q - q.mean()])[view.at]
    used = np.any(x != 0.0, axis=0)
    dry = np.flatnonzero(_columns_of(model, lambda t: t.name == "coulomb", x.shape[1])[used])
    return struck(x[:, used], view.drive[view.at], q[view.at], dry=int(dry[0]) if dry.size else None)


def start(kind: Any, found: list[Region]) -> ServoTerm | None:
    """The term of this kind at the regions found, if they fit it."""
    sides = {f.side: f.edge for f in found}
    want = {k.END_STOP: {1, -1}, k.END_STOP_UPPER: {1}, k.END_STOP_LOWER: {-1}}[kind.code]
    if set(sides) != want:
        return None
    if kind.code == k.END_STOP:
        return ServoTerm(kind, (0.0, 0.5 * (sides[1] - sides[-1]), RELAXATIONS[2], 0.5 * (sides[1] + sides[-1])))
    return ServoTerm(kind, (0.0, next(iter(sides.values())), RELAXATIONS[2], 0.0))


def holds(model: ServoHypothesis) -> bool:
    """Whether the model contains a stop that was found by its events."""
    return any(t.kind in KINDS for t in model.terms)


def usable(model: ServoHypothesis) -> tuple[Candidate, ...]:
    """Stops that may be added to a model."""
    return () if any(t.name == "end_stop" for t in model.terms) else KINDS


def contact(view: Any, model: ServoHypothesis) -> Array | None:
    """+1 or -1 at judged samples where a stop of the model may push, 0 elsewhere, shape (n,); None without a stop."""
    stops = [t for t in model.terms if t.kind in KINDS]
    if not stops:
        return None
    from scipy.ndimage import maximum_filter1d

    q = view.motion.position
    width = 2 * int(np.ceil(AROUND * CUTOFF_SIGMA / (2 * np.pi * view.cutoff) / view.scene.dt)) + 1
    out = np.zeros(q.size)
    for t in stops:
        low, high = t.effect.ends
        out[maximum_filter1d((q > high).astype(np.int8), width) > 0] = 1.0
        out[maximum_filter1d((q < low).astype(np.int8), width) > 0] = -1.0
    return out[:: view.every][view.at]


def away(view: Any, model: ServoHypothesis) -> Array | None:
    """One at judged samples without contact at a stop, zero at the others, shape (n,); None without a stop."""
    touched = contact(view, model)
    return None if touched is None else (touched == 0.0).astype(float)


def pushes(model: ServoHypothesis, columns: Array) -> NDArray[np.bool_]:
    """Mask of the columns (that of inertia first) that belong to a stop."""
    return _columns_of(model, lambda t: t.kind in KINDS, columns.shape[1])


def _columns_of(model: ServoHypothesis, chosen: Callable[[ServoTerm], bool], n: int) -> NDArray[np.bool_]:
    """Mask of the n columns (that of inertia first) that belong to the chosen terms."""
    out = [False]
    for t in model.terms:
        out += [chosen(t)] * (1 if t.kind.code in TWO_MASS else t.kind.linear)
    return np.array(out + [False] * (n - len(out)))


def without_pushes(model: ServoHypothesis, columns: Array) -> Array:
    """The columns with those of stops set to zero: outside the contact only the tail of the blur is left of them."""
    return np.where(pushes(model, columns), 0.0, columns) if holds(model) else columns


def stiffness(model: ServoHypothesis, columns: Array, left: Array) -> Array:
    """Sizes of the columns: every stop's stiffness is fitted to the residual of the others, which are set to zero."""
    sizes = np.zeros(columns.shape[1])
    for i in np.flatnonzero(pushes(model, columns)):
        c = columns[:, i]
        sizes[i] = max(0.0, float(c @ left) / (float(c @ c) + 1e-300))
    return sizes


def unexplained(view: Any, model: ServoHypothesis) -> float:
    """Rms of what a model leaves, in contact too, where only the fitted push of a stop is taken off."""
    _, x, target, sizes, _ = view.solved(model)
    return float(view.rms((target - x @ sizes)[view.at]))


def settled(view: Any, model: ServoHypothesis, term: ServoTerm) -> ServoHypothesis:
    """The model with the stop; edge and relaxation are moved downhill on the part of the push not yet explained."""
    q = view.motion.position[:: view.every][view.at]
    low, high = term.effect.ends
    beyond = max(float(q.max()) - high, low - float(q.min()), 1e-3 * view.scene.reach)

    def tried(term: ServoTerm) -> tuple[float, ServoHypothesis]:
        grown = view.fit(model.with_term(term))
        return unexplained(view, grown), grown

    least, best = min((tried(term.with_slot(2, r)) for r in RELAXATIONS), key=lambda t: t[0])
    steps = {1: EDGE_STEP * beyond, 2: 0.5 * best.terms[-1].q[2] + RELAXATIONS[1]}
    for _ in range(EDGE_STEPS):
        for slot, step in steps.items():
            here = best.terms[-1]
            for value in (here.q[slot] - step, here.q[slot] + step):
                cost, grown = tried(here.with_slot(slot, value if slot == 1 else max(0.0, value)))
                if cost < least:
                    least, best = cost, grown
                    steps[slot] *= 1.5
                    break
            steps[slot] *= 0.6
    return best


def share_of(view: Any, model: ServoHypothesis, term: ServoTerm) -> float:
    """Share of the gap's power that a stop explains at its start."""
    grown = view.fit(model.with_term(term))
    return float(np.clip(1.0 - (view.rms(view.gap(grown)) / max(view.rms(view.gap(model)), 1e-300)) ** 2, 0.0, 1.0))
