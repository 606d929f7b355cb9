"""The comparison that all jobs share: fit each candidate, simulate it on unseen records, and record the result."""

from __future__ import annotations

import contextlib
import time
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import Any

import click
import numpy as np
from numpy.typing import NDArray
from sklearn.base import clone
from tqdm import tqdm

from whsklearn import (
    DifferentialEvolutionRegressor,
    MILSRegressor,
    MultiInnovationGradientRegressor,
    PEMRegressor,
    RLSRegressor,
    RMILSRegressor,
    WienerHammersteinLags,
)
from whsklearn.cli.job import table, worse_than_mean, wrapped
from whsklearn.metrics import mu_e, nmse, parameter_error, rmse
from whsklearn.plot import flat_parameters, parameter_paths
from whsklearn.tracking import Run, TrackingError, estimator_params

MOST_OF_A_PATH = 20  # points; the default estimator takes a tenth of a second for each
WARM_UP = 600  # samples: more than the 480 at which a stream's first models take over, so that every kernel has run


@dataclass(frozen=True)
class ComparedRecord:
    """An input (n, 1) and an output (n,), with a name, and the segment of each sample if there are holes.

    ``column`` is the name of the input in its log, empty where there is none.

    >>> record = ComparedRecord("sine", X=np.zeros((100, 1)), y=np.zeros(100))
    >>> record.name, record.X.shape, record.y.shape
    ('sine', (100, 1), (100,))
    """

    name: str
    X: NDArray[np.float64]
    y: NDArray[np.float64]
    groups: NDArray[np.int64] | None = None
    column: str = ""

    @property
    def named(self) -> Any:
        """The input as a frame with the column name that a served model uses; X if there is no name."""
        if not self.column:
            return self.X
        import pandas as pd

        return pd.DataFrame(self.X, columns=[self.column])


@dataclass(frozen=True)
class ComparedModel:
    """An estimator to be compared.

    >>> from whsklearn import PEMRegressor
    >>> ComparedModel("PEM", PEMRegressor(), stream=False).reading
    '-'
    """

    name: str  # of the estimator in tables
    model: Any  # not fitted
    reading: str = "-"  # which reading of the article it follows; a dash if there is only one
    stream: bool = True  # whether its parameters are updated sample by sample, so that their paths are drawn


PUBLISHED: dict[str, Any] = {"gradient": "pseudolinear", "theta0": 0.01, "P0": 1e6}  # the article's theta(0) = 1/100


def candidates(
    lags: WienerHammersteinLags,
    *,
    p: int = 4,
    seed: int = 0,
    evolution: bool = False,
    published: dict[str, Any] | None = None,
) -> list[ComparedModel]:
    """Both readings of RLS, MILS and RMILS, the gradient scheme, and the batch fit for comparison."""
    old: dict[str, Any] = {**PUBLISHED, **(published or {})}
    common: dict[str, Any] = {"lags": lags, "random_state": seed}
    innovations = {"MILS": partial(MILSRegressor, p=p), "RMILS": partial(RMILSRegressor, p=p)}
    recursive: dict[str, Any] = {"RLS": RLSRegressor, **innovations}
    gradient = MultiInnovationGradientRegressor(lags=lags, p=p, theta0=old["theta0"])
    batch: dict[str, Any] = {"PEM": PEMRegressor}
    if evolution:
        batch["differential evolution"] = DifferentialEvolutionRegressor
    return [
        *(ComparedModel(name, cls(**common, **old), "pseudolinear") for name, cls in recursive.items()),
        ComparedModel("gradient", gradient, "pseudolinear"),
        *(ComparedModel(name, cls(**common), "full") for name, cls in recursive.items()),
        *(ComparedModel(name, cls(**common), "batch", stream=False) for name, cls in batch.items()),
    ]


@dataclass
class Outcome:
    """The result of one candidate.

    >>> from whsklearn import PEMRegressor
    >>> outcome = Outcome(ComparedModel("PEM", PEMRegressor()), failure="The record is too short.")
    >>> outcome.failure or f"NMSE {outcome.indices['nmse']:.3f}"
    'The record is too short.'
    """

    candidate: ComparedModel
    seconds: float = 0.0  # of its fit
    # ``nmse``, ``mu_e``, ``rmse`` of the free runs, mean over the test records; ``delta`` if the truth is known
    indices: dict[str, float] = field(default_factory=dict)
    fitted: Any = None
    predictions: list[NDArray[np.float64]] = field(default_factory=list)  # (n,): one free run per test record
    # (samples, name -> parameter at them) of a stream
    paths: tuple[NDArray[np.int64], dict[str, NDArray[np.float64]]] | None = None
    failure: str = ""  # the error message if it could not be fitted; empty otherwise


def compare(
    candidates: Sequence[ComparedModel],
    train: ComparedRecord,
    test: Sequence[ComparedRecord],
    *,
    parent: Run,
    theta: NDArray[np.float64] | None = None,
    skip: int = 0,
) -> list[Outcome]:
    """Fit, judge and record every candidate; a failure is reported and does not affect the others.

    Raises ValueError if no candidate can be fitted. Raises TrackingError if the record is lost: after all candidates
    are fitted and their table is printed.
    """
    compile_once(candidates, train)
    outcomes: list[Outcome] = []
    lost: TrackingError | None = None
    bar = tqdm(candidates, desc="fitting", unit="model", disable=None)
    for candidate in bar:
        bar.set_postfix_str(f"{candidate.name} {candidate.reading}")
        outcome = Outcome(candidate)
        try:
            _fit_and_score(outcome, train, test, theta, skip)
        except ValueError as error:
            outcome.failure = str(error).splitlines()[0]
        outcomes.append(outcome)
        if lost is None:
            try:
                _record(outcome, parent, train)
            except TrackingError as error:
                lost = error
    if lost is not None:
        click.echo(f"\n{results_table(outcomes, f'Not all of it recorded, on {train.name}')}")
        raise lost
    if all(o.failure for o in outcomes):
        raise ValueError(f"No candidate could be fitted to {train.name}; the first reason is: {outcomes[0].failure}")
    best = min((o for o in outcomes if not o.failure), key=lambda o: o.indices["nmse"])
    parent.log_metrics(best.indices)  # so that the page, sorted by a metric, shows the parent in its place
    parent.log_tags({"best": f"{best.candidate.name} ({best.candidate.reading})"})
    return outcomes


def compile_once(candidates: Sequence[ComparedModel], train: ComparedRecord) -> None:
    """Fit every candidate to a few samples, so that the measured times do not include compilation.

    The first run on a machine compiles for some tens of seconds and caches the result; later runs take a second.
    """
    bar = tqdm(candidates, desc="compiling (once on a machine)", unit="model", leave=False, disable=None)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # a few samples are not enough to judge by
        for candidate in bar:
            with contextlib.suppress(ValueError):
                few = clone(candidate.model)
                if "n_starts" in few.get_params(deep=False):
                    few.set_params(n_starts=2)  # they need the same kernels as 32
                few.fit(train.X[:WARM_UP], train.y[:WARM_UP])
                few.predict(train.X[:WARM_UP])


def _fit_and_score(
    outcome: Outcome,
    train: ComparedRecord,
    test: Sequence[ComparedRecord],
    theta: NDArray[np.float64] | None,
    skip: int,
) -> None:
    model = outcome.candidate.model
    start = time.perf_counter()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # interim estimates of a poor candidate may overflow
        outcome.fitted = model.fit(train.X, train.y)
        outcome.seconds = time.perf_counter() - start
        outcome.predictions = [np.asarray(outcome.fitted.predict(r.X), dtype=float) for r in test]
        for index in (nmse, mu_e, rmse):
            values = [index(r.y, y_hat, skip=skip) for r, y_hat in zip(test, outcome.predictions, strict=True)]
            outcome.indices[index.__name__] = float(np.mean(values))
        if theta is not None and hasattr(outcome.fitted, "theta_"):
            outcome.indices["delta"] = parameter_error(outcome.fitted.theta_, theta)
        if outcome.candidate.stream:
            every = max(10, train.y.size // MOST_OF_A_PATH)
            outcome.paths = parameter_paths(model, train.X, train.y, every=every)


def _record(outcome: Outcome, parent: Run, train: ComparedRecord) -> None:
    """Record the run of one candidate; if it could not be fitted, the run is marked as failed, with the reason."""
    candidate = outcome.candidate
    tags = {"reading": candidate.reading, "data": train.name, "estimator": type(candidate.model).__name__}
    failing = contextlib.suppress(ValueError) if outcome.failure else contextlib.nullcontext()
    with failing, parent.child(f"{candidate.name} ({candidate.reading})", tags=tags) as run:
        if outcome.failure:
            raise ValueError(outcome.failure)
        _log(outcome, run, train)


def _log(outcome: Outcome, run: Run, train: ComparedRecord) -> None:
    """Params, metrics, paths and model of one candidate."""
    fitted = outcome.fitted
    run.log_params(estimator_params(fitted))
    run.log_metrics({**outcome.indices, "fit_seconds": outcome.seconds})
    run.log_input(train.X, train.y, train.name)
    if outcome.paths is not None:
        steps, paths = outcome.paths
        run.log_paths({f"path/{k}": v for k, v in paths.items()}, steps)
    elif hasattr(fitted, "parameters_"):
        run.log_metrics({f"path/{k}": v for k, v in flat_parameters(fitted.parameters_).items()})
    if type(fitted).__module__.startswith("whsklearn."):  # the reference models of the jobs cannot be loaded elsewhere
        run.log_model(fitted, train.X)


def results_table(outcomes: Sequence[Outcome], title: str) -> str:
    """A table of candidates (rows) and indices (columns), with failures listed below it."""
    names = [k for k in ("nmse", "mu_e", "rmse", "delta") if any(k in o.indices for o in outcomes)]
    called = {f"{o.candidate.name} ({o.candidate.reading})": o for o in outcomes}
    rows = [[o.candidate.name, o.candidate.reading, *map(o.indices.get, names), o.seconds or None] for o in outcomes]
    text = table(["estimator", "reading", *names, "seconds"], rows, title=title)
    told = [f"{name} could not be fitted: {o.failure}" for name, o in called.items() if o.failure]
    bad = worse_than_mean({name: o.indices.get("nmse", 0.0) for name, o in called.items()})
    return "\n".join([text, *told, *([wrapped(bad)] if bad else [])])


def by_name(outcomes: Sequence[Outcome], **wanted: str) -> Mapping[str, Outcome]:
    """Outcomes that did not fail, by ``name, reading``."""
    fits = (o for o in outcomes if not o.failure and wanted.items() <= vars(o.candidate).items())
    return {f"{o.candidate.name}, {o.candidate.reading}": o for o in fits}
