"""Write a simulated log of an axis with an effect hidden in it, to try ``whsklearn gap`` on."""

from __future__ import annotations

from pathlib import Path

import click


@click.command(context_settings={"show_default": True})
@click.option("--effect", default="cogging", help="Name of the effect in the catalogue, or 'none'.")
@click.option("--size", type=click.FloatRange(min=0.0), default=0.1, help="Its size as a share of the rms drive.")
@click.option("--duration", type=click.FloatRange(min=5.0), default=40.0, help="Length of the log in s.")
@click.option("--seed", type=click.IntRange(min=0), default=0, help="Random seed.")
@click.option("--out", type=click.Path(dir_okay=False), default="reports/hidden.csv", help="File to write.")
def main(effect: str, size: float, duration: float, seed: int, out: str) -> None:
    """Simulate a log with a hidden effect."""
    from whsklearn.datasets import make_servo_log
    from whsklearn.effects import effect_names

    if effect not in (*effect_names(), "none"):
        raise click.ClickException(f"Unknown effect {effect!r}; expected none or one of: {', '.join(effect_names())}.")
    log = make_servo_log([] if effect == "none" else effect, sizes=size, duration=duration, random_state=seed)
    Path(out).parent.mkdir(parents=True, exist_ok=True)
    log.to_csv(out, index=False)
    click.echo(f"Wrote {len(log)} samples to {out}; hidden in it: {effect}.")


if __name__ == "__main__":
    main()
