"""Draw an effect of a given size, for tests and examples that hide it in a log."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from whsklearn.effects import Effect, get_effect
from whsklearn.systems.servo import ServoAxis, simulate_many

if TYPE_CHECKING:
    from sklearn.utils import Bunch

# ranges from which shapes are drawn; a pair is uniform, a longer tuple a choice
_SHAPES: dict[str, dict[str, tuple[Any, ...]]] = {
    "stribeck": {"velocity": (0.05, 0.4), "exponent": (1.0, 2.0, 2.0)},
    "position_friction": {"order": (1.0, 2.0, 3.0, 4.0, 6.0)},
    "presliding_hysteresis": {"distance": (2e-3, 3e-2)},
    "friction_drift": {"time_constant": (5.0, 30.0)},
    "torque_ripple": {"order": (2.0, 3.0, 4.0, 6.0, 8.0, 12.0)},
    "cogging": {"order": (4.0, 6.0, 8.0, 12.0, 17.0, 24.0)},
    "backlash": {"load_share": (0.4, 0.7), "frequency": (40.0, 100.0)},
    "flexible_coupling": {"load_share": (0.4, 0.7), "damping_ratio": (0.02, 0.06)},
    "encoder_eccentricity": {"order": (1.0, 2.0, 2.0)},
    "disturbance_tone": {"frequency": (3.0, 30.0)},
    "parameter_change": {"parameter": ("inertia", "viscous", "coulomb", "gain")},
}


def draw_effect(
    name: str | type[Effect],
    axis: ServoAxis,
    reference: NDArray[np.float64],
    share: float = 0.05,
    random_state: Any = 0,
) -> Effect:
    """Draw an effect of the catalogue with random shape and phase and the given influence on the drive.

    Parameters
    ----------
    name : str or Effect class
        Canonical name, or the class of one of the shapes that share it, such as ``LuGre``.
    axis : ServoAxis
        The axis to which it will be added.
    reference : ndarray of shape (n,)
        The experiment (rad).
    share : float
        Size as a share of the rms drive: that of the effect's torque if it has one, otherwise that of the response of
        the controller. For offset and drift of the sensor, to which no drive responds, it is a share of the rms
        position.
    random_state : int, Generator or None
        Of shape and phase.

    Returns
    -------
    Effect
        Ready for ``axis.with_effect``.

    Examples
    --------
    >>> from whsklearn.datasets import draw_effect, reference_signal
    >>> from whsklearn.systems import ServoAxis
    >>> effect = draw_effect("cogging", ServoAxis(), reference_signal("rich", 4.0), 0.1)
    >>> effect.name
    'cogging'
    """
    rng = np.random.default_rng(random_state)
    cls = get_effect(name) if isinstance(name, str) else name
    if not 0 < share < math.inf:
        raise ValueError(f"share is {share!r}, expected a finite number above zero, such as 0.05.")
    base = simulate_many([axis], reference=reference, noise=False)[0]
    effect = _shaped(cls, base, rng)
    signals = _signals(base, axis)
    torque = np.std(base.torque)
    if cls.name == "saturation":
        return _limited(effect, signals, share * torque)
    if effect.port in ("torque", "input") and effect.column_kind == "exact":
        unit = effect.columns(signals) @ (effect.coefficients / effect.magnitude)
        return effect.resized(math.copysign(share * torque / _rms(unit), effect.magnitude))
    if cls.name in ("output_offset", "output_drift"):
        return effect.resized(share * np.std(base.true_position) / _rms(effect.columns(signals)))
    return _answered(effect, axis, reference, base, share)


def _shaped(cls: type[Effect], base: Bunch, rng: np.random.Generator) -> Effect:
    """The effect at its default size with shapes drawn."""
    fields: dict[str, Any] = {}
    for field, choice in _SHAPES.get(cls.name, {}).items():
        if len(choice) > 2:
            value = choice[rng.integers(len(choice))]
            fields[field] = value if isinstance(value, str) else float(value)
        else:
            fields[field] = float(rng.uniform(*choice))
    if cls.phased:
        fields["phase"] = float(rng.uniform(-math.pi, math.pi))
    travel = np.abs(base.true_position).max()
    if cls.name == "end_stop":
        fields["angle"] = float(travel * rng.uniform(0.7, 0.9))
    if cls.name == "parameter_change":
        fields["time"] = float(base.time[-1] * rng.uniform(0.3, 0.7))
    return cls(**fields)


def _signals(base: Bunch, axis: ServoAxis) -> Bunch:
    """True signals of a simulated record."""
    from sklearn.utils import Bunch

    return Bunch(
        time=base.time,
        position=base.true_position,
        velocity=base.velocity,
        acceleration=np.gradient(base.velocity) * axis.sample_rate,
        drive=base.torque,
    )


def _rms(values: NDArray[np.float64]) -> float:
    """Root mean square, never zero."""
    return max(float(np.sqrt(np.mean(np.square(values)))), 1e-12)


def _limited(effect: Effect, signals: Bunch, wanted: float) -> Effect:
    """A saturation that cuts off a wanted rms of the drive, by bisection."""
    low, high = 0.0, float(np.abs(signals.drive).max())
    for _ in range(40):
        middle = 0.5 * (low + high)
        low, high = (low, middle) if _rms(effect.resized(middle).contribution(signals)) < wanted else (middle, high)
    return effect.resized(high)


def _answered(effect: Effect, axis: ServoAxis, reference: NDArray[np.float64], base: Bunch, share: float) -> Effect:
    """A size at which the response of the controller has the wanted rms, by repeated scaling."""
    wanted = share * np.std(base.drive)
    for _ in range(8):
        record = simulate_many([axis.with_effect(effect)], reference=reference, noise=False)[0]
        change = np.nan_to_num(record.drive - base.drive, nan=1e6, posinf=1e6, neginf=-1e6)
        answer = _rms(np.clip(change, -1e6, 1e6))
        if abs(answer / wanted - 1.0) < 0.05:
            break
        factor = float(np.clip(wanted / answer, 0.2, 5.0))
        quantity = effect.quantities[effect.size]
        effect = effect.resized(min(effect.magnitude * factor, quantity.high))
    return effect
