"""The uncertainty of the torque constant enters the intervals of all numbers in proportion to the drive."""

from __future__ import annotations

import math
import re

from whsklearn.gap.diagnosis import Diagnosis

_OF_DRIVE = re.compile(r"_(nm|kg)(?=_|$)")  # in the labels of an effect's numbers
_UNITS = re.compile(r"\b(Nm|N|kg)\b")


def with_drive_error(diagnosis: Diagnosis, relative: float) -> None:
    """Widen the standard errors of a diagnosis by the relative standard deviation of the drive's scale.

    A scale that is off by a share puts inertia, friction and amplitudes off by the same share, and leaves orders,
    phases, delays and speeds as they are; the two errors are independent, so their variances add (JCGM 100:2008,
    eq. 10).

    Parameters
    ----------
    diagnosis : Diagnosis
        Changed in place.
    relative : float
        Standard deviation of the torque constant as a share of it; 0 changes nothing.

    Examples
    --------
    >>> from whsklearn.effects import Cogging
    >>> from whsklearn.gap import NamedEffect
    >>> errors = {"amplitude_nm": 0.003, "order": 0.01}
    >>> found = Diagnosis("named", "", effects=[NamedEffect(Cogging(0.05, 12.0), errors, 90.0, 1.0, 1.0)])
    >>> with_drive_error(found, 0.08)
    >>> found.effects[0].standard_errors
    {'amplitude_nm': 0.005, 'order': 0.01}
    """
    if not relative:
        return
    for effect in [e for found in diagnosis.effects for e in (found, *found.orders)]:
        values = effect.effect.labelled()
        for label, error in effect.standard_errors.items():
            if _OF_DRIVE.search(label):
                effect.standard_errors[label] = math.hypot(error, relative * float(values[label]))
    for row in diagnosis.base_parameters:
        if _UNITS.search(row["unit"]):
            for when in ("before", "after"):
                row[f"{when}_error"] = math.hypot(row[f"{when}_error"] or 0.0, relative * row[when])
    diagnosis.notes.insert(
        0,
        f"The torque constant is known to {100 * relative:.3g} % (standard deviation); "
        "the intervals of inertia, friction and torques include that.",
    )
