"""Inertia and friction of an axis whose drive is held over the sample, with and without its age.

    python -m benchmarks.held_drive                   # streams at 50 to 1,000 Hz, 8 logs of a minute each
    python -m benchmarks.held_drive --records         # the same logs as records
    python -m benchmarks.held_drive --first-seed 100  # fresh logs

The logs are those of `make_servo_log`: the default axis in closed loop with a noisy encoder.  Its drive is held over
the sample ("held"); the mean of two neighbours stands for one that is measured with the position ("measured").
"""

from __future__ import annotations

import warnings

import click
import numpy as np

from whsklearn import InverseDynamicsLags, RLSRegressor
from whsklearn.cli.stream import EFFECTS
from whsklearn.datasets import make_servo_log

NUMBERS = ("inertia", "viscous", "coulomb")
SECONDS = 60.0


def motion_of(kind: str, rate: float) -> str | np.ndarray:
    """A kind of reference, or a sine of so many Hz with the greatest acceleration of 40 rad/s^2, at most 1 rad."""
    if not kind.endswith("Hz"):
        return kind
    w = 2 * np.pi * float(kind.split()[0])
    return min(1.0, 40.0 / w**2) * np.sin(w * np.arange(int(SECONDS * rate)) / rate)


def errors_of(rate: float, kind: str, seed: int, records: bool) -> dict[tuple[str, str], np.ndarray]:
    """Errors of the numbers in % and in standard errors (2, 3), by timing of the drive and effects of the model."""
    log, truth = make_servo_log(
        reference=motion_of(kind, rate), duration=SECONDS, sample_rate=rate, random_state=seed, return_truth=True
    )
    held, q = log["torque_nm"].to_numpy(), log[["position_rad"]].to_numpy()
    true = np.array([truth.parameters[n] for n in NUMBERS])
    out = {}
    for timing, u in (("held", held), ("measured", np.r_[held[0], 0.5 * (held[1:] + held[:-1])])):
        for effects in ("input_offset", EFFECTS):
            model = RLSRegressor(InverseDynamicsLags(rate, effects=effects, causal=not records))
            model = model.fit(q, u) if records else model.partial_fit(q, u)
            found, spread = (np.array([p[n] for n in NUMBERS]) for p in (
                model.parameters_, model.parameter_standard_errors_))  # fmt: skip
            out[timing, effects] = np.array([100.0 * (found / true - 1.0), (found - true) / spread])
    return out


@click.command(help=__doc__.split("\n\n")[0])
@click.option("--count", type=int, default=8, show_default=True, help="Logs of each kind.")
@click.option("--first-seed", type=int, default=0, show_default=True, help="Seed of the first.")
@click.option("--records", is_flag=True, help="Records in place of streams.")
def main(count: int, first_seed: int, records: bool) -> None:
    """Measure and print."""
    print(f"{'':22s} {'drive':9s} {'age':4s}" + "".join(f"{n:>22s}" for n in NUMBERS) + "   (root mean square)")
    warnings.simplefilter("ignore", UserWarning)  # of slow axes, whose figures say it
    for rate in (50.0, 250.0, 1000.0):
        for kind in ("rich", "multisine", "0.3 Hz", "1 Hz", "3 Hz"):
            each = [errors_of(rate, kind, first_seed + i, records) for i in range(count)]
            for timing, effects in each[0]:
                size = np.sqrt(np.mean([e[timing, effects] ** 2 for e in each], axis=0))
                if not np.isfinite(size).all():
                    continue  # no window without a reversal: these numbers are not determined
                text = "".join(f"{p:10.3f} %{z:6.1f} s.e." for p, z in size.T)
                print(f"{rate:6.0f} Hz {kind:12s} {timing:9s} {'yes' if effects == EFFECTS else 'no':4s}{text}")


if __name__ == "__main__":
    main()
