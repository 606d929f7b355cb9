"""A simulator of the user's own as a plant: it simulates, refits itself and takes an effect; the rest is here.

.. code-block:: python

    class MySimulator:
        def simulate(self, record): ...           # predicted position, shape (n,)
        def refit(self, record, keep): ...        # a new simulator fitted to the samples where keep is True
        def with_effect(self, effect): ...        # a new simulator with an effect of the catalogue added
        effects_to_try = [Cogging(1.0, 12.0)]     # optional; sizes do not matter, shapes are where a fit starts
        shapes_to_try = (LuGre, ContactStop)      # optional; beside the catalogue, if with_effect can take them
        whole_numbers = ("order",)                # optional; fields that it can hold as whole numbers only

``with_effect`` raises ValueError or NotImplementedError for an effect that the simulator cannot hold; the report then
says that it was not tried.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from functools import cached_property
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from whsklearn.effects import effect_names, get_effect
from whsklearn.gap.data_check import Problem, check_servo
from whsklearn.gap.evidence import SAME_SIMULATION, WHITENED
from whsklearn.gap.filters import autoregression, whiten, whiteness
from whsklearn.gap.plant import PlantDefaults, ViewDefaults
from whsklearn.gap.plants import simulator_evidence as rules
from whsklearn.gap.plants.simulator_look import (
    STARTS,
    Motion,
    catalogue,
    columns_of,
    gains,
    motion,
    whole,
)
from whsklearn.gap.plants.simulator_model import SimulatorFit, SimulatorModel
from whsklearn.gap.plants.simulator_nameless import explainable
from whsklearn.gap.plants.simulator_pictures import pictures, signals
from whsklearn.gap.plants.simulator_refine import refine
from whsklearn.gap.record import SPLIT, ServoRecord, held_out_blocks, lattice, noise_level, rms
from whsklearn.gap.values import Linearised, Look, ModelErrors

Array = NDArray[Any]
AR_ORDER = 12  # of the whitening polynomial


class SimulatorPlant(PlantDefaults, ViewDefaults):
    """A record under a simulator of three methods; its own and only view.

    Parameters
    ----------
    model : object
        With simulate, refit and with_effect.
    record : ServoRecord
    tolerance : float
        Smallest effect worth a name, rms of what it explains over ``scale``.
    """

    whole = "motion"
    gap_word = "error of the simulated position"
    limits = WHITENED

    def __init__(self, model: Any, record: ServoRecord, *, tolerance: float):
        self.given_model, self.record, self.tolerance = model, record, tolerance
        self.units, self.own_units, self.logged = record.units, record.shown, record.logged
        self.block, self.train = held_out_blocks(len(record))
        seconds = len(record) * record.dt if len(record) > 1 else 0.0
        self.horizons, self.headline = (seconds,), seconds
        self.scale = _scale(record)
        self.ar: Array = np.array([1.0])
        self.refused: dict[str, str] = {}
        self._shapes: dict[str, list[Any]] | None = None

    # --- models ---------------------------------------------------------------------------
    def check(self) -> list[Problem]:
        """See `whsklearn.gap.data_check.check_servo`."""
        return check_servo(self.record)

    def base(self, rng: np.random.Generator) -> SimulatorModel:
        """The simulator, refitted."""
        self.fits = SimulatorFit(
            self.given_model.refit(self.record, self.train), self.record, self.train, self.given_model
        )
        self.noise = max(noise_level(self.record.position), lattice(self.record.position) / np.sqrt(12.0), 1e-300)
        return self.fits.build((), refit=False)

    def verdict_view(self, base: SimulatorModel) -> Any:
        """The whole record."""
        return self

    def view(self, model: SimulatorModel, after: Any | None) -> Any | None:
        """The plant itself, once."""
        return self if after is None else None

    def fit(self, model: SimulatorModel) -> SimulatorModel:
        """The simulator refitted with the model's effects."""
        return self.fits.build(model.terms) if model.terms else self.fits.build((), refit=False)

    def surrogate(self, model: SimulatorModel, rng: np.random.Generator) -> SimulatorPlant:
        """The plant of a record that the model itself made, with white noise of the same size."""
        y = self.record.position - self.gap(model) + self.noise * rng.standard_normal(len(self.record))
        step = lattice(self.record.position)
        record = dataclasses.replace(self.record, position=np.round(y / step) * step if step else y)
        other = SimulatorPlant(self.given_model, record, tolerance=self.tolerance)
        other.fits = SimulatorFit(self.fits.core, record, self.train, self.given_model)
        other.noise = self.noise
        other.motion, other._shapes = self.motion, self._shapes  # it differs by noise alone
        return other

    # --- looking --------------------------------------------------------------------------
    def gap(self, model: SimulatorModel) -> Array:
        """Measured minus simulated position."""
        return self.fits.built(model).error

    def floor(self, model: SimulatorModel | None = None) -> float:
        """Noise of the position."""
        return self.noise

    def quiet(self, model: SimulatorModel, least: float) -> bool:
        """Whether the error is noise or worth no name, as a share of the position and of the acceleration.

        A torque at some hertz hardly moves the position of a free axis: a tone of 6 % of the drive moved it by 0.4 %
        (`benchmarks.blind_simulator`, disturbance_tone 5002).
        """
        error, noise = self._accelerations(model), self.noise * float(np.linalg.norm(self.motion.kernels[2]))
        least_acceleration = least / self.scale * self._acceleration if self.scale else 0.0
        small = self.rms(error) ** 2 <= (self.limits.quiet * noise) ** 2 + least_acceleration**2
        return bool(small and super().quiet(model, least))

    def explained(self, before: SimulatorModel, after: SimulatorModel) -> float:
        """Rms of the error that is gone, or the same share of the acceleration if that is the larger one."""
        gone = self.rms(self._accelerations(before)) ** 2 - self.rms(self._accelerations(after)) ** 2
        share = np.sqrt(max(gone, 0.0)) / max(self._acceleration, 1e-300)
        return max(super().explained(before, after), float(share) * self.scale)

    @cached_property
    def motion(self) -> Motion:
        """The smoothed motion."""
        return motion(self.record)

    def _accelerations(self, model: SimulatorModel) -> Array:
        """Second derivative of the error through the motion's filter."""
        m = self.motion
        return m.seen(self.gap(model), 2)[m.usable]

    @property
    def _acceleration(self) -> float:
        """Rms acceleration of the motion."""
        m = self.motion
        return self.rms(m.seen(self.record.position, 2)[m.usable])

    def look(self, model: SimulatorModel) -> list[Look]:
        """Every effect at its best shapes, by a regression of the error's second derivative."""
        if self._shapes is None:
            given = getattr(self.given_model, "effects_to_try", None)
            self._shapes = {} if given is not None else catalogue(self.record, self.motion.signals, self.further_shapes)
            for e in given if given is not None else getattr(self.given_model, "also_try", ()):
                self._shapes.setdefault(e.name, []).append(e)
            self._shapes = {name: whole(shapes, self.whole_fields) for name, shapes in self._shapes.items()}
            self._leave_out_what_cannot_be_held(model)
        error, out = self.gap(model), []
        for name, shapes in self._shapes.items():
            if name in self.refused:
                continue
            known = [e for e in shapes if columns_of(e, self.motion.signals).size]
            ranked = sorted(zip(gains(self.motion, error, known, self.train), range(len(known)), strict=True))[::-1]
            if not known:
                out.append(Look(name, rules.NO_COLUMN, tuple(shapes[:1]), 1, 1, costly=True))
                continue
            best = tuple(known[i] for _, i in ranked[:STARTS])
            numbers = len(best[0].coefficients) + len(best[0].shape_fields()) or 1
            expected = np.inf
            common = shapes[0].elementary  # always simulated: in closed loop a constant shows in no derivative
            gain = max(float(ranked[0][0]), rules.ALWAYS_TRIED if common else 0.0)
            out.append(Look(name, gain, best, numbers, max(1, len(known)), expected, elementary=common))
        return out

    def _leave_out_what_cannot_be_held(self, model: SimulatorModel) -> None:
        """Ask the simulator for every effect once, so that none is ranked that it cannot take."""
        for name, shapes in (self._shapes or {}).items():
            try:
                self.fits.built(model).simulator.with_effect(shapes[0])
            except (ValueError, NotImplementedError) as error:
                self.refused[name] = str(error)

    def refine(self, model: SimulatorModel, look: Look) -> SimulatorModel:
        """See `whsklearn.gap.plants.simulator_refine.refine`."""
        return refine(self, model, look)

    def left(self, model: SimulatorModel) -> float:
        """Rms error of the training samples."""
        return self.rms(model.error[self.train])

    @property
    def whole_fields(self) -> tuple[str, ...]:
        """Fields that the simulator holds as whole numbers."""
        return tuple(getattr(self.given_model, "whole_numbers", ()))

    @property
    def further_shapes(self) -> tuple[type[Any], ...]:
        """Shapes that the simulator asks for beside those that have the names."""
        return tuple(getattr(self.given_model, "shapes_to_try", ()))

    def tune(self, error: Array) -> None:
        """The whitening: of the error's own colour, no finer than the noise."""
        self.ar = autoregression(error[self.train], AR_ORDER, self.noise**2)

    def weighed(self, error: Array) -> Array:
        """Whitened training samples of errors, shape (n,) or (n, k); k may be 0."""
        return whiten(error, self.ar)[self.train] if error.size else error[self.train]

    def compare(self, models: Sequence[SimulatorModel], best: int) -> list[ModelErrors]:
        """Errors whitened by what the best leaves; held-out errors as they are."""
        errors = [self.gap(m) for m in models]
        self.tune(errors[best])
        held, out = ~self.train, []
        for e in errors:
            w = whiten(e, self.ar)
            out.append(ModelErrors(w[self.train], w[held], self.block[held], float(self.train.sum())))
        return out

    def objection(self, model: SimulatorModel, index: int) -> str:
        """What is unphysical in an effect's size."""
        effect = model.terms[index].effect
        if effect.name in self.refused and not effect.magnitude:
            return f"the simulator cannot hold it: {self.refused[effect.name]}"
        quantity = effect.quantities[effect.size]
        if quantity.low >= 0.0 and effect.magnitude <= 0.0 and not effect.phased:
            return f"its size would be {effect.magnitude:.3g}, and a physical one is positive"
        return ""

    def same_signature(self, a: SimulatorModel, b: SimulatorModel) -> bool:
        """Whether both predict the same position, far below its noise: no such record tells them apart."""
        return self.rms(self.gap(a) - self.gap(b)) < SAME_SIMULATION * self.noise

    def replaceable(self, model: SimulatorModel, index: int) -> bool:
        """Any term may be exchanged."""
        return True

    # --- proof and report -----------------------------------------------------------------
    def simulate(self, model: SimulatorModel, horizon: float) -> Array:
        """The whole record, on which the model may not have been fitted (a surrogate's): it is not restarted."""
        return self.record.position - self.fits.error(self.fits.built(model).simulator)

    def measured(self, *models: SimulatorModel) -> tuple[Array, NDArray[np.bool_]]:
        """Position and the held-out mask."""
        return self.record.position, ~self.train

    def follows(self, model: SimulatorModel) -> float:
        """See `whsklearn.gap.plants.simulator_nameless.explainable`."""
        return explainable(self, model)

    def aliases(self, name: str) -> tuple[str, ...]:
        """The catalogue's."""
        return tuple(get_effect(name).aliases) if name in effect_names() else ()

    def commoner(self, name: str) -> tuple[str, ...]:
        """Names preferred on a tie."""
        return get_effect(name).commoner if name in effect_names() else ()

    def linearised(self, model: SimulatorModel) -> Linearised:
        """Of the whitened training residual by the numbers of all effects, and by the simulator's own if it has any.

        Of a simulator that hides its numbers, the residual is freed of what they can do, and they get no errors.
        ``rebuild`` simulates and refits nothing: standard errors draw a hundred of its models.
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

    def parameters(self, model: SimulatorModel) -> dict[str, float]:
        """The simulator's ``parameters``, if it tells them."""
        told = getattr(self.fits.built(model).simulator, "parameters", None)
        return {k: float(v) for k, v in told.items()} if isinstance(told, dict) else {}

    def parameter_units(self, model: SimulatorModel) -> dict[str, str]:
        """The simulator's ``parameter_units``, if it tells them."""
        told = getattr(self.fits.built(model).simulator, "parameter_units", None)
        return dict(told) if isinstance(told, dict) else {}

    def figures(self, base: SimulatorModel, model: SimulatorModel) -> tuple[float, float, float]:
        """(gap before, after, floor)."""
        return self.rms(self.gap(base)), self.rms(self.gap(model)), self.floor()

    @property
    def every(self) -> int:
        """Thinning of the record in reports."""
        return max(1, len(self.record) // 6000)

    def gap_to_locate(self, model: SimulatorModel) -> Array:
        """The error, thinned."""
        return self.gap(model)[:: self.every]

    def signals(self, model: SimulatorModel) -> dict[str, tuple[Array, str]]:
        """Name -> (signal at the judged samples, unit)."""
        return signals(self)

    def regressors(self, model: SimulatorModel) -> tuple[dict[str, tuple[float, Array]], Array, float]:
        """The gain of the drive stands for the simulator's numbers, which are its own."""
        k = self.every
        return {"gain of the motion": (1.0, self.record.position[::k])}, self.gap_to_locate(model), self.record.dt * k

    def residual_tests(self, base: SimulatorModel, model: SimulatorModel) -> list[dict[str, Any]]:
        """Whiteness before and after."""
        out = []
        for name, m in (("before", base), ("after", model)):
            error = self.gap(m)
            self.tune(error)
            out.append(whiteness(whiten(error, self.ar), name))
        return out

    def notes(self, base: SimulatorModel, model: SimulatorModel) -> list[str]:
        """Remarks."""
        out = [
            f"Position noise {self.record.told(self.noise, self.units[1])} (from sixth differences).",
            SPLIT,
        ]
        return out + [f"The simulator could not take {name}: {why}" for name, why in self.refused.items()]

    def pictures(self, base: SimulatorModel, model: SimulatorModel) -> dict[str, Any]:
        """Series that the page draws."""
        return pictures(self, base, model)

    def system(self, model: SimulatorModel) -> Any:
        """The repaired simulator."""
        return self.fits.built(model).simulator


def simulator_plant(model: Any, log: Any, *, tolerance: float, columns: dict[str, Any]) -> SimulatorPlant:
    """The plant of a log under a simulator of the user's own."""
    record = log if isinstance(log, ServoRecord) else ServoRecord.from_frame(pd.DataFrame(log), **columns)
    return SimulatorPlant(model, record, tolerance=tolerance)


def _scale(record: ServoRecord) -> float:
    """Rms of the motion, or of the tracking error where a controller keeps the motion near a reference."""
    if not len(record):
        return 0.0
    motion_rms = float(np.std(record.position))
    if record.reference is None:
        return motion_rms
    return min(motion_rms, rms(record.reference - record.position)) or motion_rms
