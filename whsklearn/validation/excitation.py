"""Persistent excitation: whether the data can show the parameters at all.

Theorem 1 asks for alpha I <= (1/t) sum_j sum_i phi(j, i) phi(j, i)' <= beta I with
alpha > 0.  Here alpha and beta are the extreme eigenvalues of that matrix, and the
directions in which it is practically zero are reported by the names of their parameters.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from whsklearn._inputs import check_whole, real_array

_MEMBER = 0.1  # a parameter belongs to an unseen direction if it is this share of it


@dataclass(frozen=True)
class Excitation:
    """The directions of the parameter space that the regressors excite.

    Attributes
    ----------
    alpha, beta : float
        Smallest and largest eigenvalue of the matrix in Theorem 1, in units of phi squared.
    condition : float
        Ratio of the largest to the smallest singular value of phi with every column scaled
        to unit length; inf if a column is zero.  Unlike beta / alpha it knows no units.
    rank : int
        Effective rank: scaled singular values above ``tolerance`` times the largest.
    directions : tuple of dict of str to float
        One unit vector for each direction that the data cannot show, by parameter, small shares left out.
    unseen : tuple of str
        Every parameter that takes part in such a direction.
    n_samples, n_params : int
        Shape of the regressors.

    References
    ----------
    Paper, Theorem 1; Ljung 1999, System Identification, 2nd ed., sec. 13.2, Informative experiments; Belsley, Kuh
    and Welsch 1980, Regression Diagnostics, Wiley, for the scaled condition.

    Examples
    --------
    >>> import numpy as np
    >>> from whsklearn.validation import excitation
    >>> u = np.random.default_rng(0).normal(size=200)
    >>> seen = excitation(np.c_[u, np.roll(u, 1)], names=["a", "b"])
    >>> seen.rank, seen.unseen, seen.persistent
    (2, (), True)
    """

    alpha: float
    beta: float
    condition: float
    rank: int
    directions: tuple[dict[str, float], ...]
    unseen: tuple[str, ...]
    n_samples: int
    n_params: int

    @property
    def persistent(self) -> bool:
        """Whether every direction is seen."""
        return self.rank == self.n_params

    @property
    def advice(self) -> str:
        """What the data cannot show, by parameter, and what to do; empty if they show everything."""
        if self.persistent:
            return ""
        alone = [next(iter(d)) for d in self.directions if len(d) == 1]
        together = [" with ".join(d) for d in self.directions if len(d) > 1]
        parts = [f"nothing about {', '.join(alone)}"] if alone else []
        parts += [f"only combinations of {'; of '.join(together)}"] if together else []
        return (
            f"The data show {' and '.join(parts)} ({self.rank} of {self.n_params} directions are excited); "
            "excite the system with more frequencies and amplitudes, or lower the orders."
        )


def excitation(phi: ArrayLike, names: Sequence[str] | None = None, p: int = 1, tolerance: float = 1e-6) -> Excitation:
    """Measure the persistence of excitation of regressors.

    Parameters
    ----------
    phi : array-like of shape (n, n_params)
        Regressors, or gradients of the predictor, one row a sample.
    names : sequence of str, optional
        Name of each parameter; ``theta[i]`` by default.
    p : int, default=1
        Innovation length: sample k is in the windows j = k, ..., k + p - 1.
    tolerance : float, default=1e-6
        A direction counts as unseen if its singular value, columns scaled to unit length, is
        below this share of the largest: its parameter then has 1e6 times the uncertainty.

    Returns
    -------
    Excitation

    Raises
    ------
    ValueError
        If phi is not a finite matrix, names are too few or too many, or p < 1.

    Notes
    -----
    The condition of Theorem 1, paper section 4.  Scaling the columns first is Van der Sluis'
    (1969): what remains ill-conditioned then is so in the best of diagonal units but a factor sqrt(n).

    Examples
    --------
    >>> import numpy as np
    >>> from whsklearn.validation import excitation
    >>> u = np.random.default_rng(0).normal(size=100)
    >>> found = excitation(np.c_[u, 2 * u, np.roll(u, 1)], names=["a", "b", "c"])
    >>> found.unseen
    ('a', 'b')
    >>> found.advice
    'The data show only combinations of a with b (2 of 3 directions are excited); excite the system ...'
    """
    phi = _matrix(phi)
    n, n_params = phi.shape
    names = tuple(names) if names is not None else tuple(f"theta[{i}]" for i in range(n_params))
    if len(names) != n_params:
        raise ValueError(f"excitation: {len(names)} names for {n_params} columns; give one name a column.")
    check_whole("excitation: p", p, 1)
    weight = np.minimum(p, n - np.arange(n))  # of sample k among the windows j <= n
    size = float(np.max(np.abs(phi))) or 1.0  # so that no square leaves the range of floats
    with np.errstate(over="ignore"):
        eigenvalues = np.linalg.eigvalsh((phi / size * weight[:, None]).T @ (phi / size) / n) * size * size
    length = np.linalg.norm(phi / size, axis=0)
    scaled = phi / size / np.where(length > 0, length, 1.0)
    singular, vectors = np.linalg.svd(scaled, full_matrices=n < n_params)[1:]
    singular = np.pad(singular, (0, n_params - singular.size))
    largest = float(singular[0])
    seen = singular > tolerance * largest if largest > 0 else np.zeros(n_params, dtype=bool)
    directions = _named_directions(vectors[~seen], length, names)
    return Excitation(
        alpha=max(float(eigenvalues[0]), 0.0),
        beta=float(eigenvalues[-1]),
        condition=largest / float(singular[-1]) if singular[-1] > 0 else np.inf,
        rank=int(seen.sum()),
        directions=directions,
        unseen=tuple(name for name in names if any(name in d for d in directions)),
        n_samples=n,
        n_params=n_params,
    )


def _matrix(phi: ArrayLike) -> NDArray[np.float64]:
    """A finite float matrix with at least one row and one column."""
    array = real_array(phi, "excitation: phi")
    if array.ndim != 2 or 0 in array.shape:
        raise ValueError(f"excitation: phi has shape {array.shape}, expected (n, n_params), one row a sample.")
    if not np.isfinite(array).all():
        raise ValueError("excitation: phi holds NaN or infinite values; leave such samples out.")
    return array


def _named_directions(
    vectors: NDArray[np.float64], length: NDArray[np.float64], names: Sequence[str]
) -> tuple[dict[str, float], ...]:
    """Unseen directions by name: columns that are zero stand alone, the others are made sparse."""
    zero = length == 0
    found = [{name: 1.0} for name, is_zero in zip(names, zero, strict=True) if is_zero]
    vectors = vectors[np.linalg.norm(vectors[:, ~zero], axis=1) > 0.5] if vectors.size else vectors
    for vector in _sparse_basis(vectors[:, ~zero]):
        kept = [n for n, is_zero in zip(names, zero, strict=True) if not is_zero]
        found.append({n: float(v) for n, v in zip(kept, vector, strict=True) if abs(v) > _MEMBER})
    return tuple(found)


def _sparse_basis(vectors: NDArray[np.float64]) -> NDArray[np.float64]:
    """Another basis of the rows' span, reduced by pivots so that each vector involves few parameters."""
    rows = vectors.copy()
    for i in range(len(rows)):
        j = int(np.argmax(np.abs(rows[i])))
        rows[i] /= rows[i, j]
        others = np.arange(len(rows)) != i
        rows[others] -= np.outer(rows[others, j], rows[i])
    norms = np.linalg.norm(rows, axis=1, keepdims=True)
    return rows / np.where(norms > 0, norms, 1.0)
