"""The finder's own least squares beside SciPy's: residuals evaluated, CPU and sum of squares of the fits of diagnoses.

    python -m benchmarks.least_squares [--effects cogging,stribeck,...]

Servo logs with one effect hidden are diagnosed; each joint fit of a simulation (`ObserverView.fitted`) is run by
`whsklearn.gap.least_squares.least_squares` and by `scipy.optimize.least_squares` (``trf``, as ``lm`` takes no bounds),
on the same residual from the same start, with the same differences for derivatives and the same tolerance.
"""

from __future__ import annotations

import argparse
import time
from unittest import mock

import numpy as np
from scipy import optimize

from benchmarks.blind_logs import servo
from whsklearn.gap import GapFinder
from whsklearn.gap import least_squares as own
from whsklearn.gap.plants import servo_run


class Beside:
    """Runs both on every fit and keeps (evaluations, CPU seconds, sum of squares) of either."""

    def __init__(self) -> None:
        self.rows: list[tuple[float, ...]] = []

    def __call__(self, residual, x0, steps, bounds, *, max_iterations=15, tolerance=2e-4, slopes=None, workers=None):
        """The own fit's answer, after both were run."""
        calls = 0

        def counted(x):
            nonlocal calls
            calls += 1
            return residual(x)

        options = {"max_iterations": max_iterations, "tolerance": tolerance, "slopes": slopes, "workers": workers}
        began = time.process_time()
        fit = own.least_squares(counted, x0, steps, bounds, **options)
        row = [calls, time.process_time() - began, fit.cost]
        calls, began = 0, time.process_time()
        low, high = bounds
        free = low < high  # SciPy takes no bounds that are equal
        start = np.clip(x0, low, high)
        whole = start.copy()

        def put(z):
            whole[free] = z
            return whole.copy()

        def differences(z):
            x = put(z)
            return own.jacobian(counted, x, counted(x), steps, high)[:, free]

        room = 1e-9 * (high - low)[free]  # and no start on a bound
        inside = np.clip(start[free], low[free] + room, high[free] - room)
        found = optimize.least_squares(
            lambda z: counted(put(z)), inside, differences, (low[free], high[free]), x_scale=steps[free],
            ftol=tolerance, xtol=1e-8, gtol=None, max_nfev=6 * max_iterations,
        )  # fmt: skip
        self.rows.append((*row, calls, time.process_time() - began, 2.0 * float(found.cost)))
        return fit


def main() -> None:
    """Print the totals."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--effects", default="cogging,stribeck,backlash,gravity_imbalance,torque_ripple,load_friction")
    parser.add_argument("--seed", type=int, default=77_000)
    options = parser.parse_args()
    beside = Beside()
    with mock.patch.object(servo_run, "least_squares", beside):
        for i, effect in enumerate(options.effects.split(",")):
            drawn = servo.make_case("named", options.seed + i, effects=(effect,), size=0.05, noise=servo.NOISES[0])
            GapFinder("servo").fit(drawn.frame, **servo.COLUMNS)
    rows = np.array(beside.rows)
    for name, part in (("own", rows[:, :3]), ("SciPy", rows[:, 3:])):
        print(f"{name:6s} {len(rows)} fits, {part[:, 0].sum():.0f} residuals, {part[:, 1].sum():.1f} s of CPU")
    ratio = rows[:, 5] / rows[:, 2]
    low, high = np.quantile(ratio, [0.05, 0.95])
    print(f"SciPy's sum of squares over the own one: median {np.median(ratio):.4f}, 5 to 95 % {low:.4f} to {high:.4f}")


if __name__ == "__main__":
    main()
