"""The simulation-error fit in one pass: a start on the first samples, then block by block."""

from __future__ import annotations

import copy
import warnings
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike
from threadpoolctl import threadpool_limits

from whsklearn._inputs import check_whole, starts
from whsklearn.effects import as_law
from whsklearn.effects.base import Array, Bools
from whsklearn.estimators._model import Structure
from whsklearn.estimators._records import Given, checked_weights, joined
from whsklearn.estimators._simulation_fit import natural_of, to_chain
from whsklearn.estimators.pem import ChainRegressor, PEMRegressor
from whsklearn.lags.wiener_hammerstein import WienerHammersteinLags
from whsklearn.recursion.batch.best_linear import IOData
from whsklearn.recursion.batch.simulation_error import FittedChain, block_update, orthonormal, run, with_basis
from whsklearn.recursion.batch.simulation_search import SKIP, delayed


class StreamingPEMRegressor(ChainRegressor):
    """Identify a Wiener-Hammerstein system by its simulation error, in one pass and with bounded memory.

    The first ``n_start`` samples are kept and fitted as by `PEMRegressor` with ``criterion="simulation"``.
    From then on each block is re-run with the newest parameters, from 300 samples before it, and

        |e_block(theta)|^2 + (theta - theta_0)' R (theta - theta_0)

    is minimised in three Gauss-Newton steps, after which R grows by J'J of the block.  How the samples are
    divided into chunks makes no difference.

    Parameters
    ----------
    lags : WienerHammersteinLags, optional
        Orders, law and delays; None searches for them, as `PEMRegressor` does.
    n_start : int, default=5000
        Number of samples of the start.  Its fit takes some seconds.  Before it, `predict` fits the samples so far.
    block : int, default=1000
        Number of samples of a block; values from 200 to 3,000 make no difference on the benchmark.

        In the midst of a stream `set_params` may change ``block``, and before the start all; `partial_fit` refuses
        other orders, delays or laws after it, and `fit` begins anew.

    Attributes
    ----------
    theta_, covariance_, standard_errors_, parameters_, structure_
        As for `PEMRegressor`.

    References
    ----------
    Ljung 1999, System Identification, ch. 11, of which this is the Gauss-Newton form by blocks.

    Examples
    --------
    >>> import numpy as np
    >>> from whsklearn import StreamingPEMRegressor, WienerHammersteinLags
    >>> u = np.random.default_rng(0).standard_normal((1500, 1))
    >>> x = u[:, 0] + 0.5 * np.r_[0.0, u[:-1, 0]]
    >>> y = np.tanh(x)
    >>> lags = WienerHammersteinLags(2, 0, 1, 0, law="cubic_spline", delays=(0, 0))
    >>> model = StreamingPEMRegressor(lags, n_start=500, block=200)
    >>> for chunk in np.split(np.arange(1500), 5):
    ...     model = model.partial_fit(u[chunk], y[chunk])
    >>> model.parameters_["a"].round(2)
    array([1. , 0.5])
    """

    def __init__(self, lags: WienerHammersteinLags | None = None, *, n_start: int = 5000, block: int = 1000):
        self.lags = lags
        self.n_start = n_start
        self.block = block

    _fits_free_run = True

    def _found_lags(self) -> dict[str, Any] | None:
        found: dict[str, Any] | None = self._answer()["lags"]
        return found

    def _fit(self, given: Given) -> None:
        """As `partial_fit` on a new estimator."""
        self._learn(given, some=True)
        if self.state_["lags"] is None:  # shorter than a start: fit now, as a caller of fit expects
            self._early = {**self._started(self.state_), "of": self.state_["y"]}

    def partial_fit(
        self, X: ArrayLike, y: ArrayLike, groups: ArrayLike | None = None, sample_weight: ArrayLike | None = None
    ) -> Self:
        """Learn further samples; without ``groups`` they continue the last experiment.  Raises as `fit` does.

        ``X`` (n, n_features), ``y`` (n,): input and output. ``groups`` (n,): the experiment of each row; by default the
        last one continues. ``sample_weight`` (n,): 1 / variance of each sample.
        """
        with self._alone(), self._unchanged_if_refused():
            before = self.state_["seen"] if hasattr(self, "state_") else 0
            self._learn(joined(X, y, groups, sample_weight, before), some=False)
        return self

    def _learn(self, given: Given, *, some: bool) -> None:
        """Check and learn; with ``some``, at least one weight must be above zero."""
        first = not hasattr(self, "state_")
        for name, least in (("n_start", 50), ("block", 20)):
            check_whole(name, getattr(self, name), least)
        if first or self.state_["lags"] is None:
            self._keep_lags()
        else:
            self._check_structure(self.state_)
        X, y = self._validate(given.X, given.y, reset=first)
        weights = checked_weights(given.sample_weight, len(X), some=some)
        groups = given.groups
        if first and self.lags is None and X.shape[1] > 1:
            raise ValueError("Orders are searched for one input; give lags=WienerHammersteinLags(...).")
        self.__dict__.pop("_early", None)
        state = self._initial(X.shape[1]) if first else copy.copy(self.state_)
        restart = starts(groups, len(X), first=first, last=state["group"])
        if groups is not None:
            state["group"] = str(np.asarray(groups)[-1])
        self._take(state, X, y, restart, np.ones(len(y)) if weights is None else weights)
        self.state_ = state

    def _initial(self, m: int) -> dict[str, Any]:
        return {
            "seen": 0,
            "fitted": 0,
            "group": None,
            "u": np.empty((0, m)),
            "y": np.empty(0),
            "restart": np.empty(0, dtype=bool),
            "weight": np.empty(0),
            "theta": np.empty(0),
            "lags": None,
            "basis": np.empty((0, 0)),
            "information": np.empty((0, 0)),
            "loss": np.zeros(2),
        }

    def _take(self, state: dict[str, Any], X: Array, y: Array, restart: Bools, weight: Array) -> None:
        """Put samples into the buffer; fit the start and every block at fixed counts, whatever the chunks."""
        done = 0
        while done < len(y):
            due = self.n_start if state["lags"] is None else state["fitted"] + self.block
            due = max(due, state["seen"])  # either may have been made smaller since
            part = slice(done, min(len(y), done + due - state["seen"]))
            for name, values in (("u", X), ("y", y), ("restart", restart), ("weight", weight)):
                state[name] = np.concatenate([state[name], values[part]])
            state["seen"] += part.stop - done
            done = part.stop
            if state["seen"] == due:
                self._begin(state) if state["lags"] is None else self._block(state)
                state["fitted"] = due
                for name in ("u", "y", "restart", "weight"):
                    state[name] = state[name][-SKIP:].copy()

    def _check_state(self, state: dict[str, Any]) -> None:
        super()._check_state(state)
        self._check_structure(state)

    def _check_structure(self, state: dict[str, Any]) -> None:
        """Raise if what was begun has other orders, delays or terms of the law than ``lags``, which may be None."""
        begun = state["lags"] and WienerHammersteinLags(**state["lags"])
        if begun and self.lags is not None and _structure_of(begun) != _structure_of(self.lags):
            raise ValueError(
                f"This {type(self).__name__} was begun with other orders, delays or terms of the law than lags "
                "has now; use the parameters it was begun with, or call fit."
            )

    @property
    def _skip(self) -> int:
        """Number of samples at the start of an experiment that do not count."""
        return min(SKIP, int(self.n_start) // 10)

    @threadpool_limits.wrap(limits=1, user_api="blas")  # two take twice the CPU and sum in another order
    def _begin(self, state: dict[str, Any]) -> None:
        """Fit the start as a batch, and keep its information matrix."""
        begun = self._started(state)
        chain = self._chain(begun, state["u"].shape[1])
        data = _window(state, 0, self._skip)
        basis = orthonormal(run(chain, data).columns[:, data.counts])
        error, rows = with_basis(chain, data, basis)
        state.update(begun, basis=basis, information=rows @ rows.T)
        state["loss"] = np.array([float(error @ error), float(data.counts.sum())])

    def _started(self, state: dict[str, Any]) -> dict[str, Any]:
        """theta and lags of a batch fit to all samples in the buffer."""
        restart = state["restart"].copy()
        restart[0] = True
        model = PEMRegressor(self.lags, criterion="simulation", n_starts=4, random_state=0)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", UserWarning)  # a stream may begin at rest; that is not the user's mistake
            model.fit(state["u"], state["y"], groups=np.cumsum(restart), sample_weight=state["weight"])
        found = model.state_
        return {"theta": found["theta"], "lags": found["lags"], "spread": found["covariance"], "noise": found["noise"]}

    @threadpool_limits.wrap(limits=1, user_api="blas")  # two take twice the CPU and sum in another order
    def _block(self, state: dict[str, Any]) -> None:
        """Learn the samples of the buffer that came after the last block."""
        m = state["u"].shape[1]
        chain, data = self._chain(state, m), _window(state, state["seen"] - state["fitted"], self._skip)
        chain, information, loss = block_update(chain, state["information"], data, state["basis"])
        lags = state["lags"] | {"law": chain.law.reweighted(chain.weights)}
        state.update(theta=natural_of(chain)[0], information=information, lags=lags)
        state["loss"] = state["loss"] + [loss, float(data.counts.sum())]

    def _chain(self, answer: dict[str, Any], m: int) -> FittedChain:
        lags = WienerHammersteinLags(**answer["lags"])
        return to_chain(answer["theta"], lags.dims(m), m, as_law(lags.law))

    def _answer(self) -> dict[str, Any]:
        """theta and lags of the state or, before the start, of a fit to the samples so far."""
        if self.state_["lags"] is not None:
            return self.state_
        early = self.__dict__.get("_early")
        if early is None or early["of"] is not self.state_["y"]:
            early = self._started(self.state_)  # not kept: predict leaves no trace
        return early

    def _natural(self) -> Array:
        return self._answer()["theta"].copy()

    def _running(self) -> tuple[Array, Structure]:
        if self.state_["lags"] is None:
            raise ValueError(
                f"There is no running estimate before {self.n_start} samples, and {self.state_['seen']} were learned; "
                "wait, or use settle=True, which fits the samples so far."
            )
        return super()._running()

    def _natural_covariance(self) -> Array:
        answer = self._answer()
        if self.state_["lags"] is None:
            return answer["spread"].copy()
        chain = self._chain(answer, self.n_features_in_)
        scale = np.sqrt(np.maximum(np.diag(answer["information"]), 1e-300))
        inverse = np.linalg.pinv(answer["information"] / np.outer(scale, scale), rcond=1e-13, hermitian=True)
        n = chain.linear_part.size
        back = np.eye(n + len(chain.law))
        back[n:, n:] = answer["basis"].T
        loss, count = answer["loss"]
        covariance = loss / max(count - len(scale), 1.0) * back @ (inverse / np.outer(scale, scale)) @ back.T
        at = natural_of(chain)[1]
        return covariance[np.ix_(at, at)]

    def _noise_variance(self) -> float:
        answer = self._answer()
        if self.state_["lags"] is None:
            return float(answer["noise"])
        loss, count = answer["loss"]
        return float(loss / max(count - self.state_["information"].shape[0], 1.0))


def _structure_of(lags: WienerHammersteinLags) -> tuple[Any, ...]:
    """Orders, delays and the kinds of the law's terms."""
    orders = (lags.n_a, lags.n_b, lags.n_c, lags.n_d)
    return *orders, tuple(lags.delays), *(type(term) for term in as_law(lags.law).terms)


def _window(state: dict[str, Any], last: int, skip: int) -> IOData:
    """The buffer as a record in which only the last samples count (0: all), except those just after a restart."""
    restart, n = state["restart"].copy(), state["y"].size
    counts = np.arange(n) >= (n - last if last else 0)
    for begin in np.flatnonzero(restart):
        counts[begin : begin + skip] = False
    counts &= state["weight"] > 0.0
    restart[0] = True
    delay = sum(state["lags"]["delays"]) if state["lags"] else 0
    bounds = np.append(np.flatnonzero(restart), n).astype(np.int64)
    weight = state["weight"]
    root = None if (weight == 1.0).all() else np.sqrt(weight)
    return IOData(delayed(state["u"], bounds, delay), state["y"], bounds, counts, root)
