"""Write a model for another tool: MuJoCo, URDF, Isaac Lab, C99, Structured Text, FMI, tables for drives."""

from __future__ import annotations

from typing import Any

import click

from whsklearn.cli.job import command, entry, no_room, table
from whsklearn.cli.options import FILE, POSITIVE, effects_option, load_effects

FORMAT_NAMES = "mjcf urdf isaac c st table fmu".split()  # as in `whsklearn.export.FORMATS`, which takes a second


@command
@click.argument("model", type=FILE)
@click.option("--to", type=click.Choice(FORMAT_NAMES), required=True, help="The format.")
@click.option("--out", type=click.Path(), required=True, help="A folder, or the path of the file.")
@effects_option
@click.option("--what", type=click.Choice(["model", "compensator"]), default="model", help="For c and st.")
@click.option("--real", type=click.Choice(["double", "float"]), default="double", help="Number type of the C code.")
@click.option("--rated-torque", type=POSITIVE, help="Rated torque in Nm, for tables of TF5200 and ServoOne.")
@click.option("--torque-constant", type=POSITIVE, help="Torque constant in Nm/A, for ServoOne's cogging table.")
@click.option("--speed", type=POSITIVE, help="Highest speed of friction tables; 10 rad/s or m/s if omitted.")
@click.option("--spread", type=FILE, help="A compare.json, to write ranges over units (mjcf only).")
def main(model: str, to: str, out: str, effects: str | None, spread: str | None, **options: Any) -> None:
    """Write MODEL (model.json of identify, repaired.json of gap) for another tool.

    What the format cannot represent is listed with its size and written into the file as a comment.

    Example: whsklearn export model.json --to mjcf --out axis.xml
    """
    from whsklearn.export import FORMATS, Ratings, export_model
    from whsklearn.export.model import read_ranges, write_ranges

    if spread and to != "mjcf":
        raise click.UsageError(f"--spread writes ranges for MuJoCo, and --to is {to}; give --to mjcf.")
    load_effects(effects)
    ranges = read_ranges(spread) if spread else None  # before anything is written
    try:
        ratings = Ratings(options["rated_torque"], options["torque_constant"], options["speed"])
        done = export_model(model, to=to, out=out, what=options["what"], real=options["real"], ratings=ratings)
    except OSError as error:
        why = error.strerror or type(error).__name__
        raise click.ClickException(no_room(error) or f"{out} cannot be written ({why}); name another --out.") from error
    except RuntimeError as error:  # a compiler that is missing or fails
        raise click.ClickException(str(error)) from error
    fits = "The format can represent the whole model."
    click.echo(f"Not everything fits into {FORMATS[to]}:" if done.losses else fits)
    for loss in done.losses:
        click.echo(entry(str(loss)))
    if done.left:
        left = [f"{100 * round(r.after / r.before, 6):.3g} %" for r in done.left]
        rows = [(r.name, r.before, round(r.after, 12), share) for r, share in zip(done.left, left, strict=True)]
        unit = done.left[0].unit
        title = f"Rms drive ({unit}) without and with a table, predicted by replaying the table against the model"
        click.echo(table(["table", "without", "with", "left"], rows, title=title))
    beside = [write_ranges(ranges, done.paths[0])] if ranges is not None else []
    click.echo(f"Written: {', '.join(map(str, [*done.paths, *beside]))}")
