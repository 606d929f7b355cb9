"""A thin layer over MLflow: the only place that knows where runs are stored.

Runs live in a SQLite store beneath ``mlruns/`` unless ``MLFLOW_TRACKING_URI`` names another.
No global of MLflow is changed for longer than one call, and workers never write: the parent process opens the store and
records their results.  MLflow is imported inside functions only, so the library works without it.
"""

from __future__ import annotations

import contextlib
import math
import os
import re
import sys
import time
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from whsklearn import __version__
from whsklearn.logs.files import utf8
from whsklearn.tracking import store as store
from whsklearn.tracking.served import input_example, model_requirements, own_types, served_signature
from whsklearn.tracking.store import VIEW, page_of, set_view
from whsklearn.tracking.store import TrackingError as TrackingError

if TYPE_CHECKING:
    import pandas as pd

BATCH = {"metrics": 800, "params": 100, "tags": 100}  # what one log_batch may hold: 1,000 in all


def tracking_uri(root: str | os.PathLike[str] = ".") -> str:
    """Where runs are stored: ``MLFLOW_TRACKING_URI`` if it is set, otherwise ``mlruns/mlflow.db`` beneath ``root``.

    Examples
    --------
    >>> import os
    >>> from whsklearn.tracking import tracking_uri
    >>> "MLFLOW_TRACKING_URI" in os.environ or tracking_uri().startswith("sqlite:///")
    True
    """
    default = f"sqlite:///{Path(root).resolve() / 'mlruns' / 'mlflow.db'}"
    return os.environ.get("MLFLOW_TRACKING_URI") or default


def metric_name(name: str) -> str:
    """`name` with every character that MLflow refuses replaced by an underscore.

    >>> metric_name("x_hat(k-2)")
    'x_hat_k-2'
    """
    return re.sub(r"[^\w\-./ :]+", "_", name).strip("_")


def open_tracker(
    experiment: str, *, root: str | os.PathLike[str] = ".", enabled: bool = True, tags: Mapping[str, str] | None = None
) -> Tracker:
    """Open the store in the process that records, and create the experiment if it is new.

    Parameters
    ----------
    experiment : str
        Name of the experiment.
    root : path-like
        Folder that holds ``mlruns/``; not used when ``MLFLOW_TRACKING_URI`` is set.
    enabled : bool
        False gives a tracker that records nothing and needs no MLflow.
    tags : mapping of str to str, optional
        Set on every run.

    Raises
    ------
    ImportError
        If MLflow is not installed.
    TrackingError
        If the tracking server is down or the store cannot be opened.

    Examples
    --------
    >>> from whsklearn.tracking import open_tracker
    >>> with open_tracker("axis", enabled=False).run("fit") as run:
    ...     run.log_params({"p": 4})
    """
    if not enabled:
        return Tracker(None, "", "", {})
    mlflow = store.import_mlflow()
    uri = tracking_uri(root)
    patience = store.Patience(uri)

    def opened() -> tuple[Any, str]:
        store.probe(uri, patience.most)  # a busy server may answer late
        location = None
        with store.quiet():
            if uri.startswith("sqlite:///"):
                database = Path(uri.removeprefix("sqlite:///")).resolve()
                store.initialise(database)
                location = (database.parent / "artifacts").as_uri()
            client = mlflow.MlflowClient(uri)
            found = store.experiment_id(client, experiment, location)
            set_view(client, found, experiment)
        return client, found

    try:
        client, experiment_id = patience.opened(opened)
    except TrackingError:
        raise
    except Exception as error:  # each store raises errors of its own driver
        reason = store.sentence(error)
        raise TrackingError(
            f"The record of runs at {store.public(uri)} cannot be opened ({reason}); set MLFLOW_TRACKING_URI to "
            "keep it elsewhere, or use --no-track."
        ) from error
    own = {"mlflow.source.name": experiment, "mlflow.source.type": "LOCAL", "version": __version__}
    return Tracker(store.InSentences(client, patience), experiment, experiment_id, {**own, **(tags or {})})


class Tracker:
    """An open experiment, created by `open_tracker`.

    Parameters
    ----------
    client : MlflowClient or None
        None where tracking is off.
    experiment, experiment_id : str
        Its name, and its id in MLflow.
    tags : mapping of str to str
        Of every run.

    References
    ----------
    MLflow Tracking, https://mlflow.org/docs/latest/ml/tracking/.

    Examples
    --------
    >>> from whsklearn.tracking import open_tracker
    >>> tracker = open_tracker("axis", enabled=False)  # records nothing, needs no MLflow
    >>> with tracker.run("fit") as run:
    ...     run.log_metrics({"nmse": 0.01})
    """

    def __init__(self, client: Any, experiment: str, experiment_id: str, tags: Mapping[str, str]):
        self.client = client
        self.experiment = experiment
        self.experiment_id = experiment_id
        self.tags = dict(tags)

    @property
    def place(self) -> str:
        """Address of the store; of a server, that of the experiment's page."""
        uri = store.public(str(self.client.tracking_uri))
        return page_of(uri, self.experiment_id) if uri.startswith(("http://", "https://")) else uri

    @contextlib.contextmanager
    def run(self, name: str, *, parent: Run | None = None, tags: Mapping[str, str] | None = None) -> Iterator[Run]:
        """A run of this ``name``: FINISHED after the block, FAILED with its reason if it raises, KILLED if interrupted.

        ``parent``: the run above it. ``tags``: those it has besides the tracker's.
        """
        name, own = utf8(name), {k: utf8(v) for k, v in {**self.tags, **(tags or {})}.items()}
        if self.client is None:
            yield Run(self, "")
            return
        if parent is not None:
            own["mlflow.parentRunId"] = parent.id
        run, status = Run(self, ""), "FAILED"
        try:
            with store.interruptions_wait():
                run.id = self.client.create_run(self.experiment_id, run_name=name, tags=own).info.run_id
            yield run
            status = "FINISHED"
        except KeyboardInterrupt:
            status = "KILLED"
            with contextlib.suppress(TrackingError):
                run.log_tags({"reason": "interrupted"})
            raise
        except TrackingError:  # recording itself failed; with a locked database every further attempt waits
            raise
        except BaseException as error:
            with contextlib.suppress(TrackingError):
                run.log_tags({"reason": f"{type(error).__name__}: {store.sentence(error)}"})
            raise
        finally:
            if run.id:
                self._end(run, status)

    def _end(self, run: Run, status: str) -> None:
        """Flush the buffer and end the run; an error here is raised only if the work itself succeeded."""
        lost = isinstance(sys.exception(), TrackingError)
        with contextlib.suppress(Exception) if status != "FINISHED" else contextlib.nullcontext():
            with store.interruptions_wait():
                if not lost:
                    run.flush()
                self.client.set_terminated(run.id, status)


class Run:
    """One run of the record; every method does nothing when tracking is off.

    Parameters
    ----------
    tracker : Tracker
        The experiment of the run.
    run_id : str
        In MLflow; empty if tracking is off.

    References
    ----------
    MLflow Tracking, https://mlflow.org/docs/latest/ml/tracking/.

    Examples
    --------
    >>> from whsklearn.tracking import open_tracker
    >>> with open_tracker("axis", enabled=False).run("search") as run:
    ...     with run.child("p = 4") as child:
    ...         child.log_metrics({"nmse": 0.01}, step=1000)
    """

    def __init__(self, tracker: Tracker, run_id: str):
        self.tracker = tracker
        self.id = run_id
        self._client = tracker.client
        self._buffer: dict[str, list[Any]] = {kind: [] for kind in BATCH}

    def child(self, name: str, *, tags: Mapping[str, str] | None = None) -> Any:
        """A run of this ``name`` and these ``tags`` below this one, to be used in a ``with`` block."""
        self.flush()
        return self.tracker.run(name, parent=self, tags=tags)

    def log_tags(self, tags: Mapping[str, Any]) -> None:
        """Buffer ``tags`` by name, such as ``data``, ``reading``, ``reason``."""
        if self._client is not None:
            from mlflow.entities import RunTag

            self._buffer["tags"] += [RunTag(k, utf8(str(v))[:5000]) for k, v in tags.items()]

    def log_params(self, params: Mapping[str, Any]) -> None:
        """Buffer parameters, ``params`` by name; long values are truncated."""
        if self._client is not None:
            from mlflow.entities import Param

            self._buffer["params"] += [Param(k, utf8(str(v))[:500]) for k, v in params.items()]

    def log_metrics(self, metrics: Mapping[str, float], step: int = 0) -> None:
        """Buffer ``metrics`` by name of one ``step``, such as the samples seen.

        Names of values that are not finite go into the tag ``not_finite``.
        """
        self.log_paths({k: [v] for k, v in metrics.items()}, [step])

    def log_paths(self, paths: Mapping[str, ArrayLike], steps: ArrayLike | None = None, *, points: int = 1000) -> None:
        """Buffer stepped metrics, such as the path of every parameter, thinned to at most ``points`` each.

        ``paths``: values (n,) by name. ``steps`` (n,): 0, 1, ... by default.
        """
        if self._client is None:
            return
        from mlflow.entities import Metric

        now, broken = int(time.time() * 1000), []
        for name, path in paths.items():
            values = np.asarray(path, dtype=float).ravel()
            at = np.arange(values.size) if steps is None else np.asarray(steps).ravel()
            keep = np.unique(np.linspace(0, values.size - 1, min(points, values.size)).astype(int))
            broken += [] if np.isfinite(values[keep]).all() else [name]
            self._buffer["metrics"] += [
                Metric(metric_name(name), float(values[i]), now, int(at[i])) for i in keep if math.isfinite(values[i])
            ]
        if broken:
            self.log_tags({"not_finite": ", ".join(sorted(broken))})
        if len(self._buffer["metrics"]) >= BATCH["metrics"]:
            self.flush()

    def flush(self) -> None:
        """Write the buffer, usually in one call, since each call may wait for a server."""
        while any(self._buffer.values()):
            self._client.log_batch(self.id, **{k: v[: BATCH[k]] for k, v in self._buffer.items()})
            for k, v in self._buffer.items():
                del v[: BATCH[k]]

    def log_input(self, X: ArrayLike, y: ArrayLike, name: str) -> None:
        """Record name, shape and digest of the data set, but not the samples.

        ``X`` (n, n_features): input. ``y`` (n,): output. ``name``: of the data set.
        """
        if self._client is not None:
            mlflow = store.import_mlflow()
            from mlflow.entities import DatasetInput, InputTag

            data = mlflow.data.from_numpy(np.asarray(X), targets=np.asarray(y), name=utf8(name))
            label = InputTag("mlflow.data.context", "training")
            self._client.log_inputs(self.id, [DatasetInput(data._to_mlflow_entity(), [label])])

    def log_figure(self, figure: Any, file: str) -> None:
        """Keep a matplotlib ``figure`` as the artifact ``file``."""
        if self._client is not None:
            self._client.log_figure(self.id, figure, file)

    def log_text(self, text: str, file: str) -> None:
        """Keep a ``text`` as the artifact ``file``."""
        if self._client is not None:
            self._client.log_text(self.id, text, file)

    def log_file_model(self, path: str | os.PathLike[str], rows: pd.DataFrame) -> str:
        """Keep a model file of `identify` or `gap` as a model of MLflow that can be served; return its address.

        Its metadata hold the name of the input's column and the units of input and output.

        ``path``: of ``model.json``. ``rows`` (n, 1): inputs; the first rows become the example, which names the column.
        """
        if self._client is None:
            return ""
        from whsklearn.models import load_model

        units = {"input": "as logged", "output": "as logged"} | dict(load_model(path).units)
        metadata = {"column": str(rows.columns[0]), "units": units}
        info = self._log_model(
            store.import_mlflow().pyfunc, loader_module="whsklearn.tracking.served", data_path=os.fspath(path),
            signature=served_signature(1), input_example=rows[:20], metadata=metadata,
        )  # fmt: skip
        return str(info.model_uri)

    def _log_model(self, flavour: Any, **kept: Any) -> Any:
        """MLflow's information on the model of this run that it has just kept."""

        def logged() -> Any:
            with store.active(store.import_mlflow(), self._client, self.id), store.quiet():
                return flavour.log_model(name="model", pip_requirements=model_requirements(), **kept)

        self.flush()
        return self._client.do(logged, store.LIBRARIES_SECONDS)

    def log_artifact(self, path: str | os.PathLike[str]) -> None:
        """Keep the file of this ``path`` as an artifact."""
        if self._client is not None:
            extra = Path(path).stat().st_size / store.UPLOAD_BYTES
            self._client.log_artifact(self.id, os.fspath(path), extra=extra)

    def log_model(self, model: Any, X: ArrayLike, *, registered_name: str = "", alias: str = "") -> str:
        """Keep a fitted estimator with signature, example and explicit requirements; return its address.

        Served, it takes numbers of any kind, as rows, lists or a frame; the example names its columns, see
        `input_example`.

        ``model``: fitted. ``X`` (n_samples, n_features): inputs; the first rows become the example.
        ``registered_name``, ``alias``: register it under this name and let ``models:/registered_name@alias`` point to
        it.
        """
        if self._client is None:
            return ""
        example = input_example(model, np.asarray(X, dtype=float)[:20])
        with store.quiet():
            signature = served_signature(example.shape[1])
        info = self._log_model(
            store.import_mlflow().sklearn, sk_model=model, signature=signature, input_example=example,
            registered_model_name=registered_name or None, skops_trusted_types=own_types(model),
        )  # fmt: skip
        if registered_name and alias:
            self._client.set_registered_model_alias(registered_name, alias, info.registered_model_version)
        return str(info.model_uri)

    def champion(self, name: str, alias: str) -> Any:
        """The estimator registered as models:/``name``@``alias``; None if there is none, or if tracking is off.

        Raises TrackingError if it exists and cannot be read.
        """
        if self._client is None:
            return None
        mlflow = store.import_mlflow()
        try:
            version = self._client.get_model_version_by_alias(name, alias)
        except TrackingError as error:
            if getattr(error.__cause__, "error_code", "") in ("RESOURCE_DOES_NOT_EXIST", "INVALID_PARAMETER_VALUE"):
                return None
            raise

        def loaded() -> Any:
            with store.active(mlflow, self._client, self.id), store.quiet():
                return mlflow.sklearn.load_model(f"models:/{name}/{version.version}")

        try:
            return self._client.do(loaded, store.LIBRARIES_SECONDS)
        except TrackingError as error:
            reason = store.sentence(error.__cause__ or error)
            raise TrackingError(
                f"models:/{name}@{alias} cannot be loaded ({reason}); register under another name."
            ) from error


def experiments(root: str | os.PathLike[str] = ".") -> list[tuple[str, str]]:
    """Name and id of every experiment with runs, most recent first.

    Experiments made by other programs are given the columns of their page (`view_of`).

    ``root``: folder above ``mlruns``. Raises TrackingError if the tracking server is down or the store cannot be
    opened.

    Examples
    --------
    >>> import tempfile
    >>> from whsklearn.tracking import experiments, open_tracker
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     with open_tracker("axis", root=folder).run("fit"):
    ...         pass
    ...     [name for name, _ in experiments(folder)]
    ['axis']
    """
    tracker = open_tracker("simulated_example", root=root)
    begun = {}
    for e in tracker.client.search_experiments():
        runs = tracker.client.search_runs([e.experiment_id], order_by=["attributes.start_time DESC"], max_results=1)
        if runs:
            begun[e.name, e.experiment_id] = runs[0].info.start_time
            if f"mlflow.sharedViewState.{VIEW}" not in e.tags:
                set_view(tracker.client, e.experiment_id, e.name)
    return sorted(begun, key=lambda key: -begun[key])


# --- a search as runs ------------------------------------------------------------------------------------------------
def estimator_params(estimator: Any) -> dict[str, Any]:
    """The parameters of an ``estimator``; nested ones are named by path, objects are given by class.

    Examples
    --------
    >>> from whsklearn import RLSRegressor, WienerHammersteinLags
    >>> from whsklearn.tracking import estimator_params
    >>> params = estimator_params(RLSRegressor(WienerHammersteinLags(n_a=3)))
    >>> params["lags__n_a"], params["lags"]
    (3, 'WienerHammersteinLags')
    """
    return {k: type(v).__name__ if hasattr(v, "get_params") else v for k, v in estimator.get_params(deep=True).items()}


def log_candidates(
    parent: Run,
    results: Mapping[str, Any],
    first: int = 0,
    tags: Mapping[str, str] | None = None,
    varied: Sequence[str] = (),
) -> None:
    """Record a search: a child for each candidate of ``cv_results_`` from `first` on.

    A child is named by the parameters that are `varied`, in that order; by all of them if none is given.

    A score ``neg_nmse`` becomes the metric ``nmse``, its mean over the folds, beside ``nmse_std`` and the
    stepped ``fold/nmse``; a score without ``neg_`` keeps its sign and its name.

    Parameters
    ----------
    parent : Run
    results : mapping
        ``cv_results_`` of a search.
    first : int, default=0
        Candidate to begin with.
    tags : mapping of str to str, optional
        Of every child.
    varied : sequence of str
        Names of parameters.

    Examples
    --------
    >>> from whsklearn.tracking import log_candidates, open_tracker
    >>> from sklearn.linear_model import Ridge
    >>> from sklearn.model_selection import GridSearchCV
    >>> search = GridSearchCV(Ridge(), {"alpha": [0.1, 1.0]}, cv=2).fit([[0.0], [1.0], [2.0], [3.0]], [0, 1, 2, 3])
    >>> with open_tracker("axis", enabled=False).run("grid") as parent:
    ...     log_candidates(parent, search.cv_results_)  # a child for each candidate
    """
    scores = [k.removeprefix("mean_test_") for k in results if k.startswith("mean_test_")]
    for i in range(first, len(results["params"])):
        params = results["params"][i]
        shown = {k: params[k] for k in varied if k in params} or params
        name = ", ".join(
            f"{k.split('__')[-1]}={v:g}" if isinstance(v, float) else f"{k.split('__')[-1]}={v}"
            for k, v in shown.items()
        )
        with parent.child(name[:250], tags=tags) as run:
            run.log_params(results["params"][i])
            for score in scores:
                sign, metric = (-1.0, score[4:]) if score.startswith("neg_") else (1.0, score)
                n_folds = sum(bool(re.fullmatch(rf"split\d+_test_{score}", k)) for k in results)
                run.log_paths({f"fold/{metric}": [sign * results[f"split{n}_test_{score}"][i] for n in range(n_folds)]})
                mean, std = results[f"mean_test_{score}"][i], results[f"std_test_{score}"][i]
                run.log_metrics({metric: sign * mean, f"{metric}_std": std})
            run.log_metrics({"fit_seconds": results["mean_fit_time"][i]})
