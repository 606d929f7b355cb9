"""What the house promises (docs/design.md): tests beside their modules, small functions, each equation once, examples.

Directions of imports and circles are held by import-linter (`make lint`); here only that no package escapes it.
`python -m benchmarks.house` prints the figures.
"""

from __future__ import annotations

import ast
import copy
import functools
import re
import tomllib
from collections.abc import Iterator
from pathlib import Path

import pytest

from benchmarks import house

ROOT = Path(__file__).resolve().parents[1]
FUNCTIONS = ast.FunctionDef | ast.AsyncFunctionDef


@functools.cache
def trees() -> dict[Path, ast.Module]:
    """Syntax trees of all modules by their paths within the library."""
    paths = sorted((ROOT / "whsklearn").rglob("*.py"))
    return {p.relative_to(ROOT / "whsklearn"): house.tree(p) for p in paths}


@functools.cache
def modules() -> dict[Path, ast.Module]:
    """Those that hold code."""
    return {p: t for p, t in trees().items() if any(isinstance(node, FUNCTIONS | ast.ClassDef) for node in t.body)}


def home(module: Path) -> Path:
    """Where the tests of a module stand: the same folder below tests/, the same name."""
    return ROOT / "tests" / module.parent / f"test_{module.stem.strip('_')}.py"


def test_modules_have_their_tests_where_their_names_say():
    missing = [str(m) for m in modules() if not home(m).is_file()]
    assert len(missing) < 0.15 * len(modules()), missing


def test_every_package_has_its_place_among_the_layers():
    rules = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["tool"]["importlinter"]["contracts"]
    layers = next(c["layers"] for c in rules if c["type"] == "layers")
    known = {name.strip("() ") for line in layers for name in line.split(":")}
    tops = {p.parts[0].removesuffix(".py") for p in trees()} - {"__init__", "__main__", "_numba"}
    assert tops <= known, tops - known
    assert known <= tops, known - tops


# --- functions -------------------------------------------------------------------------------------------------
@functools.cache
def functions(tree: ast.Module) -> list[tuple[ast.FunctionDef | ast.AsyncFunctionDef, str]]:
    """(function, its decorators) of a module; what holds the options of a command or types does not count."""
    return [(node, " ".join(map(ast.unparse, node.decorator_list))) for node in house.functions(tree)]


def lines(node: ast.FunctionDef | ast.AsyncFunctionDef) -> int:
    """Lines of a function but for its docstring."""
    told = ast.get_docstring(node, clean=False)
    return (node.end_lineno or node.lineno) - node.lineno + 1 - (len(told.splitlines()) if told else 0)


def test_few_functions_take_more_than_six_arguments():
    every = [(str(m), f.name, house.arguments(f)) for m, tree in modules().items() for f, _ in functions(tree)]
    many = [f for f in every if f[2] > 6]
    assert len(many) < 0.03 * len(every), sorted(many, key=lambda f: -f[2])


def test_no_compiled_function_takes_more_than_twelve_arguments():
    compiled = ("njit", "part", "_equation", "_inlined")
    every = [
        (str(m), f.name, house.arguments(f))
        for m, tree in modules().items()
        for f, decorators in functions(tree)
        if any(word in decorators for word in compiled)
    ]
    assert len(every) > 150
    assert [f for f in every if f[2] > 12] == []


def test_no_kernel_that_python_calls_returns_a_tuple():
    """Numba boxes the arrays of one in Python, and a Ctrl-C that arrives there becomes a SystemError (numba 0.68).

    A single array is boxed in a way that lets it pass.
    """
    kernels = [
        (m, f)
        for m, tree in modules().items()
        for f, words in functions(tree)
        if "njit" in words and "cache=False" not in words
    ]
    assert len(kernels) > 30
    returned = [
        (str(m), f.name)
        for m, f in kernels
        for n in ast.walk(f)
        if isinstance(n, ast.Return) and isinstance(n.value, ast.Tuple)
    ]
    assert returned == []


def test_no_function_is_longer_than_a_page():
    every = [(str(m), f.name, lines(f)) for m, tree in modules().items() for f, _ in functions(tree)]
    assert [f for f in every if f[2] > 80] == []


# --- each equation once ------------------------------------------------------------------------------------------
OPERATIONS = ast.BinOp | ast.Call | ast.UnaryOp | ast.Compare | ast.IfExp
TELLING = 4  # operations of an expression; one of fewer, c (q - q_0), stands for many things
ELSEWHERE = ("effects/quantity.py",)  # J w^2 is the definition of a stiffness


class Renamed(ast.NodeTransformer):
    """Names in the order in which they are met, so that the same formula in other letters is the same."""

    def __init__(self):
        self.names: dict[str, str] = {}

    def generic_name(self, node: ast.AST) -> ast.Name:
        return ast.Name(self.names.setdefault(ast.dump(node), f"v{len(self.names)}"), ast.Load())

    visit_Name = visit_Subscript = generic_name

    def visit_Attribute(self, node: ast.Attribute) -> ast.Name:
        function = isinstance(node.value, ast.Name) and node.value.id in ("np", "math")
        return ast.Name(node.attr, ast.Load()) if function else self.generic_name(node)


def operations(node: ast.AST) -> tuple[str, ...]:
    """The kinds of operations of an expression; what is within an index or an attribute is a letter."""
    inside = () if isinstance(node, ast.Subscript | ast.Attribute) else ast.iter_child_nodes(node)
    own = (type(node).__name__,) if isinstance(node, OPERATIONS) else ()
    return sum(map(operations, inside), own)


def formula(node: ast.expr) -> str:
    """An expression without its letters; empty if it is too short to be told from others."""
    if sum(isinstance(n, OPERATIONS) for n in ast.walk(node)) < TELLING:
        return ""
    return ast.dump(Renamed().visit(copy.deepcopy(node)))


@functools.cache
def equations() -> dict[tuple[str, ...], dict[str, tuple[Path, int]]]:
    """Operations -> formula -> where it stands, of what the effects' equations return."""
    found: dict[tuple[str, ...], dict[str, tuple[Path, int]]] = {}
    for path, tree in trees().items():
        for f, decorators in functions(tree) if path.parts[0] == "effects" else ():
            for node in ast.walk(f) if "_equation" in decorators else ():
                if isinstance(node, ast.Return | ast.Assign) and node.value is not None and formula(node.value):
                    found.setdefault(operations(node.value), {})[formula(node.value)] = path, node.value.lineno
    return found


def test_each_equation_of_an_effect_stands_once():
    assert sum(map(len, equations().values())) > 20
    again = []
    for path, tree in trees().items():
        for node in ast.walk(tree):
            sliced = any(isinstance(n, ast.Slice) for n in getattr(node, "elts", ()))
            if isinstance(node, OPERATIONS | ast.Tuple) and not sliced and (alike := equations().get(operations(node))):
                place = alike.get(formula(node))
                if place not in (None, (path, node.lineno)) and path.as_posix() not in ELSEWHERE:
                    again.append((str(path), node.lineno, ast.unparse(node)))
    assert again == []


@pytest.mark.parametrize(
    ("one", "other", "same"),
    [
        ("side * k * max(d + tau * side * v, 0.0)", "s * stiffness * max(x + t * s * w, 0.0)", True),
        ("side * k * max(d + tau * side * v, 0.0)", "s * stiffness * max(x + t * w * w, 0.0)", False),
        ("a * np.exp(-b * x) + c", "a[0] * np.exp(-a[1] * p.q) + p.r", True),
    ],
)
def test_a_formula_is_the_same_in_other_letters(one, other, same):
    a, b = (formula(ast.parse(text, mode="eval").body) for text in (one, other))
    assert a
    assert (a == b) is same


# --- public classes -------------------------------------------------------------------------------------------------
def public_classes() -> Iterator[tuple[str, str]]:
    """(module.class, docstring) of every class that a package's ``__all__`` names."""
    named = {
        e.value
        for path, tree in trees().items()
        if path.name == "__init__.py"
        for node in tree.body
        if isinstance(node, ast.Assign) and getattr(node.targets[0], "id", "") == "__all__"
        for e in getattr(node.value, "elts", ())
        if isinstance(e, ast.Constant)
    }
    for path, tree in trees().items():
        for node in tree.body:
            if isinstance(node, ast.ClassDef) and node.name in named and "_" not in {p[0] for p in path.parts[:-1]}:
                yield f"{path}:{node.name}", ast.get_docstring(node) or ""


INTERNAL = (  # of the same name as a public class of another package
    "gap/plants/servo_model.py:ServoHypothesis gap/plant.py:View gap/plant.py:Plant "
    "gap/plants/chain_model.py:ChainHypothesis gap/plants/servo_learned.py:CurveProblem "
    "gap/plants/simulator_look.py:FollowedMotion recursion/rows/pseudolinear.py:Published "
    "recursion/memory/settings.py:Settings recursion/memory/sign_posterior.py:SignProblem "
    "systems/_servo_kernel.py:How"
).split()


def test_every_public_class_has_an_example_that_runs():
    classes = dict(public_classes())
    assert len(classes) > 100
    assert [name for name, told in classes.items() if ">>>" not in told and name not in INTERNAL] == []


# --- the page of the design -------------------------------------------------------------------------------------------
NEAR = 0.04  # the page need not follow every change


def test_the_design_page_states_the_figures_that_the_benchmark_prints():
    page = (ROOT / "docs" / "design.md").read_text(encoding="utf-8")
    modules, classes, *_ = house.named_numbers(house.LIBRARY / "gap")
    rooms, drawn = house.arrows(house.LIBRARY)
    (constants,) = re.findall(r"of which there are about (\d+) ", page)
    assert int(constants) == pytest.approx(modules + classes, rel=NEAR)
    ((told, most),) = re.findall(r"^\| packages, imports between them \| (\d+), (\d+) \|", page, re.MULTILINE)
    assert len(rooms) == int(told)
    assert len(drawn) <= int(most) <= 110
    stated = re.findall(r"^\| (`\w+`(?:, `\w+`)*)[^|]* \| ([\d,]+) \| ([\d,]+) \|$", page, re.MULTILINE)
    stated = {tuple(re.findall(r"\w+", names)): counts for names, *counts in stated}
    stated[("",)] = re.search(r"([\d,]+) in total, ([\d,]+) of code", page).groups()
    assert {n for names in stated for n in names if n} == {p.parent.name for p in house.LIBRARY.glob("*/__init__.py")}
    for names, counts in stated.items():
        every = [house.lines_of(house.LIBRARY / name)[:2] for name in names]
        for told, is_now in zip(counts, map(sum, zip(*every, strict=True)), strict=True):
            assert int(told.replace(",", "")) == pytest.approx(is_now, rel=NEAR, abs=100), names


def test_benchmarks_import_each_other_from_their_package():
    # A bare import of a file beside it works as a script only, not as `python -m benchmarks.X`
    bare = [
        f"{p.name}: {line}"
        for p in sorted((ROOT / "benchmarks").rglob("*.py"))
        for line in re.findall(r"^(?:from|import) _[a-z]\w*.*$", p.read_text(), flags=re.MULTILINE)
    ]
    assert not bare, f"write 'from benchmarks._x import y': {bare}"
