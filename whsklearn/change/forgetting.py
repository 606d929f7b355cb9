"""How fast an estimator forgets after a change, so that it follows and then settles."""

from __future__ import annotations

from typing import Any

_QUICK_MEMORY = 200.0  # samples, right after a change


def forgetting_after(rows: int, settled: float = 1.0) -> float:
    """Forgetting factor for the sample that comes ``rows`` samples after a change was noticed.

    1 - 1 / (200 + rows): what came since the change is kept with weights that fall linearly
    into the past, so the memory grows with the time since the change, and the estimate
    settles.  What was learnt before goes at once, by the estimator's ``forget_past``.

    Parameters
    ----------
    rows : int
        Samples since the change was noticed.
    settled : float, default=1
        Forgetting factor to which it settles.

    Examples
    --------
    >>> from whsklearn.change import forgetting_after
    >>> [round(forgetting_after(n), 4) for n in (0, 999, 2000, 100_000)]
    [0.995, 0.9992, 0.9995, 1.0]
    """
    return min(settled, 1.0 - 1.0 / (_QUICK_MEMORY + max(rows, 0)))


def set_forgetting(model: Any, forgetting: float) -> None:
    """Let a recursive estimator forget at another rate from its next sample on, mid-stream.

    Lowered for a while after an alarm, it makes room for what is new; raised again, the
    estimate settles.

    Parameters
    ----------
    model : estimator
        With a parameter ``forgetting``; what it has learnt stays.
    forgetting : float
        In (0, 1].

    Raises
    ------
    ValueError
        If it is out of range.

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
