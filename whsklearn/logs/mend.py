"""Repairs of the signals of a log: missing values, wrapped angles, held phases."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from whsklearn.logs.check import lattice, runs
from whsklearn.logs.errors import LogError
from whsklearn.logs.findings import Array, Finding
from whsklearn.logs.units import turn_of

HUGE = 1e100  # no sensor gives larger values, and their squares overflow
TINY = 1e-100  # a signal that never exceeds this is zero or in a wrong unit
NONE = (999.0, 9999.0, 99999.0, 999999.0)  # what loggers write for a missing value
APART = 0.1  # as a share of such a value; all others are below it
HELD_SECONDS, HELD_ROWS = 1.0, 100  # time for which drive and position do not change in any digit: not controlled
AGAIN = 50  # rows; a repetition of fewer may be chance where signals are coarse
LIVELY = 0.5  # share of rows in which the drive changes while the loop is closed
FEW_COUNTS = 50.0  # a range of fewer whole numbers is that of a mode or a switch
MOST_JUMPS = 10  # of an encoder in one log, and one in 500 rows; more are no faults of it but its way of reading
LATEST = 50  # rows after which a motion still answers a drive: a delay
ANSWERED = 2.0  # times any other change of the speed; a drive `OUTSIDE` times any other makes ten times of it
OUTSIDE = 10.0  # a jump leaves the steps around it by this multiple of any change between two others
RESOLVED = 20.0  # steps across the range; a motion in fewer of them may jump by itself
FROZEN_STEPS = 3  # steps of zero in a row, and steps on either side that tell that the axis was moving
EVEN_SPEED = 0.5  # change among those, as a share of the smallest; from rest they are 1, 3, 5 or 3, 5, 7
CAUGHT_UP = 2.5  # the step after the freeze is that of all its samples, 4 at constant speed
# Within a stamp that k rows share, an axis moves by a k-th of what it moves from one stamp to the next, and noise alone
# makes both alike; rows of different axes are apart by more.
JUMPS = 3.0
MOSTLY = 0.9  # share of the stamps with the usual number of rows; the others lost one
OF_DECIMALS = 1e-3  # by which a power of ten may be missed, as a logarithm: a grid is known to four digits
BRAKED = 0.5  # s; an axis that stops sooner after its drive fell was braked, one that stops later coasted


def missing_rows(signals: dict[str, Array], columns: dict[str, str]) -> tuple[NDArray[np.bool_], Finding | None]:
    """Rows without a usable number in some column, and the finding that reports them.

    Raises LogError if fewer than three rows are left, or if all values of a signal are implausibly large.
    """
    each = {role: ~(np.abs(values) < HUGE) | no_value(values) for role, values in signals.items()}
    alone = np.zeros(0, dtype=bool)
    if motion := next((role for role in ("position", "velocity") if role in signals and "drive" in signals), ""):
        drive = np.where(each["drive"], np.nan, signals["drive"])
        alone = lone_readings(drive, signals[motion], 2 if motion == "position" else 1)
        each["drive"] |= alone
    bad = np.any(list(each.values()), axis=0)
    if bad.size - bad.sum() < 3:
        worst = max(each, key=lambda role: int(each[role].sum()))
        raise LogError(
            f"Only {bad.size - bad.sum()} rows have a number in every column; a log needs at least 3. Column "
            f"{columns[worst]!r} has none in {each[worst].sum()} of {bad.size} rows: name another, or repair it."
        )
    if not bad.any():
        return bad, None
    rows = np.flatnonzero(bad)
    role = next(r for r, missing in each.items() if missing[rows[0]])
    value = signals[role][rows[0]]
    held = "no number" if math.isnan(value) else f"{value:.3g}"
    if role == "drive" and alone[rows[0]]:
        held += ", which the motion does not answer"
    text = (
        f"Column {columns[role]!r} has no value at row {rows[0]} ({held}; {rows.size} such rows in all); these "
        "rows were left out and count as lost samples."
    )
    return bad, Finding("LOG010", "warning", text, rows, rows.size / bad.size)


def no_value(values: Array) -> NDArray[np.bool_]:
    """Samples such as 999 or -9999 that are far from all others: a sensor's code for a missing value.

    >>> no_value(np.array([0.1, -9999.0, 0.2, 0.3])).tolist(), no_value(np.array([900.0, 999.0])).any()
    ([False, True, False, False], np.False_)
    """
    size = np.abs(values)
    top = float(np.max(size, where=np.isfinite(values), initial=0.0))
    if top not in NONE:
        return np.zeros(values.size, dtype=bool)
    there = size == top
    rest = size[~there & np.isfinite(values)]
    return there if rest.size > there.sum() and rest.max() < APART * top else np.zeros(values.size, dtype=bool)


def lone_readings(drive: Array, motion: Array, order: int) -> NDArray[np.bool_]:
    """Single readings of the drive far beyond all others that the motion does not answer: a glitch of the bus.

    A drive that acted so for one sample would have changed the speed as no other sample does. ``motion``: the position,
    with an ``order`` of 2, or the velocity, with 1.

    >>> t = np.arange(1000) / 500
    >>> drive = np.sin(3 * t)
    >>> drive[600] = 1e6
    >>> np.flatnonzero(lone_readings(drive, -np.sin(3 * t), 2))
    array([600])
    """
    out = np.zeros(drive.size, dtype=bool)
    most = MOST_JUMPS + drive.size // 500
    if drive.size < 3 * MOST_JUMPS:
        return out
    size = np.where(np.isfinite(drive), np.abs(drive), 0.0)
    first = np.argpartition(size, -most - 1)[-most - 1 :]
    first = first[np.argsort(size[first])]  # the largest last
    beyond = np.flatnonzero((size[first[1:]] > OUTSIDE * size[first[:-1]]) & (size[first[:-1]] > 0.0))
    if not beyond.size:
        return out
    out[first[beyond[0] + 1 :]] = True
    pair = out[1:] & out[:-1]
    out[1:] &= ~pair
    out[:-1] &= ~pair
    bend = np.abs(np.diff(np.where(np.isfinite(motion), motion, 0.0), order))
    near = np.flatnonzero(out)[:, None] + np.arange(-2, LATEST)
    near = np.clip(near, 0, bend.size - 1)
    elsewhere = bend.copy()
    elsewhere[near] = 0.0
    answered = bend[near].max(axis=1) > ANSWERED * elsewhere.max()
    out[np.flatnonzero(out)[answered]] = False
    return out


def too_small(role: str, column: str, values: Array) -> None:
    """Refuse a signal that is almost zero throughout.

    Raises LogError if its largest value is below `TINY` and not zero.
    """
    top = float(np.max(np.abs(values))) if values.size else 0.0
    if 0.0 < top < TINY:
        raise LogError(
            f"Column {column!r} for {role} never exceeds {top:.3g}, too little for any unit; check the export."
        )


def counted(values: Array) -> bool:
    """Whether a motion was logged in the counts of its encoder: whole numbers, each a small part of the range.

    >>> counted(np.round(2000 * np.sin(np.arange(500.0)))), counted(np.sin(np.arange(500.0)))
    (True, False)
    """
    there = values[np.isfinite(values)]
    return there.size > 0 and bool(np.ptp(there) > FEW_COUNTS and np.all(there == np.round(there)))


def turns_of(unit: str) -> list[float]:
    """The turns at which an angle of this unit may be wrapped, in that unit.

    >>> turns_of("deg"), turns_of("m"), turns_of("counts")[0]
    ([360.0], [], 256.0)
    """
    known = turn_of(unit)
    turns = [known] if known else []
    if unit.startswith("counts") or unit == "as logged":  # whatever the counts of a turn, a register overflows
        turns += [2.0**k for k in range(8, 33)]
    if unit == "as logged":
        turns += [2 * math.pi, 360.0]
    return turns


def turn_in(values: Array, unit: str) -> float | None:
    """The turn at which an angle is wrapped, in its own unit; None if it is not wrapped.

    A wrapped angle stays within one turn, and its jumps are nearly a whole turn.

    >>> angle = np.linspace(0.0, 20.0, 500)
    >>> round(turn_in(np.mod(angle, 2 * np.pi), "as logged"), 6), turn_in(angle, "rad")
    (6.283185, None)
    """
    low, span = float(values.min()), float(np.ptp(values))
    leaps = np.abs(np.diff(values))
    for turn in turns_of(unit):
        tick = 1e-6 * turn if turn < 256 else 1.0
        inside = span <= turn + tick and (abs(low + turn / 2) < 0.51 * turn - 0.01 * turn or low > -tick)
        wraps = leaps > 0.5 * turn
        if inside and wraps.any() and span > 0.9 * turn:
            rest = float(np.quantile(leaps[~wraps], 0.999)) if (~wraps).any() else 0.0
            short = turn - leaps[wraps]  # true motion of the axis in that sample
            if np.median(short) <= 4.0 * rest and np.median(short) < 0.25 * turn:
                return turn
    return None


def unwrap(role: str, values: Array, turn: float) -> tuple[Array, Finding]:
    """The angle without its jumps, continued from the first value."""
    out = np.unwrap(values, period=turn)
    leaps = np.flatnonzero(np.abs(np.diff(values)) > 0.5 * turn) + 1
    text = (
        f"The {role} jumps by a turn of {turn:.6g} at {leaps.size} rows, the first is row {leaps[0]}; it was unwrapped."
    )
    return out, Finding("LOG012", "info", text, leaps, turn)


def axes_in(time: Array, motion: Array) -> int:
    """How many axes share the rows of a table: rows with one time stamp whose motions are apart; 1 for one axis.

    ``time``, ``motion`` (n,): stamps as logged, and position or velocity.

    >>> t = np.repeat(np.arange(50.0), 2)
    >>> axes_in(t, np.sin(np.arange(100) / 20)), axes_in(t, np.sin(t / 10) + np.tile([0.0, 2.0], 50))
    (1, 2)
    """
    first = np.flatnonzero(np.r_[True, np.diff(time) != 0, True])
    counts = np.diff(first)
    n = int(np.median(counts)) if counts.size > 2 else 1  # of a clock that stood still, other checks tell
    if n < 2 or np.mean(counts == n) < MOSTLY:
        return 1
    within = np.abs(np.diff(motion))[np.diff(time) == 0]
    onward = np.abs(motion[n:] - motion[:-n])
    return n if np.median(within) > JUMPS * np.median(onward) else 1


def again(signals: dict[str, Array], segment: NDArray[np.int64]) -> tuple[NDArray[np.bool_], Finding | None]:
    """Rows that repeat the log from its first row on, in every digit: the same run, saved or joined twice.

    Its samples would count twice, and those held out would be those of the fit.  It is looked for where the clock
    restarts and at the largest steps of the signals: a simulated motion without noise repeats itself too, but goes on
    without a step, and is kept.

    >>> path = np.linspace(0.0, 1.0, 300) ** 2
    >>> out, _ = again({"position": np.r_[path, path]}, np.zeros(600, dtype=np.int64))
    >>> out[:300].any(), out[300:].all()
    (np.False_, np.True_)
    """
    n = len(segment)
    out, begins = np.zeros(n, dtype=bool), []
    leaps = [np.argsort(np.abs(np.diff(v)))[-MOST_JUMPS:] for v in signals.values()]
    for row in np.unique(np.r_[np.flatnonzero(np.diff(segment)), *leaps]) + 1:
        length = min(row, n - row)
        joined = segment[row] != segment[row - 1] or any(
            abs(v[row] - v[row - 1]) > 2.0 * np.abs(np.diff(v[:row])).max() for v in signals.values() if row > 1
        )
        same = joined and all(np.array_equal(v[row : row + length], v[:length]) for v in signals.values())
        if same and length >= AGAIN and not out[row] and any(np.ptp(v[:length]) > 0 for v in signals.values()):
            out[row : row + length] = True
            begins.append(row)
    if not begins:
        return out, None
    text = (
        f"From row {begins[0]} on, {out.sum()} rows repeat the log from its first row in every digit: it has the same "
        "run more than once. It counts once."
    )
    return out, Finding("LOG006", "warning", text, begins, float(out.sum()))


def jumps_in(time: Array, position: Array, segment: NDArray[np.int64]) -> Array | None:
    """Steps that an encoder made and the motion cannot have made: one for each row, 0 where there is none.

    A motion has inertia, so each step lies near or between those around it, also in an impact. A reset of the encoder
    leaves them far, in a few rows only. None if there is no such step.

    >>> t = np.arange(1000) / 500
    >>> angle = np.sin(3 * t)
    >>> angle[600:] -= angle[600]
    >>> jump = jumps_in(t, angle, np.zeros(1000, dtype=np.int64))
    >>> np.flatnonzero(jump), round(float(jump[600]), 2)
    (array([600]), 0.44)
    """
    if position.size < 3 * MOST_JUMPS:
        return None
    steps, clock = np.diff(position), np.diff(time)
    sound = (np.diff(segment) == 0) & (clock < 1.5 * np.median(clock))  # a hole is no step of one sample
    both = sound[1:] & sound[:-1]
    excess = np.zeros(steps.size)
    low, high = np.minimum(steps[:-2], steps[2:]), np.maximum(steps[:-2], steps[2:])
    middle = steps[1:-1]
    excess[1:-1] = np.maximum(middle - high, low - middle).clip(0.0) * (both[:-1] & both[1:])
    most_of_all = MOST_JUMPS + steps.size // 500
    found = np.sort(np.argpartition(excess, -most_of_all)[-most_of_all:])
    found = found[excess[found] > 0.0]
    while found.size:  # what is left makes the others smaller, so the set only shrinks
        left = sound.copy()
        left[found] = False
        usual = np.flatnonzero(left)
        made = steps.copy()
        made[found] = np.interp(found, usual, steps[usual])  # a wrong reading of one sample makes two jumps in turn
        most = np.abs(np.diff(made))[both].max()
        if excess[found].min() > OUTSIDE * most:
            break
        found = found[excess[found] > OUTSIDE * most]
    if found.size == 0 or np.ptp(np.cumsum(made)) <= RESOLVED * np.abs(made[sound]).max():
        return None
    out = np.zeros(position.size)
    out[found + 1] = steps[found] - made[found]
    return out


def frozen(position: Array, segment: NDArray[np.int64]) -> tuple[NDArray[np.bool_], Finding | None]:
    """Rows in which a moving axis is logged at one place and then catches up.

    A bus that loses telegrams or a task that overruns repeats the last reading, or gives none (0). Inertia lets no axis
    stop from full speed in one sample and go on at full speed in another. The first reading is sound unless the
    position jumped to it.

    >>> angle = 0.1 * np.arange(40.0)
    >>> angle[20:26] = angle[20]
    >>> np.flatnonzero(frozen(angle, np.zeros(40, dtype=np.int64))[0])
    array([21, 22, 23, 24, 25])
    """
    step = np.diff(position)
    first, last = runs((step == 0) & (np.diff(segment) == 0))  # steps first..last - 1 are zero
    k = FROZEN_STEPS
    inside = (last - first >= k) & (first > k) & (last + k < step.size)
    out = np.zeros(position.size, dtype=bool)
    begins = []
    for a, b in zip(first[inside].tolist(), last[inside].tolist(), strict=True):
        if np.ptp(segment[a - k - 1 : b + k + 2]):
            continue
        jumped = not evenly_moving(step[a - k : a])
        before, after = step[a - k - jumped : a - jumped], step[b + 1 : b + 1 + k]
        most = CAUGHT_UP * max(np.abs(before).max(), np.abs(after).max())
        leap = min(abs(step[b]), abs(step[a - 1]) if jumped else np.inf)
        if evenly_moving(before) and evenly_moving(after) and leap > most:
            out[(a if jumped else a + 1) : b + 1] = True
            begins.append(a if jumped else a + 1)
    if not begins:
        return out, None
    text = (
        f"At row {begins[0]} a moving axis is logged at one place for several rows and then catches up ({len(begins)} "
        f"time(s)): the log repeats an old reading. These {out.sum()} rows were left out and count as lost samples."
    )
    return out, Finding("LOG024", "warning", text, begins, float(out.sum()))


def evenly_moving(step: Array) -> bool:
    """Whether steps are those of a motion whose speed hardly changes."""
    return bool(np.ptp(step) <= EVEN_SPEED * np.abs(step).min() and np.abs(step).min() > 0)


def without_jumps(position: Array, jump: Array) -> tuple[Array, Finding]:
    """The position without the steps of its encoder, continued from the first value."""
    rows = np.flatnonzero(jump)
    text = (
        f"The position jumps by {jump[rows[0]]:.4g} at row {rows[0]} ({rows.size} such row(s) in all), which the "
        "motion cannot have made: the encoder was reset or misread. The position was continued without the jump."
    )
    return position - np.cumsum(jump), Finding("LOG023", "warning", text, rows, float(jump[rows[0]]))


def signed(drive: Array) -> tuple[Array, Finding | None]:
    """Restore the sign of integers of 8, 16 or 32 bits whose negative values were logged as large positive ones.

    Two's complement is recognised by values at both ends of the range and none in its middle half.

    >>> signed(np.array([3.0, 1.0, 65535.0, 65530.0, 2.0]))[0]
    array([ 3.,  1., -1., -6.,  2.])
    """
    if drive.size == 0 or drive.min() < 0 or not np.all(drive == np.round(drive)):
        return drive, None
    for bits in (8, 16, 32):
        whole = 2.0**bits
        if 0.75 * whole < drive.max() < whole:
            negative = drive > 0.5 * whole
            middle = (drive > 0.25 * whole) & (drive < 0.75 * whole)
            if middle.any() or negative.all():
                return drive, None
            text = f"The drive has {bits}-bit numbers above {whole / 2:.0f}; {whole:.0f} was subtracted from them."
            found = Finding("LOG021", "info", text, np.flatnonzero(negative), whole)
            return np.where(negative, drive - whole, drive), found
    return drive, None


def speed_from_counts(speed: Array) -> Array | None:
    """The speed to all digits if it is counts over a sample; None if it is not.

    Such a speed lies on a grid, and not on that of the file's decimals.  Each value is the mean over the sample before
    it, and their sum is the count of the encoder.  The trapezoidal rule would average two counts, and the encoder's
    step would look a quarter as large.

    >>> counts = np.floor(400.0 * np.sin(0.05 * np.arange(400.0)))
    >>> speed = np.diff(counts, prepend=0.0) * 60.0 / 880 / 0.02  # rpm of an encoder of 880 counts at 50 Hz
    >>> exact = speed_from_counts(np.round(speed, 2))
    >>> bool(np.abs(exact - speed).max() < 0.01), speed_from_counts(np.round(speed)), speed_from_counts(np.sin(speed))
    (True, None, None)
    >>> whole = np.round(60.0 * np.sin(0.05 * np.arange(400.0)))  # a smooth speed in whole rpm: rounded, not counted
    >>> lattice(whole), speed_from_counts(whole)
    (1.0, None)
    """
    grid = lattice(speed)
    if not grid or abs(math.log10(grid) - round(math.log10(grid))) < OF_DECIMALS:
        return None
    return np.asarray(grid * np.round(speed / grid))


def held(time: Array, drive: Array, position: Array) -> tuple[NDArray[np.bool_], Finding | None]:
    """Rows in which the axis was not controlled: an emergency stop, a brake, a disabled drive.

    There drive and position do not change in any digit for a second or more, in a log whose drive otherwise changes
    from row to row. A deceleration of less than half a second before such a phase was caused by the brake and is
    removed too; a longer one is a coast that shows friction, and is kept. A drive at its limit with a stalled axis is
    controlled, and is kept too.
    """
    n = drive.size
    limit = (drive != 0) & ((drive == drive.max()) | (drive == drive.min()))
    changes = np.diff(drive) != 0
    constant = np.r_[False, ~changes & (np.diff(position) == 0)]
    period = (time[-1] - time[0]) / max(1, n - 1)
    long = [
        (int(a), int(b))
        for a, b in zip(*runs(constant), strict=True)
        if b - a >= HELD_ROWS and (b - a) * period >= HELD_SECONDS and not limit[a]
    ]
    out = np.zeros(n, dtype=bool)
    for a, b in long:
        out[a:b] = True
    live = ~out[1:]
    if not long or live.sum() < 10 or changes[live].mean() < LIVELY:
        return np.zeros(n, dtype=bool), None
    for a, _ in long:
        begin = a
        while begin > 0 and not changes[begin - 1]:
            begin -= 1
        if (a - begin) * period < BRAKED:
            out[begin:a] = True
    seconds = out.sum() * period
    text = (
        f"Drive and position do not change at all for {seconds:.3g} s, from row {long[0][0]} on ({len(long)} "
        "phase(s)): an emergency stop, a brake or a disabled drive. Those rows were removed."
    )
    return out, Finding("LOG014", "warning", text, np.flatnonzero(out), float(seconds))
