"""Every public name has its page, and nearly every public class an executed example and a source.

Public is what a package lists in ``__all__``. So that no class that a user holds in his hands is left out of it,
the list is held against two others: the types that public signatures and fields name, and what the pages import.
"""

from __future__ import annotations

import ast
import functools
import importlib
import inspect
import re
import sys
import typing
from pathlib import Path

import pytest

from whsklearn.effects import Effect

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "docs"))
reference = pytest.importorskip("reference")

OBJECTS = {
    f"{p}.{n}": o for p, names in reference.public().items() for n, o in names.items() if reference.is_documented(o)
}
CLASSES = {name: o for name, o in OBJECTS.items() if inspect.isclass(o)}
FUNCTIONS = {name: o for name, o in OBJECTS.items() if not inspect.isclass(o)}
SHARE = 0.95


def has_example(item) -> bool:
    """Lines that the tests run, besides imports."""
    lines = re.findall(r"^ *>>> (.*)$", item.__doc__ or "", re.MULTILINE)
    return any("+SKIP" not in line and not line.startswith(("import ", "from ")) for line in lines)


def has_source(item) -> bool:
    """A section of literature, or what an effect names as its source."""
    return "References\n" in (item.__doc__ or "") or bool(getattr(item, "reference", ""))


def test_every_public_name_is_in_the_index() -> None:
    page = reference.reference_page()
    missing = [name for name in OBJECTS if not re.search(rf"^   {name.rpartition('.')[2]}$", page, re.MULTILINE)]
    assert missing == []
    assert {"GapFinder", "load_log", "RMILSRegressor", "Cogging"} <= {name.rpartition(".")[2] for name in OBJECTS}


@pytest.mark.parametrize("has", [has_example, has_source])
def test_classes_with_an_example_and_a_source(has) -> None:
    lacking = [name for name, cls in CLASSES.items() if not has(cls)]
    assert len(lacking) <= (1 - SHARE) * len(CLASSES), lacking


def test_functions_with_an_example() -> None:
    lacking = [name for name, f in FUNCTIONS.items() if not has_example(f)]
    assert len(lacking) <= (1 - SHARE) * len(FUNCTIONS), lacking


def test_fields_have_a_section() -> None:
    """Effects say theirs by their quantities, and an error has a message only."""
    sections = re.compile("^ *(Parameters|Attributes)\n", re.MULTILINE)
    classes = {name: cls.__doc__ or "" for name, cls in CLASSES.items() if not issubclass(cls, (Effect, Exception))}
    assert [name for name, text in classes.items() if not sections.search(text)] == []


def test_every_argument_is_named_where_it_is_described() -> None:
    """In a section of its own, or in a sentence that marks it as code."""
    lacking, count = [], 0
    for name, routine in routines().items():
        text = inspect.getdoc(routine) or ""
        for argument in inspect.signature(routine).parameters:
            if argument not in ("self", "cls"):
                count += 1
                section = rf"^[\w*, ]*\b{argument}\b[\w*, ]*( : |\n    )"
                if not re.search(rf"`\*{{0,2}}{argument}`|{section}", text, re.MULTILINE):
                    lacking.append(f"{name}: {argument}")
    assert count > 400
    assert lacking == []


def test_every_public_object_is_described() -> None:
    assert [name for name, o in OBJECTS.items() if not inspect.getdoc(o)] == []


def test_public_methods_are_described() -> None:
    lacking = [
        f"{name}.{n}"
        for name, cls in CLASSES.items()
        for n, member in vars(cls).items()
        if not n.startswith("_") and (inspect.isroutine(member) or isinstance(member, property))
        if not inspect.getdoc(member)
    ]
    assert lacking == []


@functools.cache
def names_of(module: str) -> dict[str, object]:
    """What annotations of a module may name, with what it imports for them only."""
    names = dict(vars(typing)) | dict(vars(sys.modules[module]))
    for node in ast.parse(inspect.getsource(sys.modules[module])).body:
        if isinstance(node, ast.If) and "TYPE_CHECKING" in ast.dump(node.test):
            exec(compile(ast.Module(node.body, []), module, "exec"), names)
    return names


def annotations_of(item) -> dict[str, object]:
    """Annotations of a class or a function."""
    names = names_of(item.__module__)
    if not inspect.isclass(item):
        return typing.get_type_hints(item, names)
    own = inspect.get_annotations(item)  # fields; inherited ones are looked at where they stand
    texts = {name: getattr(hint, "__forward_arg__", hint) for name, hint in own.items() if not name.startswith("_")}
    return {name: eval(text, names) for name, text in texts.items() if "ClassVar" not in text}


def classes_in(hint) -> set[type]:
    """Our own classes that an annotation names."""
    inner = {c for part in typing.get_args(hint) for c in classes_in(part)}
    return inner | ({hint} if inspect.isclass(hint) and hint.__module__.startswith("whsklearn.") else set())


def routines() -> dict[str, object]:
    """Public functions, and the public methods and properties of public classes, by name."""
    found = dict(FUNCTIONS)
    for name, cls in CLASSES.items():
        for n, member in vars(cls).items():
            plain = member.fget if isinstance(member, property) else getattr(member, "__func__", member)
            if not n.startswith("_") and inspect.isfunction(plain):
                found[f"{name}.{n}"] = plain
    return found


def test_what_public_signatures_and_fields_name_is_public() -> None:
    public = list(CLASSES.values())
    items = routines() | CLASSES
    assert len(items) > 300
    lacking = {
        f"{name}: {cls.__module__}.{cls.__qualname__}"
        for name, item in items.items()
        for hint in annotations_of(item).values()
        for cls in classes_in(hint)
        if cls not in public
    }
    assert lacking == set()


def test_what_the_pages_import_is_public() -> None:
    public = [id(o) for names in reference.public().values() for o in names.values()]
    docs = ROOT / "docs"
    lacking = []
    for page in [ROOT / "README.md", *docs.glob("*.md"), *docs.glob("examples/*.py")]:
        for module, names in re.findall(r"from (whsklearn[\w.]*) import (\([^)]*\)|[^\n(]+)", page.read_text("utf-8")):
            for name in re.findall(r"\w+", names.partition("#")[0]):
                item = getattr(importlib.import_module(module), name)
                home = module == "whsklearn" or module in reference.packages()
                if not inspect.ismodule(item) and not (home and id(item) in public):
                    lacking.append(f"{page.name}: {module}.{name}")
    assert lacking == []


def test_every_effect_says_all_that_a_reader_asks() -> None:
    """Equation, signature, what the record must hold, source, example, and the neighbours it is mistaken for."""
    catalogue = pytest.importorskip("catalogue")
    effects = [c for c in catalogue.catalogued() if c.__module__.startswith("whsklearn.")]
    assert set(effects) == {c for c in CLASSES.values() if issubclass(c, Effect) and c.name}
    assert len(effects) >= 41
    for cls in effects:
        said = {"equation": cls.equation, "signature": cls.signature, "needs": cls.needs}
        said |= {"source": has_source(cls), "example": has_example(cls)}
        assert [what for what, is_said in said.items() if not is_said] == [], cls.__name__
        neighbours = re.findall(r"^    (\w+) : ", (cls.__doc__ or "").partition("See Also")[2], re.MULTILINE)
        assert neighbours, cls.__name__
        assert all(n in catalogue.whsklearn.effects.__all__ and n != cls.__name__ for n in neighbours), cls.__name__
