"""The reference section, written from the library itself at every build, so that no public name can be forgotten.

Public is what a package of ``whsklearn`` without an underscore lists in ``__all__``.
"""

from __future__ import annotations

import importlib
import inspect
import pkgutil
from pathlib import Path
from typing import Any

import click

import whsklearn

HERE = Path(__file__).parent
# What a reader looks for first comes first; a package that is not named here comes behind them.
ORDER = ("gap", "identification", "logs", "estimators", "lags", "systems", "effects", "export", "simulators", "models")


def packages() -> list[str]:
    """Names of the public packages: those that say what they export."""
    found = [m.name for m in pkgutil.iter_modules(whsklearn.__path__) if not m.name.startswith("_")]
    found.sort(key=lambda name: (ORDER.index(name) if name in ORDER else len(ORDER), name))
    names = [f"whsklearn.{name}" for name in found]
    return [name for name in names if getattr(importlib.import_module(name), "__all__", None)]


def public() -> dict[str, dict[str, Any]]:
    """Public objects by package and name; one that several packages list is kept where it is defined."""
    listed = {
        p: {n: getattr(importlib.import_module(p), n) for n in importlib.import_module(p).__all__} for p in packages()
    }

    def at_home(package: str, item: Any) -> bool:
        others = [p for p, names in listed.items() if p != package and any(item is o for o in names.values())]
        home = getattr(item, "__module__", "") or ""
        return not any(home.startswith(f"{p}.") or home == p for p in others)

    return {p: {n: o for n, o in sorted(names.items()) if at_home(p, o)} for p, names in listed.items()}


def is_documented(item: Any) -> bool:
    """Whether an object has a page of its own: a class or a function, not a constant."""
    return inspect.isclass(item) or inspect.isroutine(item)


def reference_page() -> str:
    """``api/reference.md``: every public class and function, by package."""
    lines = [
        "# Reference",
        "",
        "Every public class and function, by package, each with a page of its own. What is not listed here may change.",
    ]
    for package, names in public().items():
        module = importlib.import_module(package)
        lines += [
            "",
            f"## {package}",
            "",
            inspect.cleandoc(module.__doc__ or "").replace("`", "``").replace("````", "``"),
        ]
        constants = [n for n, o in names.items() if not is_documented(o)]
        if constants:
            lines += ["", "Constants: " + ", ".join(f"`{n}`" for n in constants) + "."]
        listed = [f"   {n}" for n, o in names.items() if is_documented(o)]
        lines += [
            "",
            "```{eval-rst}",
            f".. currentmodule:: {package}",
            "",
            ".. autosummary::",
            "   :toctree: generated",
            "",
        ]
        lines += [*listed, "```"]
    return "\n".join([*lines, ""])


def commands_page() -> str:
    """``api/commands.md``: what each command prints with ``--help``."""
    from whsklearn.cli import main

    lines = ["# Commands", "", "What `whsklearn COMMAND --help` prints. Every command ends with status 0 for a result,",
             "2 for a wrong option, 3 for a log that cannot be used and 1 for any other failure."]  # fmt: skip
    context = click.Context(main, info_name="whsklearn", terminal_width=100, max_content_width=100)
    for name in main.list_commands(context):
        command = main.get_command(context, name)
        own = click.Context(command, info_name=name, parent=context, terminal_width=100, max_content_width=100)
        lines += ["", f"## {name}", "", "```text", command.get_help(own), "```"]
    return "\n".join([*lines, ""])


def write() -> None:
    """Write both pages where they have changed, so that a second build has nothing to do."""
    for name, text in (("reference.md", reference_page()), ("commands.md", commands_page())):
        path = HERE / "api" / name
        path.parent.mkdir(exist_ok=True)
        if not path.exists() or path.read_text(encoding="utf-8") != text:
            path.write_text(text, encoding="utf-8")
