"""The model to export: an axis or a chain with its units, from a file or an object.

What a format cannot represent is listed with its size, never dropped silently.
"""

from __future__ import annotations

import dataclasses
import json
import os
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from scipy.optimize import nnls

from whsklearn.effects import Coulomb, Effect, FrictionLaw, LearnedTorque, LoadSideViscous, SpeedHinge, Viscous
from whsklearn.effects.base import ArgumentError
from whsklearn.export.chain_code import CodedChain
from whsklearn.logs.current import AMPERES
from whsklearn.logs.files import atomic_write
from whsklearn.logs.units import UNKNOWN, UNSTATED, factor_of, integral_of, respelled
from whsklearn.systems.arm import BETWEEN, closed
from whsklearn.systems.servo import ServoAxis
from whsklearn.systems.wiener_hammerstein import WienerHammersteinSystem

# A fitted order is never whole.  Rounding by this much shifts a wave by 3.6 degrees per turn and leaves 4 % of it;
# orders that are fractional by construction, because of a gear, are further off.
NEARLY_WHOLE = 0.01
ROUNDED = "written with a whole order, so that it repeats every turn"


def of_a_whole_order(wave: Any) -> Any:
    """The effect with its order rounded; None if it has none, or a fractional one.

    >>> from whsklearn.effects import Cogging
    >>> of_a_whole_order(Cogging(0.1, 11.998)).order, of_a_whole_order(Cogging(0.1, 5.5))
    (12.0, None)
    """
    order = getattr(wave, "order", None)
    if order is None or abs(order - round(order)) > NEARLY_WHOLE:
        return None
    return wave if order == round(order) else dataclasses.replace(wave, order=float(round(order)))


@dataclass(frozen=True)
class Loss:
    """A part of the model that is not in the exported file.

    Attributes
    ----------
    name : str
        Of the effect or the part.
    size : str
        Its numbers with their units.
    reason : str
        Why it is missing, or what replaces it.

    References
    ----------
    MuJoCo XML reference, https://mujoco.readthedocs.io/en/stable/XMLreference.html: on what a joint can represent.

    Examples
    --------
    >>> from whsklearn.export import Loss
    >>> print(Loss("torque_ripple", "amplitude 0.02", "MuJoCo has nothing like it"))
    torque_ripple (amplitude 0.02): MuJoCo has nothing like it
    """

    name: str
    size: str
    reason: str

    def __str__(self) -> str:
        return f"{self.name} ({self.size}): {self.reason}"


def size_of(effect: Effect) -> str:
    """All numbers of an effect with their units."""
    parts = []
    for name, value in {effect.size: effect.magnitude, **effect.shape}.items():
        unit = effect.quantities[name].unit if name in effect.quantities else ""
        parts.append(f"{name} {value:.6g}{'' if unit in ('', '1') else ' ' + unit}")
    return ", ".join(parts)


def parts_of(axis: ServoAxis) -> list[Effect]:
    """The law's terms and the effects whose size is not neutral."""
    return [*axis.law.terms, *(e for e in axis.effects if e.magnitude != e.neutral)]


def rigid(axis: ServoAxis) -> ServoAxis:
    """The axis with its load on the motor: in steady motion the friction of the load is that of the motor.

    >>> from whsklearn.effects import Backlash
    >>> rigid(ServoAxis(law=[Coulomb(0.3)], effects=[Backlash(0.01, load_coulomb=0.2)])).law.terms
    (Coulomb(torque=0.3), Coulomb(torque=0.2))
    """
    behind = [e for e in axis.effects if isinstance(e, (*BETWEEN, LoadSideViscous))]
    rest = tuple(e for e in axis.effects if e not in behind)
    law: list[Any] = [*axis.law.terms, *closed(behind)]
    return dataclasses.replace(axis, law=FrictionLaw(law), effects=rest, transmission=None)


def with_held_law(axis: ServoAxis) -> tuple[ServoAxis, list[Loss]]:
    """The axis with damping and dry friction, as formats hold them, in place of a free law over speed; what that loses.

    The slope of such a law at standstill is negative where friction falls with speed, and damping that is negative
    drives a simulation away. The two are not negative and nearest to the curve up to its last kink.
    """
    curve = [t for t in axis.law.terms if isinstance(t, SpeedHinge | Viscous | Coulomb)]
    knots = [t.knot for t in curve if isinstance(t, SpeedHinge)]
    if not knots:
        return axis, []
    speeds = np.linspace(0.0, max(knots), 201)[1:]
    torques = FrictionLaw(curve)(0.0, speeds)
    (damping, dry), _ = nnls(np.column_stack([speeds, np.ones(speeds.size)]), torques)
    off = float(np.max(np.abs(torques - damping * speeds - dry)))
    size = f"{len(knots)} kinks up to {max(knots):.6g} rad/s, {off:.6g} Nm off at most"
    held = [Viscous(float(damping)), Coulomb(float(dry))]
    law = FrictionLaw([*held, *(t for t in axis.law.terms if t not in curve)])
    return dataclasses.replace(axis, law=law), [Loss("free law over speed", size, "held as the nearest two terms")]


def left_out(axis: ServoAxis, held: Callable[[Effect], bool], reason: str) -> list[Loss]:
    """A loss for each term or effect that is not represented."""
    return losses_of([e for e in parts_of(axis) if not held(e)], reason)


def losses_of(lost: Sequence[Effect], reason: str) -> list[Loss]:
    """A loss for each effect, with a single one for a learned torque."""
    hills = [e for e in lost if isinstance(e, LearnedTorque)]
    out = [Loss(e.name, size_of(e), reason) for e in lost if not isinstance(e, LearnedTorque)]
    if hills:
        most = max(abs(e.torque) for e in hills)
        over = " and over ".join(dict.fromkeys(e.over for e in hills))
        out.append(Loss("learned_torque", f"{len(hills)} basis functions over {over}, up to {most:.6g} Nm", reason))
    return out


def in_symbols(losses: Iterable[Loss], drive: str, motion: str) -> list[Loss]:
    """Losses in Nm and rad, in other symbols; a phase is always an angle."""

    def spelled(part: str) -> str:
        return part if part.startswith("phase") else respelled(part, {"Nm": drive, "rad": motion})[1]

    return [dataclasses.replace(x, size=", ".join(map(spelled, x.size.split(", ")))) for x in losses]


def of_joint(name: str, losses: Iterable[Loss], slides: bool) -> list[Loss]:
    """The losses with the name of their joint, in its units."""
    here = in_symbols(losses, "N", "m") if slides else losses
    return [dataclasses.replace(x, name=f"{name}'s {x.name}") for x in here]


def lost_parts(axis: ServoAxis, *, moving: bool = False, limit: bool = False) -> list[Loss]:
    """Losses among drive, transmission and sensor; each argument says whether the format represents that part.

    ``moving``: dead time, lag and transmission.
    """
    out, drive, t = [], axis.drive, axis.transmission
    if not moving and drive.delay:
        out.append(Loss("drive delay", f"{drive.delay:.6g} s", "the format has no dead time"))
    if not moving and drive.lag:
        out.append(Loss("drive lag", f"{drive.lag:.6g} s", "the format has no actuator dynamics"))
    if not limit and drive.limit < float("inf"):
        out.append(Loss("drive limit", f"{drive.limit:.6g} Nm", "the format has no limit"))
    if not moving and t is not None:
        size = f"stiffness {t.stiffness:.6g} Nm/rad, gap {t.gap:.6g} rad"
        out.append(Loss("transmission", size, "the format has one mass"))
    if axis.sensor.noise:
        out.append(Loss("sensor noise", f"{axis.sensor.noise:.6g} rad", "the exported model is free of noise"))
    return out


@dataclass(frozen=True)
class Exported:
    """A model ready for export.

    >>> model = Exported(units={"input": "mNm", "output": "deg"})
    >>> model.factors[0], model.si
    (0.001, ('Nm', 'rad'))
    """

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

    def told(self, losses: list[Loss]) -> list[Loss]:
        """The losses in the SI symbols of this model."""
        return in_symbols(losses, *self.si)

    def foreign(self) -> list[Loss]:
        """Units that a format in Nm or N and rad or m does not support: a current, counts, or an unknown unit."""
        out = []
        force = ("N", "Nm") if self.linear else ("Nm", "N")
        for what, column, symbol, wanted in (
            ("drive", "input", self.si[0], force),
            ("position", "output", self.si[1], ("rad", "m")),
        ):
            if not self.units.get(column):
                out.append(Loss(f"unit of the {what}", "not stated", f"taken to be {wanted[0]}, as in the format"))
            elif symbol not in wanted:
                constant = "force" if wanted[0] == "N" else "torque"
                how = f"by the {constant} constant" if symbol in AMPERES else f"to {wanted[0]} for each {symbol}"
                text = (
                    f"the format is in {wanted[0]}: numbers that have it are in {symbol} here, and right for a {what}"
                )
                out.append(Loss(f"unit of the {what}", symbol, f"{text} in {symbol} alone; scale them {how}"))
        return out

    @property
    def linear(self) -> bool:
        """Whether the axis moves along a line, by the unit of its position."""
        return self.si[1] == "m"

    def need_axis(self, what: str) -> ServoAxis:
        """The axis; raises with a reason if there is none."""
        if self.axis is None:
            raise ArgumentError(
                f"{what} describes a mechanical axis, and this model is a chain; export it to c, st or fmu."
            )
        return self.axis


def as_exported(model: Any) -> Exported:
    """`Exported` from a file for `load_model`, a `ServoAxis`, a `WienerHammersteinSystem` or an identified model.

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
        chain = CodedChain(b, f, None, one, one, model.dt, float(model.offset), integrates)
        return Exported(chain=chain, units=units, logged=logged)
    raise ValueError(
        f"{type(model).__name__} cannot be exported; give a model file, a ServoAxis or a WienerHammersteinSystem."
    )


# --- ranges for domain randomisation ---------------------------------------------------------------------------------
# MuJoCo's names of the numbers of an axis; none of them can be negative.
HELD = {"inertia": "inertia", "viscous": "damping", "coulomb": "frictionloss", "cable_spring": "stiffness"}
DEVIATIONS = 2.0  # in each direction: 95 % of the population of units


def ranges_of(comparison: dict[str, Any]) -> dict[str, dict[str, Any]]:
    """MuJoCo's name of a number -> its range over units, in SI.

    The range is the mean plus or minus two standard deviations; the variance is that between records beyond that within
    them, plus the uncertainty of the mean.

    ``comparison``: ``compare.json``. Raises ValueError if it does not contain numbers of several records.
    """
    rows = comparison.get("numbers") or []
    if not rows or len(rows[0]["values"]) < 2:
        raise ValueError("The comparison holds no numbers of several records; give the compare.json of `compare`.")
    out = {}
    for row in rows:
        if row["name"] in HELD:
            n, si = len(row["values"]), float(row["to_si"])
            apart = DEVIATIONS * (row["spread_between"] ** 2 + row["spread_within"] ** 2 / n) ** 0.5
            low, high = ((row["mean"] + sign * apart) * si for sign in (-1.0, 1.0))
            out[HELD[row["name"]]] = {
                "of": row["name"], "mean": row["mean"] * si, "low": max(low, 0.0), "high": high, "records": n,
            }  # fmt: skip
    return out


def read_ranges(comparison: str | os.PathLike[str]) -> dict[str, dict[str, Any]]:
    """`ranges_of` a file. Raises ValueError if it is not the ``compare.json`` of several records."""
    try:
        data = json.loads(Path(comparison).read_text(encoding="utf-8"))
    except ValueError:  # also of its encoding
        data = None
    if not isinstance(data, dict):
        raise ValueError(f"{Path(comparison).name} is not JSON as `compare` writes it; give its compare.json.")
    return ranges_of(data)


def write_ranges(ranges: dict[str, dict[str, Any]], model: Path) -> Path:
    """Write ranges beside a model's file; return their path."""
    path = model.with_suffix(".ranges.json")
    atomic_write(path, (json.dumps(ranges, indent=2) + "\n").encode())
    return path
