"""The command ``whsklearn``; the module of a command is imported only when it is called, so ``--help`` is quick."""

from __future__ import annotations

import importlib

import click

COMMANDS = {
    "identify": "Find the model of an axis from its log: linear, Wiener-Hammerstein or physics.",
    "gap": "Find, name and close the gap between a model and a log.",
    "compare": "Find what changed between records of one axis.",
    "design": "Design the next reference, and predict what it would show.",
    "tune": "Search innovation length, covariance, forgetting, orders and laws.",
    "stream": "Identify row by row, continuously, with alarms and checkpoints.",
    "fleet": "Identify every axis in a folder and list the outliers.",
    "simulate": "Run a model file with the drive of a log.",
    "export": "Write a model for MuJoCo, URDF, Isaac Lab, C99, PLCs or FMI.",
    "ui": "Show the recorded runs in a browser.",
    "warm": "Compile in advance, for quick first runs.",
    "demo": "Identify a simulated example, then find an effect hidden in a log.",
}
WIDTH = 100


class Lazy(click.Group):
    """A group whose commands are modules of this package, imported on use.

    >>> Lazy().list_commands(click.Context(main))[:2]
    ['identify', 'gap']
    """

    def list_commands(self, ctx: click.Context) -> list[str]:
        """Command names in the order in which a user would try them."""
        return list(COMMANDS)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        """The command ``main`` of the module with that name."""
        if cmd_name not in COMMANDS:
            return None
        command = importlib.import_module(f"{__name__}.{cmd_name}").main
        assert isinstance(command, click.Command)
        return command

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Names and one-line descriptions, without importing the commands."""
        with formatter.section("Commands"):
            formatter.write_dl(list(COMMANDS.items()))


@click.command(cls=Lazy, context_settings={"max_content_width": WIDTH})
@click.version_option(package_name="whsklearn")
def main() -> None:
    """Identify servo axes from their logs, and find what a model misses.

    \b
    whsklearn demo
    whsklearn gap axis.csv --drive torque_nm --position position_rad --out gap
    whsklearn identify axis.csv --input torque_nm --output position_rad --out model

    Exit status: 0 a result, 2 a wrong option, 3 a log that cannot be used, 1 any other failure.
    """  # noqa: D301 - click reads the backspace
