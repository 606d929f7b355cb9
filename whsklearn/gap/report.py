"""The report: ``gap.json`` for programs, ``gap.html`` for a person, ``repaired.json`` (or, for a
MuJoCo model, ``repaired.xml``) with the repaired model, ``run.json`` with date and duration.
"""

from __future__ import annotations

import json
import os
import warnings
from pathlib import Path
from typing import Any

from whsklearn.gap.diagnosis import Diagnosis, spoken
from whsklearn.logs.files import atomic_write
from whsklearn.models import ArmModel, AxisModel, ChainModel, save_model
from whsklearn.plot.look import html_of

COLOURS = {
    "named": "#1b7f4d",
    "no_gap": "#2b6cb0",
    "partial": "#b7791f",
    "ambiguous": "#b7791f",
    "data_problem": "#b83232",
}
SILENCE = {
    "no_gap": "The base model, with its numbers refitted, explains the log to within noise and the tolerance. This "
    "holds for this record only: effects marked not testable would not have shown.",
    "unknown": "The residual is larger than noise, and functions of the motion without a name explain more of it than "
    "chance would. No effect of the catalogue could be shown to be the cause, and the most similar one is not named.",
    "coloured_noise": "The residual is larger than encoder noise, but no function of motion, drive or time explains "
    "more of it than chance would. The cause is a disturbance or coloured noise. No effect is named.",
    "not_testable": "No gap was found, but most effects of the catalogue could not have been detected in this record: "
    "the axis moves too little or too uniformly.",
    "ambiguous": "Two or more effects explain this record about equally well. The next experiment would distinguish "
    "them.",
    "partial": "The effects that were added do not explain all of the gap. Something else is missing too.",
}
LEAST_AGE = 1e-6  # samples; where the drive is not old, its fitted age ends at the bound of the fit, near 1e-9
NO_PICTURES = (
    "The report has no pictures, because matplotlib is not installed; pip install 'whsklearn[plot]' and write it again."
)


def write_report(diagnosis: Diagnosis, folder: str | os.PathLike[str], model: Any = None) -> Path:
    """Write the files to ``folder`` (created if it does not exist) and return the path of the page.

    Everything is rendered before the first byte is written, every file is replaced atomically, and the repaired model
    of an earlier report is deleted, so an interruption leaves no page beside the numbers of another log.  Without
    matplotlib the page has no pictures, and a warning says so.
    """
    target = Path(folder)
    if diagnosis.pictures and not can_draw():
        warnings.warn(NO_PICTURES, stacklevel=3)
    target.mkdir(parents=True, exist_ok=True)
    rendered = render(diagnosis).encode()
    atomic_write(target / "gap.json", _json(diagnosis.as_dict()))
    atomic_write(target / "run.json", _json(diagnosis.run()))
    for old in ("repaired.json", "repaired.xml"):
        (target / old).unlink(missing_ok=True)
    repaired = as_model(model, diagnosis.logged)
    if repaired is not None:
        save_model(repaired, target / "repaired.json")
    elif hasattr(model, "to_xml"):
        atomic_write(target / "repaired.xml", model.to_xml().encode())
    page = target / "gap.html"
    atomic_write(page, rendered)
    return page


def _json(data: dict[str, Any]) -> bytes:
    return (json.dumps(data, indent=2, allow_nan=False) + "\n").encode()


def can_draw() -> bool:
    """Whether matplotlib is installed."""
    try:
        import matplotlib  # noqa: F401
    except ImportError:
        return False
    return True


def significant(value: Any) -> str:
    """Four significant digits; text is unchanged."""
    if isinstance(value, str) or value is None:
        return str(value)
    return f"{value:.4g}"


def probability(p: float) -> str:
    """A p-value; small ones as a bound, because they depend on the tail of a fitted distribution.

    >>> probability(0.034), probability(3e-9), probability(1.0)
    ('0.034', '< 0.0001', '1')
    """
    return "< 0.0001" if p < 1e-4 else f"{p:.2g}"


def render(diagnosis: Diagnosis) -> str:
    """The page as text."""
    pictures: list[tuple[str, str, str]] = []
    drawn = can_draw()
    if diagnosis.pictures and drawn:
        from whsklearn.gap.pictures import draw

        pictures = draw(diagnosis)
    return html_of(
        Path(__file__).with_name("report.html.j2"),
        {"sig": significant, "p": probability, "spoken": spoken},
        d=diagnosis,
        pictures=pictures,
        no_pictures="" if drawn else NO_PICTURES,
        unit=diagnosis.pictures.get("units", ("", ""))[1],
        gap_unit=diagnosis.pictures.get("gap_unit", ""),
        colour=COLOURS.get(diagnosis.verdict, "#5a6773"),
        silence=SILENCE.get(diagnosis.verdict, ""),
    )


def as_model(system: Any, units: tuple[str, str] = ("Nm", "rad")) -> AxisModel | ChainModel | ArmModel | None:
    """A repaired `ServoAxis` or `WienerHammersteinSystem` as an identified model; None for a user's simulator.

    ``system``: the ``model_`` of a finder. ``units``: of drive (or input) and position (or output), as logged; empty if
    the log states none.

    >>> from whsklearn import ServoAxis
    >>> from whsklearn.effects import Cogging
    >>> from whsklearn.gap.report import as_model
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
        aged = system.drive.delay * system.sample_rate > LEAST_AGE
        delay = (InputDelay(system.drive.delay),) if aged else ()
        return AxisModel(
            system.inertia, system.law, (*system.effects, *delay), dt=1.0 / system.sample_rate, units=known,
            logged="position",
        )  # fmt: skip
    if isinstance(system, WienerHammersteinSystem):
        b1, f1, b2, f2 = (tuple(p.tolist()) for p in system.polynomials)
        return ChainModel(b1, f1, system.law, b2, f2, effects=system.effects, dt=system.dt, units=known)
    return None
