"""Links of the pages lead somewhere, pages are reachable, and the commands that they show exist with their options."""

from __future__ import annotations

import importlib
import re
import shlex
import tomllib
from pathlib import Path

import click
import pytest

from whsklearn.cli import main

ROOT = Path(__file__).resolve().parents[2]
DOCS = ROOT / "docs"
PAGES = sorted([*ROOT.glob("*.md"), *DOCS.glob("*.md")])
LINK = re.compile(r"\[[^\]]*\]\(([^)\s]+)\)")
FENCED = re.compile(r"^```(\w*)\n(.*?)^```", re.DOTALL | re.MULTILINE)


def anchors(page: Path) -> set[str]:
    """Anchors of a page's headings, as GitHub and MyST make them."""
    heads = re.findall(r"^#+ (.+)$", FENCED.sub("", page.read_text(encoding="utf-8")), re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", h.lower()).strip().replace(" ", "-") for h in heads}


def target_of(page: Path, link: str) -> Path:
    """The file that a relative link means; a page of the gallery is made of its script."""
    path = (page.parent / link).resolve()
    if path.parent == DOCS / "auto_examples":
        return DOCS / "examples" / f"{path.name.removesuffix('.rst')}.py" if path.name != "index" else DOCS / "examples"
    if path.parent == DOCS / "api" / "generated":
        package, _, item = path.name.rpartition(".")
        return DOCS / "reference.py" if item in getattr(importlib.import_module(package), "__all__", ()) else path
    if path.parent.parent == DOCS and path.parent.name == "api":
        return DOCS / "reference.py"  # which writes the section
    return path


@pytest.mark.parametrize("page", PAGES, ids=lambda p: p.stem)
def test_relative_links_lead_to_files_and_headings(page: Path) -> None:
    for link in LINK.findall(FENCED.sub("", page.read_text(encoding="utf-8"))):
        if link.startswith(("http://", "https://", "mailto:")):
            continue
        name, _, anchor = link.partition("#")
        path = target_of(page, name) if name else page
        assert path.exists(), f"{page.name}: {link} leads nowhere"
        if anchor and path.suffix == ".md":
            assert anchor in anchors(path), f"{page.name}: {link} names a heading that is not there"


def contents_of(page: str) -> set[str]:
    """Pages below one in the tree of contents, itself included."""
    trees = re.findall(
        r"^```\{toctree\}\n(.*?)^```", (DOCS / f"{page}.md").read_text("utf-8"), re.DOTALL | re.MULTILINE
    )
    below = [n for tree in trees for n in re.findall(r"^([\w/]+)$", tree, re.MULTILINE)]
    return {page}.union(*(contents_of(n) if (DOCS / f"{n}.md").exists() else {n} for n in below))


def test_every_page_is_reached_from_the_index() -> None:
    assert {p.stem for p in DOCS.glob("*.md")} <= contents_of("index")


def typed(page: Path) -> list[str]:
    """What a reader of a page types: lines of its blocks, and what stands between single back quotes."""
    text = page.read_text(encoding="utf-8")
    blocks = [block for language, block in FENCED.findall(text) if language in ("", "console", "bash", "sh")]
    lines = [line.strip() for block in blocks for line in block.replace("\\\n", " ").splitlines()]
    return lines + [" ".join(code.split()) for code in re.findall(r"(?<!`)`([^`]+)`(?!`)", FENCED.sub("", text))]


def commands() -> list[tuple[str, str]]:
    """Every line of the pages that calls whsklearn."""
    return [(p.name, line) for p in PAGES for line in typed(p) if re.search(r"(^|\| )whsklearn [a-z]+( |$)", line)]


def test_commands_of_the_pages_exist_with_their_options() -> None:
    context = click.Context(main, info_name="whsklearn")
    lines = commands()
    assert len(lines) > 40
    for page, line in lines:
        words = shlex.split(line.partition("whsklearn ")[2], comments=True)
        name, *rest = words
        command = main.get_command(context, name)
        assert command is not None, f"{page}: {line}"
        known = {o for p in command.params for o in (*p.opts, *p.secondary_opts)} | {"--help"}
        unknown = [w for w in rest if re.fullmatch(r"--?[a-zA-Z][\w-]*", w) and w not in known]
        assert not unknown, f"{page}: {line}: {unknown}"


def test_scripts_that_the_pages_name_are_there() -> None:
    for page in PAGES:
        text = page.read_text(encoding="utf-8")
        for name in set(re.findall(r"\b((?:benchmarks|docs|pipelines|tests)/[\w/]+\.(?:py|md))\b", text)):
            assert (ROOT / name).exists(), f"{page.name}: {name}"
        for name in set(re.findall(r"python -m ((?:benchmarks|pipelines)\.\w+)", text)):
            if name != "pipelines.NAME":
                assert (ROOT / f"{name.replace('.', '/')}.py").exists(), f"{page.name}: {name}"


def test_scripts_know_the_options_that_the_pages_give_them() -> None:
    """By the text of the script: importing all of them would take the peers that they measure."""
    calls = [
        (p.name, line) for p in PAGES for line in typed(p) if re.match(r"python (-m )?(benchmarks|pipelines)", line)
    ]
    assert len(calls) > 25
    for page, line in calls:
        words = shlex.split(line, comments=True)[1:]
        name, *rest = words[1:] if words[0] == "-m" else words
        if name == "pipelines.NAME":
            continue
        script = ROOT / (name if name.endswith(".py") else f"{name.replace('.', '/')}.py")
        source = script.read_text(encoding="utf-8")
        if "from whsklearn.cli" in source:  # a thin module over a command
            continue
        unknown = [w for w in rest if w.startswith("--") and f'"{w}"' not in source and f'"{w}/' not in source]
        assert not unknown, f"{page}: {line}: {unknown}"


def test_links_to_other_sites_have_the_shape_of_links() -> None:
    """No test needs a network, so that is all that can be said of them."""
    texts = {p: p.read_text(encoding="utf-8") for p in (*PAGES, *ROOT.glob("whsklearn/**/*.py"))}
    urls = [(p.name, u) for p, t in texts.items() for u in re.findall(r"https?://[^\s)\"'`>]+", FENCED.sub("", t))]
    dois = [(p.name, d) for p, t in texts.items() for d in re.findall(r"\bdoi(?:\.org/|:? )(\S+?)[\").,]*(?:\s|$)", t)]
    assert len(urls) > 15
    assert len(dois) > 1
    local = ("http://127.0.0.1", "https://...")
    wrong = [
        (p, u)
        for p, u in urls
        if not u.startswith(local) and not re.fullmatch(r"https?://[\w-]+(\.[\w-]+)+(/[\w.~%#?=&+{}-]*)*[.:]?", u)
    ]
    assert wrong == []
    assert [(p, d) for p, d in dois if not re.fullmatch(r"10\.\d{4,9}/[\w.()/-]+", d)] == []


def test_the_table_of_extras_is_that_of_the_package():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    table = (DOCS / "first_hour.md").read_text(encoding="utf-8").split("| extra |")[1].split("\n\n")[0]
    listed = re.findall(r"^\| `(\w+)` \|", table, re.MULTILINE)
    assert sorted(listed) == sorted(set(project["optional-dependencies"]) - {"bench", "dev", "docs"})
