"""Objections to an effect of an axis: unphysical numbers, a wave off the shaft, a tone of the excitation."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from whsklearn.effects import EndStop, codes
from whsklearn.gap.plants import servo_evidence as rules
from whsklearn.gap.plants.servo_model import AxisModel, Term
from whsklearn.gap.record import ServoRecord

Array = NDArray[Any]


def unphysical(record: ServoRecord, model: AxisModel, index: int) -> str:
    """The physical objection to the numbers of a term, in either view of an axis; empty if there is none."""
    term = model.terms[index]
    q = term.q
    if term.name == "encoder_eccentricity" and float(np.hypot(q[0], q[1])) * q[2] > rules.STEEPEST_ERROR:
        return "with such a steep encoder error the reading would stand still while the axis turns"
    if term.kind.positive and q[0] <= 0:
        return f"its size would be {q[0]:.3g}, but a physical one is positive"
    return (
        model.at_the_end(index)
        or never_free(term.effect, record.position)
        or negative_damping(model, index)
        or too_large(model, index)
        or off_shaft(model, index)
        or on_excitation_line(record, term)
    )


def never_free(effect: Any, position: Array) -> str:
    """The objection that the axis is always in contact with a stop, which is then a spring; empty if it is not."""
    if not isinstance(effect, EndStop):
        return ""
    low, high = effect.ends
    return "" if np.any((position > low) & (position < high)) else "the axis would always touch it: a spring"


def too_large(model: AxisModel, index: int) -> str:
    """The objection that an effect takes so much of the drive that it replaces the drive; empty if it does not."""
    t = model.terms[index]
    if t.kind.code == codes.CHANGE_GAIN and 1.0 + t.q[0] < rules.LEAST_GAIN_LEFT:
        return f"it would leave {100 * (1.0 + t.q[0]):.1f} % of the drive's effect and hide whatever is missing"
    share = float(np.linalg.norm(t.q[:2])) if t.kind.linear == 2 else abs(float(t.q[0]))
    if share <= rules.LARGEST_SHARE.get(t.name, np.inf):
        return ""
    return f"it would take {100 * share:.0f} % of the drive, which no motor or gear does"


def negative_damping(model: AxisModel, index: int) -> str:
    """The objection that an asymmetry of the viscous friction is larger than that friction; empty if it is not.

    A record of one direction under a speed controller u = k (r - v) offers -k as such an asymmetry.
    """
    t = model.terms[index]
    viscous = sum(o.q[0] for o in model.terms if o.name == "viscous")
    if t.name == "asymmetric_viscous" and abs(t.q[0]) > max(viscous, 0.0):
        return "the axis would be driven by its own friction in one direction"
    return ""


def off_shaft(model: AxisModel, index: int) -> str:
    """The objection that a wave cannot belong to the shaft of the other waves; empty if it can.

    Over several turns, an effect of one shaft repeats every turn.  Fractional orders beside whole ones are a tone in
    time, seen at the mean speed (LAAS: 61.3 and 82.7, which a tone of the mains at 60.00 Hz replaces).
    """

    def wave(t: Term) -> float | None:
        return float(t.q[2]) if t.kind.repeats and t.kind.scanned == "position" else None

    order = wave(model.terms[index])
    others = [o for i, t in enumerate(model.terms) if i != index and (o := wave(t)) is not None]
    if order is None or order.is_integer() or 2.0 * model.scene.reach < rules.SEVERAL_TURNS or not others:
        return ""
    if not all(o.is_integer() for o in others):
        return ""
    return "its order is not a whole number, so it does not repeat with every turn"


def on_excitation_line(record: ServoRecord, term: Term) -> str:
    """The objection that a tone of a position servo without a logged drive is on a line of its command; empty if not.

    For such a servo, command minus position replaces the drive.  Everything else that the loop does leaves a residual
    at every line of the command, which a tone would explain.  With a measured drive, a tone on a line is a tone.
    """
    if not record.is_following_error or record.reference is None or term.name != "disturbance_tone":
        return ""
    x = record.reference - record.reference.mean()
    power = np.abs(np.fft.rfft(np.hanning(x.size) * x)) ** 2
    at = float(term.q[2]) * record.dt * x.size
    distance = np.abs(np.arange(power.size) - at)
    line, around = power[distance <= rules.LINE], power[(distance > 2 * rules.LINE) & (distance <= rules.AROUND)]
    if line.size == 0 or around.size == 0 or line.max() <= rules.STANDS_OUT * np.median(around):
        return ""
    return "its frequency is a line of the reference, where wrong dynamics would cause a tone as well"
