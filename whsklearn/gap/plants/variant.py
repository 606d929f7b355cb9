"""One effect of the catalogue in one variant of its text fields: its numbers in the order of a fit, and its shapes."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any, Self

import numpy as np

from whsklearn.effects import Effect, Scales

N_INSTANTS = 25  # of a change, over the part of the record that can show it: a fit walks a step of that far
WAVE_STEP = 0.2 * np.pi  # rad of phase over half the travel between two waves that are tried: a tenth of a period


@dataclass(frozen=True)
class EffectVariant:
    """What a plant tries as one name; its numbers are the linear ones, then those of its shape."""

    cls: type[Effect]  # the library's effect
    choice: tuple[tuple[str, str], ...] = ()  # its text fields, the port among them

    @classmethod
    def of(cls, effect: type[Effect]) -> list[Self]:
        """Every variant of an effect."""
        return [cls(effect, tuple(options.items())) for options in effect.variants()]

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

    def ratios(self, i: int) -> bool:
        """Whether number ``i`` is varied by ratios."""
        if i < self.linear:
            return False
        q = self.cls.quantities[self.fields[i]]
        return q.log or q.low > 0.0 or bool(q.scan)

    def grid(self, scales: Scales, fastest: float) -> list[tuple[float, ...]]:
        """Shapes at which a look tries it in a record of these ``scales``; none if the residual's spectrum gives them.

        ``fastest``: highest frequency that a filter passes (Hz).
        """
        if self.scanned == "time":
            return []
        low, high = (self.cls.bounds(scales) or [(0.0, 0.0)])[0]
        if self.scanned == "position":
            most = min(high, 2 * np.pi * fastest / scales.speed)
            return [(float(o),) for o in np.arange(low, most, WAVE_STEP / scales.reach)]
        if self.scanned == "step":
            return [(float(t),) for t in np.linspace(low, high, N_INSTANTS)]
        return self.cls.starts(scales)

    def effect(self, q: Any) -> Any:
        """The library's effect with these numbers."""
        return self.cls.from_row(q, **self.options)
