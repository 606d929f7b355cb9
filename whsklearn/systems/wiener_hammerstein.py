"""The Wiener-Hammerstein system with friction: L1, a static law, L2 (paper, (1), (2), (4))."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from sklearn.utils import Bunch

from whsklearn.effects import Effect, FrictionLaw, StaticEffect, Viscous, as_law
from whsklearn.systems.chain import PackedChain, packed, run
from whsklearn.systems.stability import is_stable


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
        Further effects; each acts at its own place, see `whsklearn.systems.chain`.
    dt : float, default=1.0
        Sampling time, needed by effects whose parameters are in seconds or Hz.
    direct : int, default=0
        Number of blocks with a direct path, x(t) = u(t) + a_2 u(t-1) ...; u and y do not show which block has it.

    Raises
    ------
    ValueError
        If a or c does not begin with 1, a block is unstable, or an effect has no place in the chain.

    References
    ----------
    Paper, (1), (2) and (4); Giri and Bai (eds.) 2010, Block-oriented Nonlinear System Identification, Springer.

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
        direct: int = 0,
    ):
        self.a, self.b, self.c, self.d = (np.array(v, dtype=float).reshape(-1) for v in (a, b, c, d))
        self.law = as_law(law)
        self.effects, self.dt, self.direct = tuple(effects), float(dt), int(direct)
        if self.direct not in (0, 1, 2):
            raise ValueError(f"direct is {direct!r}; expected the number of blocks with a direct path: 0, 1 or 2.")
        packed(self.effects)  # raises for an effect that has no place
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
        """``a``, ``b``, ``c``, ``d`` and one weight per term of the law, like an estimator's ``parameters_``."""
        blocks: dict[str, Any] = {name: getattr(self, name).copy() for name in "abcd"}
        return blocks | {k: float(w) for k, w in zip(self.law.labels, self.law.weights, strict=True)}

    @property
    def theta(self) -> NDArray[np.float64]:
        """The true theta of (6): [g a, g b (+ g at b_1), other weights, c[1:], d], g the linear term's weight.

        Raises ValueError if the law has no term that is linear in x or dx.
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

        ``u`` (n,) or (n, 1): input. ``d`` (n,): noise of (2), which enters before L2's denominator; none by default.
        Returns ``x``, ``v``, ``y``, each of shape (n,); with direct paths, x and v are taken ``direct`` samples later.
        """
        u = np.ascontiguousarray(np.asarray(u, dtype=float).reshape(-1))
        noise = np.zeros_like(u) if d is None else np.array(d, dtype=float).reshape(-1)
        if noise.size != u.size:
            raise ValueError(f"d has {noise.size} samples and u has {u.size}; expected equal lengths.")
        dims = np.array([self.a.size, self.b.size, self.c.size, self.d.size, len(self.law)], dtype=np.int64)
        chain = PackedChain(dims, self.law.codes, self.law.shapes, np.inf, self.dt)
        theta = np.concatenate([self.a[1:], self.b, self.law.weights, self.c[1:], self.d])
        later = np.zeros(self.direct)  # the pass delays each block: it runs longer, and the first samples are cut
        u, noise = np.concatenate([u, later]), np.concatenate([later, noise])
        x, v, y = np.empty_like(u), np.empty_like(u), np.empty_like(u)
        run(theta, chain, packed(self.effects), u, u, noise, True, x, v, y)
        return Bunch(x=x[self.direct :], v=v[self.direct :], y=y[self.direct :])

    @property
    def polynomials(self) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
        """Numerators and denominators of L1 and L2 in powers of the delay, with leading zeros for blocks without a
        direct path.

        A single direct path is given to L1, because u and y do not show which block has it.
        """
        first, second = (np.zeros(int(self.direct < n)) for n in (1, 2))
        one = np.ones(1)
        return (
            np.concatenate([first, self.a]), np.concatenate([one, self.b]),
            np.concatenate([second, self.c]), np.concatenate([one, self.d]),
        )  # fmt: skip

    def simulate(self, u: ArrayLike, d: ArrayLike | None = None) -> NDArray[np.float64]:
        """The output y of shape (n,) alone; arguments as for `signals`.

        ``u`` (n,): input, in the unit of the log. ``d`` (n,): noise of (2).
        """
        return self.signals(u, d).y
