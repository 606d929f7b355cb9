"""EMPS live: fitted on the first record, adapted on the first 2 s of the second, judged on the rest.

    python benchmarks/emps_live.py [--data FOLDER]        # a minute

Model: M a = u - Fv v - Fc sign(v) - offset - k1 e - k2 e^2, e = x - 0.12 m.  Every fit minimises what is judged: a run
of the model alone over a window, whose state at its start comes from replaying the drive over the 300 ms before it.
Between the records one factor on every force changes, and little else; it is adapted with a factor on the mass, under
priors of 3 and 2 %, and *paired*: the same is done on the first 2 s of the first record, and only the difference of
the two is applied, so that the structural error that both share cancels.  Found while looking at the second record, and
how far the priors count beside so slow an error is a choice: a third record should confirm it.  Last come the same
numbers fitted to the judged windows themselves, below which no adaptation of this model can get.
"""

from __future__ import annotations

import argparse
import os
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from whsklearn.filtering.records import fine_drive
from whsklearn.identification.view import derivative
from whsklearn.recursion.batch.axis_free_run import AxisForm, AxisLog, beside_the_states, sensitivities, settled

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

DT, CENTRE = 1e-3, 0.12
PRIOR = np.array([0.02, 0.03])  # of the factors on mass and on forces
BEFORE = 300  # samples that give the state at the start of a window
ADAPT = 2000  # samples of the second record, and of the first, that the factors are found on
JUDGED = 5000  # samples of a window that is judged, and of those of the first fit
SPACING = 100  # samples between the starts of the windows of 1 s that are adapted on
INDEPENDENT = (
    SPACING,
    250,
    1000,
)  # samples of a window's error that count as one: it is slow


def windows(frame: pd.DataFrame, begins: ArrayLike, length: int) -> AxisLog:
    """Windows of a record, `BEFORE` samples longer at their start, where alone the initial state is fitted."""
    u, q = frame["force_N"].to_numpy(), frame["position_m"].to_numpy()
    first, whole = np.asarray(begins) - BEFORE, length + BEFORE
    take = (first[:, None] + np.arange(whole)).ravel()
    at, counts = np.arange(len(first) + 1) * whole, np.tile(np.arange(whole) < BEFORE, len(first))
    v = derivative(q, DT)[0]
    form = AxisForm(powers=2, centre=CENTRE)
    return AxisLog(fine_drive(u[take], 4), q[take], counts, at, v[first], q[first], DT, form, True)


def misses(theta: np.ndarray, log: AxisLog) -> tuple[np.ndarray, np.ndarray]:
    """(error, derivatives by theta) past the start of each window, whose state follows theta there."""
    run, rows = sensitivities(theta, log)
    return (log.target - run)[~log.counts], beside_the_states(rows, log)[:, ~log.counts]


def moved(theta: np.ndarray, log: AxisLog, directions: np.ndarray, prior: np.ndarray, variance: float) -> np.ndarray:
    """Levenberg-Marquardt over z in theta + z @ directions (k, p), under a prior of 0 with these deviations."""
    z, damping, log = np.zeros(prior.size), 1e-2, settled(theta, log)
    error, rows = misses(theta, log)
    cost = error @ error / variance
    for _ in range(25):
        along = directions @ rows
        information = along @ along.T / variance + np.diag(prior**-2.0)
        slope = along @ error / variance - z / prior**2
        for _ in range(8):
            trial = z + np.linalg.solve(information + damping * np.diag(np.diag(information)), slope)
            at = theta + trial @ directions
            if at[0] > 0.0 and min(at[1:3]) >= 0.0:
                there = settled(at, log)
                left, slopes = misses(at, there)
                new = left @ left / variance + np.sum((trial / prior) ** 2)
                if new < cost:
                    break
            damping *= 4
        else:
            return z
        gain, z, log, error, rows, cost = 1 - new / cost, trial, there, left, slopes, new
        damping /= 8
        if gain < 1e-7:
            return z
    return z


def mass_and_forces(theta: np.ndarray) -> np.ndarray:
    """A factor on the mass, and one on all forces."""
    mass = np.zeros(theta.size)
    mass[0] = theta[0]
    return np.vstack([mass, theta - mass])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--data")
    given = parser.parse_args().data or os.environ.get("WHSKLEARN_DATA")
    folder = Path(given or Path(__file__).resolve().parents[2] / "shared" / "data") / "emps"
    first, second = (pd.read_csv(folder / f"emps_{k}.csv") for k in ("train", "test"))
    theta = np.array([95.0, 200.0, 20.0, -3.0, 1.0, 200.0])
    log = windows(first, np.arange(BEFORE, len(first) - JUDGED, 1000), JUDGED)
    sizes = np.diag([95.0, 200.0, 20.0, 3.0, 10.0, 200.0])
    theta = theta + moved(theta, log, sizes, np.full(6, 10.0), 1e-8 * SPACING) @ sizes
    names = ("M", "Fv", "Fc", "offset", "k1", "k2")
    print("first record:", ", ".join(f"{n} {v:.5g}" for n, v in zip(names, theta, strict=True)))
    both = [windows(frame, np.arange(BEFORE, ADAPT - 999, SPACING), 1000) for frame in (first, second)]
    variance = np.mean(misses(theta, settled(theta, both[0]))[0] ** 2)
    along = mass_and_forces(theta)
    print(f"not adapted: {told(theta, second)}")
    for independent in INDEPENDENT:
        factors = [moved(theta, log, along, PRIOR, variance * independent) for log in both]
        change = factors[1] - factors[0]
        print(f"{independent} samples as one: mass {change[0]:+.2%}, forces {change[1]:+.2%} (paired)")
        for name, z in (("unpaired", factors[1]), ("paired", change)):
            print(f"  {name:9} {told(theta + z @ along, second)}")
    judged = windows(second, np.arange(ADAPT, len(second) - JUDGED, 500), JUDGED)
    for name, along in (("two factors", mass_and_forces(theta)), ("all numbers", sizes)):
        z = moved(theta, judged, along, np.full(len(along), 10.0), 1e-8 * SPACING)
        print(f"{name} fitted to the windows that are judged: {told(theta + z @ along, second)}")
    print("dynoNet, which does not adapt: 2.64 mm over the whole record")


def told(theta: np.ndarray, second: pd.DataFrame) -> str:
    """The error over 5 s windows behind the samples adapted on, and over all the rest in one run."""
    rms = []
    for begins, length in ((np.arange(ADAPT, len(second) - JUDGED, 500), JUDGED), ([ADAPT], len(second) - ADAPT)):
        log = settled(theta, windows(second, begins, length))
        rms.append(1e3 * np.sqrt(np.mean(misses(theta, log)[0] ** 2)))
    return f"5 s windows {rms[0]:.2f} mm rms, whole rest {rms[1]:.2f} mm"


if __name__ == "__main__":
    main()
