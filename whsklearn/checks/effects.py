"""The contract that every effect keeps, whether it is the library's or yours.

The simulator and the regressor columns are written apart, so that one can be held
against the other: that is what makes a name in a report mean something.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray
from sklearn.utils import Bunch

from whsklearn.effects.base import PLACES, Effect, rms, signals_of
from whsklearn.effects.friction import Coulomb, Viscous
from whsklearn.effects.law import FrictionLaw
from whsklearn.effects.quantity import Quantity
from whsklearn.systems.servo import ServoAxis

KINDS = ("exact", "at_size", "first_order", "none")
PORTS = ("torque", "input", "output", "block")
TOLERANCE = 0.05
START = -1.2  # rad, so that the experiment passes zero


class EffectContractError(ValueError):
    """An effect does not keep its contract.

    Examples
    --------
    >>> from whsklearn.checks import EffectContractError, check_effect
    >>> try:
    ...     check_effect("cogging")
    ... except EffectContractError as error:
    ...     print(error)
    'cogging' is not an effect; derive it from whsklearn.effects.Effect.
    """


def check_effect(effect: type[Effect] | Effect) -> tuple[str, ...]:
    """Check that an effect keeps the contract of the catalogue.

    It must describe itself (name, place, equation, units); its columns must be finite, one
    for each coefficient, and leave the signals alone; at its neutral size a simulation must
    be exactly that of the axis without it; and a small effect, simulated, must do what the
    torque of its columns does to the same axis (5 %).

    ``effect``: a class is checked at its default values. Returns names of the checks that were passed. Raises
    EffectContractError if a check fails; the sentence says which and by how much.

    Examples
    --------
    >>> from whsklearn.checks import check_effect
    >>> from whsklearn.effects import Cogging
    >>> check_effect(Cogging)
    ('description', 'columns', 'coefficients', 'neutral size', 'repeatable', 'first order')
    """
    instance = effect() if isinstance(effect, type) else effect
    if not isinstance(instance, Effect):
        raise EffectContractError(f"{effect!r} is not an effect; derive it from whsklearn.effects.Effect.")
    checks: dict[str, Callable[[Effect], None]] = {
        "description": _check_description, "columns": _check_columns, "coefficients": _check_coefficients,
        "neutral size": _check_neutral, "repeatable": _check_repeatable, "first order": _check_first_order,
    }  # fmt: skip
    for check in checks.values():
        check(instance)
    return tuple(checks)


def _require(holds: bool, effect: Effect, sentence: str) -> None:
    """Raise unless a statement holds."""
    if not holds:
        raise EffectContractError(f"{type(effect).__name__}: {sentence}")


def _check_description(e: Effect) -> None:
    """Name, place, equation, port, and a quantity for each number."""
    _require(bool(e.name) and e.name == e.name.lower() and " " not in e.name, e, f"name is {e.name!r}, use snake_case.")
    _require(e.place in PLACES, e, f"place is {e.place!r}, expected one of {', '.join(PLACES)}.")
    _require(bool(e.equation), e, "the equation is missing; write it in one line.")
    _require(e.port in PORTS, e, f"port is {e.port!r}, expected one of {', '.join(PORTS)}.")
    _require(e.column_kind in KINDS, e, f"column_kind is {e.column_kind!r}, expected one of {', '.join(KINDS)}.")
    fields = [f.name for f in dataclasses.fields(e)]
    _require(e.size in fields, e, f"size is {e.size!r}, expected one of its fields: {', '.join(fields)}.")
    _require(fields[0] == e.size, e, f"the first field is {fields[0]!r}, expected the size, {e.size!r}.")
    for name in (e.size, *e.shape):
        q = e.quantities.get(name)
        _require(isinstance(q, Quantity), e, f"the quantity of {name} is missing; give its unit and range.")
        _require(q is not None and bool(q.unit) and q.low < q.high, e, f"the range of {name} is empty; low < high.")
        above = q is not None and (not q.log or q.low > 0 or q.span is not None)
        _require(above, e, f"{name} spans ratios from zero; start above it.")


def _check_columns(e: Effect) -> None:
    """Finite, one a coefficient, also at rest, and without a trace on the signals."""
    signals = _probe()
    before = {k: v.copy() for k, v in signals.items()}
    columns = e.columns(signals)
    wanted = (signals.time.size, e.coefficients.size)
    _require(columns.shape == wanted, e, f"columns have shape {columns.shape}, expected {wanted}.")
    _require(bool(np.isfinite(columns).all()), e, "columns hold NaN or infinity; guard the formula at rest.")
    kept = all(np.array_equal(signals[k], v) for k, v in before.items())
    _require(kept, e, "columns() changes the signals it was given; work on a copy.")
    rest = signals | {k: np.zeros_like(signals.time) for k in ("velocity", "acceleration", "drive")}
    still = e.columns(type(signals)(**rest))
    _require(bool(np.isfinite(still).all()), e, "columns hold NaN or infinity at rest; guard the formula.")


def _check_coefficients(e: Effect) -> None:
    """Coefficients lead back to the effect, and twice the size is twice the torque."""
    if e.column_kind == "none":
        return
    fields = {k: v for k, v in e.shape.items() if not (e.phased and k == "phase")} | e.options
    again = type(e).from_coefficients(e.coefficients, **fields)
    near = np.allclose(again.coefficients, e.coefficients, rtol=1e-12, atol=1e-15)
    _require(near, e, f"from_coefficients gives {again}, expected {e}.")
    if e.column_kind != "exact":
        return
    signals = _probe()
    one, two = e.contribution(signals), e.resized(2.0 * e.magnitude).contribution(signals)
    _require(np.allclose(two, 2.0 * one, rtol=1e-9, atol=1e-12), e, "twice the size is not twice the torque.")
    if e.evaluate is None:
        return
    rows = list(zip(signals.time, signals.position, signals.velocity, signals.drive, strict=True))
    for size, torque in ((0.0, 0.0 * one), (2.0 * e.magnitude, two)):
        numbers = np.array(e.resized(size).numbers)
        direct = np.array([e.evaluate(numbers, *map(float, row)) for row in rows])
        same = np.allclose(direct, torque, rtol=1e-9, atol=1e-12)
        _require(same, e, f"evaluate() at size {size:g} is not the torque of the columns; multiply by p[0] once.")


def _check_neutral(e: Effect) -> None:
    """At the neutral size a simulation is the base simulation, bit for bit; near it, nearly."""
    base, drive = _experiment()
    without = base.simulate_drive(drive, initial_position=START)
    neutral = base.with_effect(e.resized(e.neutral)).simulate_drive(drive, initial_position=START)
    same = np.array_equal(neutral.position, without.position)
    _require(same, e, f"at {e.size} = {e.neutral:g} the simulation is not that of the axis without it.")


def _check_repeatable(e: Effect) -> None:
    """Two simulations are the same, finite, and other than without the effect."""
    base, drive = _experiment()
    visible = e.resized(0.5 * float(np.abs(drive).max())) if math.isinf(e.neutral) else e  # a limit that is reached
    axis = base.with_effect(visible)
    once, twice = (axis.simulate_drive(drive, initial_position=START).position for _ in range(2))
    _require(bool(np.isfinite(once).all()), e, "the simulation does not stay finite at its default size.")
    _require(np.array_equal(once, twice), e, "two simulations differ; an effect keeps no state of its own.")
    changed = not np.array_equal(once, base.simulate_drive(drive, initial_position=START).position)
    _require(changed, e, "the simulation does not change; the effect has no function to simulate it.")


def _check_first_order(e: Effect) -> None:
    """A small effect does to the axis what the torque of its columns does."""
    if e.column_kind == "none":
        return
    base, drive = _experiment()
    record = base.simulate_drive(drive, initial_position=START)
    signals = Bunch(**signals_of(record), kappa=1.0 / base.smoothing)  # the sign as smooth as the axis's
    small = _small(e, signals, record)
    simulated = base.with_effect(small).simulate_drive(drive, initial_position=START).position - record.position
    torque = small.contribution(signals)
    if e.port == "output":
        predicted = torque
    else:
        mean = torque.copy()
        mean[:-1] = 0.5 * (torque[1:] + torque[:-1])
        predicted = base.simulate_drive(drive, disturbance=-mean, initial_position=START).position - record.position
    error = rms(simulated - predicted) / max(rms(predicted), 1e-300)
    told = f"simulated, the effect differs from the torque of its columns by {error:.0%}, expected less than "
    _require(error < TOLERANCE, e, f"{told}{TOLERANCE:.0%}; compare signs, units and the order of the numbers.")


def _probe() -> Bunch:
    """Signals that pass through zero, rest and both directions."""
    t = np.arange(400) / 100.0
    position = 1.7 * np.sin(2.0 * t)
    velocity = np.where((t > 1.0) & (t < 1.2), 0.0, 3.4 * np.cos(2.0 * t))
    return Bunch(
        time=t, position=position, velocity=velocity, acceleration=-6.8 * np.sin(2.0 * t), drive=np.cos(3.1 * t)
    )


def _experiment() -> tuple[Any, NDArray[np.float64]]:
    """A smooth axis and a drive that moves it by some radians either way."""
    axis = ServoAxis(0.05, FrictionLaw([Viscous(0.3), Coulomb(0.2)]), friction="tanh", smoothing=0.05)
    t = np.arange(4000) / axis.sample_rate
    return axis, 0.9 * np.sin(2.0 * math.pi * 0.45 * t + 0.4) + 0.4 * np.sin(2.0 * math.pi * 1.3 * t)


def _small(e: Effect, signals: Bunch, record: Bunch) -> Effect:
    """The effect so small that first order is all there is: a thousandth of the drive."""
    drive = record.drive
    if math.isinf(e.neutral):
        return e.resized(0.97 * float(np.abs(drive).max()))
    size = e.magnitude if e.magnitude != e.neutral else 1.0
    reach = rms(e.resized(size).contribution(signals))
    _require(reach > 0.0, e, "its columns are zero in motion over several radians; check it at values that act there.")
    scale = rms(record.position) if e.port == "output" else rms(drive)
    return e.resized(1e-3 * size * scale / reach)
