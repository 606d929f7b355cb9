"""An effect fitted within a simulator of one's own: brought to its size first, then all its numbers together."""

from __future__ import annotations

from typing import Any

import numpy as np

from whsklearn.gap.plants.simulator_look import columns_of, gone, sized_by_drive
from whsklearn.gap.plants.simulator_model import EffectTerm, SimulatorModel
from whsklearn.gap.record import rms
from whsklearn.gap.tangent import Look

# Share of the error: an effect that leaves less is fitted again under the weights of what it leaves, since before the
# weights hid the effect's own spectrum; a look that promised as much, and whose fit leaves more, is begun anew.
PROMISING = 0.5
# Such fits at most, and the share of the error that the last one leaves: a stop takes three.
AGAIN, SETTLED = 4, 0.8


def refine(plant: Any, model: SimulatorModel, look: Look) -> SimulatorModel:
    """The effect added at its best numbers, the simulator refitted; the model as it is where it cannot be added."""
    model = plant.fits.built(model)
    plant.tune(model.error)
    best: SimulatorModel | None = None
    scanned = {"order", "frequency"} & set(look.start[0].shape_fields())  # waves have many minima
    for start in look.start if scanned else look.start[:1]:
        try:
            found = grown(plant, model, start)
        except (ValueError, NotImplementedError, FloatingPointError) as error:
            plant.refused[look.name] = str(error)
            continue
        if best is None or plant.left(found) < plant.left(best):
            best = found
    if best is None:
        refused = (*model.terms, EffectTerm(look.start[0].resized(0.0)))
        return SimulatorModel(model.simulator, refused, model.error)
    whole = plant.scale * gone(plant.motion, model.error, np.zeros_like(model.error), plant.record)
    if look.size**2 > PROMISING * whole**2 and plant.left(best) > PROMISING * plant.left(model):
        best = min((best, anew(plant, model, look.start[0])), key=plant.left)
    left = plant.left(model)
    if plant.left(best) < PROMISING * left:
        for _ in range(AGAIN):
            plant.tune(best.error)  # weighed by what is left: before, the weights hid the effect's own spectrum
            left, best = plant.left(best), plant.fits.grow(model, best, plant.weighed, again=True)
            if plant.left(best) > SETTLED * left:
                break
    return best


def grown(plant: Any, model: SimulatorModel, start: Any) -> SimulatorModel:
    """A start brought to its size, then all its numbers fitted.

    From the simulator's refitted numbers, or from those that it was given with, whichever is better with the
    effect: a refit without it may have bent them far to make up for it.
    """
    pairs = begins(plant, model, start)
    home, begin = min(pairs, key=lambda pair: plant.rms(plant.weighed(pair[1].error)))
    return plant.fits.grow(home, begin, plant.weighed)


def anew(plant: Any, model: SimulatorModel, start: Any) -> SimulatorModel:
    """The same, the simulator refitted beside the effect before anything moves together.

    Bristles in place of dry friction take inertia, damping and friction far from both beginnings, and steps along
    the slopes there lead nowhere; the look has promised most of the gap all the same.
    """
    refitted = (plant.fits.refitted(begin) for _, begin in begins(plant, model, start))
    return plant.fits.grow(model, min(refitted, key=plant.left), plant.weighed, again=True)


def begins(plant: Any, model: SimulatorModel, start: Any) -> list[tuple[SimulatorModel, SimulatorModel]]:
    """(home, home with the effect at the size that it asks for) for every home of the model."""
    fixed = (*start.later, *plant.whole_fields)
    searched = tuple(f for f in start.shape_fields() if movable(f) and f not in fixed)
    out = []
    for home in plant.fits.homes(model):
        for effect in sizes(plant, home, start):
            out.append((home, plant.fits.begun(home, EffectTerm(effect, searched))))
    return out


def sizes(plant: Any, home: SimulatorModel, start: Any) -> list[Any]:
    """The effect as large as the simulation's slope asks for, and of a shape for instants as the drive does."""
    if start.column_kind != "exact":
        return [start]
    effects = [sized(plant, home, start)]
    if isinstance(start, plant.further_shapes):
        effects.append(sized_by_drive(plant.motion, start, plant.train))
    positive = start.quantities[start.size].low >= 0.0 and not start.phased
    return [start if positive and e.magnitude <= 0.0 else e for e in effects]


def sized(plant: Any, model: SimulatorModel, start: Any) -> Any:
    """The size (and phase) by the sensitivity of the simulated position to it."""
    slopes, shape = smallest(plant, model, start)
    own = plant.weighed(plant.fits.tangent(model))
    columns = np.column_stack([plant.weighed(slopes), own])
    size = -np.linalg.lstsq(columns, plant.weighed(model.error), rcond=1e-9)[0][: slopes.shape[1]]
    return type(start).from_coefficients(size, **shape)


def smallest(plant: Any, model: SimulatorModel, start: Any) -> tuple[Any, dict[str, Any]]:
    """(derivatives of the error by the sizes of a small effect, shape (n, 1 or 2); its other numbers)."""
    torque = rms(plant.record.drive) or 1.0
    shape = {k: v for k, v in {**start.shape, **start.options}.items() if not (start.phased and k == "phase")}
    if start.column_kind != "exact":  # it has no small size: what it does at its own
        return (plant.fits.error(model.simulator.with_effect(start)) - model.error)[:, None], shape
    unit = float(np.sqrt(np.mean(np.square(columns_of(start, plant.motion.signals))))) or 1.0
    small = (0.01 * torque if start.port != "output" else 10.0 * plant.noise) / unit
    weights = np.eye(2) * small if start.phased else np.array([[small]])
    columns = []
    for w in weights:
        moved = model.simulator.with_effect(type(start).from_coefficients(w, **shape))
        columns.append((plant.fits.error(moved) - model.error) / small)
    return np.column_stack(columns), shape


def movable(field: str) -> bool:
    """Whether a fit may move a shape number: exponents and counts stay."""
    return field not in ("exponent", "elements", "load_share", "damping_ratio")
