"""A model file as served by MLflow: it simulates the output of ``model.json`` for a column of inputs."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from whsklearn.logs.units import UNKNOWN, factor_between, unit_of
from whsklearn.models import load_model

if TYPE_CHECKING:
    from numpy.typing import NDArray


class Served:
    """The free run of a model file.

    Parameters
    ----------
    path : str
        Path of a file for `whsklearn.models.load_model`.

    References
    ----------
    MLflow Models, https://mlflow.org/docs/latest/ml/model/.

    Examples
    --------
    >>> import pathlib, tempfile
    >>> from whsklearn.models import LinearModel, save_model
    >>> from whsklearn.tracking.served import Served
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = str(pathlib.Path(folder, "model.json"))
    ...     save_model(LinearModel([0.0, 0.5], [1.0, -0.5]), path)
    ...     Served(path).predict([[1], [1], [1]]).tolist()
    [0.0, 0.5, 0.75]
    """

    def __init__(self, path: str):
        self.model = load_model(path)

    def predict(self, model_input: Any, params: Any = None) -> NDArray[np.float64]:  # noqa: ARG002 - MLflow passes it
        """Output (n,) of the free run in the model's unit, from one column of numbers of any kind.

        A frame whose column name states its unit, such as ``torque_mnm``, is converted to the unit of the model.

        Raises
        ------
        ValueError
            If it is not one column, or if its unit cannot be converted to that of the model.
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


def _load_pyfunc(path: str) -> Served:
    """What MLflow calls."""
    return Served(path)
