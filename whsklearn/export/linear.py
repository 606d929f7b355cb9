"""The linear part of a model: `scipy.signal.dlti`, and python-control's transfer function."""

from __future__ import annotations

from typing import Any

import numpy as np

from whsklearn.export.model import (
    Loss,
    as_exported,
    left_out,
    lost_parts,
    parts_of,
    rigid,
    size_of,
    with_held_law,
)
from whsklearn.export.robots import total

_LINEAR = ("viscous", "cable_spring")


def to_dlti(model: Any) -> tuple[Any, list[Loss]]:
    """The linear part in discrete time, and the parts of the model that it omits.

    Parameters
    ----------
    model : path, ServoAxis, WienerHammersteinSystem or identified model

    Returns
    -------
    system : scipy.signal.dlti
        From drive to position (exact under a held drive), or from input to output.
    losses : list of Loss

    Examples
    --------
    >>> from whsklearn import ServoAxis
    >>> from whsklearn.export import to_dlti
    >>> system, losses = to_dlti(ServoAxis(inertia=0.05))
    >>> [str(x) for x in losses]
    ['coulomb (torque 0.3 Nm): it is not linear']
    >>> system.dt
    0.001
    """
    from scipy.signal import cont2discrete, dlti

    exported = as_exported(model)
    if exported.chain is not None:
        terms = exported.chain.law.terms if exported.chain.law else ()
        bent = [t for t in terms if t.name not in ("power", "viscous") or t.shape.get("degree", 1.0) != 1.0]
        losses = [Loss(t.name, size_of(t), "it is not linear") for t in bent]
        losses += [Loss(e.name, size_of(e), "a transfer function holds no effects") for e in exported.chain.effects]
        if exported.chain.offset:
            losses.append(Loss("offset", f"{exported.chain.offset:.6g}", "it is not linear"))
        numerator, denominator = exported.chain.linear()
        if not np.any(numerator):
            raise ValueError("The chain's law has no linear term, so it has no linear part; export it to c instead.")
        leading = np.flatnonzero(numerator)[0]  # in powers of z: a delay is a lower degree of the numerator
        width = max(numerator.size, denominator.size)
        wide = [np.pad(p, (0, width - p.size)) for p in (numerator, denominator)]
        return dlti(wide[0][leading:], wide[1], dt=exported.chain.dt), losses
    axis, losses = with_held_law(exported.need_axis("A linear system"))
    effects = parts_of(rigid(axis))
    losses += left_out(axis, lambda e: e.name in _LINEAR, "it is not linear")
    losses += lost_parts(axis)
    springs = [e for e in effects if e.name == "cable_spring" and e.shape["centre"]]
    losses += [Loss(e.name, f"centre {e.shape['centre']:.6g} rad", "held with its centre at zero") for e in springs]
    dt = 1.0 / axis.sample_rate
    over = [axis.inertia, total(effects, "viscous"), total(effects, "cable_spring")]
    numerator, denominator, _ = cont2discrete(([1.0], over), dt)
    return dlti(np.trim_zeros(np.ravel(numerator), "f"), denominator, dt=dt), exported.told(losses)


def to_control(model: Any) -> tuple[Any, list[Loss]]:
    """As `to_dlti` of a ``model``, for python-control (extra ``control``); ImportError if it is not installed.

    Examples
    --------
    >>> from whsklearn import WienerHammersteinSystem
    >>> from whsklearn.export import to_control
    >>> linear, losses = to_control(WienerHammersteinSystem.example())
    >>> [loss.name for loss in losses]
    ['coulomb', 'stribeck']
    """
    try:
        import control
    except ImportError:
        raise ImportError("python-control is not installed; pip install 'whsklearn[control]'.") from None
    linear, losses = to_dlti(model)
    return control.tf(linear.num, linear.den, linear.dt), losses
