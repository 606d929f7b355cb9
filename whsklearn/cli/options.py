"""Options that several commands share, and what their values mean."""

from __future__ import annotations

import importlib.util
import math
import sys
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import click
from click.core import ParameterSource

ESTIMATORS = {"rls": "RLSRegressor", "mils": "MILSRegressor", "rmils": "RMILSRegressor"}
Command = Callable[..., Any]
LOG = click.Path(exists=True)  # a file, or a folder of files that make one log
FILE = click.Path(exists=True, dir_okay=False)
NEW_FILE = click.Path(dir_okay=False, path_type=Path)
FOLDER = click.Path(file_okay=False)  # to write to


class FiniteRange(click.FloatRange):
    """A range of numbers that are finite; no comparison shuts NaN out.

    >>> FiniteRange(min=0).convert("2.5", None, None)
    2.5
    """

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> float:
        """The number; a wrong option if it is none or not finite."""
        number = float(super().convert(value, param, ctx))
        if not math.isfinite(number):
            self.fail(f"{value} is not a finite number.", param, ctx)
        return number


POSITIVE = FiniteRange(min=0, min_open=True)
PROBABILITY = FiniteRange(0.0, 1.0, min_open=True, max_open=True)


def orders_of(text: str) -> tuple[int, ...]:
    """Four whole numbers, as in ``2,2,2,2``.

    >>> orders_of("3, 2, 2,1")
    (3, 2, 2, 1)
    """
    parts = [p.strip() for p in text.split(",")]
    if len(parts) != 4 or not all(map(str.isdigit, parts)):
        raise click.BadParameter(f"{text!r}; expected four whole numbers n_a,n_b,n_c,n_d such as 2,2,2,2.")
    return tuple(map(int, parts))


ORDERS = click.types.FuncParamType(orders_of)
ORDERS.name = "n_a,n_b,n_c,n_d"  # in the help


def torque_constant(text: str) -> str:
    """The text itself; a wrong option if it is no torque constant such as ``0.12+-0.01``."""
    from whsklearn.logs.current import torque_constant_of

    try:
        torque_constant_of(text)
    except ValueError as error:
        raise click.BadParameter(str(error)) from error
    return text


def _together(*options: Callable[[Command], Command]) -> Callable[[Command], Command]:
    """One decorator that adds several options, in this order."""

    def add(function: Command) -> Command:
        for option in reversed(options):
            function = option(function)
        return function

    return add


LOGGED = click.Choice(["auto", "output", "velocity", "position"])
logged_option = click.option(
    "--logged", type=LOGGED, default="auto", help="Kind of output; a position is fitted through its velocity."
)
effects_option = click.option("--effects", type=FILE, help="A Python file with effects of your own.")
rate_option = click.option("--rate", type=POSITIVE, help="Sample rate in Hz, in place of --time.")
# How a log is to be taken.
reading_options = _together(
    click.option("--columns", help="Columns by name or number from 0: time,drive,position or drive,position."),
    click.option(
        "--unit", "units", multiple=True, metavar="ROLE=UNIT", help="Unit, such as position=deg; may be repeated."
    ),
    rate_option,
    click.option(
        "--torque-constant",
        type=torque_constant,
        metavar="K+-S",
        help="Nm/A with its standard deviation, for a drive in amperes.",
    ),
    click.option("--invert-drive", is_flag=True, help="Change the sign of the drive."),
)
time_option = click.option("--time", "time_column", help="Time column; found by its name if omitted.")
# The columns of a servo axis.
axis_options = _together(
    time_option,
    click.option("--drive", help="Column of the drive: torque, force, current, voltage."),
    click.option("--position", help="Column of the measured position; a suffix such as _deg or _mm gives its unit."),
    click.option("--velocity", help="Column of the velocity, where no position is logged."),
    click.option("--command", help="Column of a position servo's command, where no drive is logged."),
)
# The columns of a system with one input and one output, with the names of those of an axis too.
system_options = _together(
    time_option,
    click.option("--input", "--drive", "input_column", help="Input column (drive); found by its name if omitted."),
    click.option("--output", "--position", "output_column", help="Output column (position); found by its name too."),
)
# The columns of each joint of an arm.
joint_options = _together(
    click.option(
        "--joints",
        help='Joints of an arm and their columns: "NAME:POSITION,DRIVE;..."; found if omitted, or for a NAME alone.',
    ),
    click.option("--gains", help='Torque constants of an arm: "NAME:NM_PER_AMPERE+-ERROR;...", for drives in amperes.'),
)
robot_options = _together(
    click.option("--robot", type=FILE, help="URDF, MJCF or model.json: a log of an arm."), joint_options
)


def refuse_without_robot(options: Mapping[str, Any]) -> None:
    """Raise UsageError for options of an arm without its file."""
    if of_arm := [name for name in ("joints", "gains", "load", "loaded") if options.get(name)]:
        raise click.UsageError(f"--{of_arm[0]} is for arms; give the robot's file with --robot.")


# A recursive estimator, see `build_model`.
model_options = _together(
    click.option("--estimator", type=click.Choice(sorted(ESTIMATORS)), default="rmils", help="Estimator."),
    click.option("--orders", type=ORDERS, default="2,2,2,2", help="Orders of the Wiener-Hammerstein model."),
    click.option("--law", default="reduced", help="Friction law: names joined by commas."),
    click.option("--p", type=click.IntRange(min=1), default=4, help="Innovation length."),
    click.option("--forgetting", type=FiniteRange(0.0, 1.0, min_open=True), default=1.0, help="Forgetting factor."),
)


def load_effects(path: str | Path | None) -> None:
    """Run the Python file of ``--effects``, check every effect that it defines, and include them in the search.

    Raises ValueError if the file cannot be run, defines no effect, uses a name of the library, or an effect breaks the
    contract.
    """
    if path is None:
        return
    from whsklearn.checks import check_effect  # this compiles, and --help must not
    from whsklearn.effects import effect_names, get_effect

    path = Path(path)
    known = {name: get_effect(name) for name in effect_names()}
    spec = importlib.util.spec_from_file_location(path.stem, path)
    if spec is None or spec.loader is None:
        raise ValueError(f"{path.name} is not a Python file; give one that defines effects, such as my_effects.py.")
    module = importlib.util.module_from_spec(spec)
    sys.modules[path.stem] = module  # dataclasses look up their module
    try:
        spec.loader.exec_module(module)
    except Exception as error:  # any error of the user's code becomes one sentence
        raise ValueError(f"{path.name} cannot be run: {type(error).__name__}: {error}.") from error
    defined = {name: get_effect(name) for name in effect_names() if known.get(name) is not get_effect(name)}
    taken = [name for name in defined if name in known and known[name].__module__ != path.stem]
    if taken:
        raise ValueError(f"{path.name} defines {taken[0]!r}, which the library already has; give it another name.")
    if not defined:
        raise ValueError(
            f"{path.name} defines no effect; write a class derived from whsklearn.effects.Effect that has a name "
            "and a place, as docs/your_effect.md shows."
        )
    for cls in defined.values():
        check_effect(cls)


def chosen_of(options: Mapping[str, Any]) -> set[str]:
    """The options that were given on the command line."""
    source_of = click.get_current_context().get_parameter_source
    return {name for name in options if source_of(name) == ParameterSource.COMMANDLINE}


def given(options: Mapping[str, Any]) -> dict[str, Any]:
    """The options that were given or have a default, as they are recorded with a run."""
    return {k: v for k, v in options.items() if not (v is None or v is False or v == ())}


def units_of(given: tuple[str, ...]) -> dict[str, str]:
    """Units by role from texts such as ``position=deg``."""
    from whsklearn.logs.errors import ColumnError

    out = {}
    for text in given:
        role, sign, unit = text.partition("=")
        if not (role and sign and unit):
            raise ColumnError(f"--unit is {text!r}; expected ROLE=UNIT such as position=deg.")
        out[role.strip()] = unit.strip()
    return out


def lags_of(orders: tuple[int, ...], law: str | None) -> Any:
    """`WienerHammersteinLags` of these orders; the law is (4) for None or ``reduced``. Raises ValueError for no law."""
    from whsklearn import WienerHammersteinLags

    n_a, n_b, n_c, n_d = orders
    lags = WienerHammersteinLags(n_a=n_a, n_b=n_b, n_c=n_c, n_d=n_d, law=None if law == "reduced" else law)
    lags.dims()
    return lags


def build_model(options: Mapping[str, Any]) -> Any:
    """The estimator that `model_options` and ``--seed`` ask for."""
    from whsklearn import estimators

    cls = getattr(estimators, ESTIMATORS[options["estimator"]])
    wanted = {"p": options["p"], "forgetting": options["forgetting"], "random_state": options["seed"]}
    known = cls().get_params()
    return cls(lags=lags_of(options["orders"], options["law"])).set_params(
        **{k: v for k, v in wanted.items() if k in known}
    )
