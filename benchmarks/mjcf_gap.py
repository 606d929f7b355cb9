"""MJCF with one feature deleted: is it named, and does the repaired model replay the log?

    python -m benchmarks.mjcf_gap --cases 20

(extra ``bench``.) The logs are those of `benchmarks.blind_mujoco`; the simulator that the finder gets is the same MJCF
without the hidden feature, its damping off by up to 15 %. Replay error: rms over free runs of 0.5 s, each from the
position and velocity that fit it best (`MuJoCoSimulator.replay`, the same for every model), before and after; closed
means 1 - (after - floor) / (before - floor), where the floor is what the MJCF that made the log leaves. Beside it: the
same with the encoder's noise as floor. From the smoothed log's velocity the true MJCF leaves 25 to 2,300 times it.
"""

from __future__ import annotations

import dataclasses
import time

import click
import numpy as np
from tqdm import tqdm

from benchmarks.blind_mujoco import COLUMNS, EFFECTS, accepted, build, make_case
from whsklearn.gap import GapFinder
from whsklearn.gap.record import ServoRecord, noise_level
from whsklearn.logs.check import lattice
from whsklearn.simulators import MuJoCoSimulator

# what MuJoCo can be given back by `MuJoCoSimulator`
NAMES = (
    "frictionloss pendulum stiffness stiffness_cubic delay filter bias fluid cogging lugre forcerange range_both "
    "damping"
).split()
HORIZON = 0.5


def simulator_without(effect: str, case: object, rng: np.random.Generator) -> MuJoCoSimulator:
    """The case's MJCF without its feature."""
    rig = dataclasses.replace(case.rig, joint_extra="", load="", share=0.0, gravity=0.0, density=0.0)  # type: ignore[attr-defined]
    rig = dataclasses.replace(rig, actuator="", motor="", tone=(0.0, 1.0, 0.0))
    if effect == "frictionloss":
        rig = dataclasses.replace(rig, friction=0.0)
    elif effect.startswith("lugre"):
        rig = dataclasses.replace(rig, friction=rig.inertia)
    rig = dataclasses.replace(rig, damping=0.0 if effect == "damping" else rig.damping * rng.uniform(0.85, 1.15))
    return MuJoCoSimulator(build(rig), joint="axis", actuator="motor")


@click.command(help=__doc__)
@click.option("--cases", default=20, help="Logs, spread over the features.")
@click.option("--seeds", default=0, help="First seed.")
@click.option("--seconds", default=12.0, help="Length of a log.")
@click.option("--only", default="", help=f"Only these, joined by commas: {','.join(NAMES)}.")
def main(cases: int, seeds: int, seconds: float, only: str) -> None:
    plan = [(NAMES[i % len(NAMES)], seeds + i // len(NAMES)) for i in range(cases)]
    good, raws, times = [], [], []
    for effect, seed in tqdm([p for p in plan if not only or p[0] in only.split(",")]):
        case = make_case(effect, seed, seconds)
        record = ServoRecord.from_frame(case.frame, **COLUMNS)
        start = simulator_without(effect, case, np.random.default_rng(seed))
        began = time.process_time()
        finder = GapFinder(start).fit(record)
        spent = time.process_time() - began
        base = start.refit(record, np.ones(len(record), dtype=bool))
        truth = MuJoCoSimulator(case.xml, joint="axis", actuator="motor")
        before, after, floor = (
            float(np.sqrt(np.mean((record.position - s.replay(record, HORIZON)) ** 2)))
            for s in (base, finder.model_, truth)
        )
        noise = max(noise_level(record.position), lattice(record.position) / np.sqrt(12.0))
        closed, raw = (1.0 - (after - x) / max(before - x, 1e-300) for x in (min(floor, after), noise))
        names = [e.name for e in finder.effects_]
        right = finder.verdict_ == "named" and names[0] in accepted(
            EFFECTS[effect][0] if case.truth == "" else case.truth
        )
        good.append(right and closed >= 0.9)
        raws.append(right and raw >= 0.9)
        times.append(spent)
        tqdm.write(
            f"{effect:<18}{seed:<4}{finder.verdict_:<12}{'+'.join(names) or '-':<40}"
            f"closed {closed:6.3f} ({raw:6.3f}){spent:8.1f} s{'' if good[-1] else '   MISSED'}"
        )
    click.echo(f"named and closed by 0.9: {sum(good)} of {len(good)} (aim 18 of 20); down to noise: {sum(raws)}")
    click.echo(f"CPU seconds a log: median {np.median(times):.1f}, worst {max(times):.1f}")


if __name__ == "__main__":
    main()
