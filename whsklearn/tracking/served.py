"""A model file as MLflow serves it: ``model.json`` in, and the simulated output for a column of inputs out."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from whsklearn.models import load_model

if TYPE_CHECKING:
    from numpy.typing import NDArray


class Served:
    """The free run of a model file.

    Parameters
    ----------
    path : str
        Of the file, as `whsklearn.models.load_model` takes it.

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
        """Output (n,) of the free run, from one column of numbers of any kind.

        Raises
        ------
        ValueError
            If it is not one column.
        """
        u = np.asarray(model_input, dtype=float)
        if u.size != u.shape[0]:
            raise ValueError(f"The input has shape {u.shape}, expected one column.")
        return np.asarray(self.model.simulate(u.ravel()), dtype=float)


def _load_pyfunc(path: str) -> Served:
    """What MLflow calls."""
    return Served(path)
