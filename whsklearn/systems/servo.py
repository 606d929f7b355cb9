"""A servo axis as physics: inertia, friction law, effects, drive, transmission, sensor, controller.

The torque balance is torque = J a + law + effects, so a positive effect is one that the drive has to overcome.  Nothing
in it depends on radians: a linear axis reads kg, m and N.
"""

from __future__ import annotations

import dataclasses
import math
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray
from sklearn.utils import Bunch

from whsklearn._numba import is_kept
from whsklearn.effects import Coulomb, Effect, FrictionLaw, Viscous, as_law, codes
from whsklearn.systems import _servo_kernel as kernel
from whsklearn.systems._servo_kernel import DELAY, AxisNumbers, plant_of
from whsklearn.systems.servo_parts import Drive, PIDController, Sensor, Transmission

if TYPE_CHECKING:
    import pandas as pd


# --- an experiment on the axis: its inputs, checked and completed, and its compiled simulation -----------------------
class Experiment(NamedTuple):
    """An experiment on the axis: arrays of n samples, checked."""

    drive: NDArray[np.float64] | None
    reference: NDArray[np.float64]
    disturbance: NDArray[np.float64]
    measured: NDArray[np.float64]
    every: float
    linear: bool
    initial: NDArray[np.float64]


class Conditions(NamedTuple):
    """Settings of an experiment other than its reference or drive; see `simulate_many`."""

    disturbance: ArrayLike | None = None
    reference_velocity: ArrayLike | None = None
    reference_acceleration: ArrayLike | None = None
    initial_position: float | None = None
    initial_velocity: float | None = None
    position: ArrayLike | None = None
    velocity: ArrayLike | None = None
    resync: float | None = None
    hold: str = "zero"


def is_compiled() -> bool:
    """Whether an axis is simulated without compiling anything, or nothing that is compiled can be kept."""
    return is_kept(Path(kernel.__file__))


def record_frame(record: Bunch) -> pd.DataFrame:
    """The log as a logger would write it: time_s, reference_rad, torque_nm, position_rad.

    ``record``: the result of `ServoAxis.simulate`.

    Examples
    --------
    >>> from whsklearn import ServoAxis
    >>> from whsklearn.systems import record_frame
    >>> list(record_frame(ServoAxis().simulate([0.0] * 10)))
    ['time_s', 'reference_rad', 'torque_nm', 'position_rad']
    """
    import pandas as pd

    columns = {"time_s": "time", "reference_rad": "reference", "torque_nm": "drive", "position_rad": "position"}
    return pd.DataFrame({name: record[signal] for name, signal in columns.items()})


def _signal(values: ArrayLike, name: str, n: int | None = None) -> NDArray[np.float64]:
    """A finite one-dimensional signal of the right length."""
    signal = np.asarray(values, dtype=float)
    if signal.ndim != 1 or signal.size == 0 or (n is not None and signal.size != n):
        expected = "a non-empty 1-D array" if n is None else f"{n} samples"
        raise ValueError(f"{name} has shape {signal.shape}, expected {expected}; give one value per sample.")
    if not np.isfinite(signal).all():
        raise ValueError(f"{name} holds NaN or infinity at row {np.flatnonzero(~np.isfinite(signal))[0]}; clean it.")
    return np.ascontiguousarray(signal)


def experiment(
    controller: PIDController,
    sample_rate: float,
    reference: ArrayLike | None,
    drive: ArrayLike | None,
    wanted: Conditions,
) -> Experiment:
    """Check and complete the caller's experiment.

    Raises ValueError if both or none of reference (n,) in rad and drive (n,) in Nm are given, or a signal has another
    length.
    """
    if (reference is None) == (drive is None):
        raise ValueError("Give either a reference (closed loop) or a drive (open loop), not both and not neither.")
    if wanted.hold not in ("zero", "linear"):
        raise ValueError(f"hold is {wanted.hold!r}, expected 'zero' or 'linear'.")
    main = _signal(drive, "drive") if reference is None else _signal(reference, "reference")  # type: ignore[arg-type]
    n = main.size
    if drive is None:
        path = _path(controller, sample_rate, main, wanted.reference_velocity, wanted.reference_acceleration)
    else:
        path = np.full((3, n), np.nan)
    measured, every = _returns(sample_rate, wanted.position, wanted.velocity, wanted.resync, n)
    start, speed = wanted.initial_position, wanted.initial_velocity
    if start is None:  # where the measurement begins, or the reference, or at zero
        begin = wanted.position if wanted.position is not None else main if drive is None else (0.0,)
        start = float(np.asarray(begin, dtype=float)[0])
    if speed is None:
        speed = measured[1, 0] if wanted.position is not None and drive is not None else 0.0
    return Experiment(
        None if drive is None else main,
        path,
        np.zeros(n) if wanted.disturbance is None else _signal(wanted.disturbance, "disturbance", n),
        measured,
        every,
        wanted.hold == "linear",
        np.array([start, speed, start, speed], dtype=float),
    )


def _path(
    c: PIDController,
    rate: float,
    reference: NDArray[np.float64],
    velocity: ArrayLike | None,
    acceleration: ArrayLike | None,
) -> NDArray[np.float64]:
    """Reference and its two derivatives; central differences where they are not given."""
    n = reference.size
    path = np.zeros((3, n))
    path[0] = reference
    if velocity is not None:
        path[1] = _signal(velocity, "reference_velocity", n)
    elif (c.velocity_feedforward or c.acceleration_feedforward) and n > 1:
        path[1] = np.gradient(reference) * rate
    if acceleration is not None:
        path[2] = _signal(acceleration, "reference_acceleration", n)
    elif c.acceleration_feedforward and n > 1:
        path[2] = np.gradient(path[1]) * rate
    return path


def _returns(
    rate: float, position: ArrayLike | None, velocity: ArrayLike | None, resync: float | None, n: int
) -> tuple[NDArray[np.float64], int]:
    """Measured position and velocity, and the interval in samples at which to return to them (0: never)."""
    measured = np.zeros((2, n))
    if position is None:
        if resync is not None:
            raise ValueError("resync needs the measured position to return to; pass position=.")
        return measured, 0
    measured[0] = _signal(position, "position", n)
    if velocity is not None:
        measured[1] = _signal(velocity, "velocity", n)
    elif n > 4:
        measured[1] = _smoothed_velocity(measured[0], rate)
    if resync is None:
        return measured, 0
    if not 0.0 < resync < math.inf:
        raise ValueError(f"resync is {resync} s, expected a time above zero, or None for a free run.")
    return measured, max(1, round(resync * rate))


def _smoothed_velocity(position: NDArray[np.float64], rate: float) -> NDArray[np.float64]:
    """Velocity from a local parabola over 20 ms or five samples."""
    from scipy.signal import savgol_filter

    half = max(2, round(0.01 * rate))
    half = min(half, (position.size - 1) // 2)
    return savgol_filter(position, 2 * half + 1, 2, deriv=1, delta=1.0 / rate)


def reading_noise(deviation: float, noise: Any, random_state: Any, n: int) -> NDArray[np.float64]:
    """The noise on n readings (rad): drawn with the sensor's standard deviation, none, or as given."""
    if isinstance(noise, bool):
        if not noise or deviation == 0.0:
            return np.zeros(n)
        return deviation * np.random.default_rng(random_state).standard_normal(n)
    return _signal(noise, "noise", n)


def simulated(
    plant: AxisNumbers,
    controller: PIDController,
    e: Experiment,
    noise: NDArray[np.float64],
    sample_rate: float,
    substeps: int,
) -> Bunch:
    """Run the compiled simulation of one experiment and name its rows; see `ServoAxis.simulate`."""
    n, closed = e.reference.shape[1], e.drive is None
    out = np.zeros((kernel.N_SIGNALS, n))
    if e.drive is not None:
        out[0] = e.drive
    signals = kernel.PassInputs(e.reference, noise, e.disturbance, e.measured)
    how = kernel.How(1.0 / sample_rate, substeps, closed, int(e.every), linear=e.linear and not closed)
    kernel.run(out, plant, controller.row, signals, how, e.initial)
    rows = {
        "drive": kernel.DRIVE, "position": kernel.MEASURED, "true_position": kernel.POSITION,
        "velocity": kernel.VELOCITY, "torque": kernel.TORQUE, "load_position": kernel.LOAD,
        "load_velocity": kernel.LOAD_VELOCITY,
    }  # fmt: skip
    named = {name: out[row] for name, row in rows.items()}
    return Bunch(time=np.arange(n) * how.sample_time, reference=signals.reference[0], **named)


# --- the axis --------------------------------------------------------------------------------------------------------
FEWEST_STEPS = 4  # per sample, as in the fit of an axis; its code then takes under 100 ns per step
PARTS = ("drive", "transmission", "sensor", "controller")


@dataclass(frozen=True)
class ServoAxis:
    """A servo axis that can be simulated in closed loop or from a logged drive.

    Parameters
    ----------
    inertia : float
        Total moving inertia (kg m2).
    law : FrictionLaw, str or iterable of StaticEffect
        Friction law; terms given by names such as ``"viscous,coulomb"`` have weight one.
    effects : iterable of Effect
        Further effects, from the catalogue or your own.
    drive, transmission, sensor, controller
        The other parts; ``transmission=None`` means a rigid axis.
    friction : str
        ``"stick"``: dry friction is a set-valued law with true standstill.
        ``"tanh"``: sign(v) is tanh(v / smoothing), as in (3).
    smoothing : float
        Velocity over which ``tanh`` friction changes sign (rad/s).
    sample_rate : float
        Rate of controller and log (Hz).
    substeps : int
        Fine steps per sample.

    Notes
    -----
    Friction acts on the motor's side, and so do cogging and the drive's effects; springs,
    stops, imbalance and tones act on the load's side.  On a rigid axis there is no difference.

    References
    ----------
    Paper, sec. 5.2; Armstrong-Helouvry, Dupont and Canudas de Wit 1994, Automatica 30(7), 1083-1138, on standstill
    under dry friction.

    Examples
    --------
    >>> import numpy as np
    >>> from whsklearn.effects import Cogging
    >>> from whsklearn.systems import ServoAxis
    >>> axis = ServoAxis(inertia=0.05, effects=[Cogging(0.05, order=17)])
    >>> axis.parameters["cogging__order"]
    17.0
    >>> record = axis.simulate(0.5 * np.sin(2 * np.pi * np.arange(1000) / 1000))
    >>> record.position.shape
    (1000,)
    """

    inertia: float = 0.05
    law: FrictionLaw = field(default_factory=lambda: FrictionLaw([Viscous(0.12), Coulomb(0.3)]))
    effects: tuple[Effect, ...] = ()
    drive: Drive = field(default_factory=Drive)
    transmission: Transmission | None = None
    sensor: Sensor = field(default_factory=Sensor)
    controller: PIDController = field(default_factory=PIDController)
    friction: str = "stick"
    smoothing: float = 1e-3
    sample_rate: float = 1000.0
    substeps: int = 20

    def __post_init__(self) -> None:
        effects = (self.effects,) if isinstance(self.effects, Effect) else tuple(self.effects)
        object.__setattr__(self, "effects", effects)
        object.__setattr__(self, "law", as_law(self.law))
        for e in effects:
            if not isinstance(e, Effect):
                raise ValueError(f"{e!r} is not an effect; expected instances such as Cogging(0.05, order=17).")
        for name in ("inertia", "smoothing", "sample_rate"):
            value = getattr(self, name)
            if not (isinstance(value, (int, float)) and 0.0 < value < math.inf):
                raise ValueError(f"ServoAxis: {name} is {value!r}, expected a finite number above zero.")
        if self.friction not in ("stick", "tanh"):
            raise ValueError(f"ServoAxis: friction is {self.friction!r}, expected 'stick' or 'tanh'.")
        if self.substeps != int(self.substeps) or self.substeps < 1:
            raise ValueError(f"ServoAxis: substeps is {self.substeps!r}, expected a whole number of at least 1.")

    @classmethod
    def paper_rig(cls, **changes: Any) -> Self:
        """The turntable of sec. 5.2: PID 40, 0.001, 0.2 at 100 Hz, encoder of 800 divisions.

        The controller, the rate and the encoder are the paper's; it gives no inertia and no
        friction, so these are set to values of a small turntable.  Its reference is
        ``0.8 sin(2/5 pi t)``, see `whsklearn.datasets.reference_signal`.

        ``**changes``: fields of `ServoAxis` to change.
        """
        rig: dict[str, Any] = {
            "inertia": 0.02,
            "law": FrictionLaw([Viscous(0.4), Coulomb(0.5)]),
            "drive": Drive(gain=0.2, limit=3.0),
            "sensor": Sensor(resolution=2 * math.pi / 800),
            "controller": PIDController(40.0, 0.001, 0.2, derivative_filter=0.0, limit=15.0),
            "sample_rate": 100.0,
            "substeps": 100,
        }
        return cls(**(rig | changes))

    # -- parameters -------------------------------------------------------------------

    @property
    def effect_labels(self) -> tuple[str, ...]:
        """One label per effect: its name, numbered from the second occurrence on (the law's terms count)."""
        seen = Counter(t.name for t in self.law.terms)
        labels = []
        for e in self.effects:
            seen[e.name] += 1
            labels.append(e.name if seen[e.name] == 1 else f"{e.name}{seen[e.name]}")
        return tuple(labels)

    @property
    def term_names(self) -> tuple[str, ...]:
        """``inertia``, the law's labels, the effects' labels."""
        return ("inertia", *self.law.labels, *self.effect_labels)

    @property
    def parameters(self) -> dict[str, float]:
        """All parameters by name: sizes under their label, shapes as ``label__field``, parts as ``drive__gain``."""
        out = {"inertia": float(self.inertia)}
        for label, e in zip(self.term_names[1:], (*self.law.terms, *self.effects), strict=True):
            out |= {label: e.magnitude} | {f"{label}__{k}": v for k, v in e.shape.items()}
        for name in PARTS:
            part = getattr(self, name)
            if part is not None:
                numeric = {f.name: getattr(part, f.name) for f in dataclasses.fields(part)}
                out |= {f"{name}__{k}": float(v) for k, v in numeric.items() if not isinstance(v, str)}
        return out | {"smoothing": float(self.smoothing)}

    def with_parameters(self, values: Mapping[str, float] | None = None, /, **more: float) -> Self:
        """Return the same axis with other parameters.

        ``values``: values by the names in `parameters`. ``**more``: the same, as keyword arguments.

        Examples
        --------
        >>> ServoAxis().with_parameters(inertia=0.04, coulomb=0.2).parameters["coulomb"]
        0.2
        """
        wanted = {**(values or {}), **more}
        changes: dict[str, Any] = {k: float(wanted.pop(k)) for k in ("inertia", "smoothing") if k in wanted}
        if wanted:
            terms = [_changed(t, label, wanted) for label, t in zip(self.law.labels, self.law.terms, strict=True)]
            if any(new is not old for new, old in zip(terms, self.law.terms, strict=True)):
                changes["law"] = FrictionLaw(terms)
            effects = (_changed(e, label, wanted) for label, e in zip(self.effect_labels, self.effects, strict=True))
            changes["effects"] = tuple(effects)
        for name in PARTS:
            part = getattr(self, name)
            keys = [k for k in wanted if k.startswith(f"{name}__")]
            if part is not None and keys:
                fields = {f.name for f in dataclasses.fields(part)}
                known = {k: k.removeprefix(f"{name}__") for k in keys if k.removeprefix(f"{name}__") in fields}
                changes[name] = dataclasses.replace(part, **{f: float(wanted.pop(k)) for k, f in known.items()})
        if wanted:
            raise ValueError(f"Unknown parameters {sorted(wanted)}; expected some of: {', '.join(self.parameters)}.")
        return dataclasses.replace(self, **changes)

    def vector(self, names: Sequence[str]) -> NDArray[np.float64]:
        """Return the chosen parameters as a vector. ``names``: of `parameters`."""
        known = self.parameters
        missing = [n for n in names if n not in known]
        if missing:
            raise ValueError(f"Unknown parameters {missing}; expected some of: {', '.join(known)}.")
        return np.array([known[n] for n in names])

    def with_vector(self, names: Sequence[str], values: ArrayLike) -> Self:
        """The same axis with the chosen parameters taken from a vector.

        ``names``: of `parameters`. ``values`` (n_names,): in the units of those parameters.
        """
        return self.with_parameters(dict(zip(names, np.asarray(values, dtype=float).tolist(), strict=True)))

    def with_effect(self, effect: Effect) -> Self:
        """Return the same axis with one more ``effect``."""
        return dataclasses.replace(self, effects=(*self.effects, effect))

    def columns(self, signals: Any) -> tuple[NDArray[np.float64], tuple[str, ...]]:
        """Regressors of torque = J a + law + effects, with a label for each column.

        Effects of the sensor and those that can only be simulated have none; a phased
        effect has two, labelled ``name__cos`` and ``name__sin``.

        ``signals``: ``time`` (s), ``position`` (rad), ``velocity``, ``acceleration`` and ``drive`` (Nm), shape (n,)
        each.
        """
        blocks, names = [np.asarray(signals.acceleration, dtype=float).reshape(-1, 1)], ["inertia"]
        for label, e in zip(self.term_names[1:], (*self.law.terms, *self.effects), strict=True):
            if e.port == "output" or e.column_kind == "none":
                continue
            blocks.append(e.columns(signals))
            names += [f"{label}__cos", f"{label}__sin"] if e.phased else [label]
        return np.hstack(blocks), tuple(names)

    # -- simulation -------------------------------------------------------------------

    def simulate(self, reference: ArrayLike, **options: Any) -> Bunch:
        """Simulate the closed loop along a reference; see `whsklearn.systems.simulate_many`.

        ``reference`` (n,): commanded position, one value per sample (rad). ``**options``: ``noise``, ``random_state``,
        ``disturbance``, ``reference_velocity``, ``reference_acceleration``, ``initial_position``, ``initial_velocity``.
        Returns a Bunch of arrays of shape (n,): ``time``, ``reference``, ``drive`` (as logged), ``position`` (as
        measured), ``true_position``, ``velocity``, ``torque`` (at the axis), ``load_position``, ``load_velocity``.
        Raises FloatingPointError if the simulation does not stay finite.
        """
        return self._simulate(reference=reference, **options)

    def simulate_drive(self, drive: ArrayLike, **options: Any) -> Bunch:
        """Replay a logged drive (Nm) in open loop, held between samples.

        ``drive`` (n,): the drive as logged. ``**options``: as for `simulate`, and ``position``, ``velocity``
        (measured), ``resync`` (s: return to them that often), ``hold`` (``"zero"`` or ``"linear"``). Returns as for
        `simulate`, with NaN for the reference. Raises FloatingPointError if the simulation does not stay finite.
        """
        return self._simulate(drive=drive, **options)

    def _simulate(self, **options: Any) -> Bunch:
        """One simulation that must stay finite."""
        record = simulate_many([self], **options)[0]
        bad = np.flatnonzero(~np.isfinite(record.true_position) | ~np.isfinite(record.drive))
        if bad.size:
            raise FloatingPointError(
                f"The simulation is no longer finite after {record.time[bad[0]]:.3g} s; "
                f"use more substeps than {self.substeps}, lower gains or other parameters."
            )
        return record


def fine_steps(effects: Iterable[Effect], sample_time: float) -> int:
    """Fine steps per sample for an accurate simulation of these effects: four, or as many as an effect requires.

    A coupling rings and an impact is over within a fraction of a slow sample (`Effect.finest`).
    """
    longest = min((e.finest for e in effects if e.magnitude != e.neutral), default=math.inf)
    return max(FEWEST_STEPS, math.ceil(sample_time / longest - 1e-9))


# --- as compiled passes take it --------------------------------------------------------------------------------------
def parts_of(axis: ServoAxis) -> NDArray[np.float64]:
    """The numbers of an axis that do not belong to an effect, shape (12,), in the order of `AxisNumbers.parts`."""
    kappa = 1.0 / axis.smoothing if axis.friction == "tanh" else math.inf
    d, part = axis.drive, axis.transmission
    coupling = (0.0, 0.0, 0.0, 0.0)
    if part is not None:
        coupling = (part.load_share, part.stiffness, part.damping_ratio, part.gap)
    resolution, on_load = axis.sensor.resolution, float(axis.sensor.side == "load")
    return np.array([axis.inertia, kappa, d.gain, d.limit, d.delay, d.lag, *coupling, resolution, on_load])


def pack(axis: ServoAxis) -> AxisNumbers:
    """The axis as flat arrays; effects of neutral size are left out, so they change nothing.

    Raises ValueError if the drive would act early, or a user-defined effect cannot be simulated.
    """
    plant = plant_of([e for e in (*axis.law.terms, *axis.effects) if e.magnitude != e.neutral], parts_of(axis))
    delay = plant.parts[DELAY] + plant.p[plant.codes == codes.INPUT_DELAY, 0].sum()  # as in `chain_of`
    if delay < 0:
        raise ValueError(f"The drive's delay is {delay} s, expected zero or more; the drive cannot act early.")
    return plant


def _changed(effect: Any, label: str, wanted: dict[str, float]) -> Any:
    """The effect with its entries of ``wanted`` applied; they are removed from ``wanted``."""
    changes = {}
    for key, name in ((label, effect.size), *((f"{label}__{f}", f) for f in (effect.size, *effect.shape))):
        if key in wanted:
            changes[name] = float(wanted.pop(key))
    return dataclasses.replace(effect, **changes) if changes else effect


def simulate_many(
    axes: Sequence[ServoAxis],
    *,
    reference: ArrayLike | None = None,
    drive: ArrayLike | None = None,
    noise: Any = True,
    random_state: Any = 0,
    n_jobs: int = 1,
    **options: Any,
) -> list[Bunch]:
    """Simulate several axes in the same experiment; the compiled part runs in ``n_jobs`` threads.

    Parameters
    ----------
    axes : sequence of ServoAxis
        The axes; they may differ in everything, including their effects.
    reference : array-like of shape (n,), optional
        Reference of the closed loop (rad).
    drive : array-like of shape (n,), optional
        Drive to replay in open loop (Nm); give this or ``reference``.
    noise : bool, array-like of shape (n,), or list of these
        True adds white noise with the sensor's standard deviation; an array is added as it is (rad).
    random_state : int, Generator, None, or list of these
        Draws the noise; a list gives each axis its own.
    n_jobs : int
        Number of threads.
    **options
        ``disturbance`` (n,) in Nm, added to the torque; ``reference_velocity``, ``reference_acceleration``
        (n,); ``initial_position``, ``initial_velocity``; in open loop ``position``, ``velocity`` (n,),
        ``resync`` (s), ``hold`` ("zero" or "linear").

    Returns
    -------
    list of Bunch
        One record per axis, see `ServoAxis.simulate`; a simulation that diverges contains non-finite values.

    Examples
    --------
    >>> import numpy as np
    >>> from whsklearn.systems import ServoAxis, simulate_many
    >>> axes = [ServoAxis(inertia=j) for j in (0.04, 0.05)]
    >>> [r.position.size for r in simulate_many(axes, reference=np.zeros(10))]
    [10, 10]
    """
    axes = list(axes)
    noises = noise if isinstance(noise, list) else [noise] * len(axes)
    seeds = random_state if isinstance(random_state, list) else [random_state] * len(axes)
    wanted = Conditions(**options)
    jobs = []
    for axis, e_noise, seed in zip(axes, noises, seeds, strict=True):
        e = experiment(axis.controller, axis.sample_rate, reference, drive, wanted)
        added = reading_noise(axis.sensor.noise, e_noise, seed, e.reference.shape[1])
        jobs.append((pack(axis), axis.controller, e, added, axis.sample_rate, int(axis.substeps)))
    if n_jobs == 1 or len(jobs) == 1:
        return [simulated(*job) for job in jobs]
    with ThreadPoolExecutor(n_jobs) as pool:
        return list(pool.map(lambda job: simulated(*job), jobs))
