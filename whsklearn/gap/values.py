"""Values that a plant and the engine hand to each other: looks, fits, errors, learned curves, linearised fits."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[Any]


@dataclass(frozen=True)
class FittedTerm:
    """A candidate with its numbers.

    Attributes
    ----------
    kind : object
        With ``name`` and ``effect(q)``.
    q : tuple of float
    """

    kind: Any
    q: tuple[float, ...]

    @property
    def name(self) -> str:
        """Canonical name."""
        return str(self.kind.name)

    @property
    def effect(self) -> Any:
        """The effect with these numbers."""
        return self.kind.effect(np.array(self.q))


@dataclass(frozen=True)
class Look:
    """A candidate at its best start, seen cheaply.

    Attributes
    ----------
    name : str
        Canonical name.
    gain : float
        Share of the sum of squares that a linear look expects to go, 0 to 1; ranks candidates and scores surrogates.
    start : object
        What ``refine`` starts from; the engine only hands it back.
    n_numbers : int
        Free numbers that the candidate adds, shape included.
    n_looks : int
        Places at which it was looked for (orders, frequencies, starts).
    expected : float
        Delta BIC that an effect of two percent of the drive would have; small: the record cannot show it.
    elementary : bool
        A law so common that it goes first when nothing alone explains the gap.
    costly : bool
        Shows little in a linear look; refined only while nothing else closes the gap.
    reason : str
        Why it is out before it is refined; empty if it is not.
    """

    name: str
    gain: float
    start: Any = None
    n_numbers: int = 1
    n_looks: int = 1
    expected: float = np.inf
    elementary: bool = False
    costly: bool = False
    reason: str = ""


@dataclass(frozen=True)
class CandidateFit:
    """A candidate fitted jointly with the model that it is added to.

    Attributes
    ----------
    look : Look
        Where the fit started.
    model : object
        The fitted model, the candidate its last term.
    """

    look: Look
    model: Any

    @property
    def name(self) -> str:
        """Canonical name."""
        return self.look.name


class Linearised(NamedTuple):
    """A fitted vector with its residual and derivatives.

    Attributes
    ----------
    x, low, high : ndarray of shape (p,)
    residual : ndarray of shape (n,)
    jacobian : ndarray of shape (n, p)
    rebuild : callable
        x -> model.
    """

    x: Array
    low: Array
    high: Array
    residual: Array
    jacobian: Array
    rebuild: Any


class Curve(NamedTuple):
    """A learned torque as a function of one signal (times the sign or the value of a second one).

    Attributes
    ----------
    signals : tuple of str
        The signals it depends on; that of the picture's axis comes first.
    x, y, band : ndarray of shape (n,)
        Signal, torque (in the unit of the drive), and two standard deviations of the torque.

    References
    ----------
    Hastie and Tibshirani 1990, Generalized Additive Models, Chapman and Hall.

    Examples
    --------
    >>> import numpy as np
    >>> from whsklearn.gap import Curve
    >>> speed = np.array([0.0, 0.5, 1.0])
    >>> curve = Curve(("velocity",), speed, 0.2 * speed**2, np.full(3, 0.01))
    >>> bool((abs(curve.y) > curve.band).any())  # it is more than its own uncertainty somewhere
    True
    """

    signals: tuple[str, ...]
    x: Array
    y: Array
    band: Array


class Learned(NamedTuple):
    """A model with its learned nameless torques, and their curves.

    Attributes
    ----------
    model : object
    curves : tuple of Curve
        Empty where the plant has no picture of them.
    """

    model: Any
    curves: tuple[Curve, ...]
