"""`compare_records` and `compare_arms`: what changed between several records of one axis or one arm."""

from __future__ import annotations

import dataclasses
import time
import warnings
from collections.abc import Collection, Mapping, Sequence
from typing import Any

import numpy as np
from threadpoolctl import threadpool_limits

from whsklearn.compare.arm import MOST_LEFT, ArmLog, arm_rows, poor_joints
from whsklearn.compare.axis import OneWay, axis_rows
from whsklearn.compare.comparison import Change, Comparison, spoken
from whsklearn.compare.estimate import Estimate, estimate, walking
from whsklearn.compare.hypotheses import OF_ZERO, Difference, hypotheses, smallest
from whsklearn.compare.pair import between, changes_between
from whsklearn.compare.rows import Regression
from whsklearn.compare.series import change_point, course, scatter, spread
from whsklearn.gap.data_check import FEWEST_SAMPLES, SHORTEST_RECORD, check_servo
from whsklearn.gap.record import ServoRecord
from whsklearn.identification.arm_fit import N_LEFT_OUT, identify_arm
from whsklearn.identification.payload import find_payload
from whsklearn.models.files import as_arm
from whsklearn.systems.arm import Arm

SURE = 3.0  # standard errors below zero: one in a thousand by chance
SEEN = 0.5  # of a number: a comparison that would miss half of every number has seen nothing
FOLLOWS = 0.01  # of the drive that a function of position leaves: then the drive is the controller's, not the axis's
N_KNOTS = 24
FEWEST_OF_A_TREND = 4  # records: three leave a line and a step one degree of freedom, and no choice between them
NAMED = 3  # joints of an arm by name in one phrase


@threadpool_limits.wrap(limits=1, user_api="blas")  # two take twice the CPU and sum in another order
def compare_records(
    records: Sequence[ServoRecord], labels: Sequence[str] = (), *, alpha: float = 0.01, random_state: int = 0
) -> Comparison:
    """Find what changed between records of one axis and by how much, or say that nothing did or why it is unknown.

    Parameters
    ----------
    records : sequence of ServoRecord
        At least two, in order of time.
    labels : sequence of str, optional
        Names of the records.
    alpha : float
        Probability of reporting a change although nothing changed.
    random_state : int

    Raises
    ------
    ValueError
        If there are fewer than two records, or their units differ in kind.

    References
    ----------
    DerSimonian and Laird 1986, Controlled Clinical Trials 7(3), 177-188, for the spread between records; MacKay 1992,
    Neural Computation 4(3), 415-447, for the price of a number.

    Examples
    --------
    >>> import pandas as pd
    >>> from whsklearn.compare import compare_records
    >>> from whsklearn.datasets import make_servo_log
    >>> from whsklearn.effects import Cogging
    >>> from whsklearn.gap import ServoRecord
    >>> logs = [make_servo_log([Cogging(size, 12.0)], duration=20.0, random_state=0) for size in (0.2, 0.3)]
    >>> found = compare_records([ServoRecord.from_frame(pd.DataFrame(log)) for log in logs])
    >>> found.verdict, [c.name for c in found.changes]
    ('moved', ['cogging'])
    """
    began = time.perf_counter()
    records = list(records)
    names = _labels(records, labels)
    kinds = {r.units for r in records}
    if len(kinds) > 1:
        told = " and ".join(f"{u} over {m}" for u, m in sorted(kinds))
        raise ValueError(f"The records hold {told}; compare records of one kind of drive and motion.")
    found = _compared(records, names, alpha, np.random.default_rng(random_state))
    found.alpha, found.seconds = alpha, time.perf_counter() - began
    return found


@threadpool_limits.wrap(limits=1, user_api="blas")  # two take twice the CPU and sum in another order
def compare_arms(
    records: Sequence[ArmLog], robot: Any, labels: Sequence[str] = (), *, alpha: float = 0.01
) -> Comparison:
    """The same for records of an arm: what changed at which joint, or what load came to which link.

    Parameters
    ----------
    records : sequence of ArmLog
        At least two, in order of time.
    robot : Arm, or path of a URDF, MJCF or model file
        The kinematics; its masses are not used.
    labels : sequence of str, optional
        Names of the records.
    alpha : float
        Probability of reporting a change although nothing changed.

    Raises
    ------
    ValueError
        If there are fewer than two records, or one of them does not fit the robot.

    References
    ----------
    Gautier and Khalil 1990, IEEE Trans. Robotics and Automation 6(3), 368-373, for the numbers that an arm shows.

    Examples
    --------
    >>> import numpy as np
    >>> from whsklearn.compare import ArmLog, compare_arms
    >>> from whsklearn.datasets import default_arm, make_arm_log
    >>> arm = default_arm()
    >>> loaded = arm.with_body("pitch", 0.5, [0.1, 0.0, 0.0])
    >>> logs = [make_arm_log(a, random_state=k, return_arrays=True) for k, a in enumerate((arm, loaded))]
    >>> found = compare_arms([ArmLog(500.0, *log) for log in logs], arm)
    >>> print(found.changes[0].name, round(found.changes[0].change, 3))  # 0.5 kg, 0.1 m from the axis
    moment at pitch 0.05
    """
    began = time.perf_counter()
    names = _labels(records, labels)
    arm = as_arm(robot)
    try:
        for r, label in zip(records, names, strict=True):
            if len(r.position) < max(FEWEST_SAMPLES, SHORTEST_RECORD * r.sample_rate):
                n = len(r.position)
                raise ValueError(
                    f"{label}: Record too short. {n} samples over {n / r.sample_rate:.1f} s; at least "
                    f" {FEWEST_SAMPLES} samples and {SHORTEST_RECORD:.0f} s are needed. Log longer."
                )
        rows = arm_rows(records, arm, names)
    except ValueError as reason:
        found = dataclasses.replace(cannot_tell(str(reason), names), usable=False)
    else:
        poor = poor_joints(rows, arm.joints)
        rows = [dataclasses.replace(r, changes={n: b for n, b in r.changes.items() if not at(n, poor)}) for r in rows]
        found = compare_rows(rows, alpha)
        if len(records) == 2:
            found = weighed(found, records, arm)
        found.notes += [
            f"The arm's numbers leave {100 * share:.0f} % of the drive of {joint} unexplained; what changed there "
            "cannot be told. Run `whsklearn gap` with --robot on it."
            for joint, share in poor.items()
        ]
    found.alpha, found.seconds = alpha, time.perf_counter() - began
    return found


def weighed(found: Comparison, records: Sequence[ArmLog], arm: Arm) -> Comparison:
    """The comparison with its mass as `find_payload` tells it, and as `whsklearn gap` does."""
    at_mass = [k for k, c in enumerate(found.changes) if c.name.startswith("mass at ")]
    if not at_mass:
        return found
    (_, q, u), (_, position, drive) = records
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)
        empty = identify_arm(q, u, dt=1.0 / records[0].sample_rate, robot=dataclasses.replace(arm, effects=()))
        found_loads = find_payload(empty, position, drive)
    loads = {f"mass at {p.joint}": p for p in found_loads if abs(p.mass) > OF_ZERO * p.mass_error}
    changes = list(found.changes)
    for k in at_mass:
        if (p := loads.get(changes[k].name)) is not None:
            changes[k] = dataclasses.replace(
                changes[k], after=p.mass, standard_error=p.mass_error, degrees=N_LEFT_OUT - 1.0
            )
    return dataclasses.replace(found, changes=changes, sentence=told(changes))


def at(name: str, joints: Collection[str]) -> bool:
    """Whether a change belongs to these joints themselves, and not to a load that all joints carry."""
    effect, _, joint = name.partition(" at ")
    return joint in joints and effect not in ("mass", "moment")


def _labels(records: Sequence[Any], labels: Sequence[str]) -> list[str]:
    names = list(labels) or [f"record {k + 1}" for k in range(len(records))]
    if len(records) < 2 or len(names) != len(records):
        raise ValueError(f"{len(records)} records and {len(names)} labels; give two records at least, a label each.")
    return names


def _compared(records: list[ServoRecord], labels: list[str], alpha: float, rng: np.random.Generator) -> Comparison:
    for record, label in zip(records, labels, strict=True):
        if reason := unusable(record, label):
            return dataclasses.replace(cannot_tell(reason, labels), usable=False)
    try:
        rows = axis_rows(records, labels, alpha, rng)
    except OneWay as reason:
        return cannot_tell(str(reason), labels)
    return compare_rows(rows, alpha)


def unusable(record: ServoRecord, label: str) -> str:
    """Why nothing can be concluded from a record; empty if it can be used."""
    for problem in check_servo(record):
        if problem.fatal:
            return f"{label}: {problem.title}. {problem.explanation}"
    edges = np.quantile(record.position, np.linspace(0.0, 1.0, N_KNOTS + 1)[1:-1])
    part = np.searchsorted(edges, record.position)
    u = record.drive
    line = np.column_stack([(part == k)[:, None] * np.column_stack([np.ones(u.size), record.position])
                            for k in np.unique(part)])  # fmt: skip
    left = u - line @ np.linalg.lstsq(line, u, rcond=None)[0]
    if np.std(left) < FOLLOWS * np.std(u):
        return (
            f"{label}: the drive is a function of the position (a gravity compensation, or a position loop alone), so "
            "the record holds the controller and not the axis. Log with a reference that moves."
        )
    return ""


def cannot_tell(reason: str, labels: list[str]) -> Comparison:
    """A result of `cannot_tell`, with the reason."""
    return Comparison("cannot_tell", f"It cannot be said what changed. {reason}", labels, reason=reason)


def compare_rows(rows: list[Regression], alpha: float) -> Comparison:
    """Compare records that are given as rows of one regression."""
    labels = [r.label for r in rows]
    rows = walking(rows)
    parts = [estimate(r) for r in rows]
    for part in parts:
        if part.left > MOST_LEFT:
            return cannot_tell(
                f"{part.label}: the model leaves {100 * part.left:.0f} % of the drive unexplained, more than "
                f"{100 * MOST_LEFT:.0f} %. Run `whsklearn gap` on it first.", labels,
            )  # fmt: skip
        if reason := unphysical(rows[0], part):
            return cannot_tell(reason, labels)
    if len(rows) == 2:
        d = between(rows, parts[:1], parts[1:])
        changes = changes_between(d, rows[0].units, alpha)
    else:
        changes, d = change_point(rows, parts, alpha)
        changes = changes or scatter(rows, parts, alpha)
    found = Comparison("moved" if changes else "nothing", "", labels, changes, smallest(d, alpha))
    found.numbers = table(rows, parts, alpha)
    found.notes = drift_notes(rows, parts) + trend_notes(found.numbers)
    if not changes and (blind := unseen(d, found.smallest_seen)):
        found.verdict, found.reason = "cannot_tell", blind
    found.sentence = sentence(found, d)
    return found


def unphysical(rows: Regression, part: Estimate) -> str:
    """A sentence on the number that is clearly negative although physics requires a positive one; empty if none is."""
    for i, name in enumerate(rows.names):
        if name in rows.positive and part.values[i] < -SURE * part.errors[i]:
            return (
                f"{part.label}: {name} comes out as {part.values[i]:.2g} ± {part.errors[i]:.1g} {rows.units[i]}, which "
                "no axis has: another axis drives this one, or the sense of the drive is wrong."
            )
    return ""


def table(rows: list[Regression], parts: list[Estimate], alpha: float) -> list[dict[str, Any]]:
    """One row per number: value and standard error in each record, the mean, and the excess spread between records.

    From `FEWEST_OF_A_TREND` records on with its course: a trend, a change point or neither, and the slope a record.
    """
    out = []
    for i, name in enumerate(rows[0].names):
        values, variances = np.array([e.values[i] for e in parts]), np.array([e.covariance[i, i] for e in parts])
        mean, apart, p = spread(values, variances)
        out.append({
            "name": name, "part": rows[0].parts[i] if rows[0].parts else "", "unit": rows[0].units[i],
            "values": values.tolist(),
            "standard_errors": np.sqrt(variances).tolist(), "mean": mean, "spread_between": apart,
            "spread_within": float(np.sqrt(np.mean(variances))), "p_value_spread": p,
            "to_si": rows[0].to_si[i] if rows[0].to_si else 1.0,
        })  # fmt: skip
        if len(parts) >= FEWEST_OF_A_TREND:
            told = course(values, variances, alpha / len(rows[0].names))
            out[-1] |= {"course": told.word, "slope": told.slope, "slope_standard_error": told.standard_error}
    return out


def trend_notes(numbers: list[dict[str, Any]]) -> list[str]:
    """Notes on numbers that rise or fall all along the records."""
    return [
        f"{spoken(r)} {'rises' if r['slope'] > 0.0 else 'falls'} by {abs(r['slope']):.3g} ± "
        f"{r['slope_standard_error']:.2g} {r['unit']} per record: a trend over all records fits better than one change."
        for r in numbers
        if r.get("course") == "trend"
    ]


def drift_notes(rows: list[Regression], parts: list[Estimate]) -> list[str]:
    """Notes on numbers that drift within a record, which therefore do not count as changes between records."""
    out = []
    for r, e in zip(rows, parts, strict=True):
        for i, walk in e.drift.items():
            if walk * r.sizes[i] > 0.01 * r.drives[i]:
                out.append(
                    f"{r.names[i].replace('_', ' ')} walks by {walk:.2g} {r.units[i]} (rms) within {r.label}; that "
                    "widens its interval and is not counted as a change."
                )
    return out


def own_sizes(d: Difference) -> dict[str, float]:
    """Name -> size of the number that is certain, for the numbers that every axis has."""
    out = {}
    for name in (h.name for h in hypotheses(d)):
        if name in d.names and name.partition(" at ")[0] not in ("delay", "input_offset"):
            at = [i for i, n in enumerate(d.names) if n == name]
            size, error = (float(np.linalg.norm(x[at])) for x in (d.mean, d.errors))
            out[name] = max(0.0, size - 2.0 * error)
    return out


def unseen(d: Difference, smallest_seen: dict[str, float]) -> str:
    """Why "nothing" would claim too much: a change of half of any number would have been missed; empty if not so."""
    sizes = own_sizes(d)
    if any(smallest_seen[name] < SEEN * size for name, size in sizes.items()):
        return ""
    return (
        "Even a change of any number by half would have been missed: the records are too short or too noisy, or the "
        "model explains too little of them."
    )


def sentence(found: Comparison, d: Difference) -> str:
    """The answer in words."""
    if found.verdict == "moved":
        return told(found.changes)
    if found.verdict == "cannot_tell":
        return f"It cannot be said what changed. {found.reason}"
    sizes = own_sizes(d)
    seen = by_effect({n: found.smallest_seen[n] / s for n, s in sizes.items() if found.smallest_seen[n] < SEEN * s})
    if "gain" in found.smallest_seen:  # an arm has one at every joint
        seen.append(f"{100 * found.smallest_seen['gain']:.2g} % of the drive's gain")
    masses = {n: x for n, x in found.smallest_seen.items() if n.startswith("mass at ")}
    if masses:  # the lightest that shows, of all places a hand may carry it
        name = min(masses, key=lambda n: masses[n])
        seen.append(f"{masses[name]:.2g} kg at {name.removeprefix('mass at ')}")
    hidden = by_effect({n: np.nan for n, s in sizes.items() if found.smallest_seen[n] >= SEEN * s})
    text = f"These records show no change. A change of {', '.join(seen)} would have been detected."
    return text + (f" A change of {' or '.join(hidden)} by less than half would not." if hidden else "")


def told(changes: Sequence[Change]) -> str:
    """The changes in one sentence."""
    text = "; ".join(map(str, changes))
    return text[0].upper() + text[1:] + "."


def by_effect(shares: Mapping[str, float]) -> list[str]:
    """One phrase per effect: the shares at the joints of an arm together; no number where a share is NaN.

    Examples
    --------
    >>> by_effect({"inertia": 0.02, "coulomb": float("nan")})
    ['2 % of inertia', 'coulomb']
    >>> by_effect({"coulomb at hip": 0.1, "coulomb at knee": 0.2, "coulomb at foot": 0.4, "coulomb at toe": 0.3})
    ['10 to 40 % of coulomb at 4 joints']
    """
    groups: dict[str, dict[str, float]] = {}
    for name, share in shares.items():
        effect, _, joint = name.partition(" at ")
        groups.setdefault(effect.replace("_", " "), {})[joint] = share
    out = []
    for effect, joints in groups.items():
        low, high = (f"{100 * f(joints.values()):.2g}" for f in (min, max))
        text = "" if low == "nan" else f"{low} % of " if low == high else f"{low} to {high} % of "
        where = f" at {len(joints)} joints" if len(joints) > NAMED else f" at {' and '.join(joints)}"
        out.append(f"{text}{effect}{'' if '' in joints else where}")
    return out
