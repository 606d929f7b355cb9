"""Logs in which every line labels its numbers, as printed by Arduino sketches: ``Time: 5001 Position: 595``."""

from __future__ import annotations

import re
from collections import Counter
from pathlib import Path

import numpy as np

from whsklearn.logs.errors import damaged
from whsklearn.logs.packed import DAMAGE, opened
from whsklearn.logs.source import Source
from whsklearn.logs.units import symbol_of

_PAIR = (
    r"([A-Za-z_\u00b5\u03bc][\w .\[\]()/\u00b0\u00b5\u03bc-]*?)\s*[:=]\s*([+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)"
)
_UNIT = r"(?:\s?([a-zA-Z%\u00b0\u00b5\u03bc]{1,5}(?:/s)?)(?=[,;\s|]|$)(?!\s*[:=]))?"  # a word before a colon is a name
_PAIRS = re.compile(_PAIR + _UNIT)
_LINE = re.compile(rf"(?:{_PAIR}{_UNIT}\s*[,;|]?\s*)+")
# The time of day that the serial monitor prints before each line, or log levels and stamps in brackets.
_MONITOR = re.compile(r"^\s*(?:[\d:.]+\s*->\s*|(?:\[[^\]]*\]:?\s*)+)")
_MOST = 0.8  # share of the first lines that label their numbers; the others are start-up messages of the sketch
_FEWEST = 3


def is_labelled(head: bytes) -> bool:
    r"""Whether the lines of a text label their numbers.

    >>> is_labelled(b"ready\nTime: 5001 Position: 595\nTime: 5011 Position: 597\nTime: 5021 Position: 601\n")
    True
    >>> is_labelled(b"Samples: 3\nDevice: rig 7\nt,q\n0,1\n1,2\n2,3\n")
    False
    """
    text = head.decode("utf-8", errors="replace")
    lines = [t for t in text[: text.rfind("\n") + 1].splitlines() if t.strip()][:50]
    labels = [_labels(t) for t in lines]
    usual, count = Counter(filter(None, labels)).most_common(1)[0] if any(labels) else ((), 0)
    return bool(usual) and count >= max(_FEWEST, _MOST * (len(lines) - 5))


def open_labelled(path: Path) -> Source:
    """A text of labelled numbers as a source of columns; lines with other labels are ignored.

    Raises LogError if it is damaged.
    """
    with damaged(path, "archive", *DAMAGE), opened(path) as file:
        lines = file.read().decode("utf-8-sig", errors="replace").splitlines()
    labels = [_labels(t) for t in lines]
    names = Counter(filter(None, labels)).most_common(1)[0][0]
    kept = [_PAIRS.findall(_MONITOR.sub("", t)) for t, n in zip(lines, labels, strict=True) if n == names]
    table = np.array([[float(v) for _, v, _ in row] for row in kept])
    units = {n: u for n, (_, _, word) in zip(names, kept[0], strict=True) if (u := symbol_of(word))}
    notes = [f"Each line labels its numbers: {', '.join(names)}."]
    left = sum(bool(t.strip()) for t in lines) - len(kept)
    if left:
        notes.append(f"{left} line(s) with other labels or none were ignored.")
    return Source.of_arrays(path.name, dict(zip(names, table.T, strict=True)), units=units, notes=notes)


def _labels(line: str) -> tuple[str, ...]:
    """The labels in a line of labelled numbers."""
    text = _MONITOR.sub("", line.strip())
    return tuple(n.strip() for n, _, _ in _PAIRS.findall(text)) if _LINE.fullmatch(text) else ()
