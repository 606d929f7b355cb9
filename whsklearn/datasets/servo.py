"""Logs of a simulated servo axis with any effects: its reference, effects of a given size, and the record."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike
from sklearn.utils import Bunch

from whsklearn.effects.base import Array, Effect, get_effect, rms, signals_of
from whsklearn.systems.servo import ServoAxis, record_frame, simulate_many
from whsklearn.systems.servo_parts import PIDController, Sensor

if TYPE_CHECKING:
    import pandas as pd


def reference_signal(
    kind: str,
    duration: float = 40.0,
    sample_rate: float = 1000.0,
    amplitude: float | None = None,
    random_state: Any = 0,
) -> Array:
    """A reference for the position.

    Parameters
    ----------
    kind : str
        ``sine``: 0.8 sin(2/5 pi t) of sec. 5.2.  ``multisine``: eight tones from 0.1 to 2.9 Hz
        of equal velocity and random phase. ``staircase``: constant speeds in both directions, from slow to fast.
        ``sweep``: 0.1 to 5 Hz at constant velocity.  ``rich``: the multisine on a slow triangle, which excites every
        effect of the catalogue.
    duration : float
        Length (s).
    sample_rate : float
        Samples per second (Hz).
    amplitude : float, optional
        Largest position (rad); the default is 0.8 for the sine, 1 for multisine and sweep,
        and 5 for staircase and rich.
    random_state : int, Generator or None
        Of the phases.

    Returns
    -------
    ndarray of shape (n,)
        Position (rad).

    Raises
    ------
    ValueError
        If the kind is unknown or a number is not above zero.

    Examples
    --------
    >>> from whsklearn.datasets import reference_signal
    >>> float(reference_signal("sine", 10.0, 100.0).max().round(3))
    0.8
    """
    makers = {
        "sine": (_sine, 0.8), "multisine": (_multisine, 1.0), "staircase": (_staircase, 5.0), "sweep": (_sweep, 1.0),
        "rich": (_rich, 5.0),
    }  # fmt: skip
    if kind not in makers:
        raise ValueError(f"Unknown reference {kind!r}; expected one of: {', '.join(makers)}, or an array.")
    make, default = makers[kind]
    peak = default if amplitude is None else amplitude
    for name, value in (("duration", duration), ("sample_rate", sample_rate), ("amplitude", peak)):
        if not (0 < value < math.inf):
            raise ValueError(f"{name} is {value!r}, expected a finite number above zero.")
    n = round(duration * sample_rate)
    if n < 2:
        raise ValueError(f"{duration} s at {sample_rate} Hz are {n} samples, expected at least two; lengthen it.")
    return make(np.arange(n) / sample_rate, peak, np.random.default_rng(random_state))


def _sine(t: Array, peak: float, _rng: np.random.Generator) -> Array:
    """The paper's reference."""
    return peak * np.sin(0.4 * math.pi * t)


def _scaled(path: Array, peak: float) -> Array:
    """A path scaled by its largest value."""
    return path * (peak / np.abs(path).max())


def _faded(t: Array) -> Array:
    """A rise from 0 to 1 within the first second, so that the axis starts from rest."""
    return 0.5 - 0.5 * np.cos(math.pi * np.minimum(t, 1.0))


def _multisine(t: Array, peak: float, rng: np.random.Generator) -> Array:
    """Eight tones of equal velocity; frequencies 0.1, 0.5, 0.9 ... 2.9 Hz."""
    frequencies = 0.1 + 0.4 * np.arange(8)
    phases = rng.uniform(0.0, 2.0 * math.pi, 8)
    tones = np.sin(2.0 * math.pi * frequencies[:, None] * t + phases[:, None]) / frequencies[:, None]
    return _scaled(tones.sum(axis=0) * _faded(t), peak)


def _rich(t: Array, peak: float, rng: np.random.Generator) -> Array:
    """A triangle over 20 s with rounded corners, from 0 upwards, and the multisine at a sixth of its height."""
    triangle = np.arcsin(0.98 * np.sin(2.0 * math.pi * t / min(20.0, t[-1]))) / math.asin(0.98)
    return _scaled(triangle * _faded(t) + _multisine(t, 1.0, rng) / 6.0, peak)


def _staircase(t: Array, peak: float, _rng: np.random.Generator) -> Array:
    """Eight speeds, each forwards and backwards, with smooth reversals."""
    speeds = np.geomspace(0.02, 1.0, 8)
    edges = np.linspace(0.0, t[-1] * (1 + 1e-12), 17)
    step = np.minimum(np.searchsorted(edges, t, side="right") - 1, 15)
    velocity = speeds[step // 2] * np.where(step % 2 == 0, 1.0, -1.0)
    width = max(3, round(0.1 * t.size / 16))
    window = np.hanning(width + 2)[1:-1]
    soft = np.convolve(np.pad(velocity, width, mode="edge"), window / window.sum(), mode="same")[width:-width]
    return _scaled(np.cumsum(soft * _faded(t)), peak)


def _sweep(t: Array, peak: float, _rng: np.random.Generator) -> Array:
    """A geometric sweep from 0.1 to 5 Hz with constant velocity amplitude."""
    low, high = 0.1, 5.0
    frequency = low * (high / low) ** (t / t[-1])
    phase = 2.0 * math.pi * np.cumsum(frequency) * (t[1] - t[0])
    return _scaled(np.sin(phase) / frequency * _faded(t), peak)


# --- draw an effect of a given size, for tests and examples that hide it in a log ------------------------------------
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
    name: str | type[Effect], axis: ServoAxis, reference: Array, share: float = 0.05, random_state: Any = 0
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
    signals = signals_of(base, "torque")
    torque = np.std(base.torque)
    if cls.name == "saturation":
        return _limited(effect, signals, share * torque)
    if effect.port in ("torque", "input") and effect.column_kind == "exact":
        unit = effect.columns(signals) @ (effect.coefficients / effect.magnitude)
        return effect.resized(math.copysign(share * torque / _size(unit), effect.magnitude))
    if cls.name in ("output_offset", "output_drift"):
        return effect.resized(share * np.std(base.true_position) / _size(effect.columns(signals)))
    return _answered(effect, axis, reference, base, share)


def _shaped(cls: type[Effect], base: Bunch, rng: np.random.Generator) -> Effect:
    """The effect at its default size with shapes drawn."""
    fields: dict[str, Any] = {}
    for field, choice in _SHAPES.get(cls.name, {}).items():
        fields[field] = choice[rng.integers(len(choice))] if len(choice) > 2 else float(rng.uniform(*choice))
    if cls.phased:
        fields["phase"] = float(rng.uniform(-math.pi, math.pi))
    travel = np.abs(base.true_position).max()
    if cls.name == "end_stop":
        fields["angle"] = float(travel * rng.uniform(0.7, 0.9))
    if cls.name == "parameter_change":
        fields["time"] = float(base.time[-1] * rng.uniform(0.3, 0.7))
    return cls(**fields)


def _size(values: Array) -> float:
    """Root mean square, never zero: it divides."""
    return max(rms(values), 1e-12)


def _limited(effect: Effect, signals: Bunch, wanted: float) -> Effect:
    """A saturation that cuts off a wanted rms of the drive, by bisection."""
    low, high = 0.0, float(np.abs(signals.drive).max())
    for _ in range(40):
        middle = 0.5 * (low + high)
        low, high = (low, middle) if _size(effect.resized(middle).contribution(signals)) < wanted else (middle, high)
    return effect.resized(high)


def _answered(effect: Effect, axis: ServoAxis, reference: Array, base: Bunch, share: float) -> Effect:
    """A size at which the response of the controller has the wanted rms, by repeated scaling."""
    wanted = share * np.std(base.drive)
    for _ in range(8):
        record = simulate_many([axis.with_effect(effect)], reference=reference, noise=False)[0]
        change = np.nan_to_num(record.drive - base.drive, nan=1e6, posinf=1e6, neginf=-1e6)
        answer = _size(np.clip(change, -1e6, 1e6))
        if abs(answer / wanted - 1.0) < 0.05:
            break
        factor = float(np.clip(wanted / answer, 0.2, 5.0))
        effect = effect.resized(min(effect.magnitude * factor, effect.quantities[effect.size].high))
    return effect


def make_servo_log(
    effects: Effect | str | Iterable[Effect | str] = (),
    *,
    sizes: float | Sequence[float] = 0.05,
    axis: ServoAxis | None = None,
    reference: str | ArrayLike = "rich",
    amplitude: float | None = None,
    duration: float = 40.0,
    sample_rate: float | None = None,
    noise: float | None = None,
    resolution: float | None = None,
    disturbance: ArrayLike | None = None,
    random_state: Any = 0,
    return_truth: bool = False,
) -> Any:
    """Simulate a log of a servo axis in closed loop.

    Parameters
    ----------
    effects : Effect, str, or iterable of these
        Hidden effects: instances, or names; the shape and phase of a named effect are drawn, and its size is a share of
        the rms drive, see `draw_effect`.
    sizes : float or sequence of float
        The shares of effects given by name.
    axis : ServoAxis, optional
        The axis without these effects; by default a small direct-drive table whose controller has feed-forward.
    reference : str or array-like of shape (n,)
        Kind of reference, see `reference_signal`, or the reference itself (rad).
    amplitude, duration : float
        Of a reference given by kind (rad, s).
    sample_rate : float, optional
        Rate of controller and log (Hz); the axis's own, 1,000 by default.
    noise : float, optional
        Standard deviation of white noise on the encoder (rad); 2e-5 on the default axis.
    resolution : float, optional
        Step of the encoder (rad).
    disturbance : array-like of shape (n,), optional
        A torque that no effect explains (Nm).
    random_state : int, Generator or None
        Of phases, shapes and noise.
    return_truth : bool
        Whether to return the truth as well.

    Returns
    -------
    log : DataFrame
        Columns ``time_s``, ``reference_rad``, ``torque_nm`` (as commanded), ``position_rad``.
    truth : Bunch
        Only with ``return_truth``: ``axis`` (with the effects), ``effects``, ``parameters``
        (by name), ``record`` (all signals).

    Examples
    --------
    >>> from whsklearn.datasets import make_servo_log
    >>> from whsklearn.effects import Cogging
    >>> log = make_servo_log([Cogging(0.1, order=17)], duration=2.0)
    >>> log.shape
    (2000, 4)
    """
    rng = np.random.default_rng(random_state)
    axis = default_axis() if axis is None else axis
    if sample_rate is not None:
        axis = dataclasses.replace(axis, sample_rate=float(sample_rate))
    if isinstance(reference, str):
        reference = reference_signal(reference, duration, axis.sample_rate, amplitude, rng)
    path = np.asarray(reference, dtype=float)
    wanted = [effects] if isinstance(effects, (str, Effect)) else list(effects)
    shares = np.broadcast_to(np.asarray(sizes, dtype=float), (len(wanted),))
    hidden = tuple(
        draw_effect(e, axis, path, float(s), rng) if isinstance(e, str) else e
        for e, s in zip(wanted, shares, strict=True)
    )
    for effect in hidden:
        axis = axis.with_effect(effect)
    sensor = {k: float(v) for k, v in (("noise", noise), ("resolution", resolution)) if v is not None}
    axis = dataclasses.replace(axis, sensor=dataclasses.replace(axis.sensor, **sensor))  # type: ignore[arg-type]
    record = axis.simulate(path, random_state=rng, disturbance=disturbance)
    log = record_frame(record)
    if not return_truth:
        return log
    return log, Bunch(axis=axis, effects=hidden, parameters=axis.parameters, record=record)


def default_axis() -> ServoAxis:
    """A small direct-drive table: 0.05 kg m2, 0.12 Nm s/rad, 0.3 Nm, PID with feed-forward at 1 kHz.

    Examples
    --------
    >>> from whsklearn.datasets import default_axis
    >>> axis = default_axis()
    >>> axis.inertia, axis.sample_rate
    (0.05, 1000.0)
    """
    controller = PIDController(60.0, 60.0, 2.0, velocity_feedforward=0.12, acceleration_feedforward=0.05)
    return ServoAxis(controller=controller, sensor=Sensor(noise=2e-5))


# --- the shipped record of the turntable of sec. 5.2 -----------------------------------------------------------------
# It is simulated, not measured: the paper's records are not public.
EXPERIMENTS = ("sine", "multisine")
DURATION = 40.0


def load_turntable(experiment: str = "sine", *, return_X_y: bool = False) -> pd.DataFrame | tuple[Array, Array]:
    """A simulated record of the preset rig, `ServoAxis.paper_rig`: 40 s at 100 Hz.

    Parameters
    ----------
    experiment : str
        ``sine``: the paper's reference, which does not excite all parameters; ``multisine``: eight tones, which do.
    return_X_y : bool
        Whether to return reference (n, 1) and position (n,) instead of the table.

    Returns
    -------
    DataFrame
        Columns ``time_s``, ``reference_rad``, ``torque_nm``, ``position_rad``; 4,000 rows.

    Raises
    ------
    ValueError
        If there is no experiment of that name.
    FileNotFoundError
        If the records are missing from the installation.

    Examples
    --------
    >>> from whsklearn.datasets import load_turntable
    >>> load_turntable().shape
    (4000, 4)
    """
    import pandas as pd

    if experiment not in EXPERIMENTS:
        raise ValueError(f"Unknown experiment {experiment!r}; expected one of: {', '.join(EXPERIMENTS)}.")
    name = f"turntable_{experiment}.csv"
    here = Path(__file__).resolve().parent
    path = next((p for p in (here / "logs" / name, here.parents[1] / "datasets" / name) if p.is_file()), None)
    if path is None:
        raise FileNotFoundError(
            f"{name} is not installed; reinstall the package, or use make_turntable({experiment!r})."
        )
    log = pd.read_csv(path)
    if return_X_y:
        return log[["reference_rad"]].to_numpy(), log["position_rad"].to_numpy()
    return log


def make_turntable(experiment: str = "sine") -> pd.DataFrame:
    """Simulate the record that `load_turntable` returns, rounded to a microradian and a micronewtonmetre."""
    rig = ServoAxis.paper_rig()
    record = rig.simulate(reference_signal(experiment, DURATION, rig.sample_rate))
    return record_frame(record).round(6)
