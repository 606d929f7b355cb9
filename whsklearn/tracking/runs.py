"""A small layer over MLflow: one place that knows where runs are kept and how they look.

Runs live in a SQLite store beneath ``mlruns/`` unless ``MLFLOW_TRACKING_URI`` names another.
Nothing here sets a global of MLflow for longer than one call, workers never write: the parent
process opens the store and records what they return.  MLflow is imported inside functions only,
so the library works without it.

Examples
--------
>>> from whsklearn.tracking.runs import open_tracker
>>> tracker = open_tracker("doctest", enabled=False)  # records nothing, as --no-track does
>>> with tracker.run("one") as run:
...     run.log_metrics({"nmse": 0.02})
"""

from __future__ import annotations

import contextlib
import json
import math
import os
import re
import sys
import time
from collections.abc import Iterator, Mapping, Sequence
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from whsklearn.tracking import store as store
from whsklearn.tracking.store import TrackingError as TrackingError

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

_BATCH = 1000  # metrics one log_batch may hold
# What the page shows at the link with this key: best runs first, children beside parents, our columns.
VIEW = "comparison"
_INDICES = tuple(f"metrics.`{m}`" for m in ("nmse", "mu_e", "rmse"))
# By experiment: the column to order by, whether the least comes first, and the columns beside name and data set.
_COLUMNS: dict[str, tuple[str, bool, tuple[str, ...]]] = {
    "close_gap": (
        "attributes.start_time",
        False,
        ("tags.`verdict`", "tags.`effects`", "metrics.`closure`", "metrics.`missing_share`", *_INDICES, "tags.`data`"),
    ),
    "tune": (
        "metrics.`nmse`",
        True,
        (
            *(f"params.`{p}`" for p in ("p", "P0", "forgetting", "lags__n_a", "lags__n_b", "lags__n_c", "lags__n_d")),
            "params.`lags__law`",
            *_INDICES,
            "metrics.`fit_seconds`",
        ),
    ),
    "fleet": (
        "metrics.`nmse`",
        False,
        ("tags.`axis`", "tags.`status`", "tags.`why`", *_INDICES, "metrics.`failed`", "metrics.`outliers`"),
    ),
    "stream": (
        "attributes.start_time",
        False,
        ("params.`source`", "metrics.`innovation_rmse`", "metrics.`alarm`", "tags.`resumed_from`"),
    ),
}
_COMPARISON = (
    "metrics.`nmse`",
    True,
    (
        *_INDICES,
        "metrics.`delta`",
        "params.`p`",
        "params.`P0`",
        "tags.`data`",
        "tags.`reading`",
        "metrics.`fit_seconds`",
    ),
)


def view_of(experiment: str) -> dict[str, Any]:
    """What the page shows of an experiment's runs: their order and the columns that tell them apart.

    Examples
    --------
    >>> view_of("close_gap")["selectedColumns"][:2]
    ['tags.`verdict`', 'tags.`effects`']
    """
    key, ascending, columns = _COLUMNS.get(experiment, _COMPARISON)
    return {"orderByKey": key, "orderByAsc": ascending, "selectedColumns": list(columns)}


def tracking_uri(root: str | os.PathLike[str] = ".") -> str:
    """Where runs go: ``MLFLOW_TRACKING_URI`` if it is set, else ``mlruns/mlflow.db`` beneath `root`.

    Parameters
    ----------
    root : str or path
        Folder above ``mlruns``.

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
    """`name` with every character that MLflow refuses made an underscore.

    Parameters
    ----------
    name : str

    Examples
    --------
    >>> metric_name("x_hat(k-2)")
    'x_hat_k-2'
    """
    return re.sub(r"[^\w\-./ :]+", "_", name).strip("_")


def open_tracker(
    experiment: str,
    *,
    root: str | os.PathLike[str] = ".",
    enabled: bool = True,
    tags: Mapping[str, str] | None = None,
) -> Tracker:
    """Open the store, once, in the process that records; make the experiment if it is new.

    Parameters
    ----------
    experiment : str
        Name of the experiment.
    root : path-like
        Folder that holds ``mlruns/``; not used when ``MLFLOW_TRACKING_URI`` is set.
    enabled : bool
        False gives a tracker that records nothing and needs no MLflow.
    tags : mapping of str to str, optional
        Put on every run.

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
        return Tracker(None, "", {})
    mlflow = store.import_mlflow()
    uri = tracking_uri(root)
    store.probe(uri)
    location = None
    with store.quiet():
        try:
            if uri.startswith("sqlite:///"):
                database = Path(uri.removeprefix("sqlite:///")).resolve()
                store.initialise(database)
                location = (database.parent / "artifacts").as_uri()
            client = mlflow.MlflowClient(uri)
            experiment_id = store.experiment_id(client, experiment, location)
            client.set_experiment_tag(experiment_id, f"mlflow.sharedViewState.{VIEW}", json.dumps(view_of(experiment)))
        except Exception as error:  # a store fails with the errors of its own driver
            reason = store.sentence(error)
            raise TrackingError(f"The store at {store.public(uri)} cannot be opened: {reason}") from error
    source = {"mlflow.source.name": experiment, "mlflow.source.type": "LOCAL"}
    return Tracker(
        store.InSentences(client), experiment_id, {**source, "version": version("whsklearn"), **(tags or {})}
    )


class Tracker:
    """An open experiment; ask `open_tracker` for one.

    Parameters
    ----------
    client : MlflowClient or None
        None where tracking is off.
    experiment_id : str
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

    def __init__(self, client: Any, experiment_id: str, tags: Mapping[str, str]):
        self.client = client
        self.experiment_id = experiment_id
        self.tags = dict(tags)

    @contextlib.contextmanager
    def run(self, name: str, *, parent: Run | None = None, tags: Mapping[str, str] | None = None) -> Iterator[Run]:
        """A run: FINISHED after the block, FAILED with its reason if the block raises, KILLED if interrupted.

        Parameters
        ----------
        name : str
        parent : Run, optional
            The run above it.
        tags : mapping of str to str, optional
        """
        own = {**self.tags, **(tags or {})}
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
        except TrackingError:  # what failed is the record itself; a locked database makes every further try wait
            raise
        except BaseException as error:
            with contextlib.suppress(TrackingError):
                run.log_tags({"reason": f"{type(error).__name__}: {store.sentence(error)}"})
            raise
        finally:
            if run.id:
                self._end(run, status)

    def _end(self, run: Run, status: str) -> None:
        """Write what is buffered and the end itself; a failure counts where the work did not fail."""
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
        The experiment that it belongs to.
    run_id : str
        Of MLflow; empty where tracking is off.

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
        self._buffer: list[Any] = []

    @property
    def _client(self) -> Any:
        return self.tracker.client

    def child(self, name: str, *, tags: Mapping[str, str] | None = None) -> Any:
        """A run below this one, to be used in a ``with`` block.

        Parameters
        ----------
        name : str
        tags : mapping of str to str, optional
        """
        return self.tracker.run(name, parent=self, tags=tags)

    def log_tags(self, tags: Mapping[str, Any]) -> None:
        """Set tags, such as ``data``, ``reading``, ``reason``.

        Parameters
        ----------
        tags : mapping of str to str
        """
        if self._client is not None:
            from mlflow.entities import RunTag

            self._client.log_batch(self.id, tags=[RunTag(k, str(v)[:5000]) for k, v in tags.items()])

    def log_params(self, params: Mapping[str, Any]) -> None:
        """Log parameters; long values are cut.

        Parameters
        ----------
        params : mapping
        """
        if self._client is not None:
            from mlflow.entities import Param

            entries = [Param(k, str(v)[:500]) for k, v in params.items()]
            for start in range(0, len(entries), 100):
                self._client.log_batch(self.id, params=entries[start : start + 100])

    def log_metrics(self, metrics: Mapping[str, float], step: int = 0) -> None:
        """Buffer metrics of one step; what is not finite becomes the tag ``not_finite``.

        Parameters
        ----------
        metrics : mapping of str to float
        step : int, default=0
            Such as the samples seen.
        """
        self.log_paths({k: [v] for k, v in metrics.items()}, [step])

    def log_paths(self, paths: Mapping[str, ArrayLike], steps: ArrayLike | None = None, *, points: int = 1000) -> None:
        """Buffer stepped metrics, such as the path of every parameter, thinned to at most `points` each.

        Parameters
        ----------
        paths : mapping of str to array-like of shape (n,)
        steps : array-like of shape (n,), optional
            0, 1, ... by default.
        points : int, default=1000
            At most, a path.
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
            self._buffer += [
                Metric(metric_name(name), float(values[i]), now, int(at[i])) for i in keep if math.isfinite(values[i])
            ]
        if broken:
            self.log_tags({"not_finite": ", ".join(sorted(broken))})
        if len(self._buffer) >= _BATCH:
            self.flush()

    def flush(self) -> None:
        """Write what is buffered."""
        while self._buffer:
            self._client.log_batch(self.id, metrics=self._buffer[:_BATCH])
            del self._buffer[:_BATCH]

    def log_input(self, X: ArrayLike, y: ArrayLike, name: str, context: str = "training") -> None:
        """Record the data set: its name, shape and digest, not the samples.

        Parameters
        ----------
        X : array-like of shape (n, n_features)
            Input.
        y : array-like of shape (n,)
            Output.
        name : str
            Of the data set.
        context : str, default="training"
            What it is used for.
        """
        if self._client is not None:
            mlflow = store.import_mlflow()
            from mlflow.entities import DatasetInput, InputTag

            data = mlflow.data.from_numpy(np.asarray(X), targets=np.asarray(y), name=name)
            label = InputTag("mlflow.data.context", context)
            self._client.log_inputs(self.id, [DatasetInput(data._to_mlflow_entity(), [label])])

    def log_figure(self, figure: Any, file: str) -> None:
        """Keep a matplotlib figure as an artifact.

        Parameters
        ----------
        figure : matplotlib figure
        file : str
            Name of the artifact.
        """
        if self._client is not None:
            self._client.log_figure(self.id, figure, file)

    def log_text(self, text: str, file: str) -> None:
        """Keep a text as an artifact.

        Parameters
        ----------
        text : str
        file : str
            Name of the artifact.
        """
        if self._client is not None:
            self._client.log_text(self.id, text, file)

    def log_artifact(self, path: str | os.PathLike[str]) -> None:
        """Keep a file as an artifact.

        Parameters
        ----------
        path : str or path
            Of a file.
        """
        if self._client is not None:
            self._client.log_artifact(self.id, os.fspath(path))

    def log_model(
        self, model: Any, X: ArrayLike, *, registered_name: str = "", alias: str = "", trusted: Sequence[str] = ()
    ) -> str:
        """Keep a fitted estimator with signature, example and explicit requirements; return its address.

        Parameters
        ----------
        model : estimator
            Fitted.
        X : array-like of shape (n_samples, n_features)
            Inputs; the first rows become the example.
        registered_name, alias : str
            Register it under this name and let ``models:/registered_name@alias`` point to it.
        trusted : sequence of str
            Classes from outside whsklearn that may be loaded with it.
        """
        if self._client is None:
            return ""
        mlflow = store.import_mlflow()
        example = np.asarray(X, dtype=float)[:20]
        with store.active(mlflow, self._client, self.id), store.quiet():
            info = mlflow.sklearn.log_model(
                model,
                name="model",
                signature=mlflow.models.infer_signature(example, np.asarray(model.predict(example), dtype=float)),
                input_example=example,
                pip_requirements=model_requirements(),
                registered_model_name=registered_name or None,
                skops_trusted_types=[*_own_types(model), *trusted],
            )
            if registered_name and alias:
                mlflow.MlflowClient().set_registered_model_alias(registered_name, alias, info.registered_model_version)
        return info.model_uri


def model_requirements() -> list[str]:
    """What a logged model needs, pinned to what runs here.

    Examples
    --------
    >>> from whsklearn.tracking import model_requirements
    >>> any(line.startswith("scikit-learn==") for line in model_requirements())
    True
    """
    return [f"{p}=={version(p)}" for p in ("whsklearn", "mlflow", "scikit-learn", "numpy", "scipy", "numba", "skops")]


def estimator_params(estimator: Any) -> dict[str, Any]:
    """The parameters of an estimator, nested ones by their path, whole objects by their class.

    Parameters
    ----------
    estimator : estimator
        Of scikit-learn.

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


def latest_experiment(root: str | os.PathLike[str] = ".") -> str | None:
    """The experiment that was written to last, by its id; None where there is none.

    Parameters
    ----------
    root : str or path
        Folder above ``mlruns``.

    Examples
    --------
    >>> import tempfile
    >>> from whsklearn.tracking import latest_experiment, open_tracker
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     with open_tracker("axis", root=folder).run("fit"):
    ...         pass
    ...     latest_experiment(folder) is not None
    True
    """
    mlflow = store.import_mlflow()
    with store.quiet():
        client = mlflow.MlflowClient(tracking_uri(root))
        ids = [e.experiment_id for e in client.search_experiments()]
        runs = client.search_runs(ids, order_by=["attributes.start_time DESC"], max_results=1) if ids else []
    return runs[0].info.experiment_id if runs else None


def _own_types(model: Any) -> list[str]:
    """Our classes inside a model; anything else is left for skops to refuse."""
    import skops.io

    return [t for t in skops.io.get_untrusted_types(data=skops.io.dumps(model)) if t.startswith("whsklearn.")]
