"""Time stamps of a log: numbers, ticks or dates become seconds from the first, sorted, in segments, on an even grid.

Estimators and derivatives need one sample per period, whatever the logger did.
"""

from __future__ import annotations

import contextlib
import itertools
import re
import warnings
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from whsklearn.logs.check import ALLOWED_JITTER, GAP
from whsklearn.logs.errors import LogError
from whsklearn.logs.findings import Array, Finding
from whsklearn.logs.units import UNKNOWN, is_time, seconds_of

LONG_GAP = 5.0  # periods; four lost samples can be interpolated, within more an axis may have reversed
TURNED = 0.9  # share of steps backwards above which a log is written newest first
ROUNDED = 1.05  # ticks; rounding scatters stamps by less than one about their line, which is fitted to 5 % of one
RESTART = 20.0  # periods backwards; shorter steps are rows out of order, as written by two threads
# What stamps count, between which numbers (2001 and 2100; 1917 and 2234 on Windows and TwinCAT), and seconds per unit
_EPOCHS = (
    ("s since 1970", 1e9, 4.2e9, 1.0), ("ms since 1970", 1e12, 4.2e12, 1e-3), ("us since 1970", 1e15, 4.2e15, 1e-6),
    ("ns since 1970", 1e18, 4.2e18, 1e-9), ("100 ns since 1601", 1e17, 2e17, 1e-7),
)  # fmt: skip
_DAYS = (2e4, 8e4)  # days since 1900, as in spreadsheets, between 1954 and 2119
_DIGITS = 10  # behind the point of such a day, of the fifteen digits that Excel keeps
_FASTEST = 2e-6  # s; smaller steps are counted in a longer unit
_COUNTERS = (2.0**16, 2.0**24, 2.0**32)  # ticks at which a counter overflows
_DAY = (86400.0, 86400e3, 86400e6)  # s, ms and us of a day, whose count begins again at midnight
ZONE = re.compile(r"\s+(?![AP]M$)[A-Z]{3,4}$")  # CEST behind a date, which is no part of it: only differences count
# s; no axis is logged more slowly, so integers with larger steps count ms or us.  20 Hz, whose stamps are 0.05 s apart
# only to the last digit of a float and to the clock's 1 %.
SLOWEST = 0.0505


def to_seconds(values: NDArray[Any], unit: str, column: str) -> tuple[Array, tuple[Finding, ...]]:
    """Seconds since the first stamp, from numbers in `unit`, ticks since 1970, dates or times of the day.

    Raises LogError if a stamp is none of these; the row is named.

    >>> to_seconds(np.array([1.7e12, 1.7e12 + 5.0]), "s", "t")[0]
    array([0.   , 0.005])
    >>> to_seconds(np.array(["2024-05-01T12:00:00Z", "2024-05-01T12:00:00.25Z"]), "s", "t")[0]
    array([0.  , 0.25])
    """
    import pandas as pd

    values = np.asarray(values)
    if values.dtype.kind == "M":
        return _from_first(values.astype("datetime64[ns]")), ()
    if values.dtype.kind == "m":
        return values.astype("timedelta64[ns]").astype(float) * 1e-9, ()
    if values.dtype.kind not in "fiub":
        numbers = pd.to_numeric(pd.Series(values, dtype="string"), errors="coerce")
        if numbers.isna().any() or not isinstance(values[0], str):
            return _dates(values, column)
        values = numbers.to_numpy()  # as text, which Parquet files may hold
    start = next((v for v in values[:1000] if np.isfinite(v)), 0.0)
    first = float(start)
    for since, low, high, factor in _EPOCHS:
        if low <= first < high:
            # Subtract before scaling: 1.7e18 ns as a double has a resolution of 256 ns.
            return (values - start).astype(float) * factor, (_begins(column, since),)
    values = values.astype(float)
    step = np.abs(np.diff(values)) if _DAYS[0] <= first < _DAYS[1] else np.empty(0)
    # Excel saves twelve digits, so stamps of ten ms and less repeat: then their mean step counts.
    if step.size and 0.0 < (np.nanmedian(step) or np.nanmean(step)) < _FASTEST:
        days = _begins(column, "days, as spreadsheets count them")
        return np.round(values - first, _DIGITS) * 86400.0, (days,)
    values, found = _unwound(values, column)
    if not is_time(unit):
        unit, told = _whole_numbers(values, column)
        found += told
    return values * seconds_of(unit), found


def _begins(column: str, what: str) -> Finding:
    return Finding("LOG015", "info", f"Column {column!r} holds {what}; time begins at 0 with the first row.")


def on_one_clock(stamps: list[NDArray[Any]], unit: str, column: str) -> list[Array]:
    """Seconds of several columns of stamps, counted from the first stamp of the first of them.

    >>> on_one_clock([np.array([5.0, 6.0]), np.array([5.5, 7.0])], "ms", "t")
    [array([0.   , 0.001]), array([0.0005, 0.002 ])]
    """
    ends = np.cumsum([len(s) for s in stamps])
    times = to_seconds(np.concatenate(stamps), unit or UNKNOWN, column)[0]
    first = next((t for t in times if np.isfinite(t)), 0.0)
    return np.split(times - first, ends[:-1])


def _whole_numbers(values: Array, column: str) -> tuple[str, tuple[Finding, ...]]:
    """The unit of time stamps without a stated unit: seconds, unless they are integers with too large a step.

    Steps of 1 throughout may count samples; `whsklearn.logs.slips` asks about them.
    """
    step = np.diff(values[np.isfinite(values)])
    usual = float(np.median(step)) if step.size else 0.0
    if usual < 1.0 or np.any(step != np.round(step)) or np.all(step == 1.0):
        return "s", ()
    unit = "ms" if usual * 1e-3 <= SLOWEST else "us"
    text = (
        f"Column {column!r} has integers {usual:g} apart and no unit; they were taken as {unit}. If they are not, "
        "add --unit time=UNIT."
    )
    return unit, (Finding("LOG015", "info", text),)


def _unwound(values: Array, column: str) -> tuple[Array, tuple[Finding, ...]]:
    """Unwrap the ticks of a counter of 16, 24 or 32 bits that overflowed, and the time of day over midnight.

    >>> _unwound(np.array([86399.98, 86399.99, 0.0, 0.01]), "t")[0]
    array([86399.98, 86399.99, 86400.  , 86400.01])
    """
    step = np.diff(values)
    falls = np.flatnonzero(step < 0)
    if not falls.size or not np.all(np.isfinite(values)):
        return values, ()
    usual = float(np.median(step))
    for size in (*_COUNTERS, *_DAY):
        if values.min() >= 0 and values.max() < size and np.all(np.abs(step[falls] + size - usual) <= 5.0 * usual):
            what = (
                "counts from midnight, which is"
                if size in _DAY
                else f"is a counter that overflows at {size:.0f}, first"
            )
            text = f"Column {column!r} {what} at row {falls[0] + 1}."
            out = values + size * np.r_[0.0, np.cumsum(step < 0)]
            return out, (Finding("LOG015", "info", text, falls + 1),)
    return values, ()


def _from_first(stamps: NDArray[Any]) -> Array:
    """Seconds since the first date; NaN where there is none."""
    first = next((s for s in stamps if not np.isnat(s)), np.datetime64("NaT"))
    return (stamps - first).astype("timedelta64[ns]").astype(float) * 1e-9


def _dates(values: NDArray[Any], column: str) -> tuple[Array, tuple[Finding, ...]]:
    """Dates in ISO 8601 or with the day first, or times of day."""
    import pandas as pd

    if len(values) and hasattr(values[0], "isoformat"):
        return _from_first(pd.to_datetime(pd.Series(values), utc=True).dt.tz_localize(None).to_numpy()), ()
    text = pd.Series(values, dtype="string").str.strip().str.replace(",", ".", regex=False)
    text = text.str.replace(ZONE, "", regex=True)
    text = text.str.replace(r"(:\d\d)[:;](\d{3,7})$", r"\1.\2", regex=True)  # 10:00:00:005, as LabVIEW and PLCs write
    sample = text.dropna().iloc[0] if text.notna().any() else ""
    if sample.count(":") >= 1 and "-" not in sample and "/" not in sample and sample.count(".") <= 1:
        minutes = sample.count(":") == 1 and "." in sample  # mm:ss.0, as spreadsheets show a time
        whole = 3600.0 if minutes else 86400.0
        with contextlib.suppress(ValueError, TypeError):
            since = pd.to_timedelta("00:" + text if minutes else text).dt.total_seconds().to_numpy(dtype=float)
            since = since + whole * np.r_[0.0, np.cumsum(np.diff(since) < -0.5 * whole)]  # over the hour, over midnight
            return since - since[np.isfinite(since)][0], (_begins(column, "dates"),)
    for how in ({"format": "ISO8601"}, {"format": "mixed", "dayfirst": _day_first(text)}):
        with contextlib.suppress(ValueError, TypeError):
            stamps = pd.to_datetime(text, utc=True, **how).dt.tz_localize(None)  # type: ignore[call-overload]
            return _from_first(stamps.to_numpy()), (_begins(column, "dates"),)
    dates = pd.to_datetime(text, utc=True, format="ISO8601", errors="coerce")
    bad = np.flatnonzero((pd.to_numeric(text, errors="coerce").isna() & dates.isna() & text.notna()).to_numpy())
    row = int(bad[0]) if bad.size else 0
    raise LogError(
        f"Column {column!r} holds neither numbers nor dates: row {row} holds {str(text.iloc[row])[:40]!r}; time is "
        "numbers in s, ms, us or ns, or dates such as 2024-05-01T12:00:00.005."
    )


def _day_first(text: Any) -> bool:
    """Whether the dates of stamps (n,) lie closer together if the day comes before the month, as it does if one date
    tells nothing.
    """
    import pandas as pd

    dates, span = text.str.extract(r"^(\S+)", expand=False).dropna().drop_duplicates(), {}
    for first in (False, True):
        with warnings.catch_warnings(), contextlib.suppress(ValueError, TypeError):
            warnings.simplefilter("ignore", UserWarning)  # of a date that has only the other order
            days = pd.to_datetime(dates, utc=True, format="mixed", dayfirst=first)
            span[first] = days.max() - days.min()
    return len(span) < 2 or span[True] <= span[False]


def in_order(
    time: Array, same_rows: NDArray[np.bool_], rows: NDArray[np.intp], found: list[Finding]
) -> tuple[NDArray[np.intp], Array, NDArray[np.int64]]:
    """The rows sorted by time, without duplicates and stray stamps, with their stamps and segments without long holes.

    ``time`` (n,): finite stamps in s, as logged.
    ``same_rows`` (n,): rows that equal the row before in every signal.
    ``rows`` (n,): row numbers in the file.
    ``found``: gets what was found.
    A clock that restarts begins a new segment, whose stamps continue from the one before.
    Raises LogError if fewer than three stamps increase.
    """
    logged = time
    turned = np.mean(np.diff(time) < 0) > TURNED
    if turned:
        time, rows, same_rows = time[::-1], rows[::-1], same_rows[::-1]
        found.append(Finding("LOG004", "warning", "The newest row comes first; the rows were reversed."))
    step = np.diff(time)
    rising = step[step > 0]
    period = float(np.median(rising)) if rising.size else 0.0
    if np.any(step < 0) and _one_run(time):
        order = np.argsort(time)
        text = (
            f"{int(np.sum(step < 0))} rows have an earlier stamp than the row before; sorted, all are of one even run."
        )
        found.append(Finding("LOG004", "warning", text, rows[np.flatnonzero(step < 0) + 1], float(np.sum(step < 0))))
        time, rows, same_rows = time[order], rows[order], np.zeros_like(same_rows)
        period = _period(time)
    time = _spread(time, same_rows, period, found)
    time, rows = _without_strays(time, rows, period, found)
    time, rows = _sorted(time, rows, period, found)
    starts = np.r_[False, np.diff(time) < -RESTART * period]
    if starts.any():
        first = rows[np.flatnonzero(starts)]
        text = f"At row {first[0]}" + (f" and {first.size - 1} more" if first.size > 1 else "")
        found.append(
            Finding("LOG013", "warning", f"{text} time jumps back; each restart begins a new experiment.", first)
        )
        fall = np.where(starts, time - np.r_[0.0, time[:-1]] - period, 0.0)
        time = time - np.cumsum(fall)
    later = np.r_[True, time[1:] > np.maximum.accumulate(time)[:-1]]
    if not later.all():
        lost = rows[~later]
        text = (
            f"{lost.size} rows whose stamp is not later than the one before were dropped, the first is row {lost[0]}."
        )
        found.append(Finding("LOG003", "warning", text, lost, float(lost.size)))
    time, rows, starts = time[later], rows[later], starts[later]
    if time.size < 3:
        raise LogError(
            f"of {logged.size} time stamps over {np.ptp(logged):.6g} s only {time.size} increase, a log needs three: "
            "the clock stood still, or its last digits were lost. Export more digits, or give --rate HZ, not --time."
        )
    breaks = np.diff(time) >= LONG_GAP * _period(time)
    segment = np.r_[0, np.cumsum(breaks | starts[1:])].astype(np.int64)
    return rows, time, segment


def _one_run(time: Array) -> bool:
    """Whether the stamps, in any order, are those of one even run: rows that a database or parallel writers shuffled.

    >>> _one_run(np.array([0.2, 0.0, 0.3, 0.1])), _one_run(np.array([0.0, 0.1, 0.2, 0.0, 0.1, 0.2]))
    (True, False)
    """
    step = np.diff(np.sort(time))
    return bool(np.all(np.abs(step - np.median(step)) <= ALLOWED_JITTER * np.median(step)) and step.min() > 0)


def _period(time: Array) -> float:
    return float(np.median(np.diff(time)))


def _spread(time: Array, same_rows: NDArray[np.bool_], period: float, found: list[Finding]) -> Array:
    """Refine stamps coarser than the sampling, such as 0 0 1 1 2 2: an even line if all are consistent with a rounded
    one, otherwise evenly spaced between changes.
    """
    double = np.r_[False, np.diff(time) == 0]
    if double.sum() < 0.2 * time.size or (double & same_rows).sum() > 0.5 * double.sum() or period == 0.0:
        return time
    first = np.flatnonzero(~double)
    counts = np.diff(np.r_[first, time.size])
    slope, line = _fitted_line(time)
    if np.ptp(time - line) <= ROUNDED * period:
        out, how = line, f"evenly every {slope:.6g} s"
    else:
        last = time[first[-1]] + period
        out = np.interp(np.arange(time.size), np.r_[first, time.size], np.r_[time[first], last])
        how = "evenly"
    text = f"Up to {counts.max()} rows share a time stamp with a resolution of {period:.3g} s; they were spread {how}."
    found.append(Finding("LOG003", "warning", text, np.flatnonzero(double), float(double.sum())))
    return out


def _without_strays(
    time: Array, rows: NDArray[np.intp], period: float, found: list[Finding]
) -> tuple[Array, NDArray[np.intp]]:
    """Drop single stamps that deviate from the line through their neighbours."""
    if time.size < 5 or period == 0.0:
        return time, rows
    around = time[2:] - time[:-2]
    outside = (time[1:-1] < time[:-2]) | (time[1:-1] > time[2:])
    stray = np.r_[False, outside & (around > 0) & (around <= 4 * period), False]
    stray[0] = time[0] > time[1] and abs(time[2] - time[1]) <= 4 * period and time[2] > time[1]
    stray[-1] = time[-1] - time[-2] > 1e3 * period
    # If two neighbours both look wrong, as in 0 9 1 2, the first one is; without it the second fits.
    stray[1:] &= ~stray[:-1]
    if not stray.any():
        return time, rows
    lost = rows[stray]
    text = (
        f"Row {lost[0]} has the stamp {time[stray][0]:.6g} s among rows at {time[max(0, lost[0] - 1)]:.6g} s; "
        f"{lost.size} such row(s) were left out."
    )
    found.append(Finding("LOG004", "warning", text, lost, float(lost.size)))
    return time[~stray], rows[~stray]


def _sorted(time: Array, rows: NDArray[np.intp], period: float, found: list[Finding]) -> tuple[Array, NDArray[np.intp]]:
    """Sort rows that were written slightly out of order; a restart of the clock is left unchanged."""
    step = np.diff(time)
    back = step < 0
    if not back.any() or step.min() < -RESTART * period:
        return time, rows
    order = np.argsort(time, kind="stable")
    at = np.flatnonzero(back) + 1
    text = (
        f"{at.size} rows have an earlier stamp than the row before, the first is row {rows[at[0]]}; they were sorted."
    )
    found.append(Finding("LOG004", "warning", text, rows[at], float(at.size)))
    return time[order], rows[order]


# --- short holes ------------------------------------------------------------------------------------------------------
# Of the rms drive and of the way in a hole, over the whole log: interpolation that leaves less hides no force that a
# structure is judged by (`LEAST_FORCE` of `whsklearn.identification`)
BRIDGED = 0.01
TRIED = 256  # places at which a hole is tried
BESIDE = 8  # samples on either side of it that the spline uses


def bridged(
    time: Array, signals: dict[str, Array], segment: NDArray[np.int64]
) -> tuple[NDArray[np.int64], list[Finding]]:
    """The segments joined over holes that interpolation fills, as the log itself shows where nothing is missing.

    Signals are interpolated over stretches as long as the hole elsewhere in the log, and what that leaves, times the
    root of the share of samples that such holes take, must be `BRIDGED` at most.  A slow drive passes over 20 ms, noise
    over none.

    >>> t = np.delete(np.arange(2000) / 500, slice(900, 908))
    >>> signals = {"drive": np.cos(3 * t), "position": np.sin(3 * t)}
    >>> int(bridged(t, signals, (np.arange(t.size) >= 900).astype(np.int64))[0].max())
    0
    >>> signals["drive"] = np.random.default_rng(0).normal(size=t.size)
    >>> int(bridged(t, signals, (np.arange(t.size) >= 900).astype(np.int64))[0].max())
    1
    """
    period = _period(time)
    lengths = np.round(np.diff(time) / period).astype(int)
    holes = (np.diff(segment) > 0) & (lengths >= LONG_GAP)
    length = 0
    for tried in np.unique(lengths[holes])[::-1].tolist():
        share = float(np.sum(lengths[holes & (lengths <= tried)] - 1)) / time.size
        if all(np.sqrt(share) * _off(v, lengths, tried, k) <= BRIDGED for k, v in signals.items()):
            length = tried
            break
    if not length:
        return segment, []
    filled = holes & (lengths <= length)
    text = (
        f"{filled.sum()} hole(s) of up to {length * period:.3g} s were filled. Tried on stretches as long elsewhere, "
        f"interpolation changes less than {100 * BRIDGED:g} % of the signals of the whole log."
    )
    joined = segment - np.r_[0, np.cumsum(filled)]
    return joined, [Finding("LOG011", "info", text, np.flatnonzero(filled) + 1, float(filled.sum()))]


def _off(values: Array, lengths: NDArray[np.int64], length: int, role: str) -> float:
    """What interpolation over ``length`` samples leaves where they are there, as a share of the signal or its way."""
    from scipy.interpolate import CubicSpline

    whole = np.r_[0, np.cumsum(lengths > 1)]  # runs without a lost sample
    first = np.arange(BESIDE - 1, values.size - length - BESIDE)
    first = first[whole[first - BESIDE + 1] == whole[first + length + BESIDE - 1]]
    if not first.size:
        return np.inf
    first = first[np.linspace(0, first.size - 1, TRIED).astype(int)]
    inside = np.arange(1, length)[:, None]
    ends = values[first + length] - values[first]
    if role in MOTIONS:
        place = np.r_[np.arange(1 - BESIDE, 1), np.arange(length, length + BESIDE)]
        guess, size = CubicSpline(place, values[first + place[:, None]])(inside[:, 0]), np.sqrt(np.mean(ends**2))
    else:
        guess, size = values[first] + ends * inside / length, np.std(values)
    left = np.sqrt(np.mean((guess - values[first + inside]) ** 2))
    return float(left / size) if size else (np.inf if left else 0.0)


# --- an even grid, segment by segment -------------------------------------------------------------------------------
MOTIONS = ("position", "reference", "command")
# Share of the roughness on the stamps.  Where the encoder's steps drown the jitter both are as rough, to a tenth at
# steps of 0.7 to 1.3 periods, and where the samples jitter they are rougher on an even line.
SMOOTHER = 0.8
_FEWEST = 100  # rows, of which the roughness is estimated to a tenth


def usual_step(time: Array) -> float:
    """The time between two rows; stamps may be rounded, to whole ms say, and rows may be lost among them.

    The median of 2, 3, 2, 3 ms is neither a step of these rows nor their mean. Zero if fewer than three stamps tell it.

    >>> float(round(usual_step(np.round(np.arange(200) / 800, 3)), 6)), usual_step(np.array([0.0, 0.5, 1.0, 3.0, 3.5]))
    (0.00125, 0.5)
    """
    if time.size < 3:
        return 0.0
    line, step = _line(time), np.diff(time)
    if line is not None:
        return float((line[-1] - line[0]) / (line.size - 1))
    near = step[(step > 0.0) & (step < GAP * np.median(step))]
    return float(near.mean()) if near.size else 0.0


class Even(NamedTuple):
    """Signals on an even grid, segment by segment."""

    time: Array
    signals: dict[str, Array]
    segment: NDArray[np.int64]
    period: float
    finding: Finding | None
    rounded: bool  # the stamps were rounded and have been replaced; the values are as logged


def even(time: Array, signals: dict[str, Array], segment: NDArray[np.int64]) -> Even:
    """Signals with one sample per period in each segment; unchanged if the stamps are even.

    Stamps within one tick of an even line were rounded by the logger while the samples were not, and stamps on which
    the motion is rougher than by rows jitter more than the samples; these stamps are replaced. Otherwise motions are
    interpolated by cubic splines and other signals linearly: linear interpolation of a motion is off by h^2 a / 8, at
    100 Hz more than an encoder's noise, and its acceleration is a train of pulses.

    ``time`` (n,): increasing stamps in s. ``signals``: by role. ``segment`` (n,): number of the segment of each
    row.
    """
    step = np.diff(time)
    inside = np.diff(segment) == 0
    period = float(np.median(step[inside])) if inside.any() else float(np.median(step))
    if np.all(np.abs(step[inside] / period - 1.0) <= ALLOWED_JITTER):
        usual = float(np.mean(step[inside])) if inside.any() else period  # the median of stamps is a whole tick
        return Even(time, signals, segment, usual, None, False)
    bounds = np.r_[0, np.flatnonzero(~inside) + 1, time.size].tolist()
    spans = [slice(a, b) for a, b in itertools.pairwise(bounds) if b - a >= 3]
    why, straight = "rounded", [line for part in spans if (line := _line(time[part])) is not None]
    if len(straight) < len(spans) and "position" in signals:
        motion = signals["position"]
        why = "less even than the samples, whose motion is smoother by rows"
        straight = [line for part in spans if (line := _by_rows(time[part], motion[part])) is not None]
    if len(straight) == len(spans) > 0:
        period = float(np.median([(line[-1] - line[0]) / (line.size - 1) for line in straight]))
        text = f"The time stamps are {why}; rows are taken {period:.6g} s apart in {len(spans)} segment(s)."
        parts = [(line, {k: v[part] for k, v in signals.items()}) for line, part in zip(straight, spans, strict=True)]
    else:
        near = step[inside & (step < GAP * period)]
        period = float(near.mean())  # the median of 10, 12, 10, 12 ms is neither of them
        text = f"Onto an even grid of {period:.6g} s in {len(spans)} segment(s): motions by splines, the rest linearly."
        parts = [_resampled(time[part], {k: v[part] for k, v in signals.items()}, period) for part in spans]
    return Even(
        np.concatenate([t for t, _ in parts]),
        {k: np.concatenate([v[k] for _, v in parts]) for k in signals},
        np.concatenate([np.full(t.size, i, dtype=np.int64) for i, (t, _) in enumerate(parts)]),
        period,
        Finding("LOG011", "warning", text, value=period),
        why == "rounded" and len(straight) == len(spans),
    )


def _resampled(t: Array, signals: dict[str, Array], period: float) -> tuple[Array, dict[str, Array]]:
    """One segment on its grid: motions by cubic splines, the rest linearly."""
    from scipy.interpolate import CubicSpline

    grid = t[0] + period * np.arange(int((t[-1] - t[0]) / period * (1 + 1e-9)) + 1)
    smooth = {k: np.asarray(CubicSpline(t, v)(np.minimum(grid, t[-1]))) for k, v in signals.items() if k in MOTIONS}
    return grid, {k: smooth[k] if k in smooth else np.interp(grid, t, v) for k, v in signals.items()}


def _fitted_line(t: Array) -> tuple[float, Array]:
    """The step and the stamps of the even line that fits best."""
    rows = np.arange(t.size)
    slope, start = np.polyfit(rows, t, 1)
    return slope, start + slope * rows


def _line(t: Array) -> Array | None:
    """An even line through stamps that were rounded to a tick of at least a tenth of the period; None otherwise."""
    steps = np.round(np.diff(t), 9)
    short, long = float(steps.min()), float(steps.max())
    tick = long - short
    often = float(np.mean(steps == long))
    # Rounding gives two step lengths, both whole ticks and one tick apart, and both frequent; lost samples are rare.
    if tick < 0.1 * steps.mean() or not np.all((steps == short) | (steps == long)) or not 0.02 < often < 0.98:
        return None
    line = _fitted_line(t)[1]
    off = t - line
    if abs(short / tick - round(short / tick)) > 1e-3 or np.ptp(off) > ROUNDED * tick:
        return None
    return line + 0.5 * (off.max() + off.min())


def _by_rows(t: Array, motion: Array) -> Array | None:
    """The even line through stamps of a run without lost rows, if the motion is smoother on it; None otherwise.

    A host stamps rows when it gets to them: the samples of the drive are even, and the stamps jitter.  At 30 rad/s
    0.2 ms are eight counts of an encoder, which a spline through the stamps turns into acceleration.
    """
    slope, line = _fitted_line(t)
    if t.size < _FEWEST or np.abs(t - line).max() > 0.5 * (GAP - 1.0) * slope:  # a longer step may be a lost row
        return None
    return line if _rough(line, motion) < SMOOTHER * _rough(t, motion) else None


def _rough(t: Array, motion: Array) -> float:
    """The rms error of the cubic through two samples on either side, at the sample between them."""
    k = np.arange(2, t.size - 2)
    guess = np.zeros(k.size)
    for i in (-2, -1, 1, 2):
        others = [j for j in (-2, -1, 1, 2) if j != i]
        weight = np.prod([(t[k] - t[k + j]) / (t[k + i] - t[k + j]) for j in others], axis=0)
        guess += weight * motion[k + i]
    return float(np.sqrt(np.mean((motion[k] - guess) ** 2)))
