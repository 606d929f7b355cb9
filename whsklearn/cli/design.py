"""Design the next run: a reference within the limits of a rig, and which rivals of a diagnosis it would separate."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path
from typing import Any

import click

from whsklearn.cli.job import command, seed_option, table, wrapped, writable_folder
from whsklearn.cli.options import FILE, FOLDER, POSITIVE, effects_option, load_effects

LIMITS = ("position", "speed", "drive", "seconds")
MOST_RIVALS = 3  # in addition to the named effects; each takes three simulated runs of some seconds


def limits_of(context: Any, option: Any, text: str) -> dict[str, float]:
    """Parse positive numbers from a text such as ``position=0.5,speed=2,drive=1.2,seconds=6``."""
    given = dict(part.split("=", 1) for part in text.split(",") if "=" in part)
    out = {name.strip(): POSITIVE.convert(value, option, context) for name, value in given.items()}
    if set(out) != set(LIMITS) or len(out) != text.count(",") + 1:
        raise click.BadParameter(f"{text!r}; expected each of {', '.join(LIMITS)} once, as in position=0.5.")
    return out


@command
@click.argument("gap_file", metavar="GAP.JSON", type=FILE)
@click.option(
    "--limits", required=True, callback=limits_of, help="position=..,speed=..,drive=..,seconds=.. of the rig."
)
@click.option("--rivals", help="Names of effects, joined by commas; those of the diagnosis if omitted.")
@effects_option
@click.option("--out", type=FOLDER, default="design", help="Folder for reference and answer.")
@seed_option
def main(**options: Any) -> None:
    """Design the next reference within limits, and predict what it would show.

    GAP.JSON is that of `whsklearn gap`, with repaired.json beside it. Limits are in the units of the log.

    \b
    whsklearn design gap/gap.json --limits position=0.5,speed=2,drive=1.2,seconds=6 --out next
    """  # noqa: D301 - click reads the backspace
    from whsklearn.gap.design import SAID, Limits, design, write_design
    from whsklearn.logs.units import factor_of

    folder = writable_folder(options["out"])
    load_effects(options["effects"])
    data, axis, rivals, law = diagnosis_of(Path(options["gap_file"]), options["rivals"])
    drive, position = (data.get("units", {}).get(role, "") for role in ("drive", "position"))
    by, far = (factor_of(unit)[0] if unit else 1.0 for unit in (drive, position))
    given = Limits(**options["limits"])
    limits = Limits(given.position * far, given.speed * far, given.drive * by, given.seconds)
    made = design(
        axis, rivals, law, limits, share=data["missing"]["before"], noise=data["noise_floor_rmse"] * far,
        alpha=data["alpha"], seed=options["seed"],
    )  # fmt: skip
    page = write_design(made, given, folder, (drive, position))
    click.echo(table(["rival", "within these limits"], [[n.replace("_", " "), SAID[y]] for n, y in made.named.items()]))
    click.echo(wrapped(made.advice(drive or "of drive", by)))
    click.echo(f"Written: {folder / 'reference.csv'}, {folder / 'design.json'}\nReport: {page}")


def diagnosis_of(file: Path, rivals: str | None) -> tuple[dict[str, Any], Any, list[Any], str]:
    """The diagnosis, the fitted axis without the effects in doubt, the rivals, and the base model's friction law."""
    from whsklearn.effects import effect_names
    from whsklearn.models import AxisModel, load_model

    data = json.loads(file.read_text(encoding="utf-8"))
    beside = file.with_name("repaired.json")
    if "candidates" not in data or not beside.is_file():
        raise ValueError(
            f"{file} is not a gap.json with a repaired.json beside it; give one that `whsklearn gap` wrote."
        )
    model = load_model(beside)
    if not isinstance(model, AxisModel):
        raise ValueError(f"{beside} holds a model of kind {model.kind}; runs can be designed for an axis only.")
    named = [e["name"] for e in data["effects"]]
    law = ",".join(r["name"] for r in data["base"] if r["name"] in effect_names("friction"))
    axis = dataclasses.replace(model, effects=tuple(e for e in model.effects if e.name not in named)).system()
    if rivals is not None:
        wanted: list[Any] = [n.strip() for n in rivals.split(",") if n.strip()]
    else:
        others = [c["name"] for c in data["candidates"] if c["name"] not in named and c["status"] != "not_testable"]
        wanted = [*named, *dict.fromkeys(others)][: len(named) + MOST_RIVALS]
    if unknown := set(wanted) - set(effect_names()):
        raise ValueError(
            f"{', '.join(sorted(unknown))} is not an effect; expected some of {', '.join(effect_names())}. "
            "Give the file of an effect of your own with --effects."
        )
    fitted = {e.name: e for e in model.effects if e.name in named}
    return data, axis, [fitted.get(n, n) for n in wanted], law
