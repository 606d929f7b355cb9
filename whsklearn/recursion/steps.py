"""Work in pieces: a generator that yields wherever the next sample may come first, and returns what it found."""

from __future__ import annotations

from typing import TYPE_CHECKING, TypeVar

if TYPE_CHECKING:
    from collections.abc import Generator

Answer = TypeVar("Answer")


def in_one(steps: Generator[None, None, Answer]) -> Answer:
    """What the pieces come to, all done at once."""
    while True:
        try:
            next(steps)
        except StopIteration as end:
            return end.value
