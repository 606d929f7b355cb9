"""Parts of a model that a format cannot represent, with their sizes; they are reported, never dropped silently."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from whsklearn.effects import Effect, LearnedTorque
from whsklearn.systems.servo import ServoAxis


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


def left_out(axis: ServoAxis, held: Callable[[Effect], bool], reason: str) -> list[Loss]:
    """A loss for each term or effect that is not represented."""
    return losses_of([e for e in parts_of(axis) if not held(e)], reason)


def losses_of(lost: list[Effect], reason: str) -> list[Loss]:
    """A loss for each effect, with a single one for a learned torque."""
    hills = [e for e in lost if isinstance(e, LearnedTorque)]
    out = [Loss(e.name, size_of(e), reason) for e in lost if not isinstance(e, LearnedTorque)]
    if hills:
        most = max(abs(e.torque) for e in hills)
        over = " and over ".join(dict.fromkeys(e.over for e in hills))
        out.append(Loss("learned_torque", f"{len(hills)} basis functions over {over}, up to {most:.6g} Nm", reason))
    return out


def lost_parts(axis: ServoAxis, *, timing: bool, transmission: bool, limit: bool) -> list[Loss]:
    """Losses among drive, transmission and sensor; each argument says whether the format represents that part."""
    out = []
    if not timing and axis.drive.delay:
        out.append(Loss("drive delay", f"{axis.drive.delay:.6g} s", "the format has no dead time"))
    if not timing and axis.drive.lag:
        out.append(Loss("drive lag", f"{axis.drive.lag:.6g} s", "the format has no actuator dynamics"))
    if not limit and axis.drive.limit < float("inf"):
        out.append(Loss("drive limit", f"{axis.drive.limit:.6g} Nm", "the format has no limit"))
    if not transmission and axis.transmission is not None:
        t = axis.transmission
        out.append(
            Loss("transmission", f"stiffness {t.stiffness:.6g} Nm/rad, gap {t.gap:.6g} rad", "the format has one mass")
        )
    if axis.sensor.noise:
        out.append(Loss("sensor noise", f"{axis.sensor.noise:.6g} rad", "the exported model is free of noise"))
    return out
