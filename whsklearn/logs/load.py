"""`load_log`: the one reader of logs, from a file of any format to even samples with units and notes."""

from __future__ import annotations

import os
import warnings
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from sklearn.utils import Bunch

from whsklearn.logs import mend
from whsklearn.logs.check import check_log
from whsklearn.logs.current import AMPERES, is_current, torque_constant_of
from whsklearn.logs.errors import ColumnError, LogError, LogWarning
from whsklearn.logs.findings import Array, Finding, LogReport
from whsklearn.logs.formats import open_source
from whsklearn.logs.heads import drive_unit
from whsklearn.logs.roles import guess
from whsklearn.logs.source import Column, Source
from whsklearn.logs.timebase import LONG_GAP, Even, bridged, even, in_order, to_seconds
from whsklearn.logs.units import (
    OTHER_NAMES,
    ROLES,
    UNKNOWN,
    UNSTATED,
    factor_of,
    integral_of,
    is_known,
    stated,
    time_unit_of,
    unit_in,
    written_unit,
)

# Findings that say what was done to the samples, and are warned of.
_MENDED = {f"LOG{number:03}" for number in (1, 2, 3, 4, 6, 10, 11, 13, 14, 18, 23, 24)}
FEWEST = 3  # rows
_STAMPS = {"LOG001", "LOG002", "LOG003", "LOG004", "LOG010"}


class Log(Bunch):
    """A log as it was read, with drive and position in both orders that models take.

    Attributes
    ----------
    X, y : ndarray of shape (n, 1), (n,)
        Drive and position, for models that simulate, such as `WienerHammersteinLags`.
    position, drive : ndarray of shape (n, 1), (n,)
        The same in reverse order, for inverse dynamics, as in
        ``RLSRegressor(InverseDynamicsLags(sample_rate=log.sample_rate)).fit(log.position, log.drive)``.

    Examples
    --------
    >>> import numpy as np
    >>> log = Log(X=np.array([[1.0], [2.0]]), y=np.array([0.1, 0.3]))
    >>> log.position.shape, log.drive
    ((2, 1), array([1., 2.]))
    """

    @property
    def position(self) -> Array:
        """The output as a column."""
        return np.asarray(self.y)[:, None]

    @property
    def drive(self) -> Array:
        """The input as a vector."""
        return np.asarray(self.X)[:, 0]


def load_log(
    path: str | os.PathLike[str] | Source,
    *,
    units: Mapping[str, str] | None = None,
    sample_rate: float | None = None,
    torque_constant: str | float | tuple[float, float] | None = None,
    resample: bool = True,
    return_X_y: bool = False,
    **columns: str | int | None,
) -> Any:
    """Read the log of an axis, repair what can be repaired, and report it.

    Parameters
    ----------
    path : str or path
        A text table of any dialect (comma, semicolon, tab or blanks, decimal comma, comments, with or without a header
        line), JSON or JSON lines, each also packed (gz, bz2, xz, zip), Parquet, MATLAB, HDF5, NumPy, TDMS, MDF4 or
        MCAP, a ROS bag or a LeRobot folder. All but text, JSON, MATLAB (before 7.3) and NumPy need an extra, which the
        error names. Also what `open_source` returned.
    units : dict of str to str, optional
        Units by role, if the names of the columns do not end in one (``time_s``, ``torque_nm``, ``position_rad``,
        ``angle [deg]``). Signals other than time are not converted. ``counts/4096`` gives the counts per turn.
    sample_rate : float, optional
        In Hz, if there is no time column. With neither, time counts samples.
    torque_constant : float, pair of float or str, optional
        Nm (or N) per ampere, if the drive is a current: ``0.12``, or ``"0.12+-0.01"`` with its standard deviation,
        which is passed on in ``drive_error``.
    resample : bool, default=True
        Repair rows without a number and stamps that are uneven, repeated or out of order, and split the log into
        segments at long holes; False refuses such a log and names the row.
    return_X_y : bool, default=False
        Return only the drive as X (n, 1) and the position as y (n,); refused if the log has several segments.
    **columns : str or int
        Columns, named or counted from 0; if none is given, recognised by their names, as the commands do. ``time``
        (numbers, ticks since 1970, or dates; without it rows are samples at `sample_rate`), ``drive`` or ``input``
        (torque, force, current, voltage, u), ``position`` or ``output`` (the response, y), ``reference``, ``command``
        (of a position servo, if no drive is logged) and ``velocity`` (if no position is logged; it is integrated).

    Returns
    -------
    Log
        ``X`` (n, 1), ``y`` (n,), the drive and the position; ``position`` (n, 1) and ``drive`` (n,), the same in the
        order of inverse dynamics; ``time`` (n,) in s from 0, ``reference`` and ``command`` (n,) or None, ``groups``
        (n,) int, the segment of each row, ``sample_rate`` in Hz, ``units`` and ``columns`` by role, ``frame`` (the
        signals by role), ``drive_error`` (standard deviation of the torque constant as a share of it), ``report``
        (`LogReport`), ``notes`` (its sentences), ``name``.

    Raises
    ------
    LogError
        A `ValueError`: the file is empty, damaged or not a table; a column is missing or not numeric; the sampling is
        irregular beyond 1 % (the row is named) and ``resample`` is False.
    ImportError
        If the format needs a package that is not installed.
    FileNotFoundError
        If there is no such file.

    Warns
    -----
    LogWarning
        One message with a sentence or two per repair.

    Examples
    --------
    >>> import numpy as np, pandas as pd, tempfile, pathlib
    >>> folder = tempfile.TemporaryDirectory()
    >>> file = pathlib.Path(folder.name) / "axis.csv"
    >>> t = np.arange(500) / 100
    >>> table = {"time_s": t, "torque_nm": np.cos(t), "position_rad": np.round(np.sin(t), 3)}
    >>> pd.DataFrame(table).to_csv(file, index=False)
    >>> log = load_log(file, time="time_s", drive="torque_nm", position="position_rad")
    >>> log.X.shape, round(log.sample_rate, 6), log.units["drive"], log.report.codes
    ((500, 1), 100.0, 'Nm', ('LOG007',))
    >>> folder.cleanup()
    """
    source = path if isinstance(path, Source) else open_source(path)
    asked = _by_role(columns) if any(c is not None for c in columns.values()) else _guessed(source, sample_rate)
    given = stated(units or {})
    names = {r: source.resolve(c, r) for r, c in asked.items()}
    if "drive" in names and names["drive"] == names.get("position"):
        raise ColumnError(
            f"Column {names['drive']!r} of {source.name} was given for both drive and position; give two columns."
        )
    record = _read(source, names, given, sample_rate)
    constant, deviation = (None, 0.0) if torque_constant is None else torque_constant_of(torque_constant)
    _as_torque(record, constant, deviation)
    if not resample:
        _refuse(record)
    log = _mended(record)
    log.drive_error = deviation / constant if constant is not None else 0.0
    if return_X_y and log.groups[-1] > 0:
        raise LogError(
            f"{source.name} falls into {log.groups[-1] + 1} segments, and X and y alone do not tell where one ends; "
            "leave return_X_y out and pass groups."
        )
    told = [f for f in log.report.findings if f.severity == "warning" and f.code in _MENDED]
    if told:
        text = " ".join(f"{f.title}. {f.explanation}" for f in told)
        warnings.warn(f"{source.name}: {text}", LogWarning, stacklevel=2)
    return (log.X, log.y) if return_X_y else log


def _guessed(source: Source, sample_rate: float | None) -> dict[str, str | int]:
    """Time, drive and position (or velocity) by the names of the columns.

    Raises ColumnError, with the columns there are, if one is not there or several are.
    """
    roles: dict[str, str | int | None] = {"drive": guess(source, "drive"), "position": guess(source, "position")}
    if roles["position"] is None:
        roles["velocity"] = guess(source, "velocity")
    if not source.clocked and sample_rate is None:
        roles["time"] = guess(source, "time")
    missing = [r for r in ("drive", "position") if roles[r] is None and not (r == "position" and roles["velocity"])]
    if missing:
        raise ColumnError(
            f"{source.name} has no column that is clearly the {missing[0]}; it has: {', '.join(source.names[:30])}. "
            f"Name it: {missing[0]}=."
        )
    return {r: roles[r] for r in ROLES if roles.get(r) is not None}  # type: ignore[misc]


def _by_role(columns: Mapping[str, str | int | None]) -> dict[str, str | int]:
    """The columns that were given, by role."""
    if unknown := columns.keys() - {*ROLES, *OTHER_NAMES}:
        raise TypeError(f"load_log got an unexpected argument {min(unknown)!r}; columns are {', '.join(ROLES)}.")
    given = {name: c for name, c in columns.items() if c is not None}
    for other, role, instead in (("input", "drive", "command"), ("output", "position", "velocity")):
        both, neither = {other, role} <= given.keys(), given.keys().isdisjoint({other, role, instead})
        if both or neither:
            got = "both" if both else "neither"
            raise ValueError(f"load_log got {got} of {other} and {role}, two names for one column; give one of them.")
    by_role = {OTHER_NAMES.get(name, name): c for name, c in given.items()}
    return {role: by_role[role] for role in ROLES if role in by_role}


@dataclass
class _Record:
    """A log on its way to an even grid: signals (n,) by role on their clock, in segments, and what was found so far."""

    name: str
    time: Array
    signals: dict[str, Array]
    columns: dict[str, str]
    units: dict[str, str]
    found: list[Finding]
    segment: NDArray[np.int64]

    def keep(self, rows: NDArray[np.intp]) -> None:
        """Keep these rows, in this order."""
        self.time, self.segment = self.time[rows], self.segment[rows]
        self.signals = {k: v[rows] for k, v in self.signals.items()}

    def leave_out(self, out: NDArray[np.bool_], told: Finding | None) -> None:
        """Leave rows out, if a finding says why; a new segment begins after each long run of them."""
        if told is None:
            return
        rows = np.flatnonzero(~out)
        self.keep(rows)
        segment = self.segment + np.cumsum(np.diff(rows, prepend=rows[0]) >= LONG_GAP)
        self.segment = np.unique(segment, return_inverse=True)[1].astype(np.int64)
        self.found.append(told)


def _as_torque(log: _Record, constant: float | None, deviation: float) -> None:
    """Convert a current to a torque, and report a drive that remains a current."""
    if "drive" not in log.signals:
        return
    column, unit = log.columns["drive"], log.units["drive"]
    if constant is not None:
        factor, si = factor_of(unit)
        if si not in (*AMPERES, UNKNOWN):
            raise ColumnError(
                f"A torque constant was given, and the drive, column {column!r}, is in {unit}; leave the constant out, "
                "or name the column of the current."
            )
        log.signals["drive"] = log.signals["drive"] * (constant * factor)
        log.units["drive"], needless = "Nm", repr(column)
        text = f"Column {column!r} was turned into a torque by {constant:g} Nm/A"
        text += f" with a standard deviation of {deviation:g}" if deviation else ""
        text += ", its numbers taken as A; --unit drive=UNIT states another unit." if unit == UNKNOWN else "."
    elif is_current(column, unit):
        log.units["drive"], needless = "A" if unit == UNKNOWN else unit, f"column {column!r}"
        text = f"Column {column!r} is a current: sizes are in its unit, not in Nm, unless a torque constant is given."
        text += " It states no unit and is taken to be in A; --unit drive=UNIT states another." * (unit == UNKNOWN)
    else:
        return
    log.found[:] = [f for f in log.found if f.code != "LOG019" or needless not in f.explanation]
    log.found.append(Finding("LOG022", "info", text))


def _read(source: Source, columns: dict[str, str], given: Mapping[str, str], sample_rate: float | None) -> _Record:
    """The signals of a source as floats of one length, time in s."""
    read = source.fetch(list(dict.fromkeys(columns.values())))
    units = {r: _unit(r, c, read[c], source, given) for r, c in columns.items()}
    found = [Finding("LOG017", "info", text) for text in source.notes]
    signals = {r: _floats(read[c], c, source.name) for r, c in columns.items() if r != "time"}
    doubtful = "time" in columns and units["time"] == UNKNOWN and written_unit(columns["time"]) != ""
    if "time" in columns:
        if units["time"] == "counts":
            raise ColumnError(
                f"Column {columns['time']!r} of {source.name} counts ticks of unknown rate; add --unit "
                "time=ticks/8000 for ticks of 8 kHz (an ODrive's), or leave --time out and give --rate."
            )
        clock, more = to_seconds(read[columns["time"]].values, units["time"], columns["time"])
        found += more
        values, stamps = _one_clock(columns, _in_turn(clock, signals), found)
        clock = clock if stamps is None else stamps
        units["time"] = "s"
    else:
        values, stamps = _one_clock(columns, signals, found)
        rate = sample_rate or source.sample_rate
        clock = np.arange(len(next(iter(values.values())))) / (rate or 1.0) if stamps is None else stamps - stamps[:1]
        units["time"] = "samples" if stamps is None and not rate else "s"
    if units["time"] == "samples":
        told = (
            "Neither a time column nor a sample rate is given: time counts samples, and rates are per sample. --time "
            "or time= names the column, --rate or sample_rate= gives the rate in Hz."
        )
        found.append(Finding("LOG025", "info", told))
    lengths = {r: len(v) for r, v in values.items()} | {"time": len(clock)}
    if len(set(lengths.values())) > 1:
        told = ", ".join(f"{r} {n}" for r, n in lengths.items())
        raise LogError(f"The columns of {source.name} differ in length ({told} rows); give columns of one table.")
    if len(clock) < FEWEST:
        raise LogError(f"{source.name} has {len(clock)} rows; a log needs at least {FEWEST}.")
    if doubtful:
        found.append(Finding("LOG019", "info", _not_known("time", columns["time"])))
    for role, signal in values.items():
        mend.too_small(role, columns[role], signal)
        if role == "position" and units[role] == UNKNOWN and mend.counted(signal):
            units[role] = "counts"
            told = f"Column {columns[role]!r} has whole numbers only; it is taken to be in counts. --unit {role}=UNIT "
            found.append(Finding("LOG019", "info", told + "states another unit, or the counts of a turn: counts/4096."))
        elif told := _of_unit(role, columns[role], units):
            found.append(Finding("LOG019", "info", told))
    found += _restated(source, columns, given)
    return _Record(source.name, clock, values, columns, units, found, np.zeros(len(clock), dtype=np.int64))


def _not_known(role: str, column: str) -> str:
    return f"The unit of {role}, column {column!r}, is not known; --unit {role}=UNIT states it."


def _of_unit(role: str, column: str, units: dict[str, str]) -> str:
    """What is doubtful in the unit of a signal, empty if nothing is; the drive of an ODrive gets its own."""
    unit = units[role]
    if role == "position" and unit == "counts":
        told = f"Column {column!r} is in counts, and so are the results; --unit {role}=counts/4096 states the counts "
        return told + "of a turn and gives rad."
    if unit == UNKNOWN and (known := drive_unit(column)):
        units[role] = known
        told = f"Column {column!r} is taken to be in {known}, as an ODrive logs it (before firmware 0.5, in counts). "
        return told + f"--unit {role}=UNIT states another unit."
    if unit == UNKNOWN:
        return _not_known(role, column)
    if is_known(unit):
        return ""
    told = f"Column {column!r} states the unit {unit!r}, which is not known: results are in it, not in "
    return told + f"SI. --unit {role}=UNIT states another unit."


def _restated(source: Source, columns: Mapping[str, str], given: Mapping[str, str]) -> list[Finding]:
    """Units that were given where the file states others."""
    found = []
    for role in filter(given.__contains__, columns):  # in their order, which a set has not
        own = unit_in(source.units.get(columns[role], ""), columns[role], role)
        if is_known(own) and own != "counts" and factor_of(own) != factor_of(given[role]):
            told = f"Column {columns[role]!r} states {own}, and {given[role]} was given for {role}: that is used."
            found.append(Finding("LOG017", "info", told))
    return found


def _in_turn(clock: Array, signals: dict[str, Column]) -> dict[str, Column]:
    """Signals on the clock of a table, with their own stamps if each has rows of its own, as PlotJuggler writes."""
    there = [np.isfinite(c.values) & np.isfinite(clock) for c in signals.values() if len(c.values) == len(clock)]
    if 2 <= len(signals) == len(there):
        fewest = min(int(t.sum()) for t in there)
        if fewest >= FEWEST and 2 * np.logical_and.reduce(there).sum() < fewest:
            return {r: Column(c.values[t], clock[t]) for (r, c), t in zip(signals.items(), there, strict=True)}
    return {r: Column(c.values) for r, c in signals.items()}


def _one_clock(
    columns: Mapping[str, str], signals: dict[str, Column], found: list[Finding]
) -> tuple[dict[str, Array], Array | None]:
    """Interpolate signals with their own stamps at the stamps of the position."""
    lead = "position" if "position" in signals else "velocity"
    if (base := signals[lead].stamps) is None:
        return {r: c.values for r, c in signals.items()}, None
    clocks = [c.stamps for c in signals.values() if c.stamps is not None]
    common = (base >= max(c.min() for c in clocks)) & (base <= min(c.max() for c in clocks)) if base.size else base > 0
    base, out = base[common], {}
    for role, (values, own, _) in signals.items():
        if own is None or (own.shape == common.shape and np.array_equal(own[common], base)):
            out[role] = values if own is None else values[common]
            continue
        column, other = columns[role], columns[lead]
        if own.size < FEWEST or base.size < FEWEST:
            raise LogError(
                f"Column {column!r} for {role} has no samples in the time span of {other!r}; choose signals of one run."
            )
        order = np.argsort(own, kind="stable")
        out[role] = np.interp(base, own[order], values[order])
        found.append(Finding("LOG011", "info", f"{column!r} was interpolated linearly at the stamps of {other!r}."))
    return out, base


def _unit(role: str, column: str, read: Column, source: Source, given: Mapping[str, str]) -> str:
    """The unit from the call, the file, or the end of the column's name."""
    if role in given:
        return given[role]
    unit = unit_in(source.units.get(column, "") or read.unit or "", column, role)
    return time_unit_of(column, unit) if role == "time" else unit


def _floats(read: Column, column: str, name: str) -> Column:
    """A column as floats; text is refused with its row and value."""
    import pandas as pd

    if read.values.dtype.kind in "fiub":
        return read._replace(values=read.values.astype(float))
    series = pd.Series(read.values)
    numeric = pd.to_numeric(series, errors="coerce")
    bad = np.flatnonzero((numeric.isna() & series.notna()).to_numpy())
    if bad.size:
        raise LogError(
            f"Column {column!r} of {name} is not numeric: row {bad[0]} holds {str(series.iloc[bad[0]])[:40]!r}; "
            "give a column of numbers, or cut that row."
        )
    return read._replace(values=numeric.to_numpy(dtype=float))


def _refuse(log: _Record) -> None:
    """Refuse a log that needs repairs."""
    _, hole = mend.missing_rows({"time": log.time, **log.signals}, log.columns)
    if hole is not None:
        raise LogError(f"{log.name}: {hole.explanation.partition(');')[0]}); fill or drop them, or pass resample=True.")
    worst = next((f for f in check_log(log.time, log.signals).findings if f.code in _STAMPS), None)
    if worst is not None:
        raise LogError(
            f"{log.name}: {worst.title.lower()}. {worst.explanation} (resample=True does this while reading.)"
        )


def _mended(log: _Record) -> Log:
    """The log on an even grid, in segments, with its report."""
    raw = _put_in_order(log)
    log.leave_out(*mend.again(log.signals, log.segment))
    _restore(log)
    if "drive" in log.signals and "position" in log.signals:
        log.leave_out(*mend.held(log.time, log.signals["drive"], log.signals["position"]))
    if "position" in log.signals and factor_of(log.units["position"])[1] in (*UNSTATED, "rad", "m", "counts"):
        log.leave_out(*mend.frozen(log.signals["position"], log.segment))
        _continue(log)
    log.segment, more = bridged(log.time, log.signals, log.segment)
    done = even(log.time, log.signals, log.segment)
    found = [*log.found, *more, *([done.finding] if done.finding is not None else [])]
    if not done.rounded:  # if stamps were merely rounded, no sample is lost
        for f in raw.findings:
            if f.code in _STAMPS:  # the problem without the remedy, which was applied
                text = f.explanation.partition(";")[0].rstrip(".") + "."
                found.append(Finding(f.code, "warning", text, f.rows, f.value))
        if done.segment[-1] > 0:
            found.append(Finding("LOG020", "info", f"There are {done.segment[-1] + 1} segments."))
    found += [f for f in raw.findings if f.code not in _STAMPS]
    report = LogReport(tuple(found), raw.not_applicable, raw.jitter, raw.quantum)
    return _as_log(log, done, report)


def _put_in_order(log: _Record) -> LogReport:
    """Keep the rows that have a number everywhere, in the order of time; a check of them as they were logged."""
    bad, hole = mend.missing_rows({"time": log.time, **log.signals}, log.columns)
    kept = np.flatnonzero(~bad)
    if hole is not None:
        log.found.append(hole)
        log.keep(kept)
    motion = log.signals.get("position", log.signals.get("velocity"))
    if motion is not None and (n := mend.axes_in(log.time, motion)) > 1:
        raise LogError(
            f"{log.name}: {n} rows share each time stamp and hold motions that are apart, as rows of {n} axes do; keep "
            "the rows of one axis, or call the column that tells them apart 'axis'."
        )
    same = np.r_[False, np.all([v[1:] == v[:-1] for v in log.signals.values()], axis=0)]
    try:
        rows, time, segment = in_order(log.time, same, kept, log.found)
    except LogError as error:
        raise LogError(f"{log.name}: {error}") from None
    if not np.array_equal(rows, kept):
        log.keep(np.searchsorted(kept, rows))
    log.time, log.segment = time, segment
    return check_log(time, log.signals, rows=rows)


def _restore(log: _Record) -> None:
    """The sign of a drive logged as unsigned, wrapped angles, and a position of which only the velocity was logged."""
    signals, units = log.signals, log.units
    if "drive" in signals:
        signals["drive"], told = mend.signed(signals["drive"])
        log.found += [told] if told is not None else []
    for role in ("position", "reference", "command"):
        if role in signals and (turn := mend.turn_in(signals[role], units.get(role, UNKNOWN))) is not None:
            signals[role], text = mend.unwrap(role, signals[role], turn)
            log.found.append(text)
    if "velocity" in signals and "position" not in signals:
        if units.get("time") == "samples":
            raise LogError("The velocity cannot be integrated without time; name the time column or give sample_rate.")
        by, units["position"] = integral_of(units["velocity"])
        counted = mend.speed_from_counts(signals["velocity"])
        speed = signals["velocity"] if counted is None else counted
        over = speed[1:] if counted is not None else 0.5 * (speed[1:] + speed[:-1])
        step = np.where(np.diff(log.segment) == 0, np.diff(log.time) * over, 0.0)
        signals["position"] = by * np.r_[0.0, np.cumsum(step)]
        said = "Only the velocity is logged; its integral is taken as the position, whose origin and drift are unknown."
        log.found.append(Finding("LOG018", "warning", said))


def _continue(log: _Record) -> None:
    """The position without the jumps of its encoder."""
    jump = mend.jumps_in(log.time, log.signals["position"], log.segment)
    if jump is not None and log.units["position"] in UNSTATED and "drive" in log.signals:  # perhaps no motion
        driven = mend.jumps_in(log.time, log.signals["drive"], log.segment)
        jump = jump if driven is None or not np.any(driven[jump != 0]) else None
    if jump is not None:
        log.signals["position"], told = mend.without_jumps(log.signals["position"], jump)
        log.found.append(told)


def _as_log(log: _Record, done: Even, report: LogReport) -> Log:
    import pandas as pd

    time, signals = done.time - done.time[0], done.signals
    roles = [r for r in ("drive", "command", "position", "reference", "velocity") if r in signals]
    frame: dict[str, Any] = {"time": time, **{r: signals[r] for r in roles}}
    return Log(
        X=signals["drive" if "drive" in signals else "command"][:, None],
        y=signals["position"],
        time=time,
        reference=signals.get("reference"),
        command=signals.get("command"),
        groups=done.segment,
        sample_rate=float(1.0 / done.period),
        units=log.units,
        columns=log.columns,
        frame=pd.DataFrame(frame, copy=False),
        report=report,
        notes=report.notes,
        name=log.name,
    )
