"""One effect of the catalogue in one variant of its text fields, with its numbers in the order of a fit."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

from whsklearn.effects import Effect


@dataclass(frozen=True)
class EffectVariant:
    """What a plant tries as one name; its numbers are the linear ones, then those of its shape.

    Attributes
    ----------
    cls : type
        The library's effect.
    choice : tuple of (str, str)
        Its text fields, the port among them.
    """

    cls: type[Effect]
    choice: tuple[tuple[str, str], ...] = ()

    @property
    def name(self) -> str:
        """Canonical name."""
        return self.cls.name

    @cached_property
    def options(self) -> dict[str, str]:
        """The text fields."""
        return dict(self.choice)

    @cached_property
    def code(self) -> int:
        """Its code in the compiled kernels."""
        return int(self.cls(**self.options).code)

    @cached_property
    def linear(self) -> int:
        """Number of leading parameters in which it is linear: 1, 2 (cosine and sine), or 0 if its size is a shape."""
        return self.cls.linear()

    @cached_property
    def fields(self) -> tuple[str, ...]:
        """Names of the numbers, linear ones first."""
        first = {0: (), 1: (self.cls.size,), 2: ("cosine", "sine")}[self.linear]
        return (*first, *self.cls.searched())

    @cached_property
    def scanned(self) -> str:
        """Which fine grid finds the one number that starts would miss: ``position``, ``time``, ``step``, or empty."""
        field = self.cls.scanned()
        return self.cls.quantities[field].scan if field else ""

    def effect(self, q: Any) -> Any:
        """The library's effect with these numbers."""
        return self.cls.from_row(q, **self.options)
