"""The test bench of one record: run a model beside the measurement, look at what it lacks, fit it.

A `Bench` holds what stays the same through a diagnosis (record, lens, split, start), so that every
model and every candidate is judged by the same numbers.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from whsklearn.gap.axis_model import AxisModel, Term
from whsklearn.gap.candidates import Scene, candidate
from whsklearn.gap.fit import Fit, jacobian, least_squares
from whsklearn.gap.inverse import column, motion
from whsklearn.gap.lens import Lens, autoregression, make_lens, solve_whitening, whiten
from whsklearn.gap.record import ServoRecord, blocks, lattice, noise_level

Array = NDArray[Any]
AR_ORDER = 12


@dataclass
class Bench:
    """One record under one lens.

    Attributes
    ----------
    noise : float
        Standard deviation of the position noise.
    train, held : ndarray of bool, of int, shape (n_decimated,)
        Training mask; number of the held-out block or -1.
    ar : ndarray
        Whitening polynomial of the missing torque in force.
    tolerance : float
        Torque below which nothing is worth a name, share of the rms drive.
    """

    record: ServoRecord
    lens: Lens
    scene: Scene
    noise: float
    start: tuple[Array, Array]
    train: NDArray[np.bool_]
    held: NDArray[np.intp]
    usable: NDArray[np.bool_]
    tolerance: float
    quantum: float = 0.0
    ar: Array = field(default_factory=lambda: np.array([1.0]))

    # --- looking ---------------------------------------------------------------------------
    def follow(self, model: AxisModel) -> tuple[Array, Array, Array]:
        """Prediction, angle and velocity of the model held near the record."""
        return self.held_near(model)[:3]

    def held_near(self, model: AxisModel) -> tuple[Array, Array, Array, Array]:
        """The same, and the twist of the coupling with its rate, shape (n, 2)."""
        return model.follow(self.record.drive, self.record.position, self.lens.gains, start=self.start)

    def missing(self, model: AxisModel) -> Array:
        """Torque that the model lacks, seen through the lens; shape (n_decimated,)."""
        y_hat, _, _ = self.follow(model)
        d = self.lens.torque(self.record.position - y_hat)
        return np.where(np.isfinite(d), np.clip(d, -1e6, 1e6), 1e6)

    def whitened(self, d: Array, *, on: str = "train") -> Array:
        """Whitened samples of one part: ``train`` or ``held`` or ``all``."""
        mask = {"train": self.train, "held": self.held >= 0, "all": self.usable}[on]
        return whiten(d, self.ar)[mask & self.usable]

    def residual(self, model: AxisModel) -> Array:
        """What the fit minimises."""
        return self.whitened(self.missing(model))

    def floor(self) -> float:
        """Rms of the missing torque that position noise alone gives."""
        return self.lens.noise_gain * self.noise

    def quiet_variance(self) -> float:
        """Variance of whitened missing torque if only position noise were left."""
        from scipy.signal import fftconvolve

        spread = np.zeros((self.ar.size - 1) * self.lens.every + 1)
        spread[:: self.lens.every] = self.ar
        return float(self.noise**2 * np.sum(fftconvolve(self.lens.taps, spread) ** 2)) + 1e-300

    def rms(self, d: Array, on: str = "held") -> float:
        """Rms of missing torque on one part."""
        mask = {"train": self.train, "held": self.held >= 0, "all": self.usable}[on] & self.usable
        return float(np.sqrt(np.mean(d[mask] ** 2)))

    def weigh(self, gap: float) -> None:
        """Set the whitening to position noise plus white torque of the rms ``gap``.

        Nothing of the gap itself enters but its size, so no tone and no slow drift is whitened away.
        """
        taps, every = self.lens.taps, self.lens.every
        full = np.concatenate([taps, np.zeros(AR_ORDER * every)])
        r = np.array([taps @ full[i * every : i * every + taps.size] for i in range(AR_ORDER + 1)])
        white = max(gap, 0.5 * self.tolerance * self.scene.torque) ** 2
        self.ar = solve_whitening(self.noise**2 * r, white)

    def tune_whitening(self, d: Array) -> None:
        """Set the whitening to what the best model so far leaves over, ``d``."""
        white = (0.25 * self.tolerance * self.scene.torque) ** 2
        self.ar = autoregression(d[self.usable], AR_ORDER, white)

    # --- candidates --------------------------------------------------------------------------
    def screen(self, model: AxisModel, fit: Fit, kinds: tuple | None = None) -> list:
        """See `whsklearn.gap.signatures.screen`."""
        from whsklearn.gap import signatures

        return signatures.screen(self, model, fit, signatures.usable_kinds(model) if kinds is None else kinds)

    def refine(self, model: AxisModel, trial: object) -> object:
        """See `whsklearn.gap.signatures.refine`."""
        from whsklearn.gap import signatures

        return signatures.refine(self, model, trial)  # type: ignore[arg-type]

    def resettle(self, model: AxisModel) -> AxisModel:
        """See `whsklearn.gap.signatures.resettle`."""
        from whsklearn.gap import signatures

        return signatures.resettle(self, model)

    def cheap_kinds(self, model: AxisModel) -> tuple:
        """Candidates without a second mass, for the null."""
        from whsklearn.gap import signatures

        return tuple(k for k in signatures.usable_kinds(model) if k.substeps == 1)

    def twin(self, model: AxisModel, rng: np.random.Generator) -> Bench:
        """See `whsklearn.gap.twin.twin`."""
        from whsklearn.gap import twin

        return twin.twin(self, model, rng)

    def generic_basis(self, model: AxisModel) -> list[Array]:
        """Blocks of nameless columns, shape (n_decimated, k) each: by position, speed, drive, time and products."""
        _, angle, speed = self.follow(model)
        q, v = self.lens.pick(angle), self.lens.pick(speed)
        u = self.lens.blur(self.record.drive)
        t = np.arange(q.size) / q.size
        q = (q - self.scene.middle) / self.scene.reach
        v, u = v / (2 * self.scene.speed), u / (2 * self.scene.torque)
        s = np.sign(v)
        powers = [q, v, u, q * v, q * q, v * v, q**3, v**3, q * q * v, q * v * v, s, s * q, s * v, s * q * q, q * u]
        waves = [f(k * angle_k) for k in range(1, 13) for angle_k in [self.lens.pick(angle)] for f in (np.sin, np.cos)]
        return [
            np.column_stack(powers),
            np.column_stack([np.exp(-0.5 * ((v - c) / 0.12) ** 2) for c in np.linspace(-1, 1, 16)]),
            np.column_stack(waves),
            np.column_stack([w * x for w in waves[:8] for x in (np.ones_like(v), v, s, u)]),
            np.column_stack([p * t for p in powers]),
            np.column_stack([np.roll(x, k) for x in (u, v, s) for k in (0, 1, 2, 4, 8)]),
        ]

    def aliases(self, name: str) -> tuple[str, ...]:
        """Names that no such record can tell from ``name``."""
        from whsklearn.gap.candidates import ALIASES

        return ALIASES.get(name, ())

    def effect_with_errors(self, model: AxisModel, index: int) -> tuple[object, dict[str, float]]:
        """The catalogue's effect of one term, and the standard errors of its labelled numbers.

        The covariance is s^2 (J'J)^-1 of the whitened training residual; it is carried to labels such as
        amplitude and phase by drawing.
        """
        self.tune_whitening(self.missing(model))
        x, (_, high) = model.vector(), model.bounds()
        r = self.residual(model)
        jac = jacobian(lambda z: self.residual(model.with_vector(z)), x, r, model.steps(), high)
        return labelled_errors(model, index, x, r, jac)

    # --- fitting ---------------------------------------------------------------------------
    def fit(self, model: AxisModel, *, max_iterations: int = 12, tolerance: float = 5e-4) -> tuple[AxisModel, Fit]:
        """The model refitted to the training part, all free numbers together."""
        fit = least_squares(
            lambda x: self.residual(model.with_vector(x)),
            model.vector(),
            model.steps(),
            model.bounds(),
            max_iterations=max_iterations,
            tolerance=tolerance,
        )
        return model.with_vector(fit.x), fit


def make_bench(
    record: ServoRecord, law: tuple[str, ...] = ("viscous", "coulomb"), *, tolerance: float = 0.004
) -> tuple[Bench, AxisModel]:
    """A bench for the record and the base model's first guess.

    Parameters
    ----------
    record : ServoRecord
    law : tuple of str
        Names of the friction terms of the base model.
    tolerance : float
        Smallest rms torque worth a name, as a share of the rms drive.
    """
    dt, n = record.dt, len(record)
    y, u = record.position, record.drive
    quantum = lattice(y)
    noise = max(noise_level(y), 0.2 * quantum)
    rms = float(np.sqrt(np.mean(u**2)))
    q, v, a, us = motion(y, u, dt, min(8.0, 0.04 / dt))
    time = np.arange(n) * dt
    scene = Scene(
        torque=rms,
        inertia=1.0,
        speed=float(np.sqrt(np.mean(v**2))),
        reach=float(np.ptp(y) / 2),
        middle=float((y.max() + y.min()) / 2),
        seconds=float(n * dt),
        dt=dt,
        load=float(np.abs(u).max()),
        resonance=min(90.0, 0.2 / dt),
    )
    kinds = [candidate(name) for name in law]
    shapes = [k.starts(scene)[0] for k in kinds]
    columns = np.column_stack([a, *(column(k, q, v, us, time, s) for k, s in zip(kinds, shapes, strict=True))])
    inner = slice(int(0.3 / dt), n - int(0.3 / dt))
    weights, *_ = np.linalg.lstsq(columns[inner], us[inner], rcond=None)
    inertia = float(weights[0])
    if not inertia > 0:
        inertia = 0.3 * rms / max(float(np.sqrt(np.mean(a**2))), 1e-12)
    scene = Scene(**{**scene.__dict__, "inertia": inertia})
    terms, at = [], 1
    for kind, shape in zip(kinds, shapes, strict=True):
        terms.append(Term(kind, (*map(float, weights[at : at + kind.linear]), *shape)))
        at += kind.linear
    model = AxisModel(inertia, 0.0, tuple(terms), scene, n_base=len(terms))
    tracking = float(np.clip(0.02 / dt, 0.2, 2.0))
    lens = make_lens(dt, inertia, noise, rms, tracking=tracking, goal=tolerance)
    number, train = blocks(n)
    guard = lens.half_width
    edge = np.zeros(n, dtype=bool)
    change = np.flatnonzero(np.diff(number) != 0)
    for c in change:
        edge[max(0, c - guard) : c + guard] = True
    usable = np.ones(n, dtype=bool)
    settle = int(max(1.0, 3 / (2 * np.pi * tracking)) / dt) + guard
    usable[:settle] = False
    usable[n - guard :] = False
    start = (q.copy(), v.copy())
    bench = Bench(
        record, lens, scene, noise, start,
        lens.pick(train & ~edge), lens.pick(np.where(edge, -1, number)), lens.pick(usable), tolerance, quantum,
    )  # fmt: skip
    return bench, model


def labelled_errors(model: Any, index: int, x: Array, r: Array, jac: Array) -> tuple[object, dict[str, float]]:
    """The effect of one term and the standard errors of its labelled numbers, from residual and derivatives."""
    scale = np.linalg.norm(jac, axis=0)
    scale[scale == 0.0] = np.inf  # a change whose time lies between two fitted stretches moves no residual
    covariance = np.linalg.pinv((jac / scale).T @ (jac / scale), rcond=1e-10) / np.outer(scale, scale)
    covariance *= float(r @ r) / max(r.size - x.size, 1)
    term = model.terms[index]
    effect = term.kind.effect(np.array(term.q))
    centre = effect.labelled()
    rng = np.random.default_rng(0)
    draws: dict[str, list[float]] = {k: [] for k, v in centre.items() if not isinstance(v, str)}
    values, vectors = np.linalg.eigh(0.5 * (covariance + covariance.T))
    spread = vectors * np.sqrt(np.maximum(values, 0.0))
    low, high = model.bounds()
    for z in np.clip(x + rng.standard_normal((64, x.size)) @ spread.T, low, high):
        other = model.with_vector(z).terms[index]
        try:
            labels = term.kind.effect(np.array(other.q)).labelled()
        except ValueError:
            continue
        for k, seen in draws.items():
            gap = labels[k] - centre[k]
            seen.append((gap + np.pi) % (2 * np.pi) - np.pi if k.startswith("phase") else gap)
    held = {term.kind.fields[term.kind.linear + i] for i in term.kind.held}
    spread_of = {k: float(np.std(v)) for k, v in draws.items() if v and not any(k.startswith(h) for h in held)}
    return effect, {k: v for k, v in spread_of.items() if v > 0.0}
