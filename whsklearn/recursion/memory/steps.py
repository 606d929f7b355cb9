"""Work in pieces: a generator that yields wherever the next sample may interrupt it, and returns its result."""

from __future__ import annotations

from collections.abc import Generator
from typing import TypeVar

Answer = TypeVar("Answer")


def in_one(steps: Generator[None, None, Answer]) -> Answer:
    """Do all pieces at once and return the result."""
    while True:
        try:
            next(steps)
        except StopIteration as end:
            return end.value
