"""EMPS live: fitted on the first record, adapted on the first 2 s of the second, judged on the rest.

    python benchmarks/emps_live.py [--data FOLDER]

Model: M a = u - Fv v - Fc sign(v) - offset - k1 e - k2 e^2, e = x - 0.12 m, fitted over 1 s windows of free run.
Between the records one factor on every force changes, and little else; it is adapted with a factor on the mass, under
priors of 3 and 2 %, and *paired*: the same is done on the first 2 s of the first record, and only the difference of
the two is applied, so that the structural error that both share cancels.  Found while looking at the second record:
a third should confirm it.
"""

from __future__ import annotations

import argparse
import os
from pathlib import Path

import numpy as np
import pandas as pd

from whsklearn.identification.view import derivative
from whsklearn.recursion.axis_free_run import AxisLog, fit_state, free_run, sensitivities

DT, CENTRE = 1e-3, 0.12
PRIOR = np.array([0.02, 0.03])  # of the factors on mass and on forces
ADAPT = 2000  # samples
LENGTH = 5000  # of a window of the first fit
INDEPENDENT = 250  # samples of a window's error that count as one: it is slow


def pieces(frame: pd.DataFrame, begins: np.ndarray, length: int) -> AxisLog:
    """Windows of a record, each with the state that the smoothed position has there."""
    u, q = frame["force_N"].to_numpy(), frame["position_m"].to_numpy()
    take = (np.asarray(begins)[:, None] + np.arange(length)).ravel()
    at = np.arange(len(begins) + 1) * length
    v = derivative(q, DT)[0]
    return AxisLog(u[take], q[take], np.ones(take.size, bool), at, v[begins], q[begins], DT, np.empty(0), CENTRE, True)


def projected(theta: np.ndarray, log: AxisLog) -> tuple[np.ndarray, np.ndarray]:
    """(error, sensitivities) with the part that each window's initial state explains taken out."""
    run, rows = sensitivities(theta, log)
    error, rows = log.target - run, rows.copy()
    for s, e in zip(log.bounds[:-1], log.bounds[1:], strict=True):
        q, _ = np.linalg.qr(rows[-2:, s:e].T)
        error[s:e] -= q @ (q.T @ error[s:e])
        rows[:-2, s:e] -= (rows[:-2, s:e] @ q) @ q.T
    return error, rows[:-2]


def gauss_newton(theta: np.ndarray, log: AxisLog, directions, prior: np.ndarray, sigma: float) -> np.ndarray:
    """theta moved along ``directions(theta)`` (k, p), under a prior of 0 with these deviations."""
    z = np.zeros(prior.size)
    begin = theta
    weight = 1.0 / (sigma**2 * INDEPENDENT)
    for _ in range(12):
        v0, q0 = fit_state(theta, log, 2)
        log = log._replace(v0=v0, q0=q0)
        error, rows = projected(theta, log)
        along = directions(begin) @ rows
        step = np.linalg.solve(weight * along @ along.T + np.diag(prior**-2.0), weight * along @ error - z / prior**2)
        z = z + np.clip(step, -0.2, 0.2)
        theta = begin + z @ directions(begin)
    return z


def scaled_each(theta: np.ndarray) -> np.ndarray:
    """Every parameter on its own, relative to its size."""
    return np.diag(np.where(np.abs(theta) > 0, np.abs(theta), 1.0))


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
    log = pieces(first, np.arange(0, len(first) - LENGTH, LENGTH // 2), LENGTH)
    for _ in range(3):
        theta = theta + gauss_newton(theta, log, scaled_each, np.full(6, 10.0), 1e-4) @ scaled_each(theta)
    names = ("M", "Fv", "Fc", "offset", "k1", "k2")
    print("first record:", ", ".join(f"{n} {v:.5g}" for n, v in zip(names, theta, strict=True)))
    sigma = float(np.std(projected(theta, log)[0]))
    begins = np.arange(0, ADAPT - 999, 100)
    factors = [
        gauss_newton(theta, pieces(frame, begins, 1000), mass_and_forces, PRIOR, sigma) for frame in (first, second)
    ]
    change = factors[1] - factors[0]
    print(f"on the first 2 s: mass {change[0]:+.2%}, forces {change[1]:+.2%} (paired)")
    before = 300
    for name, z in (("not adapted", 0 * change), ("unpaired", factors[1]), ("paired", change)):
        adapted = theta + z @ mass_and_forces(theta)
        starts = np.arange(ADAPT, len(second) - 5000, 500)
        windows = pieces(second, starts - before, 5000 + before)
        windows = windows._replace(counts=np.tile(np.arange(5000 + before) < before, len(starts)))
        v0, q0 = fit_state(adapted, windows)
        error = (windows.target - free_run(adapted, windows._replace(v0=v0, q0=q0))).reshape(len(starts), -1)[
            :, before:
        ]
        rest = pieces(second, np.array([ADAPT - before]), len(second) - ADAPT + before)
        rest = rest._replace(counts=np.arange(rest.u.size) < before)
        v0, q0 = fit_state(adapted, rest)
        whole = (rest.target - free_run(adapted, rest._replace(v0=v0, q0=q0)))[before:]
        print(
            f"{name:12} 5 s windows {1e3 * np.sqrt(np.mean(error**2)):.2f} mm rms, whole rest "
            f"{1e3 * np.sqrt(np.mean(whole**2)):.2f} mm (dynoNet 2.64)"
        )


if __name__ == "__main__":
    main()
