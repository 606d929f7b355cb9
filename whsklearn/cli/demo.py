"""A demonstration in one minute: identification of the article's example, then a hidden effect found in a log."""

from __future__ import annotations

import contextlib
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import click

from whsklearn.cli.job import RecordLost, command, job, seed_option, writable_folder
from whsklearn.cli.options import FOLDER, FiniteRange


@job
@click.option("--out", type=FOLDER, default="reports", help="Folder for the log and the report.")
def main(seed: int, track: bool, out: str) -> None:
    """Identify the simulated example with every estimator, then hide cogging in a log and find it.

    Example: whsklearn demo --no-track
    """
    from whsklearn.cli import gap, simulated_example

    ctx, folder = click.get_current_context(), writable_folder(out)
    log, report = str(folder / "hidden.csv"), str(folder / "gap")
    lost = None
    with compiled_beside():
        try:
            ctx.invoke(simulated_example.main, seed=seed, track=track)
        except RecordLost as error:  # the second part still has a report to write, recorded or not
            lost, track = error, False
        ctx.invoke(hidden_effect, seed=seed, out=log)
        ctx.invoke(gap.main, log_file=log, report=report, seed=seed, track=track)
    click.echo(f"Open {Path(report, 'gap.html')}; whsklearn --help lists the commands.")
    if lost is not None:
        raise lost


@contextlib.contextmanager
def compiled_beside() -> Iterator[None]:
    """Have a second process compile ahead, if there is a core for it: compiling is half of a first run."""
    from joblib import cpu_count

    from whsklearn.systems.servo import is_compiled  # what the second part needs, and whoever has run it has all

    if cpu_count() == 1 or is_compiled():
        yield
        return
    silent = subprocess.DEVNULL
    needed = "from whsklearn.cli import warm; [*warm.fits(), *warm.searches()]"
    ahead = subprocess.Popen([sys.executable, "-c", needed], stdin=silent, stdout=silent, stderr=silent)
    try:
        yield
    finally:
        ahead.terminate()
        ahead.wait()


@command
@click.option("--effect", default="cogging", help="Name of the effect in the catalogue, or 'none'.")
@click.option("--size", type=FiniteRange(min=0), default=0.1, help="Its size as a share of the rms drive.")
@click.option("--duration", type=FiniteRange(min=5), default=40.0, help="Length of the log in s.")
@seed_option
@click.option("--out", type=click.Path(dir_okay=False), default="reports/hidden.csv", help="File to write.")
def hidden_effect(effect: str, size: float, duration: float, seed: int, out: str) -> None:
    """Simulate a log with a hidden effect."""
    from whsklearn.datasets import make_servo_log
    from whsklearn.effects import effect_names

    if effect not in (*effect_names(), "none"):
        raise click.ClickException(f"Unknown effect {effect!r}; expected none or one of: {', '.join(effect_names())}.")
    log = make_servo_log([] if effect == "none" else effect, sizes=size, duration=duration, random_state=seed)
    Path(out).parent.mkdir(parents=True, exist_ok=True)
    log.to_csv(out, index=False)
    click.echo(f"Wrote {len(log)} samples to {out}; hidden in it: {effect}.")
