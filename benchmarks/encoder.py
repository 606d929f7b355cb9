"""Whether the default inverse dynamics holds its intervals on quantised encoders.

    python benchmarks/encoder.py                  # 100 drawn axes, half a minute

Each axis has an inertia, viscous and Coulomb friction and an offset drawn over decades, moves on its
own multisine for 20 s at 0.5 to 4 kHz, and is read by an encoder of 1,000 to 20,000 counts.  The
torque is measured with 1 % noise.  Coverage of the 95 % intervals of `RLSRegressor` with
`InverseDynamicsLags(sample_rate)` and nothing else set; the interval of the share is over axes.
"""

from __future__ import annotations

from typing import Any

import click
import numpy as np

from whsklearn import InverseDynamicsLags, RLSRegressor


def drawn_log(rng: np.random.Generator) -> tuple[float, np.ndarray, np.ndarray, np.ndarray]:
    """Rate, position in counts of the encoder, torque, and the true weights."""
    rate = float(rng.choice([500.0, 1000.0, 2000.0, 4000.0]))
    counts = rng.choice([1000, 4096, 10_000, 20_000])
    t = np.arange(int(20 * rate)) / rate
    f = rng.uniform(0.1, 4.0, 6)
    size, phase = rng.uniform(0.2, 1.0, 6) / (1.0 + f), rng.uniform(0, 2 * np.pi, 6)
    w = 2 * np.pi * f[:, None]
    angle = w * t + phase[:, None]
    q, v, a = (size @ x for x in (np.sin(angle), w * np.cos(angle), -(w**2) * np.sin(angle)))
    inertia = 10.0 ** rng.uniform(-3, 1)
    scale = inertia * a.std()
    truth = np.array(
        [inertia, scale * rng.uniform(0.1, 0.5) / v.std(), scale * rng.uniform(0.1, 0.5), scale * rng.normal(0.0, 0.1)]
    )
    torque = np.column_stack([a, v, np.sign(v), np.ones_like(v)]) @ truth
    torque += 0.01 * torque.std() * rng.standard_normal(t.size)
    step = 2 * np.pi / counts
    return rate, step * np.round(q / step), torque, truth


def one_axis(seed: int) -> dict[str, Any]:
    """Errors in standard errors, and relative."""
    rate, q, torque, truth = drawn_log(np.random.default_rng([seed, 12]))
    model = RLSRegressor(InverseDynamicsLags(sample_rate=rate)).fit(q[:, None], torque)
    return {
        "z": (model.theta_ - truth) / model.standard_errors_,
        "relative": np.abs(model.theta_ / truth - 1.0),
        "interval": model.standard_errors_ / np.abs(truth),
        "cutoff": model.lags_.cutoff_,
    }


@click.command(help=__doc__.split("\n\n")[0])
@click.option("--runs", type=int, default=100, show_default=True, help="Axes.")
def main(runs: int) -> None:
    """Measure and print."""
    rows = [one_axis(s) for s in range(runs)]
    z = np.array([r["z"] for r in rows])
    share = (np.abs(z) < 1.96).mean(axis=1)
    half = 1.96 * share.std(ddof=1) / np.sqrt(runs)
    print(f"{runs} axes: 95 % intervals hold in {100 * share.mean():.1f} % (+- {100 * half:.1f})")
    for k, name in enumerate(("inertia", "viscous", "coulomb", "offset")):
        held = 100 * np.mean(np.abs(z[:, k]) < 1.96)
        error, width = (np.median([r[key][k] for r in rows]) for key in ("relative", "interval"))
        print(f"  {name:8s} {held:5.1f} %, median error {100 * error:.3f} %, standard error {100 * width:.3f} %")
    print(f"  cut-off {np.quantile([r['cutoff'] for r in rows], [0.0, 0.5, 1.0]).round(1)} Hz")


if __name__ == "__main__":
    main()
