"""The Wiener-Hammerstein system with friction: L1, a static law, L2 (paper, (1), (2), (4))."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numba import njit
from sklearn.utils import Bunch

from whsklearn.effects import Effect, FrictionLaw, StaticEffect, Viscous, as_law
from whsklearn.effects.terms import term
from whsklearn.systems.block_effects import packed, run_effects
from whsklearn.systems.stability import is_stable

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray


class WienerHammersteinSystem:
    """u -> L1 -> x -> law -> v -> L2 -> y, at rest before the first sample.

    .. code-block:: text

        x(t) = sum_i a_i u(t-i) - sum_j b_j x(t-j)               (1)
        v(t) = sum_k w_k f_k(x(t), x(t) - x(t-1))                (4) and its relatives
        y(t) = sum_m c_m v(t-m) - sum_n d_n y(t-n) + d(t)        (2)

    Parameters
    ----------
    a, b : sequences of float
        Numerator (a[0] = 1) and denominator of L1.
    c, d : sequences of float
        Numerator (c[0] = 1) and denominator of L2.
    law : FrictionLaw, str or sequence of effects, optional
        The static block; None is Example 5.1's law (4).  A Hammerstein system has
        ``a=[1], b=[]``, a Wiener system ``c=[1], d=[]``.
    effects : sequence of Effect
        Further effects, each in its place: see `whsklearn.systems.block_effects`.
    dt : float, default=1.0
        Sampling time, which effects with seconds or Hz in their numbers need.

    Raises
    ------
    ValueError
        If a or c does not begin with 1, a block is unstable, or an effect has no place in the chain.

    Examples
    --------
    >>> from whsklearn import WienerHammersteinSystem
    >>> system = WienerHammersteinSystem.example()
    >>> system.simulate([0.0, 1.0, 0.0, 0.0]).round(3).tolist()
    [0.0, 0.0, 0.0, 0.598]
    """

    def __init__(
        self,
        a: ArrayLike,
        b: ArrayLike,
        c: ArrayLike,
        d: ArrayLike,
        law: FrictionLaw | str | Iterable[StaticEffect] | None = None,
        *,
        effects: Sequence[Effect] = (),
        dt: float = 1.0,
    ):
        self.a, self.b, self.c, self.d = (np.array(v, dtype=float).reshape(-1) for v in (a, b, c, d))
        self.law = as_law(law)
        self.effects, self.dt = tuple(effects), float(dt)
        packed(self.effects)
        for name, numerator in (("a", self.a), ("c", self.c)):
            if numerator.size == 0 or numerator[0] != 1.0:
                raise ValueError(
                    f"{name} is {numerator.tolist()}, expected it to begin with 1: divide it by its first "
                    "entry and put the gain into the law."
                )
        for name, denominator in (("b", self.b), ("d", self.d)):
            if not is_stable(denominator, 1.0):
                raise ValueError(f"{name} is {denominator.tolist()}, an unstable block; expected all poles inside 1.")

    @classmethod
    def example(cls) -> WienerHammersteinSystem:
        """The system of Example 5.1."""
        return cls(a=[1.0, 2.2], b=[1.0, 0.5], c=[1.0, 0.2], d=[0.15, 0.4])

    @property
    def parameters(self) -> dict[str, Any]:
        """``a``, ``b``, ``c``, ``d`` and a weight a term of the law, as an estimator's ``parameters_``."""
        blocks: dict[str, Any] = {name: getattr(self, name).copy() for name in "abcd"}
        return blocks | {k: float(w) for k, w in zip(self.law.labels, self.law.weights, strict=True)}

    @property
    def theta(self) -> NDArray[np.float64]:
        """The true theta of (6): [g a, g b (+ g at b_1), other weights, c[1:], d], g the linear term's weight.

        Raises
        ------
        ValueError
            If the law has no term that is linear in x or dx.
        """
        key = self.law.key
        if key is None:
            raise ValueError(f"The law {self.law.labels} has no linear term, so theta of (6) is not defined.")
        g, b = self.law.weights[key], self.law.weights[key] * self.b
        if self.b.size and isinstance(self.law.terms[key], Viscous):
            b[0] += g
        return np.concatenate([g * self.a, b, np.delete(self.law.weights, key), self.c[1:], self.d])

    def __repr__(self) -> str:
        blocks = ", ".join(f"{n}={getattr(self, n).tolist()}" for n in "abcd")
        added = f", effects={list(self.effects)!r}, dt={self.dt}" if self.effects else ""
        return f"WienerHammersteinSystem({blocks}, law={self.law!r}{added})"

    def signals(self, u: ArrayLike, d: ArrayLike | None = None) -> Bunch:
        """Simulate every signal of the chain.

        Parameters
        ----------
        u : array-like of shape (n,) or (n, 1)
            Input.
        d : array-like of shape (n,), optional
            Noise of (2), which enters before L2's denominator; none by default.

        Returns
        -------
        Bunch
            ``x``, ``v``, ``y``, each of shape (n,).
        """
        u = np.ascontiguousarray(np.asarray(u, dtype=float).reshape(-1))
        noise = np.zeros_like(u) if d is None else np.ascontiguousarray(d, dtype=float).reshape(-1)
        if noise.size != u.size:
            raise ValueError(f"d has {noise.size} samples and u has {u.size}; expected equal lengths.")
        if self.effects:
            x, v, y = run_effects(self.a, self.b, self.c, self.d, self.law, self.effects, u, noise, self.dt)
            return Bunch(x=x, v=v, y=y)
        x, v, y = _simulate(self.a, self.b, self.c, self.d, self.law.codes, self.law.shapes, self.law.weights, u, noise)
        return Bunch(x=x, v=v, y=y)

    def simulate(self, u: ArrayLike, d: ArrayLike | None = None) -> NDArray[np.float64]:
        """The output y of shape (n,) alone; arguments as for `signals`."""
        return self.signals(u, d).y


@njit(cache=True)
def _simulate(a, b, c, d, codes, shapes, weights, u, noise):
    """(1), the law and (2), sample by sample from rest."""
    n = u.size
    x = np.zeros(n)
    v = np.zeros(n)
    y = np.zeros(n)
    for t in range(n):
        s = 0.0
        for i in range(min(a.size, t)):
            s += a[i] * u[t - 1 - i]
        for j in range(min(b.size, t)):
            s -= b[j] * x[t - 1 - j]
        x[t] = s
        dx = s - (x[t - 1] if t > 0 else 0.0)
        for k in range(codes.size):
            v[t] += weights[k] * term(codes[k], shapes[k, 0], shapes[k, 1], shapes[k, 2], s, dx, np.inf)[0]
        s = noise[t]
        for m in range(min(c.size, t)):
            s += c[m] * v[t - 1 - m]
        for k in range(min(d.size, t)):
            s -= d[k] * y[t - 1 - k]
        y[t] = s
    return x, v, y
