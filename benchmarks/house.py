"""The figures of the house: how long modules and functions are, what is documented, what is tested by name.

    python -m benchmarks.house [--of FOLDER]

Read off the syntax trees of ``whsklearn/``, or of another package's folder by the same counter; nothing is imported,
and folders of tests are passed over. A module is one that holds a class or a function; its
tests stand in the file of its name below ``tests/``. A function's lines are all of it, docstring included. A public
class is one that a package's ``__all__`` names, each module's own class of such a name counted.

A *named number* is a name that a module or a class body binds to a value with a number in it: a literal, a sum or
product with one, a tuple, dictionary or call that holds one. Each name counts once, however many numbers it holds.
Numeric defaults of parameters are counted apart; those of 0 and 1 are not. A field of a dataclass or a named tuple that
is 0 or 1 by default is such a parameter, and is counted apart too.

A *room* is a package or a module directly below the folder; an *arrow* is that one room imports from another, at
its head, within a function or for types only, however often. The folder's own ``__init__`` and ``__main__``, which
offer what the rooms hold, are no rooms. That arrows point down and no module stands in a circle is import-linter's
affair (``make lint``).
"""

from __future__ import annotations

import ast
import functools
import io
import statistics
import tokenize
from collections.abc import Iterator
from pathlib import Path

import click

ROOT = Path(__file__).resolve().parents[1]
LIBRARY = ROOT / "whsklearn"
FUNCTIONS = ast.FunctionDef | ast.AsyncFunctionDef
NOTHING = ("0", "1", "0.0", "1.0")


def sources(folder: Path) -> list[Path]:
    """Files of a package, without its tests."""
    return [p for p in sorted(folder.rglob("*.py")) if "tests" not in p.relative_to(folder).parts]


@functools.cache
def tree(path: Path) -> ast.Module:
    """The syntax tree of a file, which several figures are read from."""
    return ast.parse(path.read_text(encoding="utf-8"))


@functools.cache
def nodes(path: Path) -> tuple[ast.AST, ...]:
    """All nodes of that tree; to walk it takes as long as to read it."""
    return tuple(ast.walk(tree(path)))


def trees(folder: Path) -> dict[Path, ast.Module]:
    """Syntax trees of the modules of a folder that hold code."""
    every = {p: tree(p) for p in sources(folder)}
    return {p: t for p, t in every.items() if any(isinstance(n, FUNCTIONS | ast.ClassDef) for n in t.body)}


def functions(tree: ast.Module) -> Iterator[ast.FunctionDef | ast.AsyncFunctionDef]:
    """All but commands with options and stubs of types."""
    for node in ast.walk(tree):
        if isinstance(node, FUNCTIONS):
            decorators = " ".join(map(ast.unparse, node.decorator_list))
            if "click.option" not in decorators and "overload" not in decorators:
                yield node


def arguments(node: ast.FunctionDef | ast.AsyncFunctionDef) -> int:
    """How many arguments a call may give."""
    names = [a.arg for a in (*node.args.posonlyargs, *node.args.args, *node.args.kwonlyargs)]
    names += [a.arg for a in (node.args.vararg, node.args.kwarg) if a]
    return len(names) - (names[:1] in (["self"], ["cls"]))


@functools.cache
def kinds_of_lines(path: Path) -> tuple[int, int, int, int]:
    """(lines, of code, of docstrings, with a comment) of a file."""
    text = path.read_text(encoding="utf-8")
    docstrings: set[int] = set()
    for node in nodes(path):
        if isinstance(node, FUNCTIONS | ast.ClassDef | ast.Module) and ast.get_docstring(node, clean=False):
            docstrings |= set(range(node.body[0].lineno, (node.body[0].end_lineno or 0) + 1))
    code, comments = set(), set()
    for token in tokenize.generate_tokens(io.StringIO(text).readline):
        if token.type == tokenize.COMMENT:
            comments.add(token.start[0])
        elif token.type not in (tokenize.NL, tokenize.NEWLINE, tokenize.INDENT, tokenize.DEDENT, tokenize.ENDMARKER):
            code |= set(range(token.start[0], token.end[0] + 1))
    return len(text.splitlines()), len(code - docstrings), len(docstrings), len(comments)


def lines_of(folder: Path) -> tuple[int, int, int, int]:
    """(lines, of code, of docstrings, with a comment) of all files of a folder."""
    lines, code, told, comments = (sum(kind) for kind in zip(*map(kinds_of_lines, sources(folder)), strict=True))
    return lines, code, told, comments


def public_classes(folder: Path, found: dict[Path, ast.Module]) -> list[str]:
    """Docstrings of the classes that some package's ``__all__`` names."""
    names = set()
    for path in folder.rglob("__init__.py"):
        for node in tree(path).body:
            if isinstance(node, ast.Assign) and getattr(node.targets[0], "id", "") == "__all__":
                names |= {e.value for e in getattr(node.value, "elts", ()) if isinstance(e, ast.Constant)}
    classes = (n for t in found.values() for n in t.body if isinstance(n, ast.ClassDef) and n.name in names)
    return [ast.get_docstring(n) or "" for n in classes]


def numeric(node: ast.expr) -> bool:
    """Whether an expression holds a number: a literal, or a sum, container or call with one."""
    if isinstance(node, ast.Constant):
        return type(node.value) in (int, float)
    if isinstance(node, ast.UnaryOp):
        return numeric(node.operand)
    if isinstance(node, ast.BinOp):
        return numeric(node.left) or numeric(node.right)
    if isinstance(node, ast.Tuple | ast.List | ast.Set):
        return any(map(numeric, node.elts))
    if isinstance(node, ast.Dict):
        return any(map(numeric, node.values))
    return isinstance(node, ast.Call) and any(map(numeric, (*node.args, *(k.value for k in node.keywords))))


def bound(node: ast.stmt) -> Iterator[tuple[str, ast.expr]]:
    """(name, value) of an assignment; of a tuple's, one by one."""
    if isinstance(node, ast.AnnAssign) and node.value is not None:
        yield ast.unparse(node.target), node.value
    elif isinstance(node, ast.Assign):
        target = node.targets[0]
        if isinstance(target, ast.Tuple) and isinstance(node.value, ast.Tuple):
            yield from ((ast.unparse(t), v) for t, v in zip(target.elts, node.value.elts, strict=True))
        else:
            yield ast.unparse(target), node.value


def empty_field(node: ast.stmt) -> bool:
    """Whether a statement of a class body is a field that is 0 or 1 unless it is given."""
    return isinstance(node, ast.AnnAssign) and node.value is not None and ast.unparse(node.value) in NOTHING


def named_numbers(folder: Path) -> tuple[int, int, int, int]:
    """(names of modules, of class bodies, fields of 0 or 1, numeric defaults of parameters but 0 and 1) of a folder."""
    modules = classes = fields = defaults = 0
    for path in folder.rglob("*.py"):
        modules += sum(numeric(value) for node in tree(path).body for _, value in bound(node))
        for node in nodes(path):
            if isinstance(node, ast.ClassDef):
                classes += sum(numeric(v) for part in node.body if not empty_field(part) for _, v in bound(part))
                fields += sum(map(empty_field, node.body))
            elif isinstance(node, FUNCTIONS):
                given = (d for d in (*node.args.defaults, *node.args.kw_defaults) if d is not None and numeric(d))
                defaults += sum(ast.unparse(d) not in NOTHING for d in given)
    return modules, classes, fields, defaults


def imported(path: Path, folder: Path) -> Iterator[str]:
    """Modules of the package that a file imports, as paths below it with dots."""
    here = path.relative_to(folder.parent).parent.parts
    for node in nodes(path):
        if isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            base = ".".join(here[: len(here) - node.level + 1]) if node.level else ""
            names = [".".join(filter(None, (base, node.module, alias.name))) for alias in node.names]
        else:
            continue
        yield from (n.removeprefix(f"{folder.name}.") for n in names if n.startswith(f"{folder.name}."))


def arrows(folder: Path) -> tuple[set[str], set[tuple[str, str]]]:
    """Rooms of a package, and who imports from whom."""
    rooms = {p.relative_to(folder).parts[0].removesuffix(".py") for p in sources(folder)} - {"__init__", "__main__"}
    drawn = set()
    for path in sources(folder):
        room = path.relative_to(folder).parts[0].removesuffix(".py")
        drawn |= {(room, other) for name in imported(path, folder) if (other := name.split(".")[0]) != room}
    return rooms, {(a, b) for a, b in drawn if a in rooms and b in rooms}


def mirrored(path: Path) -> bool:
    """Whether the module's tests stand where its name says."""
    module = path.relative_to(LIBRARY)
    return (ROOT / "tests" / module.parent / f"test_{module.stem.strip('_')}.py").is_file()


def rows(folder: Path) -> Iterator[tuple[str, str]]:
    """(what, how much) of any package."""
    found = trees(folder)
    lengths = sorted(len(p.read_text(encoding="utf-8").splitlines()) for p in found)
    every = [f for t in found.values() for f in functions(t)]
    spans = sorted((f.end_lineno or f.lineno) - f.lineno + 1 for f in every)
    wide = sum(arguments(f) > 6 for f in every)
    _, code, told, comments = lines_of(folder)
    public = public_classes(folder, found)
    yield "modules", f"{len(found)}"
    yield "module lines, median / max", f"{statistics.median(lengths):.0f} / {lengths[-1]}"
    yield "functions", f"{len(every)}"
    p90 = spans[int(0.9 * len(spans))]
    yield "function lines, median / p90 / max", f"{statistics.median(spans):.0f} / {p90} / {spans[-1]}"
    yield "functions with more than 6 parameters", f"{100 * wide / len(every):.1f} % ({wide})"
    yield "most parameters of any function", f"{max(map(arguments, every))}"
    rooms, drawn = arrows(folder)
    yield "rooms, arrows between them", f"{len(rooms)}, {len(drawn)}"
    yield "comment lines per code line", f"{100 * comments / code:.1f} %"
    yield "docstring lines per code line", f"{100 * told / code:.0f} %"
    for what, mark in (("an executed example", ">>>"), ("a reference", "References\n")):
        share = sum(mark in doc for doc in public)
        yield f"public classes with {what}", f"{100 * share / max(1, len(public)):.0f} % ({share} of {len(public)})"


def own_rows() -> Iterator[tuple[str, str]]:
    """(what, how much) of this house alone."""
    found = trees(LIBRARY)
    share = sum(map(mirrored, found))
    yield "modules mirrored by a test", f"{100 * share / len(found):.0f} % ({share} of {len(found)})"
    packages = sorted(p.relative_to(ROOT).as_posix() for p in LIBRARY.iterdir() if (p / "__init__.py").is_file())
    for name in ("whsklearn", *packages):
        total, code, told, comments = lines_of(ROOT / name)
        yield f"lines of {name}/", f"{total}: {code} code, {told} docstrings, {comments} with a comment"
    gap = LIBRARY / "gap"
    lines = sorted(len(p.read_text(encoding="utf-8").splitlines()) for p in gap.rglob("*.py"))
    yield "files of whsklearn/gap/, longest", f"{len(lines)}, {lines[-1]} lines"
    modules, classes, fields, defaults = named_numbers(gap)
    told = f"{modules + classes} ({modules} of modules, {classes} of classes)"
    yield "named numbers of whsklearn/gap/", f"{told}; apart {fields} fields of 0 or 1, {defaults} defaults"


@click.command(help=__doc__)
@click.option("--of", "folder", type=click.Path(exists=True, file_okay=False, path_type=Path), default=None)
def main(folder: Path | None) -> None:
    for what, how_much in (*rows(folder or LIBRARY), *(() if folder else own_rows())):
        click.echo(f"{what:<42}{how_much}")


if __name__ == "__main__":
    main()
