"""Surrogates: logs in which nothing is missing, made by the fitted model in the same experiment.

A surrogate follows the measured path under a soft controller of its own, in addition to the logged drive, with the
measured noise on its encoder.  Anything that the diagnosis finds in it is a false alarm, so the best score of a
candidate on surrogates is the score that chance reaches on the real log.
"""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
from numpy.typing import NDArray

from whsklearn.gap.plants.servo_columns import ColumnSignals as Motion
from whsklearn.gap.plants.servo_model import AxisModel
from whsklearn.systems._servo_kernel import DRIVE, MEASURED, N_SIGNALS, How, PassInputs, run
from whsklearn.systems._servo_torques import DELAY, RESOLUTION

Array = NDArray[Any]
LOST = 1.0  # half travels away from the measured path, beyond which it is a different experiment


def surrogate_record(view: Any, model: AxisModel, rng: np.random.Generator) -> Any:
    """The record that the model would have produced in the same experiment.

    Parameters
    ----------
    view : object
        View of the real record, with ``record``, ``scene``, ``start``, ``noise`` and ``quantum``.
    """
    record, dt = view.record, view.scene.dt
    w = 2 * np.pi * min(4.0, 0.03 / dt)
    quiet = 0.0 if view.quantum == 0 else view.quantum / np.sqrt(12)
    sigma = np.sqrt(max(view.noise**2 - quiet**2, (0.3 * view.noise) ** 2))
    plant = model.plant()
    plant.parts[DELAY] = max(plant.parts[DELAY], 0.0)  # a controller cannot be ahead of itself
    plant.parts[RESOLUTION] = view.quantum
    path, speed = view.start
    # the controller adds the logged drive to its feedback, in place of the acceleration of a reference
    noise = sigma * rng.standard_normal(len(record))
    stiffness = model.inertia * w * w
    soft = (stiffness, 0.0, 1.4 * model.inertia * w, 0.0, 1.0, np.inf, 0.0, 0.1 / w)
    how = How(dt, max(1, int(np.ceil(dt / 1e-4))), closed=True)
    out = run_by_piece(record, plant, soft, how, (path, speed, record.drive), noise)
    drive, position = out[DRIVE], out[MEASURED]
    if not np.all(np.isfinite(position)) or np.abs(position - path).max() > LOST * view.scene.reach:
        # for a model that diverges even under a controller: the torque that it needs along the measured path
        motion = Motion(record.clock, path, speed, np.gradient(speed, dt), record.drive)
        asked = (t.effect.contribution(motion) for t in model.terms if t.effect.port in ("torque", "input"))
        drive = model.inertia * motion.acceleration + sum(asked)
        position = path + sigma * rng.standard_normal(len(record))
    return dataclasses.replace(record, drive=drive, position=position)


def run_by_piece(
    record: Any, plant: Any, controller: tuple[float, ...], how: How, reference: tuple[Array, ...], noise: Array
) -> Array:
    """Results of the kernel for every segment of a record, each started on the reference's path; shape (7, n)."""
    out = np.zeros((N_SIGNALS, len(record)))
    for s, t in record.pieces:
        part, path = np.zeros((N_SIGNALS, s.stop - s.start)), np.array([x[s] for x in reference])
        q, v = path[:2, 0]
        signals = PassInputs(path, noise[s], np.zeros(0), np.zeros((2, 1)))
        run(part, plant, controller, signals, how._replace(start=t), np.array([q, v, q, v]))
        out[:, s] = part
    return out
