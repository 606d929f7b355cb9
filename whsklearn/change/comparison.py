"""Compare two estimates and their covariances: which parameters changed, and by how much."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from whsklearn._inputs import real_array


@dataclass(frozen=True)
class ParameterDifference:
    """One parameter before and after, with the standard error of the difference.

    Attributes
    ----------
    name : str
        Name of the parameter.
    before, after : float
        Its two values, in its own unit.
    standard_error : float
        Standard error of the difference.
    z : float
        Difference over its standard error.
    significant : bool
        Whether the change is significant at the level of the comparison, which holds for all parameters together.

    References
    ----------
    Basseville and Nikiforov 1993, Detection of Abrupt Changes, Prentice Hall.

    Examples
    --------
    >>> from whsklearn.change import ParameterDifference
    >>> change = ParameterDifference("coulomb", before=0.70, after=0.84, standard_error=0.01, z=14.0, significant=True)
    >>> print(change)
    coulomb rose 20 % (0.7 to 0.84, standard error 0.01)
    >>> round(change.percent, 6)
    20.0
    """

    name: str
    before: float
    after: float
    standard_error: float
    z: float
    significant: bool

    @property
    def percent(self) -> float:
        """Change of the parameter's magnitude, as a percentage of the earlier one; inf if that was zero."""
        if self.before == 0:
            return math.inf if self.after else 0.0
        return 100.0 * (abs(self.after) - abs(self.before)) / abs(self.before)

    def __str__(self) -> str:
        if self.before * self.after < 0:
            what = "changed sign"
        else:
            what = f"{'rose' if self.percent > 0 else 'fell'} {abs(self.percent):.3g} %"
        return f"{self.name} {what} ({self.before:.4g} to {self.after:.4g}, standard error {self.standard_error:.2g})"


def compare_parameters(
    names: Sequence[str],
    before: ArrayLike,
    before_covariance: ArrayLike,
    after: ArrayLike,
    after_covariance: ArrayLike,
    level: float = 0.01,
) -> list[ParameterDifference]:
    """Which parameters changed between two estimates, the most significant first.

    Parameters
    ----------
    names : sequence of str
        One name per parameter.
    before, after : array-like of shape (n_params,)
        The two estimates.
    before_covariance, after_covariance : array-like of shape (n_params, n_params) or (n_params,)
        Their covariances, or the squared standard errors.
    level : float, default=0.01
        Probability that any parameter is reported as changed although none did (Bonferroni over the parameters).

    Raises
    ------
    ValueError
        If the sizes do not match or a variance is negative.

    Notes
    -----
    The two estimates are assumed to be independent.  They nearly are if their effective memories,
    1 / (1 - forgetting) samples each, do not overlap.

    Examples
    --------
    >>> from whsklearn.change import compare_parameters
    >>> changes = compare_parameters(["viscous", "coulomb"], [0.05, 0.70], [1e-6, 1e-4], [0.0501, 0.84], [1e-6, 1e-4])
    >>> print(*[c for c in changes if c.significant])
    coulomb rose 20 % (0.7 to 0.84, standard error 0.014)
    """
    from scipy.special import ndtri

    old, new = real_array(before, "before"), real_array(after, "after")
    variances = [
        np.diag(v) if v.ndim == 2 else v
        for v in map(real_array, (before_covariance, after_covariance), ("before_covariance", "after_covariance"))
    ]
    if not (old.shape == new.shape == variances[0].shape == variances[1].shape == (len(names),)):
        raise ValueError(
            f"compare_parameters: {len(names)} names, estimates of shapes {old.shape} and {new.shape}, variances of "
            f"shapes {variances[0].shape} and {variances[1].shape}; give one of each per parameter."
        )
    total = variances[0] + variances[1]
    if not np.all(total >= 0) or not 0 < level < 1:
        raise ValueError("compare_parameters: expected variances >= 0 and 0 < level < 1; check the covariances.")
    limit = float(-ndtri(level / 2 / max(len(names), 1)))
    changes = []
    for name, b, a, error in zip(names, old.tolist(), new.tolist(), np.sqrt(total).tolist(), strict=True):
        z = (a - b) / error if error > 0 else math.copysign(math.inf, a - b) if a != b else 0.0
        changes.append(ParameterDifference(name, b, a, error, z, abs(z) > limit))
    return sorted(changes, key=lambda c: -abs(c.z))
