"""The lagged regressors of (6), with the auxiliary model that replaces the unknown x and v."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray
from sklearn.base import BaseEstimator, TransformerMixin, clone
from sklearn.utils.validation import check_array, check_is_fitted, column_or_1d, validate_data

from whsklearn._inputs import check_lengths, check_whole, in_one_sentence, starts, writeable
from whsklearn.effects import FrictionLaw, StaticEffect, as_law
from whsklearn.recursion.rows.pseudolinear import auxiliary_size, rows_along


class WienerHammersteinLags(TransformerMixin, BaseEstimator):
    """Regressors phi(t) of (6) for any orders and law; the state holds x_hat and v_hat.

    The columns depend on past y as well as on u, so this transformer cannot be used in a Pipeline or a
    FeatureUnion, which transform X alone.  Instead, the estimators hold one (``lags=``), and a grid search reaches
    it as ``lags__n_a``.  With ``n_d=0`` the columns depend on u alone, and it can be used there, as can
    `InverseDynamicsLags`.

    Parameters
    ----------
    n_a, n_b, n_c, n_d : int, default=2
        Orders of (1) and (2): numerator and denominator of L1, of L2.
    law : str, FrictionLaw or sequence of effects, optional
        The static block; None is (4).
    delays : pair of int, default=(1, 1)
        Samples before L1 and L2 respond; one each by default, as in the paper.  0 is a direct path, which is only
        available in a fit of the simulation error (``PEMRegressor(criterion="simulation")``).
    theta : array-like of shape (n_parameters,), optional
        Parameters of the auxiliary model, in the paper's order; by default 0.01 for all,
        the paper's theta(0).

    Attributes
    ----------
    max_lag : int
        Samples of the past that a row needs.
    n_parameters : int
        Number of columns.

    References
    ----------
    Paper, (5) and (6).

    Examples
    --------
    >>> from whsklearn import WienerHammersteinLags
    >>> from whsklearn.datasets import make_wiener_hammerstein
    >>> X, y = make_wiener_hammerstein(n_samples=50, random_state=0)
    >>> lags = WienerHammersteinLags()
    >>> lags.fit_transform(X, y).shape
    (50, 9)
    >>> list(lags.get_feature_names_out())[:4]
    ['u(k-2)', 'u(k-3)', '-x_hat(k-2)', '-x_hat(k-3)']
    """

    def __init__(
        self,
        n_a: int = 2,
        n_b: int = 2,
        n_c: int = 2,
        n_d: int = 2,
        law: str | FrictionLaw | StaticEffect | Iterable[StaticEffect] | None = None,
        theta: ArrayLike | None = None,
        delays: tuple[int, int] = (1, 1),
    ):
        self.n_a = n_a
        self.n_b = n_b
        self.n_c = n_c
        self.n_d = n_d
        self.law = law
        self.theta = theta
        self.delays = delays

    @property
    def max_lag(self) -> int:
        """Samples of the past that a row needs."""
        return max(self.n_a + 1, self.n_b + 1, self.n_c, self.n_d)

    @property
    def n_parameters(self) -> int:
        """Number of columns, and of entries of theta."""
        return int(self.n_a + self.n_b + len(as_law(self.law)) - 1 + self.n_c - 1 + self.n_d)

    def dims(self, n_inputs: int = 1) -> NDArray[np.int64]:
        """n_a of all inputs, n_b, n_c, n_d and the number of weights, in the form that the kernels take.

        ``n_inputs``: inputs that share the denominator of L1. Raises ValueError if an order is not a whole number, n_a
        or n_c is below 1, or n_b or n_d is below 0.
        """
        for name, least in (("n_a", 1), ("n_b", 0), ("n_c", 1), ("n_d", 0)):
            check_whole(name, getattr(self, name), least, "; set the order")
        return np.array([n_inputs * self.n_a, self.n_b, self.n_c, self.n_d, len(as_law(self.law))], dtype=np.int64)

    def advance(self) -> int:
        """Samples by which the response comes earlier than the paper's: 2 minus both delays.

        Raises ValueError if ``delays`` is not a pair of whole numbers of 0 or more.
        """
        delays: tuple[Any, ...] = tuple(self.delays) if np.size(self.delays) == 2 else (None,)
        if any(isinstance(d, bool) or not isinstance(d, (int, np.integer)) or d < 0 for d in delays):
            raise ValueError(
                f"delays is {self.delays!r}, expected two whole numbers of 0 or more, for L1 and for L2; "
                "(1, 1) is the paper's, 0 a direct path."
            )
        return 2 - sum(map(int, delays))

    def key_term(self) -> int:
        """Index of the law's term that carries the linear part of (5).

        Raises ValueError if the law has no term that is linear in x or dx.
        """
        key = as_law(self.law).key
        if key is not None:
            return key
        raise ValueError(
            f"The law {as_law(self.law).labels} has no linear term, and key-term separation (5) needs one: add "
            'Viscous(), or use gradient="full".'
        )

    def fit(self, X: ArrayLike, y: ArrayLike | None = None) -> Self:
        """Check the settings; nothing is learned. ``X`` (n, n_inputs): inputs. ``y``: not used."""
        self.dims()
        if self.advance() != 0:
            raise ValueError(
                f"delays is {self.delays!r}, but the regressors of (6) assume one sample in each block; leave it "
                'at (1, 1), or fit PEMRegressor(criterion="simulation").'
            )
        self.key_term()
        with in_one_sentence(X):
            validate_data(self, X, dtype=np.float64)
        self._carried: dict[str, Any] = {}
        return self

    def transform(self, X: ArrayLike, y: ArrayLike | None = None, groups: ArrayLike | None = None) -> Any:
        """Rows of a record that is at rest before its first sample; the stored state does not change.

        ``X`` (n, n_inputs): inputs. ``y`` (n,): output, of which past samples are regressors; not needed where ``n_d``
        is 0. ``groups`` (n,): experiment of each sample; the past is forgotten where one begins. Returns (n,
        n_parameters): as many rows as samples; the first ``max_lag`` rows hold zeros for samples before the start.
        """
        check_is_fitted(self, "n_features_in_")
        return self._rows(X, y, groups, {})

    def fit_transform(self, X: ArrayLike, y: ArrayLike | None = None, groups: ArrayLike | None = None) -> Any:
        """Start from a clean state, and keep the state for `partial_fit_transform`.

        ``X``, ``y``, ``groups``: as for `transform`.
        """
        carried: dict[str, Any] = {}
        rows = clone(self).fit(X, y)._rows(X, y, groups, carried)
        self.fit(X, y)
        self._carried = carried
        return rows

    def partial_fit_transform(self, X: ArrayLike, y: ArrayLike | None = None, groups: ArrayLike | None = None) -> Any:
        """Rows that continue where the last call ended. ``X``, ``y``, ``groups``: as for `transform`."""
        if not hasattr(self, "_carried"):
            return self.fit_transform(X, y, groups)
        return self._rows(X, y, groups, self._carried)

    def get_feature_names_out(self, input_features: Any = None) -> NDArray[np.object_]:
        """Names of the columns, such as ``u(k-2)`` and ``-x_hat(k-2)``.

        ``input_features``: not used; present for scikit-learn compatibility.
        """
        law, key = as_law(self.law), self.key_term()
        m = getattr(self, "n_features_in_", 1)
        inputs = ["u"] if m == 1 else [f"u{k + 1}" for k in range(m)]
        names = [f"{u}(k-{i + 1})" for i in range(1, self.n_a + 1) for u in inputs]
        names += [f"-x_hat(k-{j + 1})" for j in range(1, self.n_b + 1)]
        names += [f"{label}(k-1)" for k, label in enumerate(law.labels) if k != key]
        names += [f"v_hat(k-{m})" for m in range(2, self.n_c + 1)]
        names += [f"-y(k-{n})" for n in range(1, self.n_d + 1)]
        return np.array(names, dtype=object)

    def _rows(
        self, X: ArrayLike, y: ArrayLike | None, groups: ArrayLike | None, carried: dict[str, Any]
    ) -> NDArray[np.float64]:
        """Rows of X and y that follow ``carried``, which is updated; an empty state means rest."""
        with in_one_sentence(X, y):
            u: NDArray[np.float64] = np.asarray(validate_data(self, X, reset=False, dtype=np.float64))
        m = u.shape[1]
        if y is None:
            if self.n_d:
                raise ValueError(
                    f"y is missing, and the regressors of (6) hold past outputs (n_d = {self.n_d}); call with (X, y), "
                    "or give these lags to an estimator: a Pipeline or FeatureUnion transforms X alone."
                )
            y = np.zeros(len(u))
        with in_one_sentence(X, y):
            y_ = column_or_1d(check_array(y, ensure_2d=False, dtype=np.float64, input_name="y"))
        check_lengths(u, y_)
        restart = starts(groups, len(u), first=not carried)
        dims, law, key = self.dims(m), as_law(self.law), self.key_term()
        n = self.n_parameters + (m - 1) * self.n_a
        theta = np.full(n, 0.01) if self.theta is None else np.asarray(self.theta, dtype=float)
        if theta.shape != (n,):
            raise ValueError(f"theta has shape {theta.shape}, expected ({n},): one entry per column.")
        state = carried.get("state", np.zeros(auxiliary_size(dims))).copy()
        past_u = carried.get("u", np.zeros((self.n_a + 1) * m)).copy()
        past_y = carried.get("y", np.zeros(max(self.n_d, 1))).copy()
        u, y_ = writeable(u), writeable(y_)
        out = rows_along(theta, dims, law.codes, law.shapes, key, state, past_u, past_y, u, y_, restart)
        carried.update(state=state, u=past_u, y=past_y)
        return out
