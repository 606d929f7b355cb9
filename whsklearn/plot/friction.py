"""A friction law with its confidence band."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from whsklearn.effects import FrictionLaw
from whsklearn.plot.look import COLOURS, TRUTH, Z95, Display


class FrictionDisplay(Display):
    """A friction law against velocity, with its 95 % confidence band.

    Parameters
    ----------
    velocity : array-like of shape (n,)
        Abscissa; dx = x(t) - x(t-1) for a Wiener-Hammerstein system.
    friction : array-like of shape (n,)
        The law there.
    standard_error : array-like of shape (n,), optional
        Its standard error there; the band is 1.96 of it to either side.
    truth : array-like of shape (n,), optional
        The true law, dashed.

    References
    ----------
    scikit-learn developer's guide, Developing with the plotting API;
    Armstrong-Helouvry, Dupont and Canudas de Wit 1994, Automatica 30(7), 1083-1138.

    Examples
    --------
    >>> from whsklearn.effects import as_law
    >>> from whsklearn.plot import FrictionDisplay
    >>> display = FrictionDisplay.from_law(as_law("viscous,coulomb"), [-1.0, 0.5])
    >>> display.friction.tolist()
    [-2.0, 1.5]
    """

    def __init__(
        self,
        velocity: ArrayLike,
        friction: ArrayLike,
        standard_error: ArrayLike | None = None,
        truth: ArrayLike | None = None,
    ):
        self.velocity, self.friction = np.asarray(velocity, dtype=float), np.asarray(friction, dtype=float)
        self.standard_error = None if standard_error is None else np.asarray(standard_error, dtype=float)
        self.truth = None if truth is None else np.asarray(truth, dtype=float)

    @classmethod
    def from_law(
        cls,
        law: FrictionLaw,
        velocity: ArrayLike,
        *,
        covariance: ArrayLike | None = None,
        truth: FrictionLaw | None = None,
        ax: Any = None,
    ) -> FrictionDisplay:
        """Draw a law at x = 0; `covariance` (n_terms, n_terms) is that of its weights.

        Parameters
        ----------
        law : FrictionLaw
        velocity : array-like of shape (n,)
            Abscissa.
        covariance : array-like of shape (n_terms, n_terms), optional
            Of the weights, for the band.
        truth : FrictionLaw, optional
            Drawn dashed.
        ax : matplotlib axes, optional
            Where to draw; a new figure by default.
        """
        dx = np.asarray(velocity, dtype=float)
        columns = law.regressors(np.zeros_like(dx), dx)
        error = None
        if covariance is not None:
            error = np.sqrt(np.maximum(np.einsum("ij,jk,ik->i", columns, np.asarray(covariance), columns), 0.0))
        return cls(dx, columns @ law.weights, error, None if truth is None else truth(0.0, dx)).plot(ax)

    def plot(self, ax: Any = None) -> FrictionDisplay:
        """Draw law, band and truth.

        Parameters
        ----------
        ax : matplotlib axes, optional
            Where to draw; a new figure by default.
        """
        (ax,) = self._axes(ax, 1, 1, (6.4, 4.2))[:1]
        if self.standard_error is not None:
            low, high = (self.friction + s * Z95 * self.standard_error for s in (-1, 1))
            ax.fill_between(self.velocity, low, high, color=COLOURS[0], alpha=0.2, linewidth=0, label="95 % band")
        ax.plot(self.velocity, self.friction, color=COLOURS[0], label="identified")
        if self.truth is not None:
            ax.plot(self.velocity, self.truth, color="black", linestyle=TRUTH, linewidth=1.0, label="truth")
        ax.axhline(0.0, color="0.6", linewidth=0.7)
        ax.axvline(0.0, color="0.6", linewidth=0.7)
        ax.set(xlabel="velocity", ylabel="friction")
        ax.legend(frameon=False)
        return self
