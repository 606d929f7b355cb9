"""How fast an estimator forgets after a change, so that it follows the change and then settles."""

from __future__ import annotations

from typing import Any

_QUICK_MEMORY = 200.0  # samples, right after a change


def forgetting_after(rows: int, settled: float = 1.0) -> float:
    """Forgetting factor for the sample that comes ``rows`` samples after a change was detected.

    It is 1 - 1 / (200 + rows).  The weights of the samples since the change then fall linearly
    into the past, so the memory grows with the time since the change, and the estimate
    settles.  The samples before the change are forgotten at once by the estimator's ``forget_past``.

    Parameters
    ----------
    rows : int
        Samples since the change was detected.
    settled : float, default=1
        Final forgetting factor.

    Examples
    --------
    >>> from whsklearn.change import forgetting_after
    >>> [round(forgetting_after(n), 4) for n in (0, 999, 2000, 100_000)]
    [0.995, 0.9992, 0.9995, 1.0]
    """
    return min(settled, 1.0 - 1.0 / (_QUICK_MEMORY + max(rows, 0)))


def set_forgetting(model: Any, forgetting: float) -> None:
    """Change the forgetting factor of a recursive estimator in mid-stream, from its next sample on.

    Lower it for a while after an alarm so that the estimate follows the change, then raise it
    again so that the estimate settles.

    Parameters
    ----------
    model : estimator
        An estimator with a parameter ``forgetting``; its learned state is kept.
    forgetting : float
        The new forgetting factor, in (0, 1].

    Raises
    ------
    ValueError
        If ``forgetting`` is out of range.

    Examples
    --------
    >>> from whsklearn import RLSRegressor
    >>> from whsklearn.change import set_forgetting
    >>> model = RLSRegressor().partial_fit([[1.0], [2.0]], [2.0, 4.0])
    >>> set_forgetting(model, 0.99)
    >>> model.forgetting
    0.99
    """
    if not 0 < forgetting <= 1:
        raise ValueError(f"set_forgetting: forgetting is {forgetting!r}, expected a number above 0 and at most 1.")
    model.set_params(forgetting=forgetting)
    schedule = getattr(model, "state_", {}).get("forgetting")
    if schedule is not None:  # the exact gradient carries its schedule: present value, final value, rate
        schedule[:2] = forgetting
