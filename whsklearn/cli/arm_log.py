"""The log of an arm on the command line: the columns of each joint, their units, and the reading."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from whsklearn.cli.records import note, read
from whsklearn.logs.errors import ColumnError, LogError

if TYPE_CHECKING:
    from sklearn.utils import Bunch

    from whsklearn.systems import Arm

PER_JOINT = ("LOG009", "LOG019", "LOG022")  # a joint at rest, unknown units, a current: told once for the whole arm
# Words of a column's name, the most reliable last.  A measured current is preferred to a torque that the controller
# commands, because the command may come from a model.
DRIVES = ("current", "currents", "iq", "i", "strom"), (
    "torque", "torques", "trq", "tau", "moment", "moments", "effort", "efforts", "eff", "force", "forces", "drehmoment",
    "kraft",
)  # fmt: skip
POSITIONS = ("enc", "encoder"), ("position", "positions", "pos", "angle", "angles", "theta", "q", "winkel", "lage")
UNITS = {
    "position": ("rad", "m", "counts"),
    "drive": ("Nm", "N", "A", "Arms", "Apk"),
}  # SI; they tell a column without a word
ASKED = {"target", "desired", "des", "d", "reference", "ref", "command", "commanded", "cmd", "setpoint", "goal", "soll"}
NEITHER = {
    "velocity", "velocities", "vel", "speed", "dot", "acceleration", "acc", "error", "ext", "external", "hat", "limit",
    "residual", "tcp", "ee", "tool", "wrench", "cartesian", "window", "temperature", "mode",
}  # fmt: skip


def joint_columns(text: str) -> dict[str, tuple[str, ...]]:
    """Columns of position and drive by joint, from ``hip:q1,i1;knee:q2,i2``; none for one that is only named.

    >>> joint_columns("shoulder:q1,i1;elbow")
    {'shoulder': ('q1', 'i1'), 'elbow': ()}
    """
    out = {}
    for part in filter(None, (p.strip() for p in text.split(";"))):
        name, colon, columns = part.partition(":")
        pair = tuple(c.strip() for c in columns.split(",")) if colon else ()
        if not (name.strip() and all(pair) and len(pair) in ((2,) if colon else (0,))):
            raise ColumnError(
                f"--joints holds {part!r}; expected NAME:POSITION,DRIVE for each joint, or its NAME, separated by ;"
            )
        if name.strip() in out:
            raise ColumnError(f"--joints names {name.strip()!r} twice; give each joint once.")
        out[name.strip()] = pair
    if twice := [c for pair in out.values() for c in pair if sum(p.count(c) for p in out.values()) > 1]:
        raise ColumnError(f"--joints gives column {twice[0]!r} twice; give each joint its own position and drive.")
    return out


def guessed_columns(joints: Sequence[str], names: Sequence[str], exactly: bool = False) -> dict[str, tuple[str, str]]:
    """The columns of position and drive of joints, from columns that contain the joint's name or its number.

    If the joints are ``exactly`` those that were logged, there are no more numbers than joints: of several columns, the
    first may be those of others.  Raises ColumnError if a joint has not exactly one column of each kind.

    >>> guessed_columns(["hip", "knee"], ["t", "actual_q_0", "actual_q_1", "actual_qd_0", "actual_qd_1", "I0", "I1"])
    {'hip': ('actual_q_0', 'I0'), 'knee': ('actual_q_1', 'I1')}
    """
    position = _one_kind(joints, names, POSITIONS, "position", exactly)
    drive = _one_kind(joints, names, DRIVES, "drive", exactly)
    return {joint: (position[joint], drive[joint]) for joint in joints}


def _one_kind(
    joints: Sequence[str], names: Sequence[str], ranks: Sequence[Sequence[str]], kind: str, exactly: bool
) -> dict[str, str]:
    """The column of this kind for every joint, by the most reliable words that every joint has, or else by its unit.

    A joint of which no word tells any column of this kind has that whose unit does.
    """
    from whsklearn.logs.units import factor_of, unit_of

    found: dict[tuple[bool, int, bool], dict[str, list[str]]] = {}
    series: dict[tuple[bool, int, tuple[str, ...]], list[tuple[int, str]]] = {}
    for column in names:
        owner = _owner(joints, column)
        words = words_and_numbers(re.sub(_named(owner), " ", column, flags=re.IGNORECASE) if owner else column)
        by_unit = -1 if factor_of(unit_of(column))[1] in UNITS[kind] else None
        rank = max((r for r, known in enumerate(ranks) if set(known) & set(words)), default=by_unit)
        if rank is None or NEITHER & set(words):
            continue
        measured = not ASKED & set(words)
        if owner:
            found.setdefault((measured, rank, True), {}).setdefault(owner, []).append(column)
            continue
        unit = words_and_numbers(unit_of(column))  # not that of the others where some joints slide and others turn
        signal = words[: -len(unit)] if unit and words[-len(unit) :] == unit else words
        for k in (k for k, word in enumerate(signal) if word.isdigit()):
            stem = (*signal[:k], "#", *signal[k + 1 :])
            series.setdefault((measured, rank, stem), []).append((int(words[k]), column))
    for (measured, rank, _), numbered in series.items():
        numbers, columns = zip(*sorted(numbered), strict=True)
        enough = len(numbers) == len(joints) if exactly else len(numbers) >= len(joints)
        if enough and numbers in (tuple(range(len(numbers))), tuple(range(1, len(numbers) + 1))):
            for joint, column in zip(joints, columns, strict=False):
                found.setdefault((measured, rank, False), {}).setdefault(joint, []).append(column)
    count = 0
    said = {j for (_, rank, _), of in found.items() if rank >= 0 for j in of}
    for key in sorted(found, reverse=True):
        alone = found.get((key[0], -1, True), {})  # of a joint that no word tells, beside others that one does
        of = {j: c for j, c in alone.items() if j not in said} | found[key]
        missing = [j for j in joints if len(of.get(j, ())) != 1]
        if not missing:
            return {j: of[j][0] for j in joints}
        if (count := max(map(len, of.values()))) > 1 or key[2]:
            joints, count = missing, len(of.get(missing[0], ()))
            break
    raise ColumnError(
        f"The log has {count} columns that may be the {kind} of {joints[0]}; name all joints with "
        f'--joints "{joints[0]}:POSITION,DRIVE;..."; it has: {", ".join(names[:30])}.'
    )


def _owner(joints: Sequence[str], column: str) -> str:
    """The joint whose name is contained in the column's, the longest if there are several; empty if there is none."""
    at = {j: found.start() for j in joints if (found := re.search(_named(j), column, re.IGNORECASE))}
    return max(at, key=lambda j: (len(j), -at[j]), default="")


def _named(joint: str) -> str:
    """A pattern that matches the joint's name as a word."""
    return rf"(?<![a-z0-9]){re.escape(joint)}(?![a-z0-9])"


def words_and_numbers(column: str) -> list[str]:
    """The words and the numbers in a column's name, separately.

    >>> words_and_numbers("tau_J0"), words_and_numbers("joint.2/i_q [A]")
    (['tau', 'j', '0'], ['joint', '2', 'iq', 'a'])
    """
    spelled = re.sub(r"(?<=[a-z])(?=[A-Z])", "_", column).lower()
    spelled = re.sub(r"(?<![a-z0-9])i_q(?![a-z])", "iq", spelled)
    return re.findall(r"[a-z]+|\d+", spelled)


def gains_of(text: str) -> dict[str, tuple[float, float]]:
    """Nm per unit of the logged drive and its standard error by joint, from ``shoulder:11.2;elbow:9.8+-0.3``.

    >>> gains_of("shoulder:11.2;elbow:9.8+-0.3")
    {'shoulder': (11.2, 0.0), 'elbow': (9.8, 0.3)}
    """
    out = {}
    for part in filter(None, (p.strip() for p in text.split(";"))):
        name, _, value = part.partition(":")
        gain, _, error = value.replace("±", "+-").partition("+-")
        try:
            out[name.strip()] = float(gain), float(error or 0.0)
        except ValueError:
            raise ColumnError(
                f"--gains holds {part!r}; expected NAME:NM_PER_AMPERE for each joint, separated by ;"
            ) from None
    return out


def columns_of(options: Mapping[str, Any], arm: Arm, names: Sequence[str]) -> dict[str, tuple[str, str]]:
    """Columns of position and drive of every joint: those of ``--joints``, or found by their names."""
    stated = joint_columns(options["joints"]) if options.get("joints") else dict.fromkeys(arm.joints, ())
    if missing := [j for j in arm.joints if j not in stated]:
        raise ColumnError(f"--joints does not name {missing[0]!r}; the robot's joints are {', '.join(arm.joints)}.")
    taken = {c for pair in stated.values() for c in pair}
    sought = [j for j in arm.joints if not stated[j]]
    free = [c for c in names if c not in taken]
    found = guessed_columns(sought, free, exactly=bool(options.get("joints"))) if sought else {}
    return found | {j: (pair[0], pair[1]) for j, pair in stated.items() if pair}


def gains_used(options: Mapping[str, Any], arm: Arm, units: Mapping[str, str]) -> dict[str, tuple[float, float]]:
    """The gains of ``--gains``; without it those that the robot's model was identified with, for drives in amperes.

    ``units``: unit of the drive by joint.
    """
    from whsklearn.logs.current import AMPERES
    from whsklearn.logs.units import factor_of
    from whsklearn.models import load_model

    path = str(options.get("robot") or options.get("model") or "")
    currents = [j for j, unit in units.items() if factor_of(unit)[1] in AMPERES]
    gains = gains_of(options.get("gains") or "")
    if unknown := [j for j in gains if j not in arm.joints]:
        raise ColumnError(f"--gains names {unknown[0]!r}; the robot's joints are {', '.join(arm.joints)}.")
    if gains or not currents or not path.endswith(".json"):
        return gains
    kept = getattr(load_model(path), "gains", {})
    if known := {j: (kept[j][0], kept[j][1]) for j in currents if j in kept}:
        said = "; ".join(f"{j}:{gain:g}" + f"+-{error:g}" * bool(error) for j, (gain, error) in known.items())
        note(f"Gains of {path}: {said} (--gains gives others).")
    return known


def to_si(joint: str, slides: bool, position: str, drive: str, gains: Mapping[str, Any]) -> tuple[float, float]:
    """Factors that convert the position and drive of a joint from these units to rad and Nm, or m and N.

    >>> [round(x, 4) for x in to_si("hip", False, "deg", "mA", {"hip": (11.0, 0.2)})]
    [0.0175, 0.011]
    """
    from whsklearn.logs.current import AMPERES
    from whsklearn.logs.units import UNSTATED, factor_between, factor_of

    place, force = ("m", "N") if slides else ("rad", "Nm")
    ampere = factor_of(drive)[1] in AMPERES
    if joint in gains and drive not in UNSTATED and not ampere:
        raise ColumnError(
            f"The drive of {joint} is in {drive}, so no gain in {force} per A applies to it; leave out --gains, or "
            "--load, which finds gains."
        )
    if ampere and joint not in gains:
        raise ColumnError(
            f"The drive of {joint} is a current in {drive}; give the {force} per A of every joint, "
            f'--gains "{joint}:{force.upper()}_PER_AMPERE;...".'
        )
    gain, target = (gains[joint][0], factor_of(drive)[1] if ampere else "A") if joint in gains else (1.0, force)
    try:
        return factor_between(position, place), gain * factor_between(drive, target)
    except ValueError as error:
        raise ColumnError(
            f"{joint} {'slides' if slides else 'turns'} in the robot's file, so its position is read in {place} and "
            f"its drive in {force}, but {error}; correct the unit in the column's name, or the columns in --joints."
        ) from error


def common_rows(times: Sequence[Any]) -> list[Any]:
    """Of every joint, the rows at the instants that all joints have: an encoder may drop out alone.

    Raises LogError if less than half of the instants are common.

    >>> [at.tolist() for at in common_rows([np.array([0.0, 0.1, 0.4]), np.array([0.0, 0.1, 0.2, 0.3, 0.4])])]
    [[0, 1, 2], [0, 1, 4]]
    """
    step = float(np.median(np.diff(times[0])))
    ticks = [np.rint((t - times[0][0]) / (0.1 * step)).astype(np.int64) for t in times]
    shared = ticks[0]
    for other in ticks[1:]:
        shared = np.intersect1d(shared, other)
    if 2 * shared.size < max(map(len, times)):
        counts = sorted(map(len, times))
        raise LogError(
            f"The joints have samples at different instants (one has {counts[0]}, another {counts[-1]}); write all "
            "columns at the same ones."
        )
    return [np.searchsorted(t, shared) for t in ticks]


def read_arm(path: str, options: Mapping[str, Any], arm: Arm) -> Bunch:
    """A log by the robot's joints, in rad, m, Nm and N.

    Its fields are those of other logs: ``time`` (n,), ``X`` and ``y`` (n, n_joints), the drives and positions,
    ``groups`` (n,), the segment of each row, and ``sample_rate``; ``columns`` holds position and drive by joint,
    ``gains`` those that were used, and ``stated`` is False if drives are currents without gains.
    """
    from sklearn.utils import Bunch

    from whsklearn.logs import open_source
    from whsklearn.logs.roles import guess
    from whsklearn.logs.units import UNSTATED

    source = open_source(path)
    time = options["time_column"] or (None if options.get("rate") or source.clocked else guess(source, "time"))
    given = columns_of(options, arm, source.names)
    read_logs: list[Bunch] = []
    quiet = PER_JOINT
    for position, drive in (given[joint] for joint in arm.joints):
        read_logs.append(read(source, options, quiet, time=time, position=position, drive=drive))
        quiet = (*quiet, *read_logs[-1].report.codes)
    gains = gains_used(options, arm, {j: log.units["drive"] for j, log in zip(arm.joints, read_logs, strict=True)})
    logs: list[tuple[Bunch, float, float]] = []
    unstated: list[str] = []
    for joint, slides, log in zip(arm.joints, arm.slides, read_logs, strict=True):
        position, drive = given[joint]
        unstated += [position] * (log.units["position"] in UNSTATED)
        unstated += [drive] * (log.units["drive"] in UNSTATED and joint not in gains)
        far, by = to_si(joint, bool(slides), log.units["position"], log.units["drive"], gains)
        logs.append((log, far, by))
    first, rows = logs[0][0], common_rows([log.time for log, *_ in logs])
    if ":" not in (options.get("joints") or "") and not all(_owner([j], c) for j, pair in given.items() for c in pair):
        note(f"Columns in the robot's order: {'; '.join(f'{j}: {q} and {u}' for j, (q, u) in given.items())}.")
    unknown = [u for j, (_, u) in given.items() if u in unstated and set(DRIVES[0]) & set(words_and_numbers(u))]
    if unknown:
        note(
            f"{unknown[0]} is taken as a current: without --gains the numbers of a joint are in its unit, not in Nm, "
            "and those that joints with different gains share fit none of them."
        )
    unstated = [c for c in unstated if c not in unknown]
    if unstated:
        which = ", ".join(unstated[:4]) + (f" and {len(unstated) - 4} more" if len(unstated) > 4 else "")
        note(f"No unit is known for {which}; rad and Nm (m and N) are assumed. State it in the column's name.")
    if first.units["time"] == "samples":
        raise LogError("The log has no time; name its column with --time, or its rate with --rate.")
    parts = np.column_stack([log.groups[at] for (log, *_), at in zip(logs, rows, strict=True)])
    return Bunch(
        name=first.name, time=first.time[rows[0]],
        X=np.column_stack([by * log.X[at, 0] for (log, _, by), at in zip(logs, rows, strict=True)]),
        y=np.column_stack([far * log.y[at] for (log, far, _), at in zip(logs, rows, strict=True)]),
        groups=np.cumsum(np.append(False, np.any(np.diff(parts, axis=0) != 0, axis=1))),
        sample_rate=first.sample_rate, columns=given, notes=(), stated=not unknown, gains=gains,
    )  # fmt: skip


def robot_of(options: Mapping[str, Any]) -> Arm:
    """The robot, reduced to the joints that ``--joints`` names if it is given.

    Raises ColumnError, as for any other wrong option, if the file cannot be read or has not these joints.
    """
    from whsklearn.models import as_arm

    joints = list(joint_columns(options["joints"])) if options.get("joints") else None
    try:
        return as_arm(options["robot"], joints)
    except ValueError as error:
        raise ColumnError(str(error)) from error


def note_locked(options: Mapping[str, Any], arm: Arm) -> None:
    """Print a note on joints of the robot that ``--joints`` does not name, because the file is then read without them.

    Nothing is printed if the file cannot be read with all joints: those that follow others have no columns anyway.
    """
    from contextlib import suppress

    from whsklearn.models import as_arm

    with suppress(ValueError):
        if locked := [j for j in as_arm(options["robot"]).joints if j not in arm.joints]:
            verb = "is" if len(locked) == 1 else "are"
            note(f"--joints does not name {', '.join(locked)}, which {verb} taken to stand still at zero.")


def note_friction(options: Mapping[str, Any], arm: Arm) -> None:
    """Print a note where the robot's file has damping and no dry friction: many have it for the simulator's sake."""
    names = {e.name for row in arm.effects for e in row}
    if "viscous" in names and not names & {"coulomb", "load_friction"} and not options.get("law"):
        note(
            "The robot's file has damping at its joints and no dry friction, and that is the friction to begin with; "
            "where joints rub, --law viscous,coulomb is the better start."
        )
