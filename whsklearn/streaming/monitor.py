"""The loop of a stream, without files and signals: rows in, records out, and a state that is carried along.

Nothing here depends on the chunks in which rows arrive: records are made at fixed row counts, so a stream that was
stopped, or killed and resumed from its checkpoint, writes the same records as an uninterrupted one.

An innovation is a one-step error with the parameters that were known beforehand: the model at the beginning of a block
predicts the whole block, from the rows before it.
"""

from __future__ import annotations

import copy
import math
import warnings
from collections.abc import Callable, Iterable, Mapping, Sequence, Sized
from dataclasses import asdict, dataclass, field
from typing import Any, NoReturn

import numpy as np
from numpy.typing import NDArray
from sklearn.base import clone

from whsklearn.change import ChangeAlarm, compare_parameters, forgetting_after, set_forgetting
from whsklearn.logs.errors import LogError
from whsklearn.plot import flat_parameters
from whsklearn.streaming.clock import Clock, Pace, Verdict
from whsklearn.streaming.readings import BEYOND, NEW_EXPERIMENT, Freeze, Jumps, Lone, Turns
from whsklearn.streaming.rows import BadRow, OtherHeader
from whsklearn.streaming.sides import Compare, Sides

BLOCK = 100  # rows
CONTEXT = 300  # rows before a block, over which the effect of the predictor's start at rest dies out


class Innovations:
    """One-step errors of a learning model, block by block; the outputs are the last columns of a row.

    Where the lags smooth over a moving window (those of an arm or an axis), an innovation belongs to the sample in the
    middle of the window that ends with the row.
    """

    def __init__(self, model: Any, n_outputs: int = 1):
        self.model, self.n_outputs = model, n_outputs
        self._before: Any = None
        self.rows = np.empty((0, 0))
        self.experiments = np.empty(0, dtype=np.int64)
        self.new = 0

    def learnt(self, rows: NDArray[np.float64], experiments: NDArray[np.int64]) -> None:
        """Add rows that the model has learnt, at most up to the end of a block."""
        self.rows = np.concatenate([self.rows.reshape(-1, rows.shape[1]), rows])
        self.experiments = np.concatenate([self.experiments, experiments])
        self.new += len(rows)

    def of_block(self) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
        """Outputs of the complete block, their innovations, and those to be watched; the next block begins.

        Each is (n, n_outputs). Innovations are NaN where there was no model yet; those to be watched are of the rows
        that the model learns from, and NaN at the other samples.
        """
        first = len(self.rows) - self.new
        y = self.rows[:, -self.n_outputs :]
        e = watched = np.full((self.new, self.n_outputs), np.nan)
        if self._before is not None:
            X, known = self.rows[:, : -self.n_outputs], y if self.n_outputs > 1 else y[:, 0]
            y_hat = self._before.predict_ahead(X, known, horizon=1, groups=self.experiments, settle=False)
            y_hat = y_hat.reshape(y.shape)
            lags: Any = getattr(self._before, "lags_", None)
            if hasattr(lags, "delay_"):
                y = np.roll(y, lags.delay_, axis=0)
                begun = np.flatnonzero(np.diff(self.experiments, prepend=self.experiments[0] - 1))
                past = np.arange(len(y)) - begun[np.searchsorted(begun, np.arange(len(y)), side="right") - 1]
                y_hat[past < lags.warmup_] = np.nan
            e = watched = (y - y_hat)[first:]
            if hasattr(lags, "partial_errors"):
                if 0 < first < len(y) and self.experiments[first] != self.experiments[first - 1]:
                    lags.begin()
                watched = lags.partial_errors(X[first:], known[first:], self._before.theta_, self.experiments[first:])
                watched = watched.reshape(e.shape)
        self._before = copy.copy(self.model)  # what set_state of a clone does, without its checks
        self._before.state_ = copy.deepcopy(self.model.state_)
        if hasattr(self.model, "lags_"):
            self._before.lags_ = copy.copy(self.model.lags_)
        self.rows, self.experiments, self.new = self.rows[-CONTEXT:], self.experiments[-CONTEXT:], 0
        return y[first:], e, watched

    def get_state(self) -> dict[str, Any]:
        """Everything that `set_state` needs to continue identically."""
        before = {} if self._before is None else self._before.get_state()
        return {"before": before, "rows": self.rows, "experiments": self.experiments, "new": self.new}

    def set_state(self, state: dict[str, Any]) -> None:
        """Continue from a state that `get_state` returned."""
        self._before = clone(self.model).set_state(state["before"]) if state["before"] else None
        self.rows, self.experiments, self.new = state["rows"], state["experiments"], state["new"]


# --- the loop --------------------------------------------------------------------------------------------------------
Record = dict[str, Any]
PAST = 50.0  # weight, in samples, that all rows before an alarm keep
ADAPTING_ROWS = 200 * BLOCK  # after an alarm; by then the forgetting factor has settled to within 5e-5
BRAKES = "viscous", "coulomb"  # effects that are negative together in no joint; beside Stribeck's one may be
SURE = 5.0  # standard deviations of a ratio of two variances by which an NMSE must exceed one
DRIFT_LEVEL = 0.01  # probability that a drift is ever reported although there is none
AT_REST = "at_rest"  # is told at the end only
NEIGHBOURS = "the rows on both sides are taken as neighbours"
FILLED = "the row that is lost is replaced by what lies between its neighbours"
TOLD = 10  # bad rows in a row, pauses, and jumps, with a record of their own: enough to see what is wrong with them


@dataclass(frozen=True)
class Options:
    """How a stream handles its rows.

    Parameters
    ----------
    every : int, default=1000
        Rows between estimates.
    predictions : bool, default=False
        Whether to emit a record of each row's one-step prediction.
    refuse : bool, default=False
        Whether the first bad row ends the stream; otherwise bad rows are reported and skipped.
    restart_after_hole : bool, default=False
        Whether a bad row begins a new experiment; otherwise the last sample takes its place.
    max_step : float, default=inf
        A longer pause begins a new experiment (unit of the time column).
    smallest_change : float, default=5.0
        Smaller changes of a parameter are not reported (%).
    most_held : int, default=10
        Largest number of consecutive bad rows that are replaced by the last sample.
    timed : bool, default=False
        Whether a row's first value is its time.
    outputs : tuple of str, default=("",)
        Names of the outputs, the last columns of a row; more than one only for the lags of an arm.
    factors : tuple of float, default=()
        Factors by which the columns of a row (including its time) are multiplied, for example to convert degrees to
        rad; empty for no conversion.
    step : float, default=0.0
        Time between rows for which the model was begun (unit of the time column); rows at another rate are told and
        not learnt. Zero if it has none.
    positions : tuple of int, default=()
        Indices in a row of the position of an axis, or of those of an arm's joints; their drives follow them, in the
        same order. Wrong readings are put right, and a row that is missing alone is filled in. Rows that repeat the
        position of a moving axis are left out.
    turns : tuple of tuple of float, default=()
        Turns at which each of these positions may be wrapped, in its unit.
    units : dict of str to str, default={}
        Units of the parameters by name, as a record of them states them.

    References
    ----------
    Little and Rubin 2019, Statistical Analysis with Missing Data, Wiley, on replacing a missing value by the last
    one: doing so for long causes a bias, hence ``most_held``.

    Examples
    --------
    >>> from whsklearn.streaming import Options
    >>> Options(every=100).most_held
    10
    """

    every: int = 1000
    predictions: bool = False
    refuse: bool = False
    restart_after_hole: bool = False
    max_step: float = np.inf
    smallest_change: float = 5.0
    most_held: int = 10
    timed: bool = False
    outputs: tuple[str, ...] = ("",)
    factors: tuple[float, ...] = ()
    step: float = 0.0
    positions: tuple[int, ...] = ()
    turns: tuple[tuple[float, ...], ...] = ()
    units: Mapping[str, str] = field(default_factory=dict)


class Refused(LogError):
    """A bad row in a stream that refuses them.

    Examples
    --------
    >>> from whsklearn import RLSRegressor
    >>> from whsklearn.change import ChangeAlarm
    >>> from whsklearn.streaming import Options, Refused, StreamMonitor
    >>> monitor = StreamMonitor(RLSRegressor(), ChangeAlarm(), Options(refuse=True), print)
    >>> try:
    ...     monitor.take([[1.0, 2.0], [float("nan"), 2.0]])
    ... except Refused as error:
    ...     print(error)
    line 2: a value is NaN or infinite; correct it, or skip bad rows.
    """


@dataclass
class Carried:
    """The state of the loop itself; it consists of numbers only, so that a checkpoint can hold it."""

    rows: int = 0
    bad: int = 0
    bad_run: int = 0  # those since the last row that was in order
    pauses: int = 0
    experiment: int = 0
    time: float = -np.inf
    repeated: int = 0
    repeated_run: int = 0
    held: int = 0
    held_back: int = 0  # experiment of the rows that are held back
    jumps: int = 0
    times: list[float] = field(default_factory=list)
    last: list[float] = field(default_factory=list)
    path: list[list[float]] = field(default_factory=list)  # the last two rows of a motion, whose turns are counted
    counted: int = 0  # innovations since the last estimate
    squares: list[float] = field(default_factory=list)  # their sum of squares, by output
    output_sum: list[float] = field(default_factory=list)  # sum of the outputs over the same rows
    output_squares: list[float] = field(default_factory=list)
    poor: list[bool] = field(default_factory=list)  # whether predictions were worse than the mean at the last check
    senseless: str = ""  # what was told of numbers that no axis has
    alarms: int = 0
    alarm_row: int = -1
    adapting: int = 0
    looks: int = 0
    reference: dict[str, Any] = field(default_factory=dict)


class StreamMonitor:
    """A model that learns from rows as they arrive, watched by an alarm.

    Rows are given as numbers (`take`) or as lines of text (`feed`).  The results are emitted as records.

    Parameters
    ----------
    model : estimator
        An estimator with ``partial_fit``, ``predict_ahead`` and ``get_state``.
    alarm : ChangeAlarm
        The alarm that watches the innovations.
    options : Options
        How rows are handled.
    emit : callable
        Called with each record, a dict with the keys ``kind`` (``estimate``, ``prediction``, ``alarm``, ``change``,
        ``moved`` or ``bad_row``) and ``row``.
    compare : callable, optional
        Compares the rows before and after an alarm (`whsklearn.streaming.sides.Sides`) in a thread; its answer is
        emitted as a record ``moved`` when it is ready.

    References
    ----------
    Basseville and Nikiforov 1993, Detection of Abrupt Changes, Prentice Hall, on alarms over innovations.

    Examples
    --------
    >>> from whsklearn import RLSRegressor
    >>> from whsklearn.change import ChangeAlarm
    >>> from whsklearn.streaming import Options, StreamMonitor
    >>> records = []
    >>> monitor = StreamMonitor(RLSRegressor(), ChangeAlarm(), Options(every=100), records.append)
    >>> monitor.take([[i % 7, 2.0 * (i % 7)] for i in range(200)])
    >>> [(r["kind"], r["row"]) for r in records]
    [('estimate', 100), ('estimate', 200)]
    """

    def __init__(
        self, model: Any, alarm: ChangeAlarm, options: Options, emit: Callable[[Record], None],
        compare: Compare | None = None,
    ):  # fmt: skip
        self.model, self.alarm, self.options, self.emit = model, alarm, options, emit
        self.forgetting = model.forgetting
        n = len(options.outputs)
        # outputs share the false alarms of the interval
        self.alarms = [alarm] if n == 1 else [clone(alarm).set_params(interval=n * alarm.interval) for _ in range(n)]
        self.innovations = Innovations(model, n)
        self.sides = None if compare is None else Sides(compare, alarm.n_settle * getattr(model.lags, "spacing", 1))
        self.carried = Carried(poor=[False] * n)
        self._count_anew()
        self.clock = Clock()
        self.turns = [Turns() for _ in options.positions]
        self.jumps = [Jumps() for _ in options.positions]
        self.freezes = [Freeze() for _ in options.positions]
        self.pace, self.lone = Pace(), Lone()
        self._rows: list[list[float]] = []
        self._experiments: list[int] = []
        self._numbers: list[int] = []
        self.taken = 0  # number of lines processed in the last call of feed

    def take(self, rows: Iterable[Sequence[float]], first: int = 1) -> None:
        """Learn from rows of numbers.

        ``rows`` (n_rows, n_columns): the time if ``options.timed``, the inputs, the output. ``first``: number of the
        first row; records refer to bad rows by number. A row is bad that holds anything but finite numbers, or more or
        fewer than the rows before it. Raises Refused: at the first row that is bad or comes late, if bad rows are
        refused; the rows before it are learnt.
        """
        rows = list(rows)
        least = self.options.timed + 1 + len(self.options.outputs)  # an input
        width = next((len(r) for r in (self.carried.last, *rows) if isinstance(r, Sized) and len(r) >= least), least)
        self._take_all(rows, lambda row: _finite(row, width), first)

    def feed(self, lines: Sequence[bytes], parse: Callable[[bytes], list[float] | None], first: int) -> None:
        """Learn from lines of text.

        ``lines``: one row each; blank lines are skipped. ``parse``: converts a line to a row of numbers, to None if no
        row is missing there, or raises `whsklearn.streaming.rows.BadRow`. ``first``: number of the first line. Raises
        Refused: at the first bad row, if bad rows are refused; the rows before it are learnt.
        """
        self._take_all(lines, lambda line: parse(line) if line.strip() else None, first)

    def _take_all(self, rows: Sequence[Any], parse: Callable[[Any], list[float] | None], first: int) -> None:
        """Put rows into time order and learn from them; ``parse`` gives None for what is to be skipped."""
        self.taken, self._first = len(rows), first
        for number, given in enumerate(rows, first):
            try:
                row = parse(given)
            except BadRow as reason:
                for verdict in self.clock.lost():
                    self._act(verdict)
                if isinstance(reason, OtherHeader):
                    self._refuse(number, f"{reason}.")
                self._act(Verdict("bad", number, [], str(reason)))
                continue
            if row is None:
                continue
            if not self.options.timed:
                self._act(Verdict("row", number, row))
            elif self.options.refuse:
                self._act(self.clock.take_strictly(number, row))
            else:
                for verdict in self.clock.take(number, row):
                    self._act(verdict)
        self._learn_taken()

    def _refuse(self, number: int, why: str) -> NoReturn:
        """Learn the rows before a row, and stop at it."""
        self._learn_taken()
        self.taken = number - self._first
        raise Refused(f"line {number}: {why}")

    def _act(self, verdict: Verdict) -> None:
        """Handle a row according to its verdict."""
        what, number, row, reason, missed = verdict
        if what == "row":
            before = self.carried.experiment
            fills = bool(self.options.positions) and missed == 1 and len(self.carried.path) == 2
            fills = fills and row[0] - self.carried.time <= self.options.max_step
            fills = fills and bool(self.carried.bad_run or (reason and self._shows_a_loss(row)))
            if self.options.timed and not fills:
                self._replace(number, min(self.carried.bad_run, missed))
            self._end_of_bad_rows(number)
            if reason:
                begins = self.carried.experiment > before or row[0] - self.carried.time > self.options.max_step
                self.carried.pauses += 1
                if self.carried.pauses <= TOLD:
                    then = NEW_EXPERIMENT if begins else FILLED if fills else NEIGHBOURS
                    self._warn("pause", number, f"{reason}; {then}")
            self._take(row, number, fills)
            self.carried.held = 0
            return
        self._learn_taken()  # so that the order of the records does not depend on how rows arrive
        if what == "bad" and self.options.refuse:
            self._refuse(number, f"{reason}; correct it, or skip bad rows.")
        if what == "bad":
            self.carried.bad += 1
            self.carried.bad_run += 1
            if self.carried.bad_run <= TOLD:
                self._tell_bad(number, reason)
            if not self.options.timed:  # with a time, the next row tells whether a sample is missing there
                self._replace(number, 1)
            if row and self.carried.bad_run <= TOLD:
                self._warn("clock_outlier", number, reason)
        elif what == "restart":
            self._replace(number, self.carried.bad_run)  # the old clock says nothing more of these
            self._end_of_bad_rows(number)
            self.carried.experiment += 1
            self.carried.time = -np.inf
            self._warn("clock_restart", number, reason)
        elif what == "repeated":
            self.carried.repeated += 1
            if self.carried.repeated_run == 0:
                self._warn("repeated_rows", number, f"{reason}; such rows are skipped")
            self.carried.repeated_run += 1

    def _shows_a_loss(self, row: list[float]) -> bool:
        """Whether the motion covers two steps before this row; if it covers one, only its stamp is late."""
        (first, last), two_less_one = self.carried.path, 0.0
        for at, jumps, turns in zip(self.options.positions, self.jumps, self.turns, strict=True):
            before, step = last[at] - first[at], row[at] - turns.logged[-1]
            if 2.0 * abs(step) > turns.turn > 0.0:
                step -= math.copysign(turns.turn, step)
            two_less_one += before * (3.0 * before - 2.0 * step) / (jumps.fastest**2 or math.inf)
        return two_less_one < 0.0  # its squared distance from two steps, less that from one

    def _take(self, row: list[float], number: int, fills: bool = False) -> None:
        """Queue a row to be learnt, behind one that it ``fills`` in; a long pause begins a new experiment."""
        c = self.carried
        if self.options.timed:
            took, c.time = row[0] - c.time, row[0]
            if self.options.step and took < np.inf and (told := self.pace.take(took, self.options.step)):
                self._warn("rate", number, told)
            c.experiment += self.pace.off or self.options.max_step < took < np.inf
            if self.pace.off:
                c.bad += 1
                return
        c.repeated_run = 0
        if c.held_back != c.experiment:
            self._let_go(0)
            c.path, fills = [], False
        if not self.options.positions:
            self._past_lone([number, row])
            return
        c.last = row
        c.path = [*c.path[-1:], self._unwrapped(row, number)]
        if fills:
            self._past_readings([number, [0.5 * (a + b) for a, b in zip(*c.path, strict=True)]])
        self._past_readings([number, c.path[-1]])

    def _past_lone(self, row: list[Any]) -> None:
        """Queue a row, with its number; the last sample takes the place of one with a value beyond all others."""
        c = self.carried
        for (number, values), wrong in [(row, [])] if self.options.refuse else self.lone.take(row):
            if not wrong:
                c.last = values
                self._queue([[number, values]])
                continue
            self._learn_taken()
            c.bad += 1
            said = f"a value of {values[wrong[0]]:.6g} stands alone, over {BEYOND:g} times any before it"
            self._tell_bad(number, said)
            if self.options.restart_after_hole:
                c.held_back = c.experiment = c.experiment + 1
            else:
                timed = int(self.options.timed)
                self._queue([[number, [*values[:timed], *c.last[timed:]]]])

    def _past_readings(self, row: list[Any], k: int = 0) -> None:
        """Queue a row, with its number, behind the readings that judge it, from the ``k``-th on; any may hold it back.

        They are the jumps of every position, and then its repeated readings.
        """
        c, n = self.carried, len(self.options.positions)
        if k == 2 * n:
            self._queue([row])
            return
        at = self.options.positions[k % n]
        for one in self.jumps[k].take(row, at, at + n) if k < n else self.freezes[k - n].take(row, at, at + n):
            if one.anew:
                self._let_go(k + 1)
                c.held_back = c.experiment = c.experiment + 1
            if one.told:
                c.jumps += k < n
                if k >= n or c.jumps <= TOLD:
                    self._warn("jump" if k < n else "held_rows", one.row[0], f"{self._at_joint(k % n)}{one.told}")
            self._past_readings(one.row, k + 1)

    def _let_go(self, k: int) -> None:
        """Queue the rows held back from the ``k``-th reading on, as the last of an experiment."""
        rows, readings = self.lone.end(), [*(one.end for one in self.jumps), *(one.end for one in self.freezes)]
        for end in reversed(readings[k:]):
            rows += end()
        self._queue(rows, self.carried.held_back)
        self.carried.held_back = self.carried.experiment

    def _at_joint(self, k: int) -> str:
        """The joint of a position, in front of what is told of it; empty for the only one."""
        return f"{self.options.outputs[k]}: " if len(self.options.positions) > 1 else ""

    def _unwrapped(self, row: list[float], number: int) -> list[float]:
        """A row whose positions go on from turn to turn."""
        out = list(row)
        for k, (at, turns) in enumerate(zip(self.options.positions, self.turns, strict=True)):
            out[at], anew = turns.take(row[at], self.options.turns[k] if self.options.turns else ())
            if anew:
                said = f"the position leaps from one end of a turn of {turns.turn:.6g} to the other: it is wrapped"
                self._warn("wrap", number, f"{self._at_joint(k)}{said}, and is continued from turn to turn")
        return out

    def _queue(self, rows: list[list[Any]], experiment: int | None = None) -> None:
        """Queue rows, each with its number, of an experiment: the present one, or another."""
        self._numbers += [number for number, _ in rows]
        self._rows += [row for _, row in rows]
        self._experiments += [self.carried.experiment if experiment is None else experiment] * len(rows)

    def _learn_taken(self) -> None:
        """Learn the rows queued so far."""
        if self._rows:
            rows, experiments, numbers = self._rows, self._experiments, self._numbers
            self._rows, self._experiments, self._numbers = [], [], []
            scaled = np.array(rows) * (self.options.factors or 1.0)
            self._learn(scaled, np.array(experiments), numbers)

    def _replace(self, number: int, missing: int) -> None:
        """Let the last sample stand for missing ones, at most `most_held` in a row; or begin a new experiment."""
        if self.options.restart_after_hole:
            self.carried.experiment += missing > 0
            return
        for _ in range(missing if self.carried.last else 0):
            self.carried.held += 1
            if self.carried.held <= self.options.most_held:
                self._take(list(self.carried.last), number)
            elif self.carried.held == self.options.most_held + 1:
                self.carried.experiment += 1
                said = (
                    f"more than {self.options.most_held} consecutive bad rows; the last sample is no longer held, and "
                    "a new experiment begins"
                )
                self._warn("held_rows", number, said)

    def _end_of_bad_rows(self, number: int) -> None:
        """Report in one record how many of the bad rows before line ``number`` have no record of their own."""
        more, self.carried.bad_run = self.carried.bad_run - TOLD, 0
        if more > 0:
            self._tell_bad(number - 1, f"{more} more rows up to here are bad", rows=more)

    def _tell_bad(self, line: int, reason: str, **rows: int) -> None:
        """Emit a record of a row that is not learnt, or of several, behind the rows before it."""
        self._learn_taken()
        self.emit({"kind": "bad_row", "line": line, "row": self.carried.rows, **rows, "reason": reason})

    def _warn(self, cause: str, number: int, reason: str) -> None:
        """Emit an alarm about the rows themselves, behind those before it, so that it is the same in any chunks."""
        self._learn_taken()
        self.carried.alarms += 1
        self.emit({"kind": "alarm", "cause": cause, "row": self.carried.rows, "line": number, "reason": reason})

    def _learn(self, rows: NDArray[np.float64], experiments: NDArray[np.int64], numbers: list[int]) -> None:
        """Learn from rows in pieces that end where an estimate is due."""
        start = 0
        while start < len(rows):
            every, rows_now = self.options.every, self.carried.rows
            due = min(every - rows_now % every, BLOCK - rows_now % BLOCK)
            piece = slice(start, min(start + due, len(rows)))
            try:
                self._learn_piece(rows[piece], experiments[piece])
            except ValueError as error:
                if len(rows[piece]) > 1:  # find out which row is rejected
                    piece = slice(start, start + 1)
                try:
                    self._learn_piece(rows[piece], experiments[piece])
                except ValueError:
                    if self.options.refuse:
                        self.taken = numbers[start] - self._first
                        raise Refused(f"line {numbers[start]}: {error}") from None
                    self.carried.bad += 1
                    self._tell_bad(numbers[start], str(error))
                    start = piece.stop
                    continue
            if self.carried.rows % self.options.every == 0:
                self._judge(numbers[piece.stop - 1])
                self._estimate()
            start = piece.stop

    def _learn_piece(self, rows: NDArray[np.float64], experiments: NDArray[np.int64]) -> None:
        """Call partial_fit once; at the end of a block, evaluate its innovations."""
        timed = int(self.options.timed)
        n = len(self.options.outputs)
        X, y = np.ascontiguousarray(rows[:, timed:-n]), np.ascontiguousarray(rows[:, -n:] if n > 1 else rows[:, -1])
        if self.carried.rows and experiments[0] == experiments[-1] == self.innovations.experiments[-1]:
            self.model.partial_fit(X, y)  # the same experiment continues: the fast path
        else:
            self.model.partial_fit(X, y, groups=experiments)
        self.carried.rows += len(rows)
        self.innovations.learnt(rows[:, timed:], experiments)
        if self.sides is not None:
            self.sides.take(experiments, rows)
            self.tell_moved()
        self.carried.times = (self.carried.times + rows[:, 0].tolist())[-BLOCK:] if timed else []
        if self.carried.rows % BLOCK == 0:
            self._watch(*self.innovations.of_block())

    def tell_moved(self, wait: float = 0.0) -> None:
        """Emit what changed at the last alarm, if its comparison is ready.

        ``wait``: seconds to wait for a comparison that has begun.
        """
        for told in self.sides.done(wait) if self.sides is not None else ():
            self.emit({"kind": "moved"} | told)

    def _watch(self, y: NDArray[np.float64], errors: NDArray[np.float64], e: NDArray[np.float64]) -> None:
        """Emit predictions of a complete block, check the alarms with e and update the sums; all are (n, n_outputs)."""
        first = self.carried.rows - len(e) + 1
        if self.options.predictions:
            for i, (values, missed) in enumerate(zip(y.tolist(), errors.tolist(), strict=True)):
                told = {"y": values, "y_hat": [v - e for v, e in zip(values, missed, strict=True)]}
                self.emit(self._record("prediction", first + i) | {k: self._by_output(v) for k, v in told.items()})
        if self.carried.adapting:
            self._adapt(max(self.carried.adapting - BLOCK, 0))
        every = getattr(getattr(self.model, "lags_", None), "every_", 1)  # spacing of independent rows for an arm
        asked = np.isfinite(e).all(axis=1) & ((first + np.arange(len(e))) % every == 0)  # the first block has none
        e, y = e[asked], y[asked]
        c = self.carried
        if all(alarm.settled_ for alarm in self.alarms):  # the errors of a model that settles do not count
            for name, now in (("squares", e * e), ("output_sum", y), ("output_squares", y * y)):
                setattr(c, name, [a + b for a, b in zip(getattr(c, name), now.sum(axis=0).tolist(), strict=True)])
            c.counted += len(e)
        rows = (first + np.flatnonzero(asked)).tolist()
        raised = [(rows[i], k) for k, alarm in enumerate(self.alarms) for i in alarm.update(e[:, k]).tolist()]
        for row, k in sorted(raised)[:1]:
            for other in self.alarms[:k] + self.alarms[k + 1 :]:  # the model is about to change at all joints
                other.begin()
            c.alarms += 1
            if self.sides is not None:
                self.sides.alarm(row)
            self._follow(row)
            named = {"joint": self.options.outputs[k]} if self.options.outputs[k] else {}
            said = {"cause": "change", "interval": self.alarm.interval}
            self.emit(self._record("alarm", row) | said | named)

    def _follow(self, row: int) -> None:
        """Let the model forget what it learnt before a change that was found at a row, and follow what is new."""
        self.carried.alarm_row = row
        self.model.forget_past(PAST * len(self.alarms))
        self._adapt(ADAPTING_ROWS)

    def _by_output(self, values: list[Any]) -> Any:
        """Values by the names of their outputs, or the value itself if there is only one output."""
        return values[0] if len(values) == 1 else dict(zip(self.options.outputs, values, strict=True))

    def _count_anew(self) -> None:
        """Reset the sums of innovations since the last estimate."""
        c, zeros = self.carried, [0.0] * len(self.options.outputs)
        c.counted, c.squares, c.output_sum, c.output_squares = 0, zeros, zeros, zeros

    def _adapt(self, rows: int) -> None:
        """Set the forgetting factor for a stream that will have settled after this many more rows."""
        self.carried.adapting = rows
        wanted = forgetting_after(ADAPTING_ROWS - rows, self.forgetting) if rows else self.forgetting
        if self.model.forgetting != wanted:
            set_forgetting(self.model, wanted)

    def get_state(self) -> dict[str, Any]:
        """Everything learnt and all waiting rows, in types that a state file can hold."""
        fitted = self.carried.rows > 0
        return {
            "carried": asdict(self.carried),
            "model": self.model.get_state() if fitted else {},
            "alarms": [a.get_state() if a.started else {} for a in self.alarms],
            "innovations": self.innovations.get_state() if fitted else {},
            "clock": self.clock.get_state(),
            "turns": [asdict(turns) for turns in self.turns],
            "freeze": [asdict(freeze) for freeze in self.freezes],
            "pace": asdict(self.pace),
            "lone": asdict(self.lone),
            "jumps": [asdict(jumps) for jumps in self.jumps],
            "sides": {} if self.sides is None else self.sides.get_state(),
        }

    def set_state(self, state: dict[str, Any]) -> None:
        """Continue from a state that `get_state` returned.

        ``state``: state of a monitor with the same model and options.
        """
        try:
            self.carried = Carried(**state["carried"])
            self.pace, self.lone = Pace(**state["pace"]), Lone(**state["lone"])
            self.freezes = [Freeze(**one) for one in state["freeze"]]
            self.turns, self.jumps = [Turns(**one) for one in state["turns"]], [Jumps(**one) for one in state["jumps"]]
        except (TypeError, KeyError):
            raise ValueError("This state is of an earlier version; begin the stream anew, with --fresh.") from None
        self.clock.set_state(state["clock"])
        if self.sides is not None and state.get("sides"):
            self.sides.set_state(state["sides"])
        if self.carried.rows:
            self.model.set_state(state["model"])
            self.innovations.set_state(state["innovations"])
        if self.carried.adapting:
            self._adapt(self.carried.adapting)
        for alarm, held in zip(self.alarms, state["alarms"], strict=True):
            if held:
                alarm.set_state(held)

    def _record(self, kind: str, row: int) -> Record:
        """The common fields of a record of one of the last rows."""
        times = self.carried.times
        return {"kind": kind, "row": row} | ({"time": times[row - self.carried.rows - 1]} if times else {})

    def at_the_end(self) -> list[str]:
        """What is wrong with the estimate and was not told at the last one, as none follows the last rows.

        There is a sentence for each output whose predictions are worse than the mean of the output, once the model has
        settled, and one for an axis that did not move, that nothing drove, or whose inertia is negative.
        """
        return [said for _, said in self._untold()[2]]

    @property
    def _of_an_axis(self) -> bool:
        """Whether the numbers are those of one axis."""
        return len(self.options.positions) == 1

    def lacking(self) -> str:
        """What must still come before a change can be told; empty if it can."""
        lags = getattr(self.model, "lags_", None)
        n = max(alarm.lacking_ for alarm in self.alarms) * getattr(lags, "every_", 1)
        what = "averages over motion" if self._of_an_axis else "rows"
        return f"no change can be told before {n} more {what}" if n else ""

    def _senseless(self) -> tuple[str, str]:
        """The cause and a sentence, if the numbers of an axis or of a joint are such that none has."""
        if not self.options.positions or not self.carried.rows:
            return "", ""
        values, errors = estimates(self.model)
        if not self._of_an_axis:
            brakes = {j: [n for e in BRAKES if (n := f"{j}.{e}") in values] for j in self.options.outputs}
            driven = [j for j, of in brakes.items() if of and all(values[n] < -SURE * errors[n] for n in of)]
            told = ", ".join(f"{n} is {values[n]:.4g} +- {errors[n]:.2g}" for j in driven for n in brakes[j])
            said = f"friction drives {', '.join(driven)} where it should brake ({told}); check the sign of the drive"
            return ("negative_friction", f"{said} and that of the position") if driven else ("", "")
        inertia, error = values.get("inertia", 0.0), errors.get("inertia", math.nan)
        if inertia < -SURE * error:
            return "negative_inertia", (
                f"the inertia is {inertia:.4g} +- {error:.2g}, and no axis has a negative one: drive and position "
                "count in opposite directions; change the sign of one of their columns"
            )
        if any(values.values()):
            return "", ""
        if np.isfinite(list(errors.values())).any():
            return "no_drive", (
                "the drive is zero in all rows in which the axis moved, so the zeros are no estimate; check its column "
                "and the enable"
            )
        moves = self.jumps[0].high > self.jumps[0].low
        moved = "position stops or turns in every average, as noise does," if moves else "axis has not moved yet,"
        return AT_REST, f"the {moved} so nothing was learnt and the zeros are no estimate"

    def _judged(self) -> tuple[list[bool], list[str]]:
        """Whether each output is predicted worse than by its mean, and the message for it."""
        c, poor, said = self.carried, list(self.carried.poor), [""] * len(self.options.outputs)
        if c.counted < 2 or c.adapting:  # settling after the start or an alarm
            return poor, said
        for k, name in enumerate(self.options.outputs):
            spread = c.output_squares[k] - c.output_sum[k] ** 2 / c.counted
            # an axis at rest is not judged
            nmse = c.squares[k] / spread if spread > 1e-12 * c.output_squares[k] else 0.0
            poor[k] = nmse > 1.0 + SURE * (2.0 / c.counted) ** 0.5
            of, orders = (f" of {name}", "") if name else ("", ", or try other --orders or another --law")
            said[k] = (
                f"the predictions{of} of the last {c.counted} rows are worse than the mean of the output (NMSE "
                f"{nmse:.3g}), so the model does not describe them; check columns, units and the sense of the "
                f"drive{orders}"
            )
        return poor, said

    def _judge(self, number: int) -> None:
        """Warn when an estimate begins to be none."""
        poor, cause, untold = self._untold()
        for why, reason in untold:
            if why != AT_REST:
                self._warn(why, number, reason)
        self.carried.poor, self.carried.senseless = poor, "" if cause == AT_REST else cause

    def _untold(self) -> tuple[list[bool], str, list[tuple[str, str]]]:
        """What `_judged` and `_senseless` find, with cause and sentence of what was not told at the last estimate."""
        c = self.carried
        poor, said = self._judged()
        cause, senseless = self._senseless()
        told = [("worse_than_mean", reason) for k, reason in enumerate(said) if poor[k] and not c.poor[k]]
        return poor, cause, [*told, (cause, senseless)] if cause not in ("", c.senseless) else told

    def _estimate(self) -> None:
        """Emit the current estimate, and what changed since the reference."""
        c = self.carried
        learnt = all(a.learnt_ for a in self.alarms)
        if c.alarm_row >= 0 and learnt:  # time to report what changed, from all samples since the alarm
            self.model.consolidate()
        values, errors = estimates(self.model)
        names = list(values)
        rmse = [(total / max(c.counted, 1)) ** 0.5 for total in c.squares]
        self.emit(
            self._record("estimate", c.rows)
            | {"innovation_rmse": self._by_output(rmse) if c.counted else None, "bad_rows": c.bad}
            | {"parameters": values, "standard_errors": errors}
            | ({"units": dict(self.options.units)} if self.options.units else {})
        )
        self._count_anew()
        if not (learnt if c.alarm_row >= 0 else all(a.settled_ for a in self.alarms)):
            return
        after, variances = list(values.values()), [errors[n] ** 2 for n in names]
        if not np.all(np.isfinite(variances)):
            return
        if c.reference:
            c.looks += 1
            level = DRIFT_LEVEL * 6 / (np.pi * c.looks) ** 2 if c.alarm_row < 0 else DRIFT_LEVEL
            before = c.reference
            changes = compare_parameters(names, before["values"], before["variances"], after, variances, level)
            least = self.options.smallest_change
            said = [str(change) for change in changes if change.significant and abs(change.percent) >= least]
            if said or c.alarm_row >= 0:
                since = {"since_row": before["row"], "alarm_row": c.alarm_row if c.alarm_row >= 0 else None}
                self.emit(self._record("change", c.rows) | since | {"changes": said})
            if said and c.alarm_row < 0 and not learnt:  # what is normal is still learnt, from before and after
                for alarm in self.alarms:
                    alarm.begin()
                self._follow(c.rows)
                return  # the reference stays for the change that is told once the new numbers are known
            if not said and c.alarm_row < 0 and c.reference.get("learnt", True) == learnt:
                return  # keep the reference
        c.reference = {"values": after, "variances": variances, "row": c.rows, "learnt": learnt}
        c.alarm_row, c.looks = -1, 0


# Of averages (`InverseDynamicsLags.spacing`), 100 settle the numbers of an axis, and 1,000 show what is normal: 11 s at
# 1 kHz. They are not whitened: the noise of an acceleration is all above the motion, and what is left
# below it once it is taken out follows the motion. Either matters in benchmarks/axis_alarm.py.
OF_AVERAGES: dict[str, int] = {"n_settle": 100, "n_reference": 1000, "order": 0}


def alarm_of_averages(interval: float = 1e6) -> ChangeAlarm:
    """The alarm on an axis's stream, whose innovations are those of averages; ``interval`` counts them."""
    return ChangeAlarm(interval, **OF_AVERAGES)


def _finite(row: Any, width: int) -> list[float]:
    """A row of ``width`` numbers as floats."""
    try:
        numbers = [float(v) for v in row]
    except (TypeError, ValueError):
        raise BadRow(f"a row of numbers was expected, got {str(row)[:40]!r}") from None
    if len(numbers) != width:
        raise BadRow(f"{len(numbers)} values, expected {width}")
    if not all(map(math.isfinite, numbers)):
        raise BadRow("a value is NaN or infinite")
    return numbers


def estimates(model: Any) -> tuple[dict[str, float], dict[str, float]]:
    """Parameters and standard errors by name; a standard error that is not known yet is NaN."""
    values = flat_parameters(model.parameters_)
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", message="Some standard errors are NaN")
        errors = flat_parameters(model.parameter_standard_errors_)
    return values, {name: errors.get(name, float("nan")) for name in values}
