"""An effect of one's own, searched: the magnet of `whsklearn.effects.Effect` hidden in drawn servo logs.

    python -m benchmarks.own_effect
    python -m benchmarks.own_effect --of chain
    python -m benchmarks.own_effect --of simulator

The class below is all that is added to the library. The logs, 20 s each, are of the blind generators (`blind_logs`),
whose integrator and whose magnet are not ours: 20 with the magnet at 5 %, 20 at 15 % of the rms drive, 20 without it.
Each is diagnosed from its table alone; the target is the magnet's name in 18 of 20, and in none of 20 without it.
Chains are drawn systems of 1,500 samples with the magnet behind the first block, a share of the law's output.
The simulator is the class `benchmarks.blind_simulator.Rig`, a user's own integrator, against logs that it made itself.
"""

from __future__ import annotations

import math
import tempfile
import time
from pathlib import Path
from typing import Any

import click
from tqdm import tqdm

from benchmarks.blind import rate
from benchmarks.blind_logs import servo, wiener_hammerstein
from benchmarks.blind_simulator import OWN, make_case
from whsklearn.effects import Effect, number
from whsklearn.gap import GapFinder
from whsklearn.models import load_model


class Magnet(Effect):
    """A magnet beside the path pulls at one place, c exp(-(q/w)^2) (Nm)."""

    torque: float = number(0.1, "Nm", -1, 1)
    width: float = number(0.2, "rad", 0.01, 1, log=True)

    name = "magnet"
    place = "position"
    equation = "c exp(-(q/w)^2)"
    signature = "a bump over the position"
    needs = "slow passes over the magnet"

    @staticmethod
    def evaluate(p: Any, time: float, position: float, velocity: float, drive: float) -> float:
        """The torque; ``p`` holds the fields."""
        return p[0] * math.exp(-((position / p[1]) ** 2))


def diagnose(share: float, seed: int) -> dict[str, Any]:
    """One servo log: verdict, names, relative errors of torque and width, whether the report holds the magnet."""
    hidden, kind = (("magnet",), "foreign") if share else ((), "none")
    case = servo.make_case(kind, seed, effects=hidden, size=share or 0.05, noise=servo.NOISES[seed % 3], seconds=20.0)
    numbers = case.parameters
    return figures_of(
        GapFinder("servo"),
        case.frame,
        servo.COLUMNS,
        {"torque": numbers["x_bump"], "width": numbers["x_bump_width"]} if share else {},
    )


def diagnose_chain(share: float, seed: int) -> dict[str, Any]:
    """The same of a drawn chain."""
    hidden, kind = (("magnet",), "foreign") if share else ((), "none")
    noise = wiener_hammerstein.NOISES[seed % 3]
    case = wiener_hammerstein.make_case(kind, seed, effects=hidden, size=share or 0.05, noise=noise, n=1500)
    numbers = case.parameters[0] if share else {}
    truth = {"torque": numbers["size"], "width": numbers["shape"]} if share else {}
    return figures_of(GapFinder("wiener-hammerstein"), case.frame, wiener_hammerstein.COLUMNS, truth)


def diagnose_simulator(share: float, seed: int) -> dict[str, Any]:
    """One log under a simulator of the user's own."""
    record, rig, hidden = make_case(OWN if share else "none", seed, share=share or None)
    return figures_of(GapFinder(rig), record, {}, {"torque": hidden.torque, "width": hidden.width} if share else {})


def figures_of(finder: GapFinder, log: Any, columns: dict[str, str], truth: dict[str, float]) -> dict[str, Any]:
    """One row, ``seconds`` of CPU for the diagnosis.

    ``kept`` says whether the repaired model simulates the magnet and the page shows it.

    The model is that of ``repaired.json``, or the simulator itself, of which there is no such file.
    """
    began = time.process_time()
    finder.fit(log, **columns)
    seconds = time.process_time() - began
    found = next((e.effect for e in finder.effects_ if e.name == "magnet"), None)
    row: dict[str, Any] = {"verdict": finder.verdict_, "names": [e.name for e in finder.effects_],
                           "closure": finder.diagnosis_.closure, "kept": False, "seconds": seconds}  # fmt: skip
    if found is not None and truth:
        with tempfile.TemporaryDirectory() as folder:
            page = finder.report(folder).read_text(encoding="utf-8")
            file = Path(folder) / "repaired.json"
            repaired = load_model(file) if file.exists() else finder.model_
        held = [e for e in repaired.effects if e.name == "magnet"]
        row["kept"] = bool(held) and "magnet" in page
        for number, value in truth.items():
            row[number] = abs(getattr(held[0], number) / value - 1.0) if held else 1.0
    return row


@click.command(help=__doc__)
@click.option("--count", default=20, help="Logs a cell.")
@click.option("--first-seed", default=500)
@click.option("--shares", default="0.05,0.15,0")
@click.option(
    "--of", "kind", type=click.Choice(["servo", "chain", "simulator"]), default="servo", help="What is logged."
)
def main(count: int, first_seed: int, shares: str, kind: str) -> None:
    one = {"servo": diagnose, "chain": diagnose_chain, "simulator": diagnose_simulator}[kind]
    for share in map(float, shares.split(",")):
        rows = [one(share, first_seed + i) for i in tqdm(range(count))]
        if not share:
            click.echo(rate("magnet named without one", ["magnet" in r["names"] for r in rows], "0"))
            continue
        right = [r["verdict"] == "named" and r["names"] == ["magnet"] for r in rows]
        click.echo(rate(f"magnet of {100 * share:g} % named", right, ">= 90"))
        click.echo(rate("  in repaired.json and on the page", [r["kept"] for r in rows], ">= 90"))
        for field in ("torque", "width"):
            errors = sorted(r[field] for r in rows if field in r)
            if errors:
                click.echo(f"  error of the {field}: median {100 * errors[len(errors) // 2]:.1f} %")
        click.echo(f"  closure: least {min(r['closure'] for r in rows):.3f}")
        for r, hit in zip(rows, right, strict=True):
            if not hit:
                click.echo(f"  missed: {r['verdict']} {r['names']} closure {r['closure']:.2f}")


if __name__ == "__main__":
    main()
