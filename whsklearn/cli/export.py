"""Write a model for another tool: MuJoCo, URDF, Isaac Lab, C99, Structured Text, FMI."""

from __future__ import annotations

from pathlib import Path

import click

from whsklearn.cli.job import guarded, wrapped

FORMAT_NAMES = ("mjcf", "urdf", "isaac", "c", "st", "fmu")  # as in `whsklearn.export.FORMATS`, which takes a second


@click.command(context_settings={"show_default": True, "max_content_width": 100})
@click.argument("model", type=click.Path(exists=True, dir_okay=False))
@click.option("--to", type=click.Choice(FORMAT_NAMES), required=True, help="The format.")
@click.option("--out", type=click.Path(), required=True, help="A folder, or the path of the file.")
@click.option("--effects", type=click.Path(exists=True, dir_okay=False), help="A Python file with effects of your own.")
@click.option("--what", type=click.Choice(["model", "compensator"]), default="model", help="Of c and st.")
@click.option("--real", type=click.Choice(["double", "float"]), default="double", help="Numbers of the C code.")
def main(model: str, to: str, out: str, what: str, real: str, effects: str | None) -> None:
    """Write MODEL (model.json of identify, repaired.json of gap) for another tool.

    What the format cannot hold is listed with its size, and stands as a comment in the file.

    Example: whsklearn export model.json --to mjcf --out axis.xml
    """
    guarded(write, model=Path(model), to=to, out=out, what=what, real=real, effects=effects)


def write(model: Path, to: str, out: str, what: str, real: str, effects: str | None = None) -> None:
    """Export, and say what the format cannot hold and where the files are."""
    from whsklearn.cli.own_effects import load_effects
    from whsklearn.export import FORMATS, export_model

    if effects is not None:
        load_effects(effects)
    try:
        done = export_model(model, to=to, out=out, what=what, real=real)
    except RuntimeError as error:  # a compiler that is not there or fails
        raise click.ClickException(str(error)) from error
    if done.losses:
        click.echo(f"{FORMATS[to]} does not hold all of it:")
        for loss in done.losses:
            click.echo(wrapped(f"  {loss}"))
    else:
        click.echo("The format holds all of the model.")
    click.echo(f"Written: {', '.join(map(str, done.paths))}")


if __name__ == "__main__":
    main()
