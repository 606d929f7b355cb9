"""What MLflow's own page shows of an experiment: the order of its runs and its columns, best or newest runs first."""

from __future__ import annotations

import json
import time
from typing import Any

VIEW = "comparison"  # the key of the link
VIEW_NAME = "whsklearn"  # in the menu "Views" of MLflow's own run list, from 3.15 on
_OF = {"t": "tags", "m": "metrics", "p": "params"}
_INDICES = "m.nmse m.mu_e m.rmse"
# By experiment: the column to order by, whether it is ascending, and the columns besides name and data set.
_COLUMNS: dict[str, tuple[str, bool, str]] = {
    "close_gap": ("start_time", False, f"t.verdict t.effects m.closure m.missing_share {_INDICES} t.data"),
    "compare": ("start_time", False, "t.verdict t.changes m.change m.p_value m.share_of_drive"),
    "tune": (
        "m.nmse",
        True,
        f"p.p p.P0 p.forgetting p.lags__n_a p.lags__n_b p.lags__n_c p.lags__n_d p.lags__law {_INDICES} m.fit_seconds",
    ),
    "identify": ("start_time", False, f"t.recommended t.data {_INDICES} m.size m.fit_seconds t.failure"),
    "fleet": ("m.nmse", False, f"t.axis t.status t.why {_INDICES} m.failed m.outliers"),
    "stream": ("start_time", False, "p.source m.innovation_rmse m.alarm t.resumed_from"),
}
_COMPARISON = ("m.nmse", True, f"{_INDICES} m.delta p.p p.P0 t.data t.reading m.fit_seconds")


def _column(short: str) -> str:
    """MLflow's spelling of ``m.nmse``, a metric, or of ``start_time``, an attribute."""
    kind, dot, name = short.partition(".")
    return f"{_OF[kind]}.`{name}`" if dot else f"attributes.{short}"


def view_of(experiment: str) -> dict[str, Any]:
    """Order and columns of an experiment's runs on MLflow's page."""
    key, ascending, columns = _COLUMNS.get(experiment, _COMPARISON)
    return {"orderByKey": _column(key), "orderByAsc": ascending, "selectedColumns": list(map(_column, columns.split()))}


def page_of(server: str, experiment_id: str) -> str:
    """The address of an experiment's runs with its columns, in the view for models rather than for chat traces.

    Examples
    --------
    >>> page_of("http://127.0.0.1:5000", "3")
    'http://127.0.0.1:5000/#/experiments/3/runs?workflowType=machine_learning&viewStateShareKey=comparison'
    """
    base = server.rstrip("/")
    return f"{base}/#/experiments/{experiment_id}/runs?workflowType=machine_learning&viewStateShareKey={VIEW}"


def set_view(client: Any, experiment_id: str, name: str) -> None:
    """The order and the columns of an experiment's page, at the address that `page_of` gives and in its menu "Views".

    MLflow 3.15 and later read a named view with its state as text, earlier ones the state itself: the tag holds both.
    """
    view = view_of(name)
    now = int(time.time() * 1000)
    saved = {"name": VIEW_NAME, "createdAt": now, "updatedAt": now, "state": json.dumps(view), **view}
    client.set_experiment_tag(experiment_id, f"mlflow.sharedViewState.{VIEW}", json.dumps(saved))
