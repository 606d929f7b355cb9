"""The contract that every effect keeps."""

from __future__ import annotations


class EffectContractError(ValueError):
    """An effect does not keep its contract."""


def check_effect(effect):
    """Placeholder until the simulator is there."""
    raise NotImplementedError
