"""Several records of one axis joined with holes between them: shared numbers, but own offset and timing for each."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from whsklearn.gap.data_check import UNEVEN, check_servo
from whsklearn.gap.record import ServoRecord
from whsklearn.identification.drive_lead import earlier, moved, same_age
from whsklearn.identification.logs_together import own_offsets
from whsklearn.identification.view import view
from whsklearn.logs.errors import LogError
from whsklearn.logs.timebase import LONG_GAP


def joined(records: Sequence[ServoRecord]) -> ServoRecord:
    """One record with each given one as a segment, whose drives are moved to their mean offset and to one age.

    ``records``: records of one axis, in the order of time. The result has ``starts`` at every record's
    first sample.
    Raises ValueError if there is none, LogError if one cannot be used or if sampling rates or kinds of drive and motion
    differ.

    >>> from whsklearn.datasets import make_servo_log
    >>> logs = [make_servo_log(duration=10.0, random_state=k) for k in (0, 1)]
    >>> both = joined([ServoRecord.from_frame(log) for log in logs])
    >>> len(both), both.starts
    (20000, (10000,))
    """
    if not records:
        raise ValueError("There is no record; give one or several.")
    first = records[0]
    if len(records) == 1:
        return first
    if len({r.units for r in records}) > 1:
        raise LogError(f"The records' units are {', '.join(str(r.units) for r in records)}; give one kind of them.")
    steps = np.array([r.dt for r in records])
    if np.ptp(steps) > UNEVEN * steps.min():
        rates = " and ".join(f"{1.0 / s:.6g}" for s in steps)
        raise LogError(f"The records have {rates} samples a second; resample them to one rate.")
    for k, r in enumerate(records):
        for problem in check_servo(r):
            if problem.fatal:
                raise LogError(f"Record {k + 1}: {problem.title}. {problem.explanation}")
    records = alike(records)
    begins = np.cumsum([0.0] + [float(r.time[-1] - r.time[0]) + LONG_GAP * first.dt for r in records])
    sizes = np.cumsum([0] + [len(r) for r in records])
    edges = [n + s for r, n in zip(records, sizes.tolist(), strict=False) for s in (0, *r.starts)]
    referenced = all(r.reference is not None for r in records)
    return replace(
        first,
        time=np.concatenate([r.time - r.time[0] + t for r, t in zip(records, begins, strict=False)]),
        drive=np.concatenate([r.drive for r in records]),
        position=np.concatenate([r.position for r in records]),
        reference=np.concatenate([r.reference for r in records]) if referenced else None,  # type: ignore[misc]
        starts=tuple(edges[1:]),
    )  # fmt: skip


def alike(records: Sequence[ServoRecord]) -> list[ServoRecord]:
    """The records with the drive of each at the mean offset of all and the age of the one that is least shifted."""
    logs = [
        view(r.drive, r.position, r.dt, "position", groups=np.searchsorted(r.starts, np.arange(len(r)), "right"))
        for r in records
    ]
    leads = same_age(logs)
    offsets = own_offsets([moved(log, lead) for log, lead in zip(logs, leads, strict=True)])
    return [
        replace(r, drive=r.by_piece(partial(earlier, samples=lead), r.drive - offset))
        for r, lead, offset in zip(records, leads, offsets, strict=True)
    ]
