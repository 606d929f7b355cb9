"""What is exported: an axis or a chain with its units, from a file or an object."""

from __future__ import annotations

import os
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from whsklearn.effects import Effect
from whsklearn.export.chain_code import Chain
from whsklearn.systems.servo import ServoAxis
from whsklearn.systems.wiener_hammerstein import WienerHammersteinSystem


@dataclass(frozen=True)
class Exported:
    """A model ready for export.

    Attributes
    ----------
    axis : ServoAxis or None
    chain : Chain or None
        One of the two.
    units : dict of str to str
        Of ``input`` and ``output``; empty where unknown.
    chain_effects : tuple of Effect
        Effects of a chain, which no format holds.
    logged : str
        What the model answers with: position, velocity or output.
    """

    axis: ServoAxis | None = None
    chain: Chain | None = None
    units: dict[str, str] = field(default_factory=dict)
    chain_effects: tuple[Effect, ...] = ()
    logged: str = "position"

    @property
    def linear(self) -> bool:
        """Whether the axis moves along a line, by the unit of its position."""
        return self.units.get("output", "rad").split("/")[0] in ("m", "mm", "um")

    def need_axis(self, what: str) -> ServoAxis:
        """The axis, or a sentence why there is none."""
        if self.axis is None:
            raise ValueError(
                f"{what} describes a mechanical axis, and this model is a chain; export it to c, st or fmu."
            )
        return self.axis


def as_exported(model: Any) -> Exported:
    """Whatever holds a model: a file of `load_model`, a `ServoAxis`, a `WienerHammersteinSystem`, an identified model.

    Raises
    ------
    ValueError
        If it is none of them.
    """
    if isinstance(model, str | os.PathLike):
        from whsklearn.models import load_model

        model = load_model(model)
    if isinstance(model, Exported):
        return model
    if isinstance(model, ServoAxis):
        return Exported(axis=model, units={"input": "Nm", "output": "rad"})
    if isinstance(model, WienerHammersteinSystem):
        b1, f1, b2, f2 = model.polynomials
        return Exported(chain=Chain(b1, f1, model.law, b2, f2, model.dt), chain_effects=model.effects, logged="output")
    units, logged = dict(getattr(model, "units", {})), str(getattr(model, "logged", "output"))
    kind = getattr(model, "kind", "")
    if kind == "axis":
        return Exported(axis=model.system(), units=units, logged=logged)
    integrates = logged == "position"
    if kind == "wiener_hammerstein":
        blocks = [np.array(v, dtype=float) for v in (model.b1, model.f1, model.b2, model.f2)]
        chain = Chain(blocks[0], blocks[1], model.law, blocks[2], blocks[3], model.dt, integrates=integrates)
        return Exported(chain=chain, units=units, chain_effects=tuple(model.effects), logged=logged)
    if kind in ("arx", "output_error"):
        b, f, one = np.array(model.numerator, float), np.array(model.denominator, float), np.ones(1)
        return Exported(
            chain=Chain(b, f, None, one, one, model.dt, float(model.offset), integrates), units=units, logged=logged
        )
    raise ValueError(
        f"{type(model).__name__} cannot be exported; give a model file, a ServoAxis or a WienerHammersteinSystem."
    )
