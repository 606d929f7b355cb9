"""Several logs of one axis: numbers are shared, but each log has a drive offset and a timing of its own."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from whsklearn.identification.axis_inverse import balance, solved
from whsklearn.identification.drive_lead import force_form, moved, skew, smoothing_width
from whsklearn.identification.view import View

OFFSET = 3  # of the columns of `whsklearn.identification.axis_inverse.balance`


class OwnDrive(NamedTuple):
    """What one log has of its own.

    Attributes
    ----------
    label : str
        Of the log; empty for the only one.
    lead : int
        Samples by which its drive was shifted earlier.
    offset : float
        What was subtracted from its drive, in the drive's unit.

    References
    ----------
    Schwarz 1978, Annals of Statistics 6(2), 461-464, for the price of an offset.

    Examples
    --------
    >>> OwnDrive("tuesday.csv", lead=0, offset=0.02).offset
    0.02
    """

    label: str
    lead: int
    offset: float

    def told(self, dt: float, unit: str) -> str:
        """In words; empty if the drive was left as logged.

        ``dt``: sampling time (s). ``unit``: of the drive.

        Examples
        --------
        >>> OwnDrive("", 8, 0.0).told(0.001, "Nm")
        'The drive was logged 8 ms after it acted; all models are of the log with its drive 8 samples earlier.'
        >>> OwnDrive("", -1, 0.0).told(0.025, "Nm")
        'The drive was logged 25 ms before it acted; all models are of the log with its drive 1 sample later.'
        >>> OwnDrive("b.csv", 0, 0.02).told(0.001, "Nm")
        'The drive of b.csv lies 0.02 Nm above the mean of all logs, which was subtracted.'
        """
        whose, out = f" of {self.label}" if self.label else "", []
        if self.lead:
            when = f"{1e3 * abs(self.lead) * dt:.3g} ms {'after' if self.lead > 0 else 'before'} it acted"
            steps = "1 sample" if abs(self.lead) == 1 else f"{abs(self.lead)} samples"
            moved_to = f"{steps} {'earlier' if self.lead > 0 else 'later'}"
            out.append(f"The drive{whose} was logged {when}; all models are of the log with its drive {moved_to}.")
        if self.offset:
            way = f"{abs(self.offset):.3g} {unit}".rstrip() + (" above" if self.offset > 0.0 else " below")
            out.append(f"The drive{whose} lies {way} the mean of all logs, which was subtracted.")
        return " ".join(out)


def together(logs: Mapping[str, View], si: tuple[float, float] = (1.0, 1.0)) -> tuple[View, tuple[OwnDrive, ...]]:
    """Join logs with holes between them, after each drive is moved by its own skew and to the mean offset of all.

    The offset of a log with few reversals is known only beside the friction that it shares with the others, so all logs
    are solved at once.  Offsets stay as logged where own ones explain no more than as many numbers of chance.

    ``logs``: of one kind and rate, in one unit, by their labels. ``si``: factors that convert drive and output to SI.
    """
    each = [dataclasses.replace(log, si=si) for log in logs.values()]
    leads = [skew(log.in_si) for log in each]
    timed = [moved(log, lead) for log, lead in zip(each, leads, strict=True)]
    offsets = own_offsets(timed)
    own = tuple(map(OwnDrive, logs, leads, offsets))
    if len(timed) == 1:
        return timed[0], own
    u = np.concatenate([log.u - offset for log, offset in zip(timed, offsets, strict=True)])
    y, target = (np.concatenate([getattr(log, name) for log in timed]) for name in ("y", "target"))
    begins = np.cumsum([0, *(log.y.size for log in timed)]).tolist()
    starts = [begin + s for log, begin in zip(timed, begins, strict=False) for s in (0, *log.starts)]
    return dataclasses.replace(timed[0], u=u, y=y, target=target, starts=tuple(starts[1:])), own


def own_offsets(logs: Sequence[View]) -> tuple[float, ...]:
    """How far each log's drive offset lies from their mean, in the drive's unit; zeros if they do not differ."""
    nothing = (0.0,) * len(logs)
    if len(logs) < 2 or logs[0].logged == "output":
        return nothing
    width = smoothing_width(logs[0].dt)
    form = force_form([log.in_si for log in logs])
    parts = [balance(log.in_si, width, form) for log in logs]
    columns, drive = (np.concatenate(x) for x in zip(*parts, strict=True))
    each = np.repeat(np.eye(len(logs)), [u.size for _, u in parts], axis=0)
    if not each.any(axis=0).all():  # a log without a sample of it
        return nothing
    own = np.column_stack([columns, each[:, :-1]])
    theta = solved(own, drive)
    before, after = (float(np.sum((drive - x @ solved(x, drive)) ** 2)) for x in (columns, own))
    n = drive.size / (np.sqrt(4.0 * np.pi) * width)  # independent samples behind the Gaussian
    if n * np.log(before / max(after, 1e-300)) < (len(logs) - 1) * np.log(max(n, 2.0)):
        return nothing
    offsets = theta[OFFSET] + np.append(theta[columns.shape[1] :], 0.0)
    return tuple(((offsets - offsets.mean()) / logs[0].si[0]).tolist())
