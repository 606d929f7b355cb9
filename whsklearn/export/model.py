"""The model to export: an axis or a chain with its units, from a file or an object."""

from __future__ import annotations

import dataclasses
import os
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from whsklearn.effects import Effect
from whsklearn.export.chain_code import CodedChain
from whsklearn.export.losses import Loss
from whsklearn.logs.units import UNKNOWN, UNSTATED, factor_of, integral_of, respelled
from whsklearn.systems.servo import ServoAxis
from whsklearn.systems.wiener_hammerstein import WienerHammersteinSystem


@dataclass(frozen=True)
class Exported:
    """A model ready for export."""

    axis: ServoAxis | None = None
    chain: CodedChain | None = None  # one of the two
    # of the columns ``input`` and ``output`` of the generated code; empty if unknown. The numbers are in SI.
    units: dict[str, str] = field(default_factory=dict)
    logged: str = "position"  # the output of the model: position, velocity or output

    @property
    def factors(self) -> tuple[float, float]:
        """Factors that convert the columns of input and output to SI."""
        return factor_of(self.units.get("input", ""))[0], factor_of(self.units.get("output", ""))[0]

    @property
    def si(self) -> tuple[str, str]:
        """SI symbols of drive and motion, as robot descriptions use them; Nm and rad if the units are unknown."""
        drive, motion = (factor_of(self.units.get(k, ""))[1] for k in ("input", "output"))
        return drive or "Nm", motion.removesuffix("/s") or "rad"

    @property
    def position_unit(self) -> str:
        """The unit of a position beside the output: of a velocity in rpm, turns."""
        return integral_of(self.units.get("output", ""))[1]

    @property
    def steady_factors(self) -> tuple[float, float, float]:
        """Factors that convert the drive, a velocity and a position to SI."""
        return *self.factors, factor_of(self.position_unit)[0]

    def told(self, losses: list[Loss]) -> list[Loss]:
        """Losses with their sizes, so far in Nm and rad, in the SI symbols of this model; a phase is always an
        angle.
        """
        own = dict(zip(("Nm", "rad"), self.si, strict=True))

        def spelled(size: str) -> str:
            return ", ".join(p if p.startswith("phase") else respelled(p, own)[1] for p in size.split(", "))

        return [dataclasses.replace(loss, size=spelled(loss.size)) for loss in losses]

    def foreign(self) -> list[Loss]:
        """Units that a format in Nm or N and rad or m does not support: a current, counts, or an unknown unit."""
        out = []
        for what, column, symbol, wanted in (
            ("drive", "input", self.si[0], ("Nm", "N")),
            ("position", "output", self.si[1], ("rad", "m")),
        ):
            if not self.units.get(column):
                out.append(Loss(f"unit of the {what}", "not stated", f"taken to be {wanted[0]}, as in the format"))
            elif symbol not in wanted:
                how = "by the torque constant" if symbol == "A" else f"to {wanted[0]} for each {symbol}"
                out.append(
                    Loss(
                        f"unit of the {what}", symbol, f"the format is in {wanted[0]}: numbers that have it are in "
                        f"{symbol} here, and right for a {what} in {symbol} alone; scale them {how}",
                    )
                )  # fmt: skip
        return out

    @property
    def chain_effects(self) -> tuple[Effect, ...]:
        """Effects of a chain."""
        return self.chain.effects if self.chain is not None else ()

    @property
    def linear(self) -> bool:
        """Whether the axis moves along a line, by the unit of its position."""
        return self.si[1] == "m"

    def need_axis(self, what: str) -> ServoAxis:
        """The axis; raises with a reason if there is none."""
        if self.axis is None:
            raise ValueError(
                f"{what} describes a mechanical axis, and this model is a chain; export it to c, st or fmu."
            )
        return self.axis


def as_exported(model: Any) -> Exported:
    """Convert a model to `Exported`: a file for `load_model`, a `ServoAxis`, a `WienerHammersteinSystem`, an identified
    model.

    Raises ValueError if it is none of them.
    """
    if isinstance(model, str | os.PathLike):
        from whsklearn.models import load_model

        model = load_model(model)
    if isinstance(model, Exported):
        return model
    if isinstance(model, ServoAxis):
        return Exported(axis=model, units={"input": "Nm", "output": "rad"}, logged="position")
    if isinstance(model, WienerHammersteinSystem):
        b1, f1, b2, f2 = model.polynomials
        return Exported(chain=CodedChain(b1, f1, model.law, b2, f2, model.dt, effects=model.effects), logged="output")
    stated = dict(getattr(model, "units", {}))
    units = {k: stated[k] for k in ("input", "output") if stated.get(k, UNKNOWN) not in UNSTATED}
    logged = str(getattr(model, "logged", "output"))
    kind = getattr(model, "kind", "")
    if kind == "axis":
        return Exported(axis=model.system(), units=units, logged=logged)
    integrates = logged == "position"
    if kind == "wiener-hammerstein":
        blocks = [np.array(v, dtype=float) for v in (model.b1, model.f1, model.b2, model.f2)]
        effects = tuple(model.effects)
        chain = CodedChain(blocks[0], blocks[1], model.law, blocks[2], blocks[3], model.dt, 0.0, integrates, effects)
        return Exported(chain=chain, units=units, logged=logged)
    if kind in ("arx", "output_error"):
        b, f, one = np.array(model.numerator, float), np.array(model.denominator, float), np.ones(1)
        return Exported(
            chain=CodedChain(b, f, None, one, one, model.dt, float(model.offset), integrates),
            units=units,
            logged=logged,
        )
    raise ValueError(
        f"{type(model).__name__} cannot be exported; give a model file, a ServoAxis or a WienerHammersteinSystem."
    )
