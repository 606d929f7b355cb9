"""The next run: a reference within limits, and a dry run that shows which rivals it would distinguish.

Every rival of a diagnosis is simulated under the reference with the noise of the log, and the finder runs on the
simulated record.  A reference that is optimal for distinguishing two models (T-optimal, Atkinson and Fedorov 1975)
named no more rivals than this multisine within the same limits (9 of 13 against 11).  What helps is to know in advance.
"""

from __future__ import annotations

import json
import os
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from whsklearn.datasets import draw_effect, make_servo_log, reference_signal
from whsklearn.effects import Effect, get_effect
from whsklearn.gap.diagnosis import ALPHA
from whsklearn.gap.finder import GapFinder
from whsklearn.gap.pictures import thinned
from whsklearn.gap.record import Array, ServoRecord
from whsklearn.gap.report import significant
from whsklearn.logs.files import atomic_write
from whsklearn.logs.units import factor_of
from whsklearn.plot.look import html_of
from whsklearn.systems.servo import ServoAxis
from whsklearn.systems.servo_parts import PIDController, Sensor

BANDWIDTH = 4.0  # Hz, of the dry run's controller: above the reference's 2.9 Hz, within what a log at 50 Hz resolves
RISE = 0.5  # s, over which the reference starts from rest
BEYOND = (1.5, 2.25)  # multiples of the limits at which a rival that was not named is tried again
N_RUNS = 3  # with noise of their own: of an effect that is named as often as not, they agree in a quarter of all cases
SHRINK = 0.8  # factor on a reference that needs too much drive
MOST_SHRINKING = 20  # 0.8 to the twentieth: a hundredth of the travel
SAID = {True: "would be named", False: "would not be named", None: "depends on the noise"}
WIDTH, HEIGHT, MARGIN = 680.0, 130.0, 16.0  # px of a picture; the margin above and below holds a line of text


class Limits(NamedTuple):
    """Limits of the next run, in SI: largest position, speed and drive, and its length (s).

    >>> Limits(position=0.5, speed=2.0, drive=1.2, seconds=6.0).speed
    2.0
    """

    position: float
    speed: float
    drive: float
    seconds: float


@dataclass(frozen=True)
class Design:
    """A reference, and what it would show.

    References
    ----------
    Atkinson and Fedorov 1975, The design of experiments for discriminating between two rival models, Biometrika
    62(1), 57-70.

    Examples
    --------
    >>> reached = Limits(0.4, 1.9, 1.1, 6.0)
    >>> named = {"cogging": True, "cable_spring": False}
    >>> made = Design(np.zeros(2), np.zeros(2), np.zeros(2), reached, named, {"cable_spring": 1.5})
    >>> print(made.advice("Nm"))
    Within these limits cogging would be named, cable spring would not; to see cable spring allow 1.65 Nm.
    """

    time: Array  # time, reference, drive (n,): in s, rad or m, and Nm or N; the drive is that of the simulated axis
    reference: Array
    drive: Array
    reached: Limits  # what the simulated axis needs for it
    # rival -> whether it would be named first, or beside its alias; None where that depends on the noise
    named: dict[str, bool | None]
    # rival that is not named -> the factor on the limits at which it would be; None if no factor that was tried does
    factors: dict[str, float | None]

    def advice(self, unit: str, by: float = 1.0) -> str:
        """What the run would show, in words; drives in ``unit``, which is ``by`` in SI."""

        def told(names: Iterable[str], what: str) -> list[str]:
            *others, last = [n.replace("_", " ") for n in names] or [""]
            return [f"{', '.join(others)} and {last} {what}" if others else f"{last} {what}"] if last else []

        yes, no, perhaps = ([n for n, said in self.named.items() if said is answer] for answer in (True, False, None))
        parts = told(yes, "would be named") + told(perhaps, "may or may not be named, depending on the noise")
        text = "Within these limits " + ", ".join(parts + told(no, "would not"))
        for name, factor in self.factors.items():
            if factor is not None:
                text += f"; to see {name.replace('_', ' ')} allow {factor * self.reached.drive / by:.3g} {unit}"
        never = [n for n, factor in self.factors.items() if factor is None]
        return "; ".join([text, *told(never, f"would not at {BEYOND[-1]:g} times these limits either")]) + "."


def closed_loop(axis: ServoAxis, noise: float) -> ServoAxis:
    """The axis under a controller of the dry run's bandwidth, with the log's noise on its reading."""
    w = 2.0 * np.pi * min(BANDWIDTH, 0.04 * axis.sample_rate)
    j = axis.inertia
    controller = PIDController(j * w * w, 0.0, 1.4 * j * w, acceleration_feedforward=j)
    return replace(axis, controller=controller, sensor=Sensor(noise=noise))


def reference_within(axis: ServoAxis, limits: Limits, seed: int = 0) -> tuple[Array, Array, Limits]:
    """The library's rich reference, as large as the limits allow on this axis, the drive that it takes, and the limits
    that both reach.

    Raises ValueError if the axis cannot be moved within the limits.
    """
    rate = axis.sample_rate
    shape = reference_signal("rich", limits.seconds, rate, amplitude=1.0, random_state=seed)
    rise = np.minimum(1.0, np.arange(shape.size) / rate / RISE)
    shape = (shape - shape[0]) * rise**2 * (3.0 - 2.0 * rise)
    shape = shape / np.abs(shape).max()
    size = min(limits.position, limits.speed / float(np.abs(np.gradient(shape, 1.0 / rate)).max()))
    for _ in range(MOST_SHRINKING):
        run = axis.simulate(size * shape, noise=False)
        needs = float(np.abs(run.drive).max())
        if needs <= limits.drive:
            path = size * shape
            speed = float(np.abs(np.gradient(path, 1.0 / rate)).max())
            return path, run.drive, Limits(float(np.abs(path).max()), speed, needs, limits.seconds)
        size *= SHRINK
    raise ValueError(
        f"The axis needs a drive of {needs:.3g} to move at all, the limit is {limits.drive:.3g}; allow more drive."
    )


def is_named(axis: ServoAxis, rival: Effect, reference: Array, law: str, *, alpha: float, seed: int) -> bool:
    """Whether the finder names a rival, or one of its aliases, in a run of the axis with that rival."""
    log = make_servo_log([rival], axis=axis, reference=reference, random_state=seed)
    found = GapFinder("servo", law=law, alpha=alpha, max_effects=1, random_state=seed).fit(ServoRecord.from_frame(log))
    return bool(found.effects_) and found.effects_[0].name in accepted(rival.name)


def surely_named(axis: ServoAxis, rival: Effect, reference: Array, law: str, *, alpha: float, seed: int) -> bool | None:
    """`is_named` of several runs with other noise, if they all agree; else None."""
    answers: set[bool] = set()
    for k in range(N_RUNS):
        answers.add(is_named(axis, rival, reference, law, alpha=alpha, seed=seed + k))
        if len(answers) > 1:
            return None
    return answers.pop()


def accepted(name: str) -> set[str]:
    """The name, and the names that no data can distinguish from it."""
    return {name, *get_effect(name).aliases}


def design(
    axis: ServoAxis, rivals: Sequence[Effect | str], law: str, limits: Limits, *,
    share: float, noise: float, alpha: float = ALPHA, seed: int = 0,
) -> Design:  # fmt: skip
    """The next reference within limits, and which rivals it would distinguish.

    ``axis``: fitted, without the rivals.
    ``rivals``: as fitted, or by name; an effect given by name has a size of ``share`` of the rms drive.
    ``law``: friction of the base model that the finder is given.
    ``noise``: standard deviation on the position (rad or m).
    Raises ValueError if the axis cannot be moved within the limits.
    """
    axis = closed_loop(axis, noise)
    reference, drive, reached = reference_within(axis, limits, seed)
    rng = np.random.default_rng(seed)
    drawn = [r if isinstance(r, Effect) else draw_effect(r, axis, reference, share, rng) for r in rivals]
    named = {r.name: surely_named(axis, r, reference, law, alpha=alpha, seed=seed) for r in drawn}
    factors: dict[str, float | None] = {}
    for rival in drawn:
        if not named[rival.name]:
            tried = (f for f in BEYOND if surely_named(axis, rival, f * reference, law, alpha=alpha, seed=seed))
            factors[rival.name] = next(tried, None)
    return Design(np.arange(reference.size) / axis.sample_rate, reference, drive, reached, named, factors)


# --- the report: reference.csv for the rig, design.json for programs, design.html for people ------------------------
def write_design(
    made: Design, limits: Limits, folder: str | os.PathLike[str], units: tuple[str, str] = ("Nm", "rad")
) -> Path:
    """Write ``reference.csv``, ``design.json`` and ``design.html``.

    ``limits``: as given, in ``units``. ``folder``: created if it does not exist. ``units``: of drive and position;
    empty where the log states none. Returns the path of the page.

    >>> from tempfile import TemporaryDirectory
    >>> reached = Limits(0.4, 1.9, 1.1, 6.0)
    >>> made = Design(np.arange(50.0), *np.zeros((2, 50)), reached, {"cogging": True}, {})
    >>> with TemporaryDirectory() as folder:
    ...     page = write_design(made, Limits(0.5, 2.0, 1.2, 6.0), folder)
    ...     sorted(p.name for p in Path(folder).iterdir())
    ['design.html', 'design.json', 'reference.csv']
    """
    by, far = (factor_of(unit)[0] if unit else 1.0 for unit in units)
    reached = Limits(
        made.reached.position / far, made.reached.speed / far, made.reached.drive / by, made.reached.seconds
    )
    advice = made.advice(units[0] or "of drive", by)
    answer = {"would_be_named": made.named, "limits": limits._asdict(), "reached": reached._asdict(), "advice": advice}
    path, motion = made.reference / far, units[1]
    named = (
        ("position", motion, path, limits.position),
        ("speed", f"{motion}/s" if motion else "", np.gradient(path, made.time), limits.speed),
        ("drive of the simulated axis", units[0], made.drive / by, limits.drive),
    )
    page = html_of(
        Path(__file__).with_name("design.html.j2"),
        {"sig": significant},
        advice=advice,
        rows=[(name, SAID[yes], made.factors.get(name), name in made.factors) for name, yes in made.named.items()],
        pictures=[(name, unit, against(made.time, x, limit)) for name, unit, x, limit in named],
        limits=limits,
        reached=reached,
        units=units,
        seconds=float(made.time[-1]),
        width=WIDTH,
        height=HEIGHT,
    )
    target = Path(folder)
    target.mkdir(parents=True, exist_ok=True)
    table = np.column_stack([made.time, path])
    header = f"time_s,reference_{motion or 'rad'}"
    np.savetxt(target / "reference.csv", table, delimiter=",", header=header, comments="", fmt="%.9g")
    atomic_write(target / "design.json", (json.dumps(answer, indent=2) + "\n").encode())
    atomic_write(target / "design.html", page.encode())
    return target / "design.html"


class Picture(NamedTuple):
    """A signal against its limit: the points of a polyline, and the heights of the limits and of zero, in px.

    >>> picture = against(np.array([0.0, 1.0]), np.array([0.5, -0.5]), 0.5)
    >>> picture.points, picture.limit
    ('0.0,16.0 680.0,114.0', 0.5)
    """

    points: str
    top: float
    zero: float
    bottom: float
    limit: float


def against(time: Array, signal: Array, limit: float) -> Picture:
    """A signal over time, scaled so that the limits on both sides are the edges of the picture.

    >>> picture = against(np.array([0.0, 1.0]), np.array([0.0, -0.5]), 0.5)
    >>> picture.points, picture.top, picture.zero, picture.bottom
    ('0.0,65.0 680.0,114.0', 16.0, 65.0, 114.0)
    """
    half = HEIGHT / 2.0 - MARGIN
    x, y = thinned(time, signal)
    across = WIDTH * np.asarray(x) / max(float(time[-1]), 1e-300)
    up = HEIGHT / 2.0 - half * np.asarray(y) / limit
    points = " ".join(f"{a:.1f},{b:.1f}" for a, b in zip(across, up, strict=True))
    return Picture(points, MARGIN, HEIGHT / 2.0, HEIGHT - MARGIN, limit)
