"""The repaired model as a file: ``repaired.json`` is a model file like any other, see `whsklearn.models.load_model`."""

from __future__ import annotations

from typing import Any

from whsklearn.models import ArmModel, AxisModel, ChainModel


def as_model(system: Any, units: tuple[str, str] = ("Nm", "rad")) -> AxisModel | ChainModel | ArmModel | None:
    """A repaired `ServoAxis` or `WienerHammersteinSystem` as an identified model; None for a user's simulator.

    Parameters
    ----------
    system : object
        What a finder handed back as ``model_``.
    units : tuple of str
        Of drive (or input) and position (or output), as logged; empty where the log states none.

    Examples
    --------
    >>> from whsklearn import ServoAxis
    >>> from whsklearn.effects import Cogging
    >>> from whsklearn.gap.repaired import as_model
    >>> model = as_model(ServoAxis(inertia=0.05, law="coulomb", effects=[Cogging(0.2, 12.0)]), units=("A", "rad"))
    >>> model.effects, dict(model.units)
    ((Cogging(amplitude=0.2, order=12.0, phase=0.0),), {'input': 'A', 'output': 'rad'})
    """
    from whsklearn.effects import InputDelay
    from whsklearn.systems.servo import ServoAxis
    from whsklearn.systems.wiener_hammerstein import WienerHammersteinSystem

    known = {k: u for k, u in zip(("input", "output"), units, strict=True) if u}
    if isinstance(system, ArmModel):
        return system
    if isinstance(system, ServoAxis):
        delay = (InputDelay(system.drive.delay),) if system.drive.delay else ()
        return AxisModel(
            system.inertia, system.law, (*system.effects, *delay), dt=1.0 / system.sample_rate, units=known,
            logged="position",
        )  # fmt: skip
    if isinstance(system, WienerHammersteinSystem):
        b1, f1, b2, f2 = (tuple(p.tolist()) for p in system.polynomials)
        return ChainModel(b1, f1, system.law, b2, f2, effects=system.effects, dt=system.dt, units=known)
    return None
