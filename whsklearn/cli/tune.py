"""Search the settings of an estimator: every candidate is a run, and the best model is registered if it is good enough.

Workers, on this machine or on a Dask cluster, compute; this process records, so that an interrupted
search keeps the runs of the candidates that it finished.
"""

from __future__ import annotations

import contextlib
import itertools
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, Any

import click
import numpy as np

from whsklearn.cli.job import dask_client, job, progress_bar, say_where, table, tracker_for, wrapped
from whsklearn.cli.options import LOG, ORDERS, given, logged_option, reading_options, system_options
from whsklearn.cli.records import note, record_of
from whsklearn.cli.simulated_example import SNR_DB, simulated_records

if TYPE_CHECKING:
    from whsklearn.cli.comparison import ComparedRecord

MEAN = 1.0  # the NMSE of a model that only knows the mean of the output


@job
@click.option("--log", "log_file", type=LOG, help="A log: CSV, Parquet, MAT, MCAP, ...")
@system_options
@logged_option
@reading_options
@click.option("--samples", type=click.IntRange(100), default=1000, help="Of the simulated example, if no log is given.")
@click.option("--p", "lengths", default="1,2,4,8", help="Innovation lengths to try.")
@click.option("--P0", "variances", default="default", help="Initial covariance scales to try, as in default,1,1e6.")
@click.option("--forgetting", "factors", default="default", help="Forgetting factors to try, as in default,0.999.")
@click.option("--orders", type=ORDERS, multiple=True, default=("2,2,2,2",), help="Orders; repeat to try several.")
@click.option("--law", "laws", multiple=True, help="Friction laws as names joined by commas; repeat to try several.")
@click.option(
    "--search", "kind", type=click.Choice(["grid", "random", "halving"]), default="grid", help="How to search."
)
@click.option("--candidates", type=click.IntRange(min=1), default=20, help="Candidates of a random search.")
@click.option("--folds", type=click.IntRange(min=2), default=4, help="Folds; each is tested on what comes after it.")
@click.option("--jobs", type=int, default=-1, help="Worker processes; -1 for one per core.")
@click.option("--backend", type=click.Choice(["local", "dask"]), default="local", help="Where the workers are.")
@click.option("--scheduler", help="Address of a Dask scheduler; a cluster of two local workers if omitted.")
@click.option("--register", "registered", default="tuned", help="Name to register the best model under.")
def main(**options: Any) -> None:
    """Search innovation length, covariance, forgetting, orders and laws with time-safe folds.

    The best model is registered with an alias of its data set, champion-axis for axis.csv, unless the mean of the
    output or the present champion does better on the same folds.

    Example: whsklearn tune --log axis.csv --input torque_nm --output velocity_rad_s --p 1,2,4,8
    """
    from sklearn import config_context

    from whsklearn import RMILSRegressor, WienerHammersteinLags
    from whsklearn.tracking.served import alias_of

    if options["log_file"]:
        record = record_of(options)
    else:
        record, *_ = simulated_records(options["samples"], SNR_DB, options["seed"])
    grid = grid_of(options)
    estimator = RMILSRegressor(lags=WienerHammersteinLags(), random_state=options["seed"])
    check_values(estimator, grid)
    if record.groups is not None:
        note(f"The log has holes; the model restarts in each of its {record.groups[-1] + 1} segments.")
    tracker = tracker_for("tune", options["track"], data=record.name, estimator="RMILSRegressor")
    with (
        config_context(enable_metadata_routing=record.groups is not None),  # segments reach ``fit``: `with_segments`
        workers(options["backend"], options["scheduler"]),
        tracker.run(f"{options['kind']} on {record.name}") as parent,
    ):
        parent.log_params(given(options))
        parent.log_input(record.X, record.y, record.name)
        search = build_search(options, estimator, grid, record)
        run_search(search, record, parent, total=count(options, grid), varied=varied_names(grid))
        results = by_our_names(search.cv_results_)
        click.echo("\n" + leaders(results))
        for score, sign in (("neg_nmse", -1.0), ("neg_rmse", -1.0), ("mu_e", 1.0)):
            if f"mean_test_{score}" in results:
                value = sign * results[f"mean_test_{score}"][search.best_index_]
                parent.log_metrics({score.removeprefix("neg_"): value})
        parent.log_tags({f"best_{k}": v for k, v in search.best_params_.items()})
        name, alias = options["registered"], alias_of(record.name)
        better = what_is_better(search, record, lambda: parent.champion(name, alias))
        if better:
            parent.log_model(search.best_estimator_, record.X)
            parent.log_tags({"not_registered": better})
            click.echo("\n" + wrapped(f"{better} Nothing is registered."))
        elif options["track"]:
            parent.log_model(search.best_estimator_, record.X, registered_name=name, alias=alias)
            click.echo(f"\nThe best model, fitted to the whole record, is models:/{name}@{alias}.")
    say_where(tracker)


def with_segments(estimator: Any, record: ComparedRecord) -> tuple[Any, dict[str, Any]]:
    """The estimator, requesting segments if there are several, and the arguments of a search besides X and y.

    A test fold is simulated across holes; the error lasts as long as the system remembers and is the same for every
    setting.
    """
    if record.groups is None:
        return estimator, {}
    return estimator.set_fit_request(groups=True), {"groups": record.groups}


def what_is_better(search: Any, record: ComparedRecord, champion: Callable[[], Any]) -> str:
    """A sentence if the mean of the output or the settings of the champion do better on the folds; otherwise empty."""
    from sklearn.base import clone
    from sklearn.model_selection import cross_val_score

    scorer = search.scoring["neg_nmse"] if isinstance(search.scoring, dict) else search.scoring

    def nmse_of(estimator: Any) -> float:
        model, params = with_segments(clone(estimator), record)
        scores = cross_val_score(model, record.X, record.y, scoring=scorer, cv=search.cv, params=params or None)
        return -float(scores.mean())

    # halving judges on part of the record, but the champion is judged on all of it
    best = nmse_of(search.best_estimator_) if hasattr(search, "n_resources_") else -float(search.best_score_)
    if not best < MEAN:
        return (
            f"The best candidate has an NMSE of {best:.3g}, and the mean of the output one of 1. Try --P0 default,1, "
            "other --orders or another --law; `whsklearn identify` finds the structure that fits the record."
        )
    try:
        holder = champion()
        present = np.inf if holder is None else nmse_of(holder)
    except Exception as error:  # a model that somebody else registered may fail in any way
        return f"The present champion cannot be judged on this record, so it is kept: {str(error).splitlines()[0]}"
    if present < best:
        return (
            f"The present champion's settings have an NMSE of {present:.3g} on these folds, the best ones {best:.3g}."
        )
    return ""


def grid_of(options: dict[str, Any]) -> list[dict[str, list[Any]]]:
    """One grid for each combination of orders and law, because orders move together."""
    from whsklearn import RMILSRegressor

    usual = RMILSRegressor().get_params()
    free: dict[str, list[Any]] = {"p": numbers(options["lengths"], "--p", int)}
    for name, key in (("P0", "variances"), ("forgetting", "factors")):
        if options[key] != "default":
            free[name] = numbers(options[key], f"--{name}", float, default=usual[name])
    laws = options["laws"] or (None,)
    grids = []
    for orders, law in itertools.product(options["orders"], laws):
        fixed = {f"lags__{k}": [v] for k, v in zip(("n_a", "n_b", "n_c", "n_d"), orders, strict=True)}
        grids.append({**free, **fixed, "lags__law": [law]})
    return grids


def check_values(estimator: Any, grid: list[dict[str, list[Any]]]) -> None:
    """Raise in one sentence for a value that no fit takes; the search would raise the tracebacks of all its fits."""
    from sklearn.base import clone

    for name, value in dict.fromkeys((k, v) for part in grid for k, values in part.items() for v in values):
        clone(estimator).set_params(**{name: value})._check_parameters()


def numbers(text: str, option: str, kind: type, **words: Any) -> list[Any]:
    """Numbers from ``1,2,4``, and what each of the ``words`` stands for."""
    try:
        return [words[v] if v in words else kind(v) for v in map(str.strip, text.split(","))]
    except ValueError:
        like = "default,1,1e6" if words else "1,2,4"
        raise ValueError(f"{option} is {text!r}; expected numbers joined by commas, such as {like}.") from None


def count(options: dict[str, Any], grid: list[dict[str, list[Any]]]) -> int:
    """Number of candidates that the search will try; halving tries some of them more than once."""
    from sklearn.model_selection import ParameterGrid

    whole = len(ParameterGrid(grid))
    return min(options["candidates"], whole) if options["kind"] == "random" else whole


def build_search(
    options: dict[str, Any], estimator: Any, grid: list[dict[str, list[Any]]], record: ComparedRecord
) -> Any:
    """The search with its folds and scores of the free run, without the first samples after each restart."""
    from sklearn.base import clone
    from sklearn.metrics import make_scorer
    from sklearn.model_selection import GridSearchCV, RandomizedSearchCV

    from whsklearn.cli.recorded_search import recorded
    from whsklearn.metrics import free_run_scorer, mu_e, nmse, rmse
    from whsklearn.validation import memory_length, time_series_split

    orders = [{k: v[0] for k, v in g.items() if k.startswith("lags__")} for g in grid]
    widest = max((clone(estimator).set_params(p=max(grid[0]["p"]), **o) for o in orders), key=memory_length)
    least = record.y.size // (4 if options["kind"] == "halving" else 1)  # samples of the shortest search
    skip = min(50, least // (4 * (options["folds"] + 1)))
    scoring = {"neg_nmse": free_run_scorer(nmse, skip=skip), "neg_rmse": free_run_scorer(rmse, skip=skip)}
    scoring["mu_e"] = make_scorer(mu_e, skip=skip)
    common = {"scoring": scoring, "refit": "neg_nmse", "cv": time_series_split(widest, options["folds"])}
    common |= {"n_jobs": options["jobs"], "error_score": np.nan}
    if options["kind"] == "random":
        return recorded(RandomizedSearchCV)(
            estimator, grid, n_iter=count(options, grid), random_state=options["seed"], **common
        )
    if options["kind"] == "halving":
        from sklearn.experimental import enable_halving_search_cv  # noqa: F401
        from sklearn.model_selection import HalvingGridSearchCV

        common |= {"scoring": scoring["neg_nmse"], "refit": True, "min_resources": least}
        return recorded(HalvingGridSearchCV)(estimator, grid, random_state=options["seed"], **common)
    return recorded(GridSearchCV)(estimator, grid, **common)


def varied_names(grid: list[dict[str, list[Any]]]) -> list[str]:
    """The parameters that the search varies, the innovation length first; runs are named after them."""
    values: dict[str, set[str]] = {}
    for part in grid:
        for name, choices in part.items():
            values.setdefault(name, set()).update(map(str, choices))
    return [k for k, v in values.items() if len(v) > 1]


def run_search(search: Any, record: ComparedRecord, parent: Any, total: int, varied: list[str]) -> None:
    """Fit, and record each chunk of candidates when it is finished.

    If recording fails, the search ends and prints the candidates so far.
    """
    from whsklearn.tracking import TrackingError, log_candidates

    done = 0
    with progress_bar(total=total, desc="candidates", unit="fit") as bar:

        def record_chunk(results: dict[str, Any]) -> None:
            nonlocal done
            tags = {"reading": "full", "estimator": type(search.estimator).__name__}
            try:
                log_candidates(parent, by_our_names(results), first=done, tags=tags, varied=varied)
            except TrackingError:
                click.echo("\n" + leaders(by_our_names(results)))
                raise
            bar.update(len(results["params"]) - done)
            done = len(results["params"])

        search.on_results = record_chunk
        search.estimator, params = with_segments(search.estimator, record)
        search.fit(record.named, record.y, **params)
        for model in (search.estimator, search.best_estimator_):
            vars(model).pop("_metadata_request", None)  # of the search, not of the model that is kept


def by_our_names(results: dict[str, Any]) -> dict[str, Any]:
    """The results, with halving's single ``score`` under the name of its metric."""
    return {k.replace("_test_score", "_test_neg_nmse"): v for k, v in results.items()}


@contextlib.contextmanager
def workers(backend: str, scheduler: str | None) -> Iterator[None]:
    """Compute on this machine's processes, or on a Dask cluster through joblib."""
    if backend == "local":
        yield
        return
    from joblib import parallel_config

    with dask_client(scheduler, 2) as client:
        count, where = len(client.scheduler_info()["workers"]), client.scheduler.address
        click.echo(f"Dask: {count} workers at {where}.", err=True)
        with parallel_config(backend="dask"):
            yield


def leaders(results: dict[str, Any]) -> str:
    """The best eight candidates as a table."""
    key = "mean_test_neg_nmse"
    order = np.argsort(-np.nan_to_num(results[key], nan=-np.inf))[:8]
    varied = [k for k in results["params"][0] if len({str(p[k]) for p in results["params"]}) > 1] or ["p"]
    rows = []
    for i, c in enumerate(order):
        settings = [results["params"][c][k] for k in varied]
        settings = ["default" if v is None else v for v in settings]  # None is the estimator's default
        rows.append([i + 1, *settings, float(-results[key][c]), float(results["mean_fit_time"][c])])
    names = [k.removeprefix("lags__") for k in varied]
    return table(["", *names, "NMSE", "seconds"], rows, title=f"The best {len(rows)}")
