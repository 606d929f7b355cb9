"""The fine view of a servo axis: its model runs on the logged drive, held near the measurement by an observer.

The trajectory is the model's own, so the columns contain no encoder noise and small effects are measured accurately.
If much is missing, the innovation no longer shows it, because a wrong model carries the estimate along; so the inverse
view comes first.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from whsklearn.effects import Scales
from whsklearn.gap.filters import ResidualFilter, autoregression, solve_whitening, whiten
from whsklearn.gap.least_squares import Fit, jacobian, least_squares
from whsklearn.gap.plant import Linearised
from whsklearn.gap.plants import servo_screening as screening
from whsklearn.gap.plants.servo_model import LONGEST_STEP, AxisModel
from whsklearn.gap.plants.servo_surrogate import surrogate_record
from whsklearn.gap.record import ServoRecord, rms

Array = NDArray[Any]
AR_ORDER = 12  # of the whitening polynomial
SUBSTEPS = 4  # fine steps per sample, at least, with a step longer than `LONGEST_STEP`
STEP_ERROR = 0.01  # share of the tolerance by which a longer fine step may change the gap
LOST = 1e3  # times the travel or the speed of the record: a run beyond that has diverged


@dataclass
class ObserverView:
    """One record under one residual filter.

    Attributes
    ----------
    noise : float
        Standard deviation of the position noise.
    step : float
        Largest fine step of a run (s), see `coarsened`.
    train, held : ndarray of bool, of int, shape (n_decimated,)
        Training mask; number of the held-out block, or -1.
    is_surrogate : bool
        Whether the model itself made the record.
    ar : ndarray
        Current whitening polynomial of the missing torque.
    tolerance : float
        Torque below which nothing is worth a name, as a share of the rms drive.
    """

    record: ServoRecord
    filter: ResidualFilter
    scene: Scales
    noise: float
    start: tuple[Array, Array]
    train: NDArray[np.bool_]
    held: NDArray[np.intp]
    usable: NDArray[np.bool_]
    tolerance: float
    quantum: float = 0.0
    step: float = LONGEST_STEP
    is_surrogate: bool = False
    ar: Array = field(default_factory=lambda: np.array([1.0]))

    # --- looking ---------------------------------------------------------------------------
    def follow(self, model: AxisModel) -> tuple[Array, Array, Array]:
        """Prediction, angle and velocity of the model held near the record."""
        return self.held_near(model)[:3]

    def held_near(self, model: AxisModel) -> tuple[Array, Array, Array, Array]:
        """The same with the twist of the coupling and its rate, shape (n, 2); a diverging run is kept finite."""
        r = self.record
        out = model.follow(r.drive, r.position, self.filter.gains, start=self.start, pieces=r.pieces)
        far = LOST * (self.scene.reach + abs(self.scene.centre)), LOST * self.scene.speed
        if all(-f < x.min() and x.max() < f for x, f in zip(out[:3], (far[0], far[0], far[1]), strict=True)):
            return out
        held = [
            np.clip(np.nan_to_num(x, nan=0.0), -f, f) for x, f in zip(out[:3], (far[0], far[0], far[1]), strict=True)
        ]
        return held[0], held[1], held[2], np.clip(np.nan_to_num(out[3]), -far[1], far[1])

    def gap(self, model: AxisModel) -> Array:
        """Torque that the model lacks, filtered; shape (n_decimated,)."""
        y_hat, _, _ = self.follow(model)
        d = self.filter.torque(self.record.position - y_hat)
        return np.where(np.isfinite(d), np.clip(d, -1e6, 1e6), 1e6)

    def whitened(self, d: Array, *, on: str = "train") -> Array:
        """Whitened samples of one part: ``train``, ``held`` or ``all``."""
        mask = {"train": self.train, "held": self.held >= 0, "all": self.usable}[on]
        return whiten(d, self.ar)[mask & self.usable]

    def residual(self, model: AxisModel) -> Array:
        """The residual that the fit minimises."""
        return self.whitened(self.gap(model))

    def floor(self, model: AxisModel | None = None) -> float:
        """Rms of the missing torque due to position noise alone."""
        return self.filter.noise_gain * self.noise

    def quiet_variance(self) -> float:
        """Variance of the whitened missing torque if only position noise were left."""
        from scipy.signal import fftconvolve

        spread = np.zeros((self.ar.size - 1) * self.filter.every + 1)
        spread[:: self.filter.every] = self.ar
        return float(self.noise**2 * np.sum(fftconvolve(self.filter.taps, spread) ** 2)) + 1e-300

    def rms(self, d: Array, on: str = "all") -> float:
        """Rms of the missing torque on one part."""
        mask = {"train": self.train, "held": self.held >= 0, "all": self.usable}[on] & self.usable
        return rms(d[mask])

    def weigh(self, gap: float) -> None:
        """Set the whitening to position noise plus white torque of the rms ``gap``.

        Only the size of the gap is used, so no tone and no slow drift is whitened away.
        """
        taps, every = self.filter.taps, self.filter.every
        full = np.concatenate([taps, np.zeros(AR_ORDER * every)])
        r = np.array([taps @ full[i * every : i * every + taps.size] for i in range(AR_ORDER + 1)])
        white = max(gap, 0.5 * self.tolerance * self.scene.torque) ** 2
        self.ar = solve_whitening(self.noise**2 * r, white)

    def tune_whitening(self, d: Array) -> None:
        """Set the whitening to the residual ``d`` of the best model so far."""
        white = (0.25 * self.tolerance * self.scene.torque) ** 2
        self.ar = autoregression(d[self.usable], AR_ORDER, white)

    # --- the protocol of a view --------------------------------------------------------------

    def coarsened(self, model: AxisModel) -> ObserverView:
        """The view with the longest fine step, at most a quarter of a sample, that does not change the gap.

        A record at 50 Hz does not need a step of a millisecond if its axis is slow (arm joints: 5 ms change the gap by
        5e-6 of the drive), but does if it is fast (a jaw with a mechanical time constant of 2 ms: 2e-3).
        """
        step, longest = LONGEST_STEP, self.scene.dt / SUBSTEPS
        if 2.0 * step > longest:
            return self
        gap = self.gap(dataclasses.replace(model, step=step))
        while 2.0 * step <= longest:
            other = self.gap(dataclasses.replace(model, step=2.0 * step))
            if self.rms(other - gap) > STEP_ERROR * self.tolerance * self.scene.torque:
                break
            step *= 2.0
        return dataclasses.replace(self, step=step)

    def fit(self, model: AxisModel) -> AxisModel:
        """The model refitted to the training part, weighted by the size of its own gap."""
        model = dataclasses.replace(model, scene=self.scene, step=self.step)
        if model.has_play:
            return screening.settled_play(self, model)
        for _ in range(2):
            self.weigh(self.rms(self.gap(model)))
            model, _ = self.fitted(model)
        return model

    def surrogate(self, model: AxisModel, rng: np.random.Generator) -> ObserverView:
        """The view of a record that the model itself makes in the same experiment."""
        return dataclasses.replace(self, record=surrogate_record(self, model, rng), is_surrogate=True)

    def seen(self, model: AxisModel) -> tuple[Array, Array, Array, NDArray[np.bool_], NDArray[np.bool_]]:
        """(position, velocity, drive, training mask, held-out mask) at the samples of the gap."""
        _, angle, speed = self.follow(model)
        pick = self.filter.pick
        held = (self.held >= 0) & self.usable
        return pick(angle), pick(speed), self.filter.blur(self.record.drive), self.train & self.usable, held

    def linearised(self, model: AxisModel) -> Linearised:
        """Whitened training residual and its derivatives at the model."""
        self.tune_whitening(self.gap(model))
        x, (low, high) = model.vector(), model.bounds()
        r = self.residual(model)
        jac = jacobian(lambda z: self.residual(model.with_vector(z)), x, r, model.steps(), high)
        return Linearised(x, low, high, r, jac, model.with_vector)

    # --- fitting ---------------------------------------------------------------------------
    def fitted(self, model: AxisModel, *, max_iterations: int = 12, tolerance: float = 5e-4) -> tuple[AxisModel, Fit]:
        """The model refitted to the training part, all free numbers together, under the current weights."""
        fit = least_squares(
            lambda x: self.residual(model.with_vector(x)),
            model.vector(),
            model.steps(),
            model.bounds(),
            max_iterations=max_iterations,
            tolerance=tolerance,
        )
        return model.with_vector(fit.x), fit
