"""Waves and tones that a record offers falsely: off the shaft of the others, on a line of the excitation."""

from __future__ import annotations

import numpy as np

from whsklearn.gap.axis_model import AxisModel, Term
from whsklearn.gap.plants import servo_evidence as rules
from whsklearn.gap.record import ServoRecord


def off_shaft(model: AxisModel, index: int) -> str:
    """Whether a wave has no place on the shaft on which the others have theirs; empty if it has.

    Over several turns, what sits on one shaft comes back every turn.  Fractional orders beside whole ones are a
    tone in time seen at the mean speed (LAAS: 61.3 and 82.7, which a tone of the mains, 60.00 Hz, replaces).
    """

    def wave(t: Term) -> float | None:
        return float(t.q[2]) if t.kind.repeats and t.kind.scanned == "position" else None

    order = wave(model.terms[index])
    others = [o for i, t in enumerate(model.terms) if i != index and (o := wave(t)) is not None]
    if order is None or order.is_integer() or 2.0 * model.scene.reach < rules.SEVERAL_TURNS or not others:
        return ""
    if not all(o.is_integer() for o in others):
        return ""
    return "its order is no whole number, and it does not come back with every turn"


def on_excitation_line(record: ServoRecord, term: Term) -> str:
    """Whether a tone of a position servo without a logged drive sits on a line of its command; empty if not.

    There command minus position stands for the drive, so what the loop does besides leaves a leftover at every line
    of the command, and a tone would explain it.  With a drive that was measured a tone on a line is a tone.
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
    return "its frequency is a line of the reference, where wrong dynamics would leave a tone as well"
