"""A user's own simulator as a plant: it simulates, refits itself and accepts an effect; everything else is here.

.. code-block:: python

    class MySimulator:
        def simulate(self, record): ...           # predicted position, shape (n,)
        def refit(self, record, keep): ...        # a new simulator fitted to the samples where keep is True
        def with_effect(self, effect): ...        # a new simulator with an effect of the catalogue added
        effects_to_try = [Cogging(1.0, 12.0)]     # optional; sizes do not matter, shapes are the start of a fit
        shapes_to_try = (LuGre, ContactStop)      # optional; besides the catalogue, if with_effect accepts them
        whole_numbers = ("order",)                # optional; fields that must be whole numbers

A record with holes has ``starts``, the samples that follow a hole: ``simulate`` restarts there, at the measured
position (``record.segments`` are the segments as records of their own).

``with_effect`` raises ValueError or NotImplementedError for an effect that the simulator cannot hold; the report then
says that it was not tried.
"""

from __future__ import annotations

import dataclasses
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from whsklearn.effects import Surroundings, effect_names, get_effect
from whsklearn.effects.base import rms
from whsklearn.gap.calibration import GATE, gain, n_effective, p_value
from whsklearn.gap.data_check import DataProblem, check_servo
from whsklearn.gap.filters import WHITENING, autoregression, whiten, whiteness
from whsklearn.gap.localisation import since_reversal, spectra
from whsklearn.gap.plant import Figures, Gap, Linearised, Plant, Told, quiet
from whsklearn.gap.plants.simulator_look import (
    Errors,
    FollowedMotion,
    accelerations,
    catalogue,
    followed_motion,
    gone,
    scales_of,
    slopes,
    whole,
)
from whsklearn.gap.plants.simulator_model import SimulatorFit, SimulatorModel, refine
from whsklearn.gap.record import SPLIT, Array, ServoRecord, noise_level, training_samples
from whsklearn.gap.search import HALF, MOST_FITTED, WORTH_FITTING
from whsklearn.gap.tangent import Look, with_p_values
from whsklearn.logs.check import lattice

FAR_ABOVE = 3.0  # multiple of the noise, whose level is known from sixth differences to within a few percent


class SimulatorPlant(Plant):
    """A record under a simulator with the methods simulate, refit and with_effect."""

    whole = "motion"
    gap_word = "error of the simulated position"
    exact = True

    def __init__(self, model: Any, record: ServoRecord, *, tolerance: float):
        self.given_model, self.record, self.tolerance = model, record, tolerance
        self.units, self.own_units, self.logged = record.units, record.shown, record.logged
        self.train = training_samples(record.position)
        seconds = len(record) * record.dt if len(record) > 1 else 0.0
        self.horizons, self.headline = (seconds,), seconds
        self.scale = _scale(record)
        self.ar: Array = np.array([1.0])
        self.refused: dict[str, str] = {}
        self._shapes: dict[str, list[Any]] | None = None

    # --- models ---------------------------------------------------------------------------
    def check(self) -> list[DataProblem]:
        """See `whsklearn.gap.data_check.check_servo`."""
        return check_servo(self.record)

    def base(self, rng: np.random.Generator) -> SimulatorModel:
        """The simulator, refitted."""
        self.fits = SimulatorFit(
            self.given_model.refit(self.record, self.train), self.record, self.train, self.given_model,
            scales_of(self.record, self.motion.signals),
        )  # fmt: skip
        self.noise = max(noise_level(self.record.position), lattice(self.record.position) / np.sqrt(12.0), 1e-300)
        return self.fits.build((), refit=False)

    def made(self, model: SimulatorModel, rng: np.random.Generator) -> SimulatorPlant:
        """The plant of a record that the model itself makes, with white noise of the same size."""
        y = self.record.position - self.errors(model) + self.noise * rng.standard_normal(len(self.record))
        step = lattice(self.record.position)
        record = dataclasses.replace(self.record, position=np.round(y / step) * step if step else y)
        other = SimulatorPlant(self.given_model, record, tolerance=self.tolerance)
        other.fits = dataclasses.replace(self.fits, record=record, _known={})
        other.noise = self.noise
        other.motion, other._shapes = self.motion, self._shapes  # they differ only by noise
        return other

    # --- looking --------------------------------------------------------------------------
    def errors(self, model: SimulatorModel) -> Array:
        """Measured minus simulated position at all samples: held-out ones are as informative."""
        return self.fits.built(model).error

    def settled(self, model: SimulatorModel) -> SimulatorModel:
        """The model itself: every fit is a joint one."""
        return self.fits.built(model)

    def size(self, before: Array, after: Array) -> float:
        """Rms of the change of the error, or the same as a share of the acceleration if that is larger.

        A torque at a few hertz hardly moves the position of a free axis: a tone of 6 % of the drive moved it by 0.4 %
        (`benchmarks.blind_simulator`, disturbance_tone 5002).
        """
        return max(super().size(before, after), self.scale * gone(self.motion, before, after, self.record))

    @cached_property
    def motion(self) -> FollowedMotion:
        """The smoothed motion."""
        return followed_motion(self.record)

    @property
    def shapes(self) -> dict[str, list[Any]]:
        """Every effect that the simulator accepts, at every shape worth trying."""
        if self._shapes is None:
            given = getattr(self.given_model, "effects_to_try", None)
            shapes = {} if given is not None else catalogue(self.record, self.motion.signals, self.further_shapes)
            for e in given or ():
                shapes.setdefault(e.name, []).append(e)
            self._shapes = {name: whole(found, self.whole_fields) for name, found in shapes.items()}
            self._leave_out_what_cannot_be_held()
        return {name: found for name, found in self._shapes.items() if name not in self.refused}

    def looks(self, model: SimulatorModel, rng: np.random.Generator, beside: Any = None) -> list[Look]:
        """Look at every effect by the error's second derivative, and at common ones by simulation too; fit likely ones.

        They are fitted here, so that all are compared under the residual of the best one.
        """
        model = self.fits.built(model)
        seen = Errors.of(self, model, rng)
        best: dict[str, Look] = {}
        nameless = []
        for k in with_p_values([*accelerations(self, seen), *slopes(self, seen)]):
            if not k.name:
                nameless.append(k)
            else:
                both = [k, best.get(k.name, k)]
                best[k.name] = dataclasses.replace(
                    min(both, key=lambda one: one.p_value), size=max(one.size for one in both)
                )
        looks, fitted = sorted(best.values(), key=lambda k: -k.score), 0
        before, strongest = self.errors(model), 0.0
        # if the error is far above the noise, records with its spectrum hide a strong effect; then effects are fitted
        far = rms(before) > FAR_ABOVE * self.noise and not any(k.p_value <= GATE for k in looks)
        for i, k in enumerate(looks):
            likely = k.p_value <= GATE or far
            if not likely or k.size < self.tolerance * self.scale or fitted == MOST_FITTED:
                continue
            if k.size**2 < WORTH_FITTING * strongest**2:  # both to first order, which underestimates all effects alike
                continue
            grown = refine(self, model, k)
            fitted += 1
            left = self.errors(grown)
            looks[i] = dataclasses.replace(k, start=grown, size=self.size(before, left))
            if rms(left) < HALF * rms(before):  # a shape that the look did not have may explain much more
                g = gain(float(before @ before), float(left @ left), n_effective(before))
                looks[i] = dataclasses.replace(looks[i], p_value=p_value(g, k.null, len(looks) + len(nameless)))
            if not self.objection(model, grown):
                strongest = max(strongest, k.size)
        after = {i: self.errors(k.start) for i, k in enumerate(looks) if isinstance(k.start, SimulatorModel)}
        self.n_effective = n_effective(min([before, *after.values()], key=rms))
        for i, e in after.items():
            g = gain(float(before @ before), float(e @ e), self.n_effective)
            looks[i] = dataclasses.replace(looks[i], gain=g)
        return looks + nameless

    def refine(self, model: SimulatorModel, look: Look) -> SimulatorModel:
        """The model with the effect, which was fitted during the look."""
        return look.start if isinstance(look.start, SimulatorModel) else refine(self, self.fits.built(model), look)

    def _leave_out_what_cannot_be_held(self) -> None:
        """Try every effect once on the simulator, so that none is ranked that it cannot accept."""
        for name, shapes in (self._shapes or {}).items():
            try:
                self.fits.core.with_effect(shapes[0])
            except (ValueError, NotImplementedError) as error:
                self.refused[name] = str(error)

    def left(self, model: SimulatorModel) -> float:
        """Rms error of the training samples."""
        return self.rms(model.error[self.train])

    @property
    def whole_fields(self) -> tuple[str, ...]:
        """Fields that the simulator holds as whole numbers."""
        return tuple(getattr(self.given_model, "whole_numbers", ()))

    @property
    def further_shapes(self) -> tuple[type[Any], ...]:
        """Shapes that the simulator requests besides the named ones."""
        return tuple(getattr(self.given_model, "shapes_to_try", ()))

    def tune(self, error: Array) -> None:
        """Set the whitening to the colour of the error, but not below the noise."""
        self.ar = autoregression(error[self.train], WHITENING, self.noise**2)

    def weighed(self, error: Array) -> Array:
        """Whitened training samples of errors, shape (n,) or (n, k); k may be 0."""
        return self.white(error)[self.train] if error.size else error[self.train]

    def white(self, error: Array) -> Array:
        """Whitened errors, shape (n,) or (n, k); the filter restarts after a hole."""
        return np.asarray(self.record.by_piece(lambda e: whiten(e, self.ar), error))

    def objection(self, model: SimulatorModel, grown: SimulatorModel) -> str:
        """The physical objection to an effect's size, or nothing."""
        effect = grown.terms[-1].effect
        if effect.name in self.refused and not effect.magnitude:
            return f"the simulator cannot hold it: {self.refused[effect.name]}"
        quantity = effect.quantities[effect.size]
        if quantity.low >= 0.0 and effect.magnitude <= 0.0 and not effect.phased:
            return f"its size would be {effect.magnitude:.3g}, but a physical one is positive"
        return str(effect.implausible(self.surroundings))

    @cached_property
    def surroundings(self) -> Surroundings:
        """The record, beside whose simulator inertia, friction and weight are not known."""
        r, unknown = self.record, {"viscous": np.inf, "coulomb": np.inf}
        velocity, command = self.motion.signals.velocity, r.reference if r.is_following_error else None
        return Surroundings(
            r.position, velocity, r.drive, sizes=unknown, carried=True, step=lattice(r.position), dt=r.dt,
            turns=r.units[1] == "rad", command=command,
        )  # fmt: skip

    # --- proof and report -----------------------------------------------------------------
    def simulate(self, model: SimulatorModel, horizon: float) -> Array:
        """The free run over the whole record, which may be a surrogate's; it is not restarted."""
        return self.record.position - self.fits.error(self.fits.built(model).simulator)

    def measured(self, *models: SimulatorModel) -> tuple[Array, NDArray[np.bool_]]:
        """Position and the held-out mask."""
        return self.record.position, ~self.train

    def aliases(self, name: str) -> tuple[str, ...]:
        """The catalogue's."""
        return tuple(get_effect(name).aliases) if name in effect_names() else ()

    def linearised(self, model: SimulatorModel) -> Linearised:
        """Whitened training residual and its derivatives by the numbers of all effects and of the simulator, if known.

        If a simulator hides its numbers, their influence is projected out of the residual and they get no standard
        errors.  ``rebuild`` neither simulates nor refits, because standard errors draw a hundred of its models.
        """
        model = self.fits.built(model)
        self.tune(model.error)
        jac, own = self.weighed(self.fits.by_terms(model)), self.weighed(self.fits.tangent(model))
        r, effects = self.weighed(model.error), jac.shape[1]
        x = np.concatenate([np.zeros(0), *(np.array(t.vector()) for t in model.terms)])
        if hasattr(model.simulator, "with_numbers"):
            x, jac = np.concatenate([x, np.asarray(model.simulator.numbers, dtype=float)]), np.column_stack([jac, own])
        else:
            q, _ = np.linalg.qr(own)
            jac, r = jac - q @ (q.T @ jac), r - q @ (q.T @ r)
        wide = np.full(x.size, np.inf)
        return Linearised(x, -wide, wide, r, jac, lambda z: model.moved(z[:effects], z[effects:]))

    def numbers(self, model: SimulatorModel) -> dict[str, tuple[float, str]]:
        """The simulator's ``parameters`` and ``parameter_units``, if it has them."""
        simulator = self.fits.built(model).simulator
        values, units = (getattr(simulator, name, None) for name in ("parameters", "parameter_units"))
        known = units if isinstance(units, dict) else {}
        return {k: (float(v), known.get(k, "")) for k, v in values.items()} if isinstance(values, dict) else {}

    def complete(self, before: Array, model: SimulatorModel) -> bool:
        """Whether a model leaves no more than noise; a rival is then told by few instants, as of a stop, too."""
        return bool(quiet(self.rms(self.errors(model)), self.noise, self.tolerance * self.scale))

    def figures(self, base: SimulatorModel, model: SimulatorModel, nameless: float = 0.0) -> Figures:
        """Rms of the errors, and the noise; the whole error above it is nameless if something follows the motion."""
        before, after = (self.rms(self.errors(m)) for m in (base, model))
        above = float(np.sqrt(max(after**2 - self.noise**2, 0.0)))
        return Figures(before, after, self.noise, max(nameless, above) if nameless > 0.0 else 0.0)

    @property
    def every(self) -> int:
        """Thinning of the record in reports."""
        return max(1, len(self.record) // 6000)

    def gap(self, model: SimulatorModel) -> Gap:
        """The error, thinned; only the gain of the motion may drift, because the simulator's numbers are not known."""
        k = self.every
        gain_of_motion = {"gain of the motion": (1.0, self.record.position[::k])}
        return Gap(self.errors(model)[::k], self.record.dt * k, signals(self), gain_of_motion)

    def told(self, base: SimulatorModel, model: SimulatorModel) -> Told:
        """Whiteness before and after, remarks, and the series that the page draws."""
        tests = []
        for name, m in (("before", base), ("after", model)):
            error = self.errors(m)
            self.tune(error)
            tests.append(whiteness(self.white(error), name))
        notes = [
            f"Position noise {self.record.told(self.noise, self.units[1])} (from sixth differences).",
            SPLIT,
            *(f"The simulator could not accept {name}: {why}" for name, why in self.refused.items()),
        ]
        return Told(tests, notes, pictures(self, base, model))

    def system(self, model: SimulatorModel) -> Any:
        """The repaired simulator."""
        return self.fits.built(model).simulator


def _scale(record: ServoRecord) -> float:
    """Rms of the motion, or of the tracking error if a controller keeps the motion near a reference."""
    if not len(record):
        return 0.0
    motion_rms = float(np.std(record.position))
    if record.reference is None:
        return motion_rms
    return min(motion_rms, rms(record.reference - record.position)) or motion_rms


def signals(plant: Any) -> dict[str, tuple[Array, str]]:
    """Name -> (signal at the judged samples, unit)."""
    s, k = plant.motion.signals, plant.every
    drive, rad = plant.units
    still = 0.01 * rms(s.velocity)
    return {
        "time": (s.time[::k], "s"), "position": (s.position[::k], rad), "velocity": (s.velocity[::k], f"{rad}/s"),
        "reversal": (since_reversal(s.velocity, plant.record.dt, still)[::k], "s"), "drive": (s.drive[::k], drive),
    }  # fmt: skip


def pictures(plant: Any, base: SimulatorModel, model: SimulatorModel) -> dict[str, Any]:
    """Overlay, gap over time, its spectra by frequency and by order, and its axes."""
    step, y, clock = plant.record.dt * plant.every, plant.record.position, plant.record.clock
    errors = plant.errors(base), plant.errors(model)
    gaps = errors[0][:: plant.every], errors[1][:: plant.every]
    return {
        "time": clock, "measured": y, "held": ~plant.train,
        "runs": {"before": y - errors[0], "after": y - errors[1]},
        "gap_time": clock[:: plant.every], "usable": np.ones(gaps[0].size, dtype=bool),
        "floor": plant.noise, "axes": signals(plant), "units": plant.units, "what": plant.gap_word,
        **spectra(*gaps, step, y[:: plant.every], np.arange(0.5, 40.0, 0.1)),
    }  # fmt: skip
