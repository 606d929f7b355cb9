"""A demonstration in one minute: identification of the article's example, then a hidden effect found in a log."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import click

from whsklearn.cli.job import RecordLost, writable_folder


@click.command(context_settings={"show_default": True, "max_content_width": 100})
@click.option("--seed", type=click.IntRange(min=0), default=0, help="Random seed.")
@click.option("--track/--no-track", default=True, help="Record the runs in MLflow.")
@click.option("--out", type=click.Path(file_okay=False), default="reports", help="Folder for the log and the report.")
@click.pass_context
def main(ctx: click.Context, seed: int, track: bool, out: str) -> None:
    """Identify the simulated example with every estimator, then hide cogging in a log and find it.

    Example: whsklearn demo --no-track
    """
    from whsklearn.cli import gap, simulated_example

    try:
        folder = writable_folder(out)
    except OSError as error:
        raise click.ClickException(str(error)) from None
    log, report = str(folder / "hidden.csv"), str(folder / "gap")
    # The log is written in parallel with the first part: on a new machine both begin by compiling for ten seconds or
    # more, and what one process compiles the others load.
    with subprocess.Popen(
        [sys.executable, "-m", "whsklearn.cli.hidden_effect", "--seed", str(seed), "--out", log],
        stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
    ) as writing:  # fmt: skip
        lost = None
        try:
            ctx.invoke(simulated_example.main, seed=seed, track=track)
        except RecordLost as error:  # the second part still has a report to write, recorded or not
            lost, track = error, False
        except BaseException:
            writing.kill()  # its log is no longer needed
            raise
        said = writing.communicate()[0].strip().splitlines()
    if writing.returncode:
        raise click.ClickException(said[-1] if said else f"no log was written to {log}")
    click.echo(said[-1])
    ctx.invoke(gap.main, log_file=log, report=report, seed=seed, track=track)
    click.echo(f"Open {Path(report, 'gap.html')}; whsklearn --help lists the commands.")
    if lost is not None:
        raise lost


if __name__ == "__main__":
    main()
