"""`compare_records` and `compare_arms`: what changed between several records of one axis or one arm."""

from __future__ import annotations

import dataclasses
import time
import warnings
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from scipy.stats import chi2
from scipy.stats import t as student
from threadpoolctl import threadpool_limits

from whsklearn.compare.arm import MOST_LEFT, ArmLog, arm_rows, poor_joints
from whsklearn.compare.axis import OneWay, axis_rows
from whsklearn.compare.comparison import Change, Comparison, spoken
from whsklearn.compare.estimate import Estimate, Summand, degrees_of, estimate, walking
from whsklearn.compare.hypotheses import LEAST, OF_ZERO, Difference, between, changes_between, hypotheses, smallest
from whsklearn.compare.rows import Array, Regression
from whsklearn.gap.data_check import FEWEST_SAMPLES, SHORTEST_RECORD, check_servo
from whsklearn.gap.diagnosis import spoken as in_words
from whsklearn.gap.record import KINDS, MOTIONS, ServoRecord
from whsklearn.identification.arm_fit import identify_arm
from whsklearn.identification.joint_least_squares import N_LEFT_OUT
from whsklearn.identification.payload import find_payload
from whsklearn.logs.units import UNKNOWN, factor_between, factor_of, integral_of, unit_of
from whsklearn.models.files import as_arm
from whsklearn.systems.arm import Arm


def spread(values: Array, variances: Array) -> tuple[float, float, float]:
    """The mean, the deviation between records beyond that within them, and the p-value that there is none.

    Source: DerSimonian and Laird 1986, Controlled Clinical Trials 7(3), 177-188.
    """
    w = 1.0 / variances
    mean = float(w @ values / w.sum())
    q = float(w @ (values - mean) ** 2)
    others = (1.0 - np.eye(values.size)) @ w  # no difference of sums, which may round to zero
    tau2 = max(0.0, (q - (values.size - 1.0)) / max(float(w @ others / w.sum()), 1e-300))
    if tau2 > 0.0:
        mean = float((1.0 / (variances + tau2)) @ values / (1.0 / (variances + tau2)).sum())
    return mean, float(np.sqrt(tau2)), float(chi2.sf(q, values.size - 1))


def scattered(parts: list[Estimate]) -> Array:
    """Variance of every number between records beyond that within them, shape (p,)."""
    if len(parts) < 2:
        return np.zeros(parts[0].values.size)
    values, variances = np.array([e.values for e in parts]), np.array([np.diag(e.covariance) for e in parts])
    return np.array([spread(v, s)[1] ** 2 for v, s in zip(values.T, variances.T, strict=True)])


class Course(NamedTuple):
    """How a number goes from record to record: ``trend``, ``change point`` or ``neither``; its slope a record.

    >>> course(np.array([1.0, 1.2, 1.4, 1.6, 1.8]), np.full(5, 1e-4), 0.01).word
    'trend'
    """

    word: str
    slope: float
    standard_error: float
    p_value: float


def course(values: Array, variances: Array, alpha: float) -> Course:
    """A line through the records in their order, against a step between two of them and against neither.

    Errors of the slope are widened by Birge's ratio, so that records which scatter show no trend.  Of a line and a step
    the one with the lower BIC is told; a step has one number more, its place.

    ``values``, ``variances`` (n_records,): in the order of time. ``alpha``: probability of a word other than
    ``neither`` although the number stays.

    Source: Birge 1932, The calculation of errors by the method of least squares, Physical Review 40(2), 207-227;
    Schwarz 1978, Annals of Statistics 6(2), 461-464.
    """
    n = values.size
    place = np.arange(n, dtype=float)
    weighed = [_line(values, variances, x) for x in (place, *(np.float64(place >= k) for k in range(1, n)))]
    slope, variance, left = weighed[0]
    step, of_step, left_by_step = min(weighed[1:], key=lambda fit: fit[2])

    def p(size: float, spread: float, rest: float, asked: int) -> float:
        z = abs(size) / np.sqrt(spread * max(1.0, rest / (n - 2.0)))
        return float(min(1.0, asked * 2.0 * student.sf(z, n - 2.0)))

    of_line, of_a_step = p(slope, variance, left, 1), p(step, of_step, left_by_step, n - 1)
    word = "trend" if left < left_by_step + np.log(n) else "change point"
    if (of_line if word == "trend" else of_a_step) > alpha:
        word = "neither"
    return Course(word, slope, float(np.sqrt(variance * max(1.0, left / (n - 2.0)))), of_line)


def _line(values: Array, variances: Array, x: Any) -> tuple[float, float, float]:
    """(slope over ``x``, its variance, chi-squared of the rest) of a weighted line."""
    w = 1.0 / variances
    beside = x - (w @ x) / w.sum()
    slope = float(w @ (beside * values) / (w @ beside**2))
    rest = values - (w @ values) / w.sum() - slope * beside
    return slope, float(1.0 / (w @ beside**2)), float(w @ rest**2)


def change_point(rows: list[Regression], parts: list[Estimate], alpha: float) -> tuple[list[Change], Difference]:
    """What changed between two consecutive records and stayed, and the difference in which it was found.

    The records of each side must agree better than the two sides do: their scatter counts as noise.
    """
    splits = range(1, len(parts))
    best: tuple[list[Change], Difference] | None = None
    for k in splits:
        inside = np.maximum(scattered(parts[:k]), scattered(parts[k:]))
        between_them = Summand(np.diag(inside), max(len(parts) - 2.0, 1.0))
        noisy = [replace(e, parts=(*e.parts, between_them)) for e in parts]
        d = between(rows, noisy[:k], noisy[k:])
        at = (parts[k - 1].label, parts[k].label)
        found = changes_between(d, rows[0].units, alpha / len(splits))
        found = [replace(c, between=at, p_value=min(1.0, c.p_value * len(splits))) for c in found]
        if best is None or (found and (not best[0] or found[0].p_value < best[0][0].p_value)):
            best = found, d
    assert best is not None
    return best


def scatter(rows: list[Regression], parts: list[Estimate], alpha: float) -> list[Change]:
    """Numbers that vary between records without any order, each with its lowest and highest record."""
    out = []
    for i, name in enumerate(rows[0].names):
        values, variances = np.array([e.values[i] for e in parts]), np.array([e.covariance[i, i] for e in parts])
        _, apart, p = spread(values, variances)
        share = apart * float(np.mean([r.sizes[i] / r.drives[i] for r in rows]))
        if p * len(rows[0].names) <= alpha and share > LEAST:
            a, b = int(np.argmin(values)), int(np.argmax(values))
            error = float(np.sqrt(variances[a] + variances[b]))
            nu = degrees_of((*parts[a].parts, *parts[b].parts), np.eye(len(rows[0].names))[[i]])
            out.append(Change(
                name, float(values[a]), float(values[b]), error, nu, rows[0].units[i],
                min(1.0, p * len(rows[0].names)), [], share, between=(parts[a].label, parts[b].label),
            ))  # fmt: skip
    return sorted(out, key=lambda c: c.p_value)


SURE = 3.0  # standard errors below zero: one in a thousand by chance
SEEN = 0.5  # of a number: a comparison that would miss half of every number has seen nothing
FOLLOWS = 0.01  # of the drive that a function of position leaves: then the drive is the controller's, not the axis's
N_KNOTS = 24
FEWEST_OF_A_TREND = 4  # records: three leave a line and a step one degree of freedom, and no choice between them
NAMED = 3  # joints of an arm by name in one phrase


@threadpool_limits.wrap(limits=1, user_api="blas")  # two take twice the CPU and sum in another order
def compare_records(
    records: Sequence[ServoRecord],
    labels: Sequence[str] = (),
    *,
    alpha: float = 0.01,
    same_zero: bool = True,
    random_state: int = 0,
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
    same_zero : bool
        Whether all records count the position from one zero. If not (an encoder without an index, or a position that
        is the integral of the velocity), effects that depend on the position are fitted to each record and not
        compared.
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
        told = " and ".join(f"{'a drive without a unit' if u == 'drive' else u} over {m}" for u, m in sorted(kinds))
        raise ValueError(f"The records hold {told}; compare records of one kind of drive and motion.")
    found = _compared(records, names, alpha, np.random.default_rng(random_state), same_zero)
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
                    f"{FEWEST_SAMPLES} samples and {SHORTEST_RECORD:.0f} s are needed. Log longer."
                )
        rows = arm_rows(records, arm, names)
    except ValueError as reason:
        found = dataclasses.replace(cannot_tell(str(reason), names), usable=False)
    else:
        poor = poor_joints(rows, arm.joints)
        rows = [dataclasses.replace(r, changes={n: b for n, b in r.changes.items() if not at(n, poor)}) for r in rows]
        found = compare_rows(rows, alpha, arm.joints)
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
    return dataclasses.replace(found, changes=changes, sentence=changes_in_words(changes))


def at(name: str, joints: Collection[str]) -> bool:
    """Whether a change belongs to these joints themselves, and not to a load that all joints carry."""
    effect, _, joint = name.partition(" at ")
    return joint in joints and effect not in ("mass", "moment")


def _labels(records: Sequence[Any], labels: Sequence[str]) -> list[str]:
    names = list(labels) or [f"record {k + 1}" for k in range(len(records))]
    if len(records) < 2 or len(names) != len(records):
        raise ValueError(f"{len(records)} records and {len(names)} labels; give two records at least, a label each.")
    return names


def _compared(
    records: list[ServoRecord], labels: list[str], alpha: float, rng: np.random.Generator, same_zero: bool
) -> Comparison:
    for record, label in zip(records, labels, strict=True):
        if reason := unusable(record, label):
            return dataclasses.replace(cannot_tell(reason, labels), usable=False)
    try:
        rows = axis_rows(records, labels, alpha, rng, same_zero)
    except OneWay as reason:
        return cannot_tell(str(reason), labels)
    found = compare_rows(rows, alpha)
    if own := [name.replace("_", " ") for name in rows[0].own]:
        found.notes.append(
            f"Every record counts the position from its own zero; {' and '.join(own)} "
            f"{'was' if len(own) == 1 else 'were'} fitted to each record, and cannot be compared."
        )
    return found


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


def compare_rows(rows: list[Regression], alpha: float, joints: Sequence[str] = ()) -> Comparison:
    """Compare records that are given as rows of one regression; of an arm, of all its ``joints``."""
    labels = [r.label for r in rows]
    rows = walking(rows)
    parts = [estimate(r) for r in rows]
    for part in parts:
        if (least := part.left.min()) > MOST_LEFT:
            return cannot_tell(
                f"{part.label}: the model leaves {100 * least:.0f} % of the drive unexplained, more than "
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
    worst = int(np.argmax(np.max([part.left for part in parts], axis=0)))
    where = "" if rows[0].channel is None else f" of {joints[np.unique(rows[0].channel)[worst]]}"
    found.sentence = sentence(found, d, [float(part.left[worst]) for part in parts], where)
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
                    f"{in_words(r.names[i])} walks by {walk:.2g} {r.units[i]} (rms) within {r.label}; that "
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


def sentence(found: Comparison, d: Difference, left: Sequence[float], where: str) -> str:
    """The answer in words; where no number changed, what no number explains may have: a play is in there.

    ``left``: what each record leaves of the drive, of an arm at the joint (``where``) at which it is most.
    """
    if found.verdict == "moved":
        return changes_in_words(found.changes)
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
    around_zero = [row for row in found.smallest_rows if row["name"] in ("input_offset", "delay")]  # no share of it
    seen += [f"{row['smallest']:.2g} {row['unit']} of {spoken(row)}" for row in around_zero]
    hidden = by_effect({n: np.nan for n, s in sizes.items() if found.smallest_seen[n] >= SEEN * s})
    text = f"These records show no change. A change of {', '.join(seen)} would have been detected."
    text += f" A change of {' or '.join(hidden)} by less than half would not." if hidden else ""
    low, high = (f"{100 * f(left):.2g}" for f in (min, max))
    return text + (
        f" {low if low == high else f'{low} to {high}'} % of the drive{where} is in none of these numbers, and a "
        "change in there, such as of a play, would not show."
    )


def changes_in_words(changes: Sequence[Change]) -> str:
    """The changes in one sentence."""
    text = "; ".join(map(str, changes))
    return text[0].upper() + text[1:] + "."


def by_effect(shares: Mapping[str, float]) -> list[str]:
    """One phrase per effect: the shares at the joints of an arm together; no number where a share is NaN.

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


# --- what changed at the alarm of a stream: its rows before and after it as two records ------------------------------
# The alarm and the comparison so tell one story of the same data.  An alarm says that the innovations differ; whether a
# number of the axis changed or a drift went on is for the comparison to say.
Side = tuple[Array, Array]  # numbers of the experiments (n,), rows (n, n_columns) with their time first

LABELS = ("before the alarm", "after it")
SHORTEST = 50  # samples of an experiment that is used


def at_an_alarm(columns: Sequence[str], dt: float | None = None) -> Callable[[Side, Side], dict[str, Any]] | None:
    """What compares the rows of an axis's stream; None unless they are time, a drive and a motion by their units.

    ``columns``: of the rows: time, drive and motion, or time, motion and drive. ``dt``: sampling time (s) of rows
    without a time.

    Examples
    --------
    >>> at_an_alarm(["time_s", "torque_nm", "velocity_rad_s"]) is None, at_an_alarm(["t", "u", "y"]) is None
    (False, True)
    """
    if len(columns) != 3 - (dt is not None):
        return None
    clock, drive, motion = (unit_of(c) for c in ("s", *columns)[-3:])
    first, second = (factor_of(unit)[1] for unit in (drive, motion))
    backwards = first in MOTIONS and first not in KINDS["drive"] and second in KINDS["drive"]
    if backwards:
        drive, motion = motion, drive
    (per, position), rate = integral_of(motion), factor_of(motion)[1].endswith("/s")
    kind = factor_of(position)[1]
    if UNKNOWN in (drive, motion) or factor_of(drive)[1] not in KINDS["drive"] or kind not in MOTIONS:
        return None
    by = 1.0 if clock == UNKNOWN else factor_between(clock, "s")

    def record(side: Side) -> ServoRecord:
        parts, starts, n = [], [], 0
        for t, *signals in evenly(side, by, dt):
            u, y = signals[::-1] if backwards else signals
            if rate:
                y = per * np.concatenate([[0.0], np.cumsum(0.5 * (y[1:] + y[:-1]) * np.diff(t))])
            parts.append((t, u, y))
            starts.append(n)
            n += t.size
        time, u, y = (np.concatenate(x) for x in zip(*parts, strict=True))
        return ServoRecord(time, u, y, units=(drive, position), starts=tuple(starts[1:]))

    return lambda before, after: stream_record(compare_records([record(before), record(after)], LABELS))


def at_an_alarm_of(arm: Arm, dt: float | None = None) -> Callable[[Side, Side], dict[str, Any]]:
    """What compares the rows of an arm's stream: time, the positions of all joints, their drives.

    ``arm``: its robot. ``dt``: sampling time (s) of rows without a time.

    Examples
    --------
    >>> import numpy as np
    >>> from whsklearn.datasets import default_arm, make_arm_log
    >>> arm = default_arm()
    >>> logs = (make_arm_log(arm, random_state=k, return_arrays=True) for k in range(2))
    >>> sides = [(np.zeros(len(q)), np.hstack([q, u])) for q, u in logs]
    >>> at_an_alarm_of(arm, dt=0.002)(*sides)["verdict"]
    'nothing'
    """

    def record(side: Side) -> ArmLog:
        longest = max(evenly(side, 1.0, dt), key=lambda part: part[0].size)
        q_and_u = np.column_stack(longest[1:])
        n = arm.n_joints
        return ArmLog(1.0 / float(longest[0][1] - longest[0][0]), q_and_u[:, :n], q_and_u[:, n:])

    return lambda before, after: stream_record(compare_arms([record(before), record(after)], arm, LABELS))


def evenly(side: Side, by: float, dt: float | None = None) -> list[list[Array]]:
    """Time (s, ``by`` times as logged) and other columns of every experiment, each on an even grid.

    ``dt``: sampling time (s) of rows without a time. Where the clock restarted, the time goes on behind that of the
    experiment before.

    Raises ValueError if no experiment has enough samples.
    """
    experiments, rows = side
    if dt is not None:
        rows = np.column_stack([np.arange(len(rows)) * dt, rows])
    step = float(np.median(np.diff(rows[:, 0])))
    out: list[list[Array]] = []
    for k in np.unique(experiments):
        part = rows[experiments == k]
        if len(part) >= SHORTEST:
            t = np.arange(part[0, 0], part[-1, 0] + 0.5 * step, step)
            signals = [np.interp(t, part[:, 0], x) for x in part.T[1:]]
            behind = out[-1][0][-1] + by * step if out else -np.inf
            out.append([by * t + max(0.0, behind - by * t[0]), *signals])
    if not out:
        raise ValueError(f"No {SHORTEST} rows without a pause were logged.")
    return out


def stream_record(found: Comparison) -> dict[str, Any]:
    """The fields of a stream's record."""
    return {
        "verdict": found.verdict, "sentence": found.sentence, "changes": [c.as_dict() for c in found.changes],
        "notes": found.notes,
    }  # fmt: skip
