"""Every candidate of an axis as a family of torque columns, filtered as the view is, looked at and then fitted.

u = J a + f is fitted by least squares of the drive.  That is right under a stiff controller, where the path is given
and the drive responds to whatever is missing.  If the axis swings freely it is the other way round: the drive is given
and the acceleration responds.  Then J a and a force of the position nearly cancel, the fit ends at an inertia near
zero, and the force explains hardly anything of the small drive (three of six logs of a pendulum).  A regression of the
acceleration on the drive, a = (u - f) / J, shows that the same force explains nearly everything.  Both describe the
same model, and a force of the position is tried in both directions.

Noise in the reading of the drive also leaves the acceleration unexplained, and a force of the position explains that
too, because any swing accelerates towards its middle.  Beside a force that is there, drive and acceleration explain
each other better (`mutual`); beside one that is not, less is left for them to share.

References
----------
Frisch 1934, Statistical Confluence Analysis by Means of Complete Regression Systems, for the two directions of one
regression; Haavelmo 1943, The statistical implications of a system of simultaneous equations, Econometrica 11(1), 1-12.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterator
from itertools import product
from typing import Any

import numpy as np

from whsklearn.effects import codes as k
from whsklearn.effects import get_effect
from whsklearn.effects.quantity import ONE_PERIOD
from whsklearn.filtering.records import CUTOFF_SIGMA
from whsklearn.gap import least_squares as ols
from whsklearn.gap.calibration import N_DRAWS, coloured, gain, independent, null_rows, smoothed_power
from whsklearn.gap.least_squares import least_squares
from whsklearn.gap.nameless import nameless, varying_inertia
from whsklearn.gap.plants import servo_stop as stop
from whsklearn.gap.plants import servo_two_mass as two_mass
from whsklearn.gap.plants.servo_candidates import TWO_MASS, Candidate, usable
from whsklearn.gap.plants.servo_inverse import later, reaching, unexplained, unphysical, weighted
from whsklearn.gap.plants.servo_model import HOLD, ServoHypothesis, ServoTerm
from whsklearn.gap.plants.servo_own import Own
from whsklearn.gap.plants.variant import WAVE_STEP
from whsklearn.gap.record import Array
from whsklearn.gap.search import HALF, LEAST_SHARE
from whsklearn.gap.tangent import (
    AT_ONCE,
    Blocks,
    Family,
    Look,
    Tangent,
    chance,
    lines,
    looks_at,
    undiluted,
    with_p_values,
)
from whsklearn.identification.drive_lead import LATEST, OLDEST


class Scene:
    """One view under one model, with everything that all families share.

    The torque is the model's; if that is not good enough, it is the torque of ``beside``.  With ``whole_waves``, a wave
    over the place has a period in the travel at least: a part of one may be any smooth function of the place, which
    only `ServoPlant.half_shown` refuses.
    """

    def __init__(
        self, view: Any, model: ServoHypothesis, beside: ServoHypothesis | None = None, *, whole_waves: bool = False
    ):
        self.view, self.model, self.whole_waves = view, model, whole_waves
        self.torque = view.torque(model)
        if self.torque is None and beside is not None:
            self.torque = view.torque(beside)
        s = view.motion if self.torque is None else view.motion._replace(drive=self.torque)
        self.signals, self.at, self.drive = s, view.at, view.reaching(model)
        self.angle, self.speed = (x[:: view.every][view.at] for x in (s.position, s.velocity))
        self.time = view.time[:: view.every][view.at]
        self.sigma = CUTOFF_SIGMA / (2 * np.pi * view.cutoff)

    def columns(self, term: ServoTerm) -> Array:
        """Columns of one term at its shape, shape (n, 1, k)."""
        columns = self.view.term_columns(self.model, term, self.torque)
        return self.view.before_lag(self.model, columns)[self.at][:, None, :]

    def transformed(self, changed: Array) -> tuple[Array, float]:
        """The residual if ``changed`` reaches the axis, shape (n, 1, 1), and its share of what does under the model."""
        before, lost = (
            self.view.before_lag(self.model, self.view.blur(u))[self.at] for u in (self.drive, self.drive - changed)
        )
        share = self.view.rms(before - lost) / max(self.view.rms(before), 1e-300)
        if self.view.artefact is not None:  # in proportion to the model's numbers, and with them to what reaches it
            lost = lost - (1.0 - share) * self.view.artefact
        return lost[:, None, None], share


def looks(
    view: Any, model: ServoHypothesis, own: Own, least: float, beside: ServoHypothesis | None = None, *,
    waves: bool = False,
) -> list[Look]:  # fmt: skip
    """Look at every candidate, and at nameless functions of the motion, beside the model's own columns.

    Effects that multiply the torque are tried too if only ``beside``, which has one more effect, predicts it well
    enough.  For ``least`` see `whsklearn.gap.tangent.with_p_values`.  If ``waves``, only waves of position and time are
    tried: behind a filter that passes noise, the controller's answer to the noise looks like any other effect.
    """
    scene = Scene(view, model, beside)
    _, x, target, sizes, free = view.solved(model)
    x = stop.without_pushes(model, x)
    left = (target - x @ sizes)[view.at]
    told = view.told(model)
    missing = view.rms(weighted(left, told))
    rate = ols.slope(x @ sizes, view.step)[view.at]
    own_columns = x[view.at][:, : view.sizes(model).size]  # without the age, which is the rate
    numbers = own_columns[:, free[: own_columns.shape[1]]]
    timed = Tangent(left, own.null, np.column_stack([numbers, rate]), own.n_effective, told)
    # A limit changes what the model must explain, so it is not beside the residual, which holds the second order of
    # the age: of a model with thirteen times the inertia that was as much as all that a controller's wind-up left.
    drive, share = view.target(model)
    whole = dataclasses.replace(timed, left=share * drive[view.at] - (0.0 if view.artefact is None else view.artefact))
    other_way = acceleration_tangent(view, model, np.random.default_rng(0))
    there, asked = placed(scene, other_way.n), []
    for f, of_place in families(scene, waves):
        ways = [whole if f.offset else timed, *([other_way] if of_place else [])]
        asked.append((f, better(looks_at(f, *ways), other_way.n, missing, there)))
    out = [look for _, look in asked]
    unnamed = [*nameless(view.scene, scene.angle, scene.speed, (x @ sizes)[view.at])]
    if view.record.units[1] == "rad":
        unnamed.append(varying_inertia(view.motion, lambda x: view.blur(x)[view.at], signal="position"))
    out += [timed.look(f) for f in unnamed if f.signal == "position" or not waves]
    latest, age = LATEST * view.scene.dt, view.age(model)
    for kind in inverse_kinds(model) if not waves else ():
        if kind.code == k.ACTUATOR_LAG:  # what it does beyond an age, which may be as large as need be
            more = 0.5 * (max(age, latest) ** 2 - latest**2) * ols.slope(ols.slope(x @ sizes, view.step), view.step)
            out.append(dataclasses.replace(timed, left=left - more[view.at]).look(family(scene, kind)))
        elif kind.delays and age > latest:  # no nuisance any more, but a candidate
            out.append(Tangent(left, own.null, numbers, own.n_effective, told).look(family(scene, kind)))
    out += [] if waves else struck(view, model, own, missing)
    found = with_p_values([undiluted(look, told) for look in out if look is not None], least)
    family_of = {id(look.start): f for f, look in asked if look is not None}

    def beside_itself(look: Look) -> Look:
        """The look; if it explains a quarter of the gap, judged by null rows with the colour of what it leaves.

        A strong slow effect, above all a constant, is part of the residual from which null rows take their colour, and
        so hides in them.  As in any F-test the noise is that of the larger model; for a weak effect both are the same.
        """
        f = family_of.get(id(look.start))
        if f is None or look.size**2 < LEAST_SHARE * missing**2:
            return look
        grown, rng = view.fit(model.with_terms((*model.terms, look.start))), np.random.default_rng(0)
        if look.swapped:
            power = smoothed_power(acceleration_left(view, grown))
            tangent, null = other_way, coloured(power, (N_DRAWS, left.size), rng)
        else:
            tangent, null = timed, null_rows(view.gap(grown), own.apart, N_DRAWS, rng) / own.weight
        other = dataclasses.replace(tangent, null=null).look(f)
        return look if other is None else dataclasses.replace(look, p_value=chance(look, other.null, len(found), least))

    return [beside_itself(k) for k in found]


def placed(scene: Scene, n: float) -> Callable[[Look], bool]:
    """Whether a force of the place leaves acceleration and drive as much to share, or more, but for chance.

    ``n``: independent samples of the acceleration.
    """
    acceleration, columns = regression(scene.view, scene.model)
    by_chance = 1.0 / n  # the mean of a squared correlation
    least = mutual(acceleration, columns) - by_chance

    def there(look: Look) -> bool:
        grown = np.column_stack([columns, scene.columns(look.start)[:, 0, :]])
        return mutual(acceleration, grown) > least

    return there


def struck(view: Any, model: ServoHypothesis, own: Own, missing: float) -> Iterator[Look]:
    """Looks at the stops that the axis strikes, by the share of a gap of rms ``missing`` that their pushes explain."""
    found = stop.regions(view, model)
    for kind in stop.usable(model) if found else ():
        if (term := stop.start(kind, found)) is not None:
            g = min(stop.share_of(view, model, term), 1.0 - 1e-12)
            gain = float(-own.n_effective * np.log1p(-g))
            yield Look(kind.name, gain, np.zeros(own.null.shape[0]), term, 4, np.sqrt(g) * missing)


def better(looks: list[Look | None], n: float, left: float, there: Callable[[Look], bool]) -> Look | None:
    """The first of the looks at one family, one by each regression, unless it explains less than half of the other.

    Families are compared by what they explain of the drive's residual, of rms ``left``.  The size of a family found by
    the other regression is the same share of it as of the acceleration, with ``n`` independent samples, if it is
    ``there`` at all.
    """
    look, other = (*looks, None)[:2]
    if look is None or other is None:
        return look
    size = left * float(np.sqrt(-np.expm1(-other.gain / n)))
    small = look.size**2 < HALF * size**2
    return dataclasses.replace(other, size=size, swapped=True) if small and there(other) else look


def families(scene: Scene, waves: bool = False) -> Iterator[tuple[Family, bool]]:
    """Families that have columns or limit the drive, each with whether it is a force of the position alone."""
    slides = scene.view.record.units[1] == "m"
    for kind in inverse_kinds(scene.model):
        if kind in stop.KINDS or kind.delays or (waves and kind.linear != 2) or (slides and kind.cls.rotary):
            continue
        if scene.torque is None and kind.driven and not kind.transforms:
            continue
        yield family(scene, kind), kind.of_place
        # A first look holds what is freed later; a force of the position may be far from where that is held. An end
        # stop had been named, with certainty, for a cubic about one end of the travel.
        for shape in kind.cls.later_starts(scene.view.scene) if kind.of_place and kind.later else ():
            yield family(scene, kind, shape), kind.of_place


def family(scene: Scene, kind: Candidate, shape: tuple[float, ...] | None = None) -> Family:
    """One candidate; at one shape if that is given."""
    n_numbers = len(kind.fields) - len(kind.held)
    zeros = (0.0,) * kind.linear

    def term(shape: tuple[float, ...], _sizes: Array) -> ServoTerm:
        return ServoTerm(kind, (*zeros, *shape))

    def given(shape: ServoTerm, _sizes: Array) -> ServoTerm:
        return shape

    if kind.code in TWO_MASS:
        return Family(kind.name, lambda _: couplings(scene, kind), given, n_numbers + 1, positive=True)
    if kind.transforms:
        shown = ages if kind.delays else limits
        return Family(kind.name, lambda _: shown(scene, kind), term, n_numbers, offset=True)
    if kind.scanned == "position":
        return Family(kind.name, lambda _: orders(scene, kind), term, n_numbers, signal=kind.signal)
    if kind.scanned == "time":
        return Family(kind.name, lambda t: tones(scene, kind, t), term, n_numbers)
    shapes = kind.grid(scene.view.scene, scene.view.cutoff) if shape is None else [shape]
    return Family(
        kind.name, lambda _: (([s], scene.columns(ServoTerm(kind, (*zeros, *s))), 1.0) for s in shapes), term,
        n_numbers, positive=kind.positive, signal=kind.signal,
    )  # fmt: skip


def couplings(scene: Scene, kind: Candidate) -> Blocks:
    """A load driven by the motor's motion, over antiresonances and widths of play."""
    play = kind.code == k.BACKLASH
    if kind.on_load:  # one column, because neither a frequency nor a width changes its shape
        hz = scene.view.scene.resonance
        term = two_mass.start(scene.model, kind, scene.view.scene.reach / 50.0, hz, 0.15 if play else 0.05)
        yield [term], scene.columns(term), 1.0
        return
    scales = scene.view.scene
    gaps = 0.5 * scales.torque / scales.inertia * CROSSINGS**2
    dry = sum(t.q[0] for t in scene.model.terms if t.name == "coulomb")
    held_back = {share * dry for share in LOAD_DRY}
    ways = (gaps, CONTACTS, IMPACTS) if play else ((0.0,), ANTIRESONANCES, (0.05,))
    for g, f, zeta, held in product(*ways, held_back):
        if f < 0.2 / scales.dt and g < scales.reach:
            term = two_mass.start(scene.model, kind, g, f, zeta, held)
            yield [term], scene.columns(term), 1.0


def limits(scene: Scene, kind: Candidate) -> Blocks:
    """What a limit or a dead zone removes from the drive; enough must remain, as the axis moves, to fit it."""
    view, u, numbers = scene.view, scene.drive, scene.model.vector().size
    low, high = kind.ranged(view.scene)[0]
    if kind.code == k.SATURATION:  # a peak may be a thousand times a limit, where a controller winds up
        low = max(low, float(np.quantile(np.abs(u[:: view.every][view.at]), min(numbers / view.n_effective, 1.0))))
    for width in np.geomspace(low, high, N_LIMITS):
        changed = reaching(ServoTerm(kind, (float(width),)), u, view.motion, view.scene.dt)
        if view.varies(changed, numbers):
            columns, share = scene.transformed(changed)
            yield [(float(width),)], columns, share


def ages(scene: Scene, kind: Candidate) -> Blocks:
    """The drive delayed by every age beyond bookkeeping; or behind every lag, less the delay of its age.

    A lag is judged by the drive before it, of which it takes nothing; it may be as short as the hold of a sample.
    """
    dt, u = scene.view.scene.dt, scene.drive
    lags = kind.code == k.ACTUATOR_LAG
    book = scene.transformed(later(k.INPUT_DELAY, u, LATEST * dt, dt))[0]
    for age in np.geomspace((HOLD if lags else LATEST) * dt, max(OLDEST, 10 * LATEST * dt), N_LIMITS):
        columns, share = scene.transformed(later(kind.code, u, age, dt))
        if lags:
            book, share = scene.transformed(later(k.INPUT_DELAY, u, age, dt))[0], 1.0
        yield [(float(age),)], columns - book, share


def orders(scene: Scene, kind: Candidate) -> Blocks:
    """Whole orders of what turns, then all orders; the Gaussian damps a wave by exp(-(k v s)^2 / 2).

    Beside waves of this kind only further ones of the same pitch: whole ones beside those nearest to whole, else
    multiples of the first, if that repeats within the travel.  Waves of any order beside each other, and multiples of
    one that does not repeat, are the series of a function of the position, such as one bump on a rail or a spring with
    play, and waves less than a period over the travel apart are one with an envelope.
    """
    view = scene.view
    present = [t.q[kind.linear] for t in scene.model.terms if t.kind == kind]
    low = max(kind.ranged(view.scene)[0][0], ONE_PERIOD / view.scene.reach if scene.whole_waves else 0.0)
    # the highest order that the filter passes in the share of the samples that a name must explain
    speed = max(float(np.quantile(np.abs(scene.speed), LEAST_SHARE)), 1e-9)
    high = float(np.clip(2 * np.pi * 1.5 * view.cutoff / speed, 4.0 * max(low, 1.0), highest_order(view)))
    step = max(WAVE_STEP / view.scene.reach, high / MOST_WAVES)
    values = np.arange(low, max(high, low + step), step)
    if view.record.units[1] == "rad":
        values = np.union1d(np.arange(np.ceil(low), high + 1), values)
    if present and all(np.abs(values - o).min() == abs(round(o) - o) for o in present):
        values = values[values % 1.0 == 0.0]
    elif present:
        repeats = present[0] * view.scene.reach >= 2.0 * ONE_PERIOD
        values = np.arange(present[0], high + present[0], present[0]) if repeats else values[:0]
    zeros = (0.0,) * kind.linear
    values = np.array([o for o in values if o > 0.0 and resolved(view, scene.model, ServoTerm(kind, (*zeros, o)))])
    if kind.linear != 2:
        for order in values:
            yield [(float(order),)], scene.columns(ServoTerm(kind, (0.0, float(order)))), 1.0
        return
    read = kind.cls.port == "output"
    size = -scene.model.inertia if read else view.blur(kind.unit_columns((0.0,), scene.signals)[:, :1])
    signals = scene.signals.position, scene.signals.velocity, scene.signals.acceleration
    angle, speed, acceleration = (x[:: view.every, None] for x in signals)
    for i in range(0, values.size, AT_ONCE):
        part = values[None, i : i + AT_ONCE]
        phase, turned = angle * part, speed * part
        cos, sin = np.cos(phase), np.sin(phase)
        if read:  # J a is computed from a reading that is ahead by the wave
            a = acceleration * part
            cos, sin = -a * sin - turned**2 * cos, a * cos - turned**2 * sin
        damped = size * np.exp(-0.5 * (turned * scene.sigma) ** 2)
        columns = view.before_lag(scene.model, np.hstack([damped * cos, damped * sin]))[view.at]
        yield [(float(o),) for o in part[0]], columns.reshape(-1, 2, part.size).swapaxes(1, 2), 1.0


def highest_order(view: Any) -> float:
    """Waves per rad, or per m: a turn is a natural unit, a metre is none, and there the travel takes its place."""
    return HIGHEST if view.record.units[1] == "rad" else HIGHEST * max(1.0, 1.0 / view.scene.reach)


def tones(scene: Scene, kind: Candidate, tangent: Tangent) -> Blocks:
    """The strongest line of the record and of every null row, from their spectra (rests are filled with zeros).

    What the filter leaves of a strong line beyond its cut-off may still be most of the residual.
    """
    view = scene.view
    low, high = kind.ranged(view.scene)[0][0], 0.5 / view.step
    return lines(tangent.rows, view.usable, view.step, low, high, scene.time)


def next_order(view: Any, model: ServoHypothesis, kind: Candidate) -> ServoHypothesis | None:
    """The model with the best further order of a family."""
    scene = Scene(view, model)
    _, x, target, sizes, free = view.solved(model)
    x = stop.without_pushes(model, x)
    left = (target - x @ sizes)[view.at]
    tangent = Tangent(left, np.empty((0, left.size)), x[view.at][:, free], view.n_effective, view.told(model))
    powers: dict[float, float] = {}
    for shapes, columns, _ in orders(scene, kind):
        power = tangent.taken(family(scene, kind), columns)[0][:, 0]
        powers |= {o: float(p) for (o,), p in zip(shapes, power, strict=True)}
    if not powers:
        return None
    best = max(powers, key=lambda o: powers[o])
    return polished(view, model, ServoTerm(kind, (0.0, 0.0, best)))


def resolved(view: Any, model: ServoHypothesis, term: ServoTerm) -> bool:
    """Whether a wave is no neighbour of the model's waves of its kind: closer orders are one wave with an envelope."""
    at = term.kind.linear
    beside = [t.q[at] for t in model.terms if t.kind == term.kind and term.kind.scanned == "position"]
    return all(abs(term.q[at] - order) > ONE_PERIOD / view.scene.reach for order in beside)


def regression(view: Any, model: ServoHypothesis) -> tuple[Array, Array]:
    """(acceleration, columns) at the judged samples; the columns are the drive and all of the model except inertia."""
    _, x, target, _, free = view.solved(model)
    columns = np.column_stack([target, stop.without_pushes(model, x)[:, 1:][:, free[1 : x.shape[1]]]])
    return x[view.at, 0], columns[view.at]


def acceleration_left(view: Any, model: ServoHypothesis) -> Array:
    """Residual of the acceleration under the model, shape (n,)."""
    return left_of(*regression(view, model))


def left_of(x: Array, columns: Array) -> Array:
    """Residual of the signals ``x``, shape (n, ...), on the columns."""
    norm = np.linalg.norm(columns, axis=0)
    columns = columns[:, norm > 0.0] / norm[norm > 0.0]
    return np.asarray(x - columns @ np.linalg.lstsq(columns, x, rcond=1e-10)[0])


def mutual(acceleration: Array, columns: Array) -> float:
    """Squared partial correlation of the acceleration and the drive, the first of the columns, beside the others.

    >>> force, noise, drive = np.random.default_rng(0).standard_normal((3, 100_000))
    >>> a = drive - 3.0 * force
    >>> [round(mutual(a, np.column_stack([drive + 0.1 * noise, *rest])), 2) for rest in ([noise], [noise, force])]
    [0.1, 1.0]
    """
    a, u = left_of(np.column_stack([acceleration, columns[:, 0]]), columns[:, 1:]).T
    return float(a @ u) ** 2 / max(float(a @ a) * float(u @ u), 1e-300)


def acceleration_tangent(view: Any, model: ServoHypothesis, rng: np.random.Generator) -> Tangent:
    """Residual of the acceleration under the model, with noise of its colour for comparison.

    The artefacts of the filters are subtracted from the drive (`InverseView.artefact`).  No record of the model itself
    is made, because a model without the force does not swing.
    """
    rest = acceleration_left(view, model)
    null = coloured(smoothed_power(rest), (N_DRAWS, rest.size), rng)
    n = independent(rest, view.n_effective)
    return Tangent(rest, null, regression(view, model)[1], n, view.told(model))


def explained_acceleration(view: Any, model: ServoHypothesis, grown: ServoHypothesis) -> tuple[float, float]:
    """(gain, share of the residual power removed) of the grown model, for the acceleration."""
    before, after = acceleration_left(view, model), acceleration_left(view, grown)
    n = independent(before, view.n_effective)
    g = gain(float(before @ before), float(after @ after), n)
    return g, float(max(0.0, -np.expm1(-g / n)))


# s in which the rms drive carries the motor across a play: a factor of two in the gap, within which a fit ends in it
CROSSINGS = 0.004 * np.sqrt(2.0) ** np.arange(11)
CONTACTS = (6.0, 12.0, 25.0, 60.0, 100.0)  # Hz, of the antiresonance in contact
IMPACTS = (0.15, 0.5)  # damping ratios of the contact: half of the speed is left after one impact, and hardly any
LOAD_DRY = (0.0, 0.25, 0.5)  # of the dry friction that is behind a transmission, where half of the inertia is
ANTIRESONANCES = np.geomspace(0.8, 65.0, 20)  # Hz
N_LIMITS = 40  # of the drive, and ages of it, over the plausible range: limits are an eighth apart
# Rounds over the shape numbers.  The step shrinks by 0.55 in each, to a tenth of the spacing of the starts, and a
# parabola goes through the last three: a spring of twice the drive, off by a tenth, leaves more than its neighbours
# explain.
POLISH = 4
MOST_WAVES = 480  # orders between the lowest and the highest, beside whole ones: half an order apart
HIGHEST = get_effect("cogging").quantities["order"].high  # waves per turn, or within 2 pi of half the travel


def inverse_kinds(model: ServoHypothesis) -> tuple[Candidate, ...]:
    """Candidates with a form in this view."""
    every = (*usable([t.kind for t in model.terms]), *stop.usable(model))
    return tuple(c for c in every if c.linear > 0 or c.transforms or c.code in TWO_MASS)


def polished(view: Any, model: ServoHypothesis, term: ServoTerm) -> ServoHypothesis:
    """The model with the term; its free shapes are moved downhill one at a time and the sizes solved for."""
    if term.kind in stop.KINDS:
        return stop.settled(view, model, term)
    grown = downhill(view, view.fit(model.with_term(term)), len(model.terms))
    if term.kind.code == k.SATURATION and unphysical(view, grown, len(model.terms)):
        grown = downhill(view, sound_limit(view, grown), len(model.terms))
    springs = any(t.kind.of_place for t in model.terms)  # their centres had moved for what the term is
    together = term.kind.later or springs or (term.kind.code in TWO_MASS and not term.kind.on_load)
    return jointly(view, grown, len(model.terms)) if together else grown


def sound_limit(view: Any, grown: ServoHypothesis) -> ServoHypothesis:
    """The model with the limit, its last term, that leaves least of what it lets through, of those that are physical.

    A limit near the dry friction lets through little but a sign, which that friction explains without any inertia: of
    the drive as a whole that left less than the limit that was there, of the drive beside its sign it leaves more.
    The model itself if no limit is physical.
    """
    last = len(grown.terms) - 1
    best, least = grown, np.inf
    low, high = grown.terms[last].kind.ranged(view.scene)[0]
    for width in np.geomspace(low, high, N_LIMITS):
        term = grown.terms[last].with_slot(0, float(width))
        if view.varies(view.reaching(grown.replaced(last, term)), grown.vector().size):
            other = view.fit(grown.replaced(last, term))
            share = unexplained(view, other, float(width))
            if share < least and not unphysical(view, other, last):
                best, least = other, share
    return best


def settled(view: Any, model: ServoHypothesis) -> ServoHypothesis:
    """The model with the shapes of its effects polished again beside the last one.

    Without that one, the rest position of a spring compensates for whatever was missing, and so does a stop's end.
    """
    for i in range(model.n_base, len(model.terms)):
        kind = model.terms[i].kind
        if kind in stop.KINDS:
            *others, moved = stop.settled(view, model.without(i), model.terms[i]).terms
            again = view.fit(model.with_terms((*others[:i], moved, *others[i:])))
            model = again if stop.unexplained(view, again) < stop.unexplained(view, model) else model
        elif kind.scanned != "step" and kind.code not in TWO_MASS:
            model = downhill(view, model, i)
    return model


def downhill(view: Any, grown: ServoHypothesis, i: int) -> ServoHypothesis:
    """The model with the free shape numbers of term ``i`` moved downhill one at a time and the sizes solved for."""
    term = grown.terms[i]
    free = [(j, log) for of, j, log in grown.free() if of == i and j >= term.kind.linear]
    if term.kind.scanned == "position" and float(term.q[2]).is_integer():
        free = []
    if not free:
        return grown
    cost = view.rms(view.gap(grown))
    widths = dict.fromkeys((j for j, _ in free), 0.0)
    for j, log in free:
        widths[j] = 0.35 if log else 0.3 * view.scene.reach
        if term.kind.code == k.SATURATION:
            widths[j] = 0.12  # the spacing of limits; one that is 0.1 % too low leaves a trace of its own
        elif term.kind.scanned == "position":
            widths[j] = np.log1p(0.2 / (view.scene.reach * term.q[j]))
        elif term.kind.scanned == "time":
            widths[j] = np.log1p(0.2 / (view.scene.duration * term.q[j]))
        elif term.kind.scanned == "step":
            widths[j] = 0.02 * view.scene.duration
    low, high = grown.bounds()
    limits = {j: (a, b) for (of, j, _), a, b in zip(grown.free(), low[2:], high[2:], strict=True) if of == i}

    def at(j: int, log: bool, x: float) -> tuple[float, ServoHypothesis]:
        moved = float(np.clip(x, *limits[j]))
        t = grown.terms[i].with_slot(j, float(np.exp(moved)) if log else moved)
        other, left = view.fit_with_gap(grown.replaced(i, t))
        return view.rms(left), other

    for _ in range(POLISH * (3 if term.kind.code == k.SATURATION else 1)):
        for j, log in free:
            value, width = grown.terms[i].q[j], widths[j]
            x = float(np.log(max(value, 1e-300))) if log else value
            sides = []
            for move in (-width, width):
                c, other = at(j, log, x + move)
                sides.append(c)
                if c < cost:
                    grown, cost = other, c
                    widths[j] *= 1.6
                    break
            else:  # between the two, at the vertex of the parabola through the three powers
                below, above = (c**2 - cost**2 for c in sides)
                if below + above > 0.0:
                    c, other = at(j, log, x + 0.5 * width * (below - above) / (below + above))
                    if c < cost:
                        grown, cost = other, c
            widths[j] *= 0.55
    return grown


def jointly(view: Any, grown: ServoHypothesis, i: int) -> ServoHypothesis:
    """The model with the free shape numbers of term ``i`` and of all springs fitted together, sizes solved for.

    Distance and damping of bristles trade off against each other, and so do frequency, damping and friction behind a
    coupling, and the centres of a linear and of a hardening spring; moved one at a time, they stop halfway to the
    minimum.
    """
    kinds = [t.kind for t in grown.terms]
    chosen = [kind.of_place or (n == i and not kind.scanned) for n, kind in enumerate(kinds)]
    free = [(n, *at) for n, at in enumerate(grown.free(), 2) if chosen[at[0]] and at[1] >= kinds[at[0]].linear]
    at = [n for n, *_ in free]
    if not at:
        return grown
    (low, high), steps = grown.bounds(), grown.steps()

    def moved(x: Array) -> tuple[ServoHypothesis, Array]:
        terms = list(grown.terms)
        for (_, of, j, log), value in zip(free, x, strict=True):
            terms[of] = terms[of].with_slot(j, float(np.exp(value)) if log else float(value))
        return view.fit_with_gap(grown.with_terms(terms))

    fit = least_squares(lambda x: moved(x)[1], grown.vector()[at], 3.0 * steps[at], (low[at], high[at]), tolerance=1e-3)
    best, left = moved(fit.x)
    return best if view.rms(left) < view.rms(view.gap(grown)) else grown


def widened(view: Any, model: ServoHypothesis) -> ServoHypothesis | None:
    """The last term with its later numbers freed, from the best of their starts."""
    last = model.terms[-1]
    rows = last.kind.opened(last.q, view.scene)
    if not rows:
        return None
    tried = [view.fit_with_gap(model.with_terms((*model.terms[:-1], ServoTerm(*row)))) for row in rows]
    return jointly(view, min(tried, key=lambda t: view.rms(t[1]))[0], len(model.terms) - 1)
