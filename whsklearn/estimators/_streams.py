"""The three ways an estimator learns, behind one interface that takes a state and returns a state.

`RowsStream` takes rows as they are, `PublishedStream` follows the paper to the letter, and
`FullStream` uses the exact gradient.  A stream object holds only settings; what is learned is
in the ``state`` dict that every call takes, so that it can be copied, saved and compared.
"""

from __future__ import annotations

import itertools
import time
from typing import Any

import numba
import numpy as np

from whsklearn.effects.base import Array, Bools
from whsklearn.estimators._model import Structure
from whsklearn.estimators._undo import Undo
from whsklearn.recursion.memory import multistart
from whsklearn.recursion.memory.linearised import has_posterior
from whsklearn.recursion.memory.multistart import posterior
from whsklearn.recursion.memory.schedule import BackgroundRefit
from whsklearn.recursion.memory.settings import State
from whsklearn.recursion.memory.sign_posterior import Gaussian
from whsklearn.recursion.rows.covariance import WIND_UP, covariance, inflate
from whsklearn.recursion.rows.least_squares import (
    BUSY,
    N_SETTINGS,
    SINCE,
    one_row,
    pack_size,
    run_gradient,
    run_rows,
    unpacked,
)
from whsklearn.recursion.rows.pseudolinear import Published, auxiliary_size, run_pseudolinear
from whsklearn.recursion.rows.subinnovations import Samples

_numba_settings: Any = numba.config  # its attributes are created at run time


def noise_variance(loss: Array, n_parameters: int) -> float:
    """Residual sum of squares divided by the degrees of freedom; NaN while there are none."""
    free = loss[1] - n_parameters
    return float(loss[0] / free) if free > 0 else float("nan")


class OneEstimate:
    """A way of learning that keeps one theta with its P and no samples."""

    is_natural = False  # whether `theta` holds natural parameters, not products in the paper's order
    ceiling: float  # of P

    def settle(self, state: State) -> None:
        """Nothing is kept to be read again."""

    def forget_past(self, state: State, samples: float) -> None:
        """P widens as it would have under so much forgetting."""
        left = min(1.0, samples / max(float(state["loss"][1]), 1e-300))
        state["loss"] *= left
        state["power"] *= left
        inflate(state["ud"], 1.0 / left, self.ceiling)

    def theta(self, state: State) -> Array:
        """One weight per column; as published, products in the paper's order."""
        return state["theta"].copy()

    def covariance(self, state: State) -> Array:
        """Noise variance times P; as published, overlapping windows make it about p times too small."""
        return noise_variance(state["loss"], state["theta"].size) * covariance(state["ud"])


class RowsStream(OneEstimate):
    """Recursive least squares on given rows."""

    def __init__(self, n: int, p: int, p0: float, forgetting: float, theta0: Array, counted_once: bool, gradient: bool):
        self.n, self.p, self.p0, self.forgetting, self.theta0 = n, p, p0, forgetting, theta0
        self.ceiling = WIND_UP * p0
        self.variance = float(p) if counted_once else 1.0
        self.gradient = gradient
        self.undo = Undo()
        self._packed = np.zeros(N_SETTINGS)  # all arguments of `step`; the state then holds views of it
        self._packed[SINCE] = -1.0
        self._of: State = {}  # the state to which it belongs
        self._theta = theta0

    def initial(self) -> State:
        """P0 I and theta0."""
        return {
            "seen": 0,
            "since": 0,
            "theta": self.theta0.copy(),
            "ud": np.eye(self.n) * self.p0,
            "loss": np.zeros(2),
            "power": np.zeros(1),
            "rows": np.zeros((self.p, self.n)),
            "targets": np.zeros(self.p),
        }

    def run(self, state: State, u: Array, y: Array, restart: Bools, weight: Array | None = None) -> None:
        """One update per row; an experiment's first window does not reach into the previous experiment."""
        seen = len(y)
        self._packed[SINCE] = -1.0  # the last row of `step` is no longer the latest
        if weight is not None:
            u, y, restart = _weighted(u, y, restart, weight)
        for piece in pieces(restart):
            if restart[piece.start]:
                state["since"] = 0
            window = state["rows"], state["targets"], state["since"]
            if self.gradient:
                state["since"] = run_gradient(
                    state["theta"], state["loss"], *window, state["power"], self.forgetting, self.p, u[piece], y[piece]
                )
            else:
                state["since"] = run_rows(
                    state["theta"], state["ud"], state["loss"], *window, self.forgetting, self.ceiling, self.p,
                    self.variance, u[piece], y[piece],
                )  # fmt: skip
        state["seen"] += seen

    def step(self, state: State, u: Array, y: Array) -> bool:
        """Learn one float64 row; False, and no change, if it needs full validation or another thread is active."""
        if state is not self._of or state["theta"] is not self._theta:
            return False  # until `pack`
        try:
            since = self._kernel(self._packed, state["since"], u, y)
        except BaseException as error:
            # A signal is handled after the kernel, which learns a row completely or not at all; the row then counts.
            if self._packed[SINCE] == state["since"] + 1:
                state["seen"] += 1
                state["since"] += 1
            elif type(error) is TypeError:
                return False  # arrays of another kind
            raise
        if since < 0:
            return False
        state["seen"] += 1
        state["since"] = since  # set last: from now on `one_row` accepts a row of another thread
        return True

    def pack(self, state: State) -> None:
        """Prepare the state for `step`: all that a row changes moves into one array, of which the state holds views."""
        if self.gradient or _numba_settings.DISABLE_JIT or (state is self._of and state["theta"] is self._theta):
            return
        flat = np.empty(pack_size(self.n, self.p))
        flat[:N_SETTINGS] = -1.0, self._packed[BUSY], self.forgetting, self.ceiling, self.p, self.variance
        names = "theta", "ud", "loss", "rows", "targets"
        for name, view in zip(names, unpacked(flat, self.n, self.p), strict=False):
            view[:] = state[name]
            state[name] = view
        self._packed, self._kernel = flat, one_row()
        self._of, self._theta = state, state["theta"]

    def hold(self, state: State) -> None:
        """Block `step` until `let_go`, after waiting for a row that another thread is learning."""
        self._packed[BUSY] = 1.0
        while state is self._of and self._packed[SINCE] not in (-1.0, state["since"]):
            time.sleep(0.0)

    def let_go(self, state: State) -> None:
        """Admit `step` again, for the current state only: no thread may learn on a state that was replaced."""
        if state is not self._of:
            self._of = {}
        self._packed[BUSY] = 0.0


class PublishedStream(OneEstimate):
    """(6) to (14) of the paper to the letter, with the auxiliary model."""

    def __init__(self, structure: Structure, p: int, p0: float, forgetting: float, theta0: Array, mode: int):
        self.structure, self.p, self.p0, self.forgetting = structure, p, p0, forgetting
        self.theta0, self.mode = theta0, mode
        self.ceiling = WIND_UP * p0
        self.undo = Undo()

    def initial(self) -> State:
        """P(0) = p_0 I and theta(0)."""
        s, n = self.structure, self.theta0.size
        lags = self.p + max(int(s.dims[0]) // s.n_inputs + 1, int(s.dims[3]), 1)
        return {
            "seen": 0,
            "since": 0,
            "theta": self.theta0.copy(),
            "ud": np.eye(n) * self.p0,
            "before": np.zeros(auxiliary_size(s.dims)),
            "loss": np.zeros(2),
            "power": np.zeros(1),
            "recent_u": np.zeros(lags * s.n_inputs),
            "recent_y": np.zeros(lags),
            "recent_weight": np.ones(lags),
        }

    def run(self, state: State, u: Array, y: Array, restart: Bools, weight: Array | None = None) -> None:
        """One window per sample."""
        weight = np.ones(len(y)) if weight is None else weight
        s = self.structure
        model = Published(*(state[name] for name in Published._fields))
        recent = Samples(state["recent_u"], state["recent_y"], state["recent_weight"])
        law = s.dims, s.law.codes, s.law.shapes, s.key
        for piece in pieces(restart):
            if restart[piece.start]:
                state["since"] = 0
                for name in ("before", "recent_u", "recent_y"):
                    state[name][:] = 0.0
            state["since"] = run_pseudolinear(
                model, recent, state["since"], self.forgetting, self.ceiling, law, self.p, self.mode,
                Samples(u[piece], y[piece], weight[piece]),
            )  # fmt: skip
        state["seen"] += len(y)


class FullStream:
    """The exact gradient, several starts and a memory."""

    is_natural = True

    def __init__(self, structure: Structure, settings: multistart.Settings):
        self.structure, self.settings = structure, settings
        self.undo = Undo()
        self._page: BackgroundRefit | None = None  # in progress; can restart at any time, so not part of the state
        self._known: tuple[bytes, Gaussian] | None = None  # the last estimate computed, and the state it belongs to

    def initial(self) -> State:
        """The state of `multistart`."""
        return multistart.initial_state(self.settings)

    def run(self, state: State, u: Array, y: Array, restart: Bools, weight: Array | None = None) -> None:
        """One window per sample and start; the memory is re-run at its scheduled instants."""
        if self.undo.noted and self._page is not None:
            self._page.put_off()
        self._page = multistart.run(state, self.settings, u, y, restart, self._page, weight)

    def settle(self, state: State) -> None:
        """Re-run the memory, so that the whole record is evaluated at the present parameters."""
        if self.settings.memory and state["fill"]:
            multistart.consolidate(state, self.settings, self._page)
            self._page = None

    def forget_past(self, state: State, samples: float) -> None:
        """P widens, and the samples in memory have less weight when they are re-run."""
        multistart.forget_past(state, samples)

    def estimate(self, state: State) -> Gaussian:
        """Mean and covariance of the natural parameters; computed once per state."""
        s = multistart.answer(state)
        numbers = [state["seen"], state["fill"], s, state["known"][0], state["oblivion"], state["past_count"][0]]
        mark = np.append(state["theta"][s], numbers).tobytes()
        if self._known is None or mark != self._known[0]:
            self._known = mark, self._estimate(state)
        return self._known[1]

    def _estimate(self, state: State) -> Gaussian:
        """The posterior if signs may be in doubt, otherwise the model that gives the answer and its P."""
        r = self.settings
        whole = bool(np.all(state["memory_kept"][: state["fill"]] == 1.0)) if r.memory else False
        silent, certain = multistart.is_silent(state), has_posterior(r)
        # Between two re-runs the recursion may stray: after 1,000 rows of a spline its free run had 2,000 times the
        # error of a re-run, which corrects it as the posterior does where there is one.
        strays = whole and not certain and bool(state["motion"][multistart.answer(state), 1])
        if r.memory and state["fill"] > r.size and (silent or strays):
            state = multistart.settled(state, r)  # re-run now, so that the estimate equals that of `fit`
        s = multistart.answer(state)
        certain = certain and not multistart.is_silent(state)
        found = posterior(state, r, s) if certain else None
        if found is not None:
            return found
        return Gaussian(state["theta"][s], noise_variance(state["loss"][s], 0) * covariance(state["ud"][s]))

    def running(self, state: State) -> Array:
        """Natural parameters, in the running recursion, of the model that gives the answer."""
        return state["theta"][multistart.answer(state)].copy()

    def theta(self, state: State) -> Array:
        """The natural parameters: the posterior mean, or those of the model that gives the answer."""
        return self.estimate(state).mean.copy()

    def covariance(self, state: State) -> Array:
        """Covariance of the posterior, or noise variance times P."""
        return self.estimate(state).covariance.copy()


AnyStream = RowsStream | PublishedStream | FullStream


def _weighted(u: Array, y: Array, restart: Bools, weight: Array) -> tuple[Array, Array, Bools]:
    """Rows and targets times the root of their weight; those of weight zero are omitted."""
    kept = weight > 0.0
    root = np.sqrt(weight[kept])
    experiment = np.cumsum(restart)[kept]
    begins = np.diff(experiment, prepend=0) > 0
    return np.ascontiguousarray(u[kept] * root[:, None]), y[kept] * root, begins


def pieces(restart: Bools) -> list[slice]:
    """The record, cut where each experiment begins."""
    cuts = np.flatnonzero(restart)
    if not cuts.size:
        return [slice(0, restart.size)] if restart.size else []
    bounds = np.unique(np.concatenate([[0], cuts, [restart.size]]))
    return [slice(int(i), int(j)) for i, j in itertools.pairwise(bounds)]
