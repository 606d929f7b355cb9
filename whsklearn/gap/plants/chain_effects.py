"""From fitted numbers to the catalogue's effects, with standard errors."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from whsklearn.gap.plants.chain_candidates import BETWEEN, effect_of

if TYPE_CHECKING:
    from whsklearn.gap.plants.chain_model import Term


@dataclass(frozen=True)
class FoundEffect:
    """An effect of a u-y record: catalogue name, place, equation and numbers in the units of the log."""

    name: str
    place: str
    equation: str
    parameters: dict[str, float]

    def labelled(self) -> dict[str, float]:
        """The numbers by name; a u-y record has no units of its own."""
        return dict(self.parameters)


def found_effect(term: Term) -> FoundEffect:
    """What a report says of a fitted effect."""
    from whsklearn.effects import get_effect

    equation, named = effect_of(term.kind, term.q)
    named.update(term.kind.options)  # type: ignore[arg-type]
    place = "law" if term.kind.variant == BETWEEN else get_effect(term.kind.name).place
    return FoundEffect(term.kind.name, place, equation.replace("u", "x") if place == "law" else equation, named)


def library_effect(term: Term) -> Any:
    """The catalogue's own effect, or None where a chain has it in another form."""
    from whsklearn.effects import get_effect

    _, named = effect_of(term.kind, term.q)
    if term.kind.name == "flexible_coupling" or term.kind.variant in ("at the input", BETWEEN):
        return None
    fields = get_effect(term.kind.name).__dataclass_fields__  # type: ignore[attr-defined]
    return get_effect(term.kind.name)(**{k: v for k, v in named.items() if k in fields}, **term.kind.options)
