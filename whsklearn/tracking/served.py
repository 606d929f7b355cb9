"""Models as MLflow keeps and serves them: signature, example and requirements, and the free run of a model file."""

from __future__ import annotations

import re
from importlib.metadata import version
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from whsklearn.logs.units import UNKNOWN, factor_between, unit_of


class Served:
    """The free run of a model file, which MLflow loads through `_load_pyfunc`.

    >>> from tempfile import TemporaryDirectory
    >>> from whsklearn.models import LinearModel, save_model
    >>> with TemporaryDirectory() as folder:
    ...     save_model(LinearModel([0.0, 0.5], [1.0, -0.5]), f"{folder}/model.json")
    ...     Served(f"{folder}/model.json").predict([1.0, 1.0, 1.0]).tolist()
    [0.0, 0.5, 0.75]
    """

    def __init__(self, path: str):
        from whsklearn.models import load_model

        self.model = load_model(path)

    def predict(self, model_input: Any, params: Any = None) -> NDArray[np.float64]:  # noqa: ARG002 - MLflow passes it
        """Output (n,) of the free run in the model's unit, from one column of numbers of any kind.

        A frame whose column name states its unit, such as ``torque_mnm``, is converted to the unit of the model.

        Raises ValueError if it is not one column, or if its unit cannot be converted to that of the model.
        """
        u = np.asarray(model_input, dtype=float)
        if u.size != u.shape[0]:
            raise ValueError(f"The input has shape {u.shape}, expected one column.")
        return np.asarray(self.model.simulate(u.ravel() * self._factor(model_input)), dtype=float)

    def _factor(self, model_input: Any) -> float:
        """Factor from the column's unit to the model's; 1 if one of them is not stated."""
        (column,) = getattr(model_input, "columns", [""])
        given, own = unit_of(str(column)), self.model.units.get("input", UNKNOWN)
        if UNKNOWN in (given, own):
            return 1.0
        try:
            return factor_between(given, own)
        except ValueError:
            raise ValueError(
                f"The column {column!r} is in {given}, which cannot be converted to {own}, the unit of the model."
            ) from None


_load_pyfunc = Served  # what MLflow calls with the path


def input_example(model: Any, rows: ArrayLike) -> Any:
    """Rows as a frame with the estimator's feature names, or ``u``, or ``u1``, ``u2``, ... for several columns.

    >>> from sklearn.linear_model import Ridge
    >>> list(input_example(Ridge().fit([[0.0], [1.0]], [0.0, 1.0]), [[0.5]]).columns)
    ['u']
    """
    import pandas as pd

    rows = np.asarray(rows, dtype=float)
    names = getattr(model, "feature_names_in_", None)
    if names is None:
        names = ["u"] if rows.shape[1] == 1 else [f"u{i + 1}" for i in range(rows.shape[1])]
    return pd.DataFrame(rows, columns=list(names))


def served_signature(n_features: int) -> Any:
    """The signature of a served model: columns of any numeric type in, doubles out.

    A typed signature would refuse float32, whole numbers or lists (a tensor), or arrays without names (named columns);
    the estimator itself checks its input.
    """
    from mlflow.models import ModelSignature
    from mlflow.types import ColSpec, Schema, TensorSpec
    from mlflow.types.schema import AnyType

    columns = Schema([ColSpec(AnyType()) for _ in range(n_features)])  # unnamed: named ones refuse arrays and lists
    return ModelSignature(columns, Schema([TensorSpec(np.dtype("float64"), (-1,))]))


def alias_of(data: str) -> str:
    """The alias of the best model of the data set of this name, in the characters that MLflow takes.

    >>> alias_of("example-5.1")
    'champion-example-5-1'
    """
    return "champion-" + re.sub(r"[^\w-]+", "-", data)[:200]


def model_requirements() -> list[str]:
    """The requirements of a logged model, pinned to the installed versions."""
    return [f"{p}=={version(p)}" for p in ("whsklearn", "mlflow", "scikit-learn", "numpy", "scipy", "numba", "skops")]


def own_types(model: Any) -> list[str]:
    """Our own classes inside a model; skops may refuse any others."""
    import skops.io

    return [t for t in skops.io.get_untrusted_types(data=skops.io.dumps(model)) if t.startswith("whsklearn.")]
