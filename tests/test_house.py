"""The house: every module has its test, and functions take few arguments."""

from __future__ import annotations

import ast
import functools
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
FUNCTIONS = ast.FunctionDef | ast.AsyncFunctionDef


@functools.cache
def modules() -> dict[Path, ast.Module]:
    """Syntax trees of all modules that hold code, by their paths within the library."""
    trees = {p: ast.parse(p.read_text(encoding="utf-8")) for p in sorted((ROOT / "whsklearn").rglob("*.py"))}
    return {
        p.relative_to(ROOT / "whsklearn"): tree
        for p, tree in trees.items()
        if any(isinstance(node, FUNCTIONS | ast.ClassDef) for node in tree.body)
    }


def home(module: Path) -> Path:
    """Where the tests of a module stand: the same folder below tests/, the same name."""
    return ROOT / "tests" / module.parent / f"test_{module.stem.strip('_')}.py"


def test_modules_have_their_tests_where_their_names_say():
    missing = [str(m) for m in modules() if not home(m).is_file()]
    assert len(missing) < 0.15 * len(modules()), missing


def wide(tree: ast.Module) -> list[tuple[str, int, bool]]:
    """(name, arguments, whether it is compiled) of every function of a module; options of a command do not count."""
    out = []
    for node in ast.walk(tree):
        if not isinstance(node, FUNCTIONS):
            continue
        decorators = " ".join(map(ast.unparse, node.decorator_list))
        if "click.option" in decorators or "overload" in decorators:
            continue
        names = [a.arg for a in (*node.args.posonlyargs, *node.args.args, *node.args.kwonlyargs)]
        names += [a.arg for a in (node.args.vararg, node.args.kwarg) if a]
        out.append((node.name, len(names) - (names[:1] in (["self"], ["cls"])), "njit" in decorators))
    return out


def test_few_functions_take_more_than_six_arguments():
    every = [(str(m), *f) for m, tree in modules().items() for f in wide(tree)]
    many = [f for f in every if f[2] > 6]
    assert len(many) < 0.03 * len(every), sorted(many, key=lambda f: -f[2])
