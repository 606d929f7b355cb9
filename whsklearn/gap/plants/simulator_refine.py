"""Fit an effect within a user's simulator: its size first, then all its numbers together."""

from __future__ import annotations

from typing import Any

import numpy as np

from whsklearn.gap.plants.simulator_look import columns_of, gone, sized_by_drive
from whsklearn.gap.plants.simulator_model import EffectTerm, SimulatorModel
from whsklearn.gap.record import rms
from whsklearn.gap.tangent import Look

# Share of the error.  An effect with a smaller residual is fitted again under the weights of that residual, because the
# previous weights hid the effect's own spectrum.  If a look promised as much but the fit has a larger residual, the fit
# is started anew.
PROMISING = 0.5
# Number of such fits at most, and the share of the error that the last one may leave: a stop takes three.
AGAIN, SETTLED = 4, 0.8


def refine(plant: Any, model: SimulatorModel, look: Look) -> SimulatorModel:
    """The model with the effect at its best numbers and the simulator refitted; unchanged if it cannot be added."""
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
            plant.tune(best.error)  # weighted by the residual; the previous weights hid the effect's own spectrum
            left, best = plant.left(best), plant.fits.grow(model, best, plant.weighed, again=True)
            if plant.left(best) > SETTLED * left:
                break
    return best


def grown(plant: Any, model: SimulatorModel, start: Any) -> SimulatorModel:
    """A start brought to its size, then all its numbers fitted.

    The fit begins from the simulator's refitted numbers or from those that it was given with, whichever is better with
    the effect: a refit without it may have changed them greatly to compensate.
    """
    pairs = begins(plant, model, start)
    home, begin = min(pairs, key=lambda pair: plant.rms(plant.weighed(pair[1].error)))
    return plant.fits.grow(home, begin, plant.weighed)


def anew(plant: Any, model: SimulatorModel, start: Any) -> SimulatorModel:
    """The same, with the simulator refitted beside the effect before all numbers are fitted together.

    Bristles in place of dry friction move inertia, damping and friction far from both starts, and steps along the
    slopes there lead nowhere, although the look has promised most of the gap.
    """
    refitted = (plant.fits.refitted(begin) for _, begin in begins(plant, model, start))
    return plant.fits.grow(model, min(refitted, key=plant.left), plant.weighed, again=True)


def begins(plant: Any, model: SimulatorModel, start: Any) -> list[tuple[SimulatorModel, SimulatorModel]]:
    """(home, home with the effect at its estimated size) for every home of the model."""
    fixed = (*start.later, *plant.whole_fields)
    searched = tuple(f for f in start.shape_fields() if movable(f) and f not in fixed)
    out = []
    for home in plant.fits.homes(model):
        for effect in sizes(plant, home, start):
            out.append((home, plant.fits.begun(home, EffectTerm(effect, searched))))
    return out


def sizes(plant: Any, home: SimulatorModel, start: Any) -> list[Any]:
    """The effect at the size given by the simulation's slope and, if it acts only for instants, by the drive too."""
    if start.column_kind != "exact":
        return [start]
    effects = [sized(plant, home, start)]
    if isinstance(start, plant.further_shapes):
        effects.append(sized_by_drive(plant.motion, start, plant.train))
    positive = start.quantities[start.size].low >= 0.0 and not start.phased
    return [start if positive and e.magnitude <= 0.0 else e for e in effects]


def sized(plant: Any, model: SimulatorModel, start: Any) -> Any:
    """The size (and phase) from the sensitivity of the simulated position to it."""
    slopes, shape = smallest(plant, model, start)
    own = plant.weighed(plant.fits.tangent(model))
    columns = np.column_stack([plant.weighed(slopes), own])
    size = -np.linalg.lstsq(columns, plant.weighed(model.error), rcond=1e-9)[0][: slopes.shape[1]]
    return type(start).from_coefficients(size, **shape)


def smallest(plant: Any, model: SimulatorModel, start: Any) -> tuple[Any, dict[str, Any]]:
    """(derivatives of the error by the sizes of a small effect, shape (n, 1 or 2); its other numbers)."""
    torque = rms(plant.record.drive) or 1.0
    shape = {k: v for k, v in {**start.shape, **start.options}.items() if not (start.phased and k == "phase")}
    if start.column_kind != "exact":  # it has no small size, so its own size is used
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
