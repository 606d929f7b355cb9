"""Records of one axis as rows of the same regression, with the same filter, smoothing of the sign and effects."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from copy import copy
from dataclasses import replace

import numpy as np

from whsklearn.compare.rows import Array, Regression, blocks_between, drifting, reversals_of, slowest_of
from whsklearn.gap import least_squares as ols
from whsklearn.gap.calibration import n_effective, p_value
from whsklearn.gap.plant import DEFAULT_TOLERANCE
from whsklearn.gap.plants import servo_stop as stop
from whsklearn.gap.plants.servo_candidates import Candidate
from whsklearn.gap.plants.servo_families import Scene, family, inverse_kinds, resolved
from whsklearn.gap.plants.servo_inverse import InverseView
from whsklearn.gap.plants.servo_model import ServoHypothesis, ServoTerm
from whsklearn.gap.plants.servo_own import own as own_records
from whsklearn.gap.plants.servo_start import base_model, logged_late, start_of, with_earlier_drive
from whsklearn.gap.record import ServoRecord
from whsklearn.gap.tangent import Look, Tangent
from whsklearn.logs.units import inertia_unit, respelled

LAW = ("viscous", "coulomb", "input_offset")
ONE_WAY = ("viscous", "input_offset")  # without a reversal Coulomb friction is an offset
LEVEL = "level"  # what the two are called then
MOST_EFFECTS = 4  # beside the law: with more numbers than that a block of a record has too few samples for each
# Of the rms drive: filters alone leave 2 % of a record in which nothing is missing (`servo_own`), and no column takes
# half of that.
WORTH = 0.01
FEWEST_MOVING = 20  # samples: three for each number of a law and an effect
LOOKED_AT = 2.5  # samples a period of the cut-off: twice that are kept where there are as many, and tell the same
ENOUGH = 1000  # samples: fewer cost little to look at, and are not thinned
N_NULL = 19  # rows of chance, which give the moments of a Gumbel law to a sixth
PLACES = ("friction", "position")  # effects of the sensor and of time are no constants of an axis
SMALL = 0.01  # of a shape number: its columns change in proportion
APART = 0.05  # of a column's norm that the others do not explain: below it, two parameters describe the same thing
AS_WELL = 0.75  # of the largest gain: what explains less imitates another effect, and would not on another path
SHOWN = 0.1  # of a column's rms in the record that shows it best: a number that another record lacks cannot be compared


class OneWay(ValueError):
    """Raised for records whose friction and offset cannot be compared.

    >>> from whsklearn.gap import ServoRecord
    >>> t = np.arange(400) / 100.0
    >>> there, back = (ServoRecord(t, 0.1 * way + 0.0 * t, way * t) for way in (1.0, -1.0))
    >>> try:
    ...     axis_rows([there, back], ["there.csv", "back.csv"], 0.01, np.random.default_rng(0))
    ... except OneWay as error:
    ...     print(error)
    The records turn different ways and never reverse, so friction and offset cannot be separated. ...
    """


def axis_rows(
    records: list[ServoRecord],
    labels: list[str],
    alpha: float,
    rng: np.random.Generator,
    same_zero: bool = True,
) -> list[Regression]:
    """Every record with the columns that any of them needs.

    ``alpha``: probability of adding a column that no record needs. ``rng``: draws the random rows.
    ``same_zero``: whether all records count the position from one zero. If not, the numbers of effects that depend on
    the position (the phase of a wave, the rest position of a spring) belong to each record alone.
    """
    records, late = in_time(records)
    views, models = alike(records)
    for _ in range(MOST_EFFECTS):
        looks = missing(views, models, rng, alpha)
        most = max((look.gain for look in looks), default=0.0)
        terms = [k.start for k in looks if k.gain > AS_WELL * most and shown_by_all(views, models, k.start)]
        if not terms:
            break
        with_each = [[v.fit(m.with_term(term)) for v, m in zip(views, models, strict=True)] for term in terms]
        models = best_of(views, with_each)
    own = records[0].shown
    rows = [rows_of(v, m, label, own, by) for v, m, label, by in zip(views, models, labels, late, strict=True)]
    if not same_zero:
        there = {t.name for t in models[0].terms if t.kind.cls.place == "position"}
        rows = [r.without(there) for r in rows]
    traces = [traces_of(v, m, rng) for v, m in zip(views, models, strict=True)]
    cleared = [replace(r, target=r.target - trace) for r, trace in zip(rows, traces, strict=True)]
    if all(unexplained(c) < unexplained(r) for c, r in zip(cleared, rows, strict=True)):
        return cleared
    return rows  # the model makes other records than these, and its own say nothing about them


def traces_of(view: InverseView, model: ServoHypothesis, rng: np.random.Generator) -> Array:
    """What filters, quantization and timing alone leave of the drive at the judged samples, by the model's own records.

    With the bias of the numbers that a fit behind these filters finds (`whsklearn.gap.plants.servo_own.own`), so that
    the age of a drive that is held over each sample is zero.
    """
    made, unbiased = own_records(view, model, rng)
    x, at = view.columns(model)[0], view.at
    bias = x @ (view.sizes(model) - view.sizes(unbiased)) + made.late * ols.slope(x @ view.sizes(model), view.step)
    return np.asarray(made.mean + bias[at])


def unexplained(rows: Regression) -> float:
    """Norm of the drive that numbers and nuisances leave."""
    z = np.column_stack([rows.columns / rows.sizes, rows.nuisances])
    return float(np.linalg.norm(rows.target - z @ np.linalg.lstsq(z, rows.target, rcond=None)[0]))


def best_of(views: Sequence[InverseView], rivals: list[list[ServoHypothesis]]) -> list[ServoHypothesis]:
    """Of models with one effect more, each fitted to all records, the one with the lowest BIC.

    Filters and the smoothed sign leave ten times the noise of a good encoder, and beside that a spring looked like
    gravity: each rival is judged without what its own records leave, and where none of them knows the friction, for the
    axis rests, by little (`whsklearn.gap.plants.servo_own`).  A look does not tell a spring from gravity on a short
    path: what it leaves has the colour of neither, and counts as a few samples.  The independent samples are the best
    one's.
    """
    if len(rivals) == 1:
        return rivals[0]
    totals = np.zeros(len(rivals))
    for k, view in enumerate(views):
        models = [fitted[k] for fitted in rivals]
        owns = [own_records(view, m, np.random.default_rng(0))[0] for m in models]
        weight = np.min([own.weight for own in owns], axis=0)
        left = [weight * (view.gap(m) - own.mean) for m, own in zip(models, owns, strict=True)]
        n = n_effective(min(left, key=lambda rest: float(rest @ rest)), view.n_effective)
        kinds = [m.terms[-1].kind for m in models]
        numbers = np.array([kind.linear + (len(kind.fields) - kind.linear) / len(views) for kind in kinds])
        power = np.array([rest @ rest for rest in left]) / (weight @ weight)
        totals += n * np.log(np.maximum(power, 1e-300)) + numbers * np.log(n)
    return rivals[int(np.argmin(totals))]


def in_time(records: list[ServoRecord]) -> tuple[list[ServoRecord], list[float]]:
    """The records with drives that act when they are written, and by how much each was moved (s).

    Numbers are linear in the age of a drive: about zero, an age T at the frequency w is found as sin(w T) / w, of 6 ms
    5.3.
    """
    moved, late = [], []
    for record in records:
        view = start_of(record, LAW, DEFAULT_TOLERANCE)[0]
        lead = logged_late(view, view.fit(base_model(LAW, view.scene)), either_way=True)
        moved.append(with_earlier_drive(record, lead) if lead else record)
        late.append(-lead * record.dt)
    return moved, late


def alike(records: list[ServoRecord]) -> tuple[list[InverseView], list[ServoHypothesis]]:
    """All records behind the lowest of their cut-offs, with one softness of the sign, and their base models."""
    began = [start_of(r, LAW, DEFAULT_TOLERANCE)[0] for r in records]
    cutoff, slowest = min(v.cutoff for v in began), max(v.slowest for v in began)
    views = [InverseView(v.record, v.scene, cutoff, v.start, v.noise) for v in began]
    for v in views:
        v.motion, v.slowest = v.motion._replace(kappa=2.0 / slowest), slowest
        judge_motion(v)
    ways = {direction(v.motion.velocity, slowest) for v in views}
    if {1, -1} <= ways and 0 not in ways:
        raise OneWay(
            "The records turn different ways and never reverse, so friction and offset cannot be separated. Log a run "
            "that reverses."
        )
    law = LAW if 0 in ways else ONE_WAY
    return views, [v.fit(base_model(law, v.scene)) for v in views]


def judge_motion(view: InverseView) -> None:
    """Exclude rests from a record with motion: while an axis sticks, its drive can be anything up to its friction."""
    if view.moving.sum() >= FEWEST_MOVING:
        view.at = np.flatnonzero(view.moving)
        view.n_effective = view.at.size * min(1.0, 2.0 * view.cutoff * view.step)


def direction(speed: Array, slowest: float) -> int:
    """1 or -1 for an axis that turns one way only, 0 for one that reverses."""
    return 0 if reversals_of(speed, slowest).size else int(np.sign(np.mean(speed)))


def missing(
    views: Sequence[InverseView], models: Sequence[ServoHypothesis], rng: np.random.Generator, alpha: float
) -> list[Look]:
    """The effects whose columns explain more of all records together than chance does.

    An axis is one axis: what all its records need is asked of all of them, each with numbers of its own.
    """
    every = [looks_of(v, m, rng) for v, m in zip(views, models, strict=True)]
    worth = [m.scene.torque * WORTH for m in models]
    out = []
    for kind in set.intersection(*map(set, every)):
        looks = [each[kind] for each in every]
        best = max(looks, key=lambda look: look.gain)
        gain, null = sum(look.gain for look in looks), np.sum([look.null for look in looks], axis=0)
        p = p_value(gain, null, len(every[0]), sum(look.degrees for look in looks) if best.degrees else 0.0)
        if p <= alpha and any(look.size > least for look, least in zip(looks, worth, strict=True)):
            out.append(replace(best, gain=gain, null=null))
    return out


def looks_of(view: InverseView, model: ServoHypothesis, rng: np.random.Generator) -> dict[Candidate, Look]:
    """What the columns of every constant effect explain of one record's residual, and of random rows of its colour."""
    own, x = own_records(view, model, rng)[0], view.solved(model)[1]
    fewer = min(int(1.0 / (LOOKED_AT * view.cutoff * view.step)), view.at.size // ENOUGH)
    every = slice(None, None, max(1, fewer))
    left, null, weight = (view.gap(model) - own.mean)[every], own.null[:N_NULL, every], own.weight[every]
    view = copy(view)
    view.at = view.at[every]
    scene = Scene(view, model, whole_waves=True)
    time = view.time[:: view.every][view.at]
    slow, _ = drifting(np.ones((time.size, 1)), ("input_offset",), time, slowest_of(path_of(view), time))
    tangent = Tangent(left, null, np.column_stack([x[view.at], slow]), own.n_effective, weight)
    return {k: look for k in inverse_kinds(model) if constant(k) and (look := tangent.look(family(scene, k)))}


def path_of(view: InverseView) -> Array:
    """Position at the judged samples."""
    return view.motion.position[:: view.every][view.at]


def constant(kind: Candidate) -> bool:
    """Whether an effect is a constant of the axis with its own columns, and not a refinement of another effect."""
    return kind.cls.place in PLACES and kind.linear > 0 and not (kind.driven or kind.parent or kind in stop.KINDS)


def shown_by_all(views: list[InverseView], models: list[ServoHypothesis], term: ServoTerm) -> bool:
    """Whether the effect's columns are distinct from the model's in every record, and of similar size in all."""
    sizes = []
    for view, model in zip(views, models, strict=True):
        if not resolved(view, model, term):
            return False
        z = view.term_columns(model, term, None)[view.at]
        sizes.append(view.rms(z))
        q = np.linalg.qr(view.columns(model)[0][view.at])[0]
        norm = np.linalg.norm(z, axis=0)
        if norm.min() == 0.0 or np.linalg.svd((z - q @ (q.T @ z)) / norm, compute_uv=False).min() < APART:
            return False
    return min(sizes) > SHOWN * max(sizes)


def by_shape(view: InverseView, model: ServoHypothesis) -> Array:
    """What a small change of each shape number would add to the drive, where the model's other columns do not.

    A wave of unknown order is no wave of known order: what its amplitude is depends on it.
    """
    q = np.linalg.qr(view.columns(model)[0][view.at])[0]
    out = [np.zeros((view.columns(model)[0].shape[0], 0))]
    for i in range(model.n_base, len(model.terms)):
        term = model.terms[i]
        kind = term.kind
        for slot in range(kind.linear, len(kind.fields)):
            step = SMALL * (abs(term.q[slot]) if kind.ratios(slot) else kind.spread(slot - kind.linear, model.scene))
            ends = [view.term_columns(model, term.with_slot(slot, term.q[slot] + by), None) for by in (step, -step)]
            change = (ends[0] - ends[1]) @ np.array(term.q[: kind.linear])
            beside = change[view.at] - q @ (q.T @ change[view.at])
            if np.linalg.norm(beside) > APART * np.linalg.norm(change[view.at]):
                out.append(change[:, None])
    return np.column_stack(out)


def rows_of(
    view: InverseView, model: ServoHypothesis, label: str, own: Mapping[str, str], late: float = 0.0
) -> Regression:
    """The judged samples of a view, with numbers in the units given by ``own``; the last is the age of the drive.

    ``late``: by how much the drive of the view's record has been moved (s, see `in_time`).
    """
    at = view.at
    x = view.columns(model)[0]
    rate = ols.slope(x @ view.sizes(model), view.step)
    drive, motion = view.record.units
    kinds = [(t.name, t.kind) for t in model.terms for _ in range(t.kind.linear)]
    sizes = [kind.cls.quantities[kind.cls.size].unit.replace("Nm", drive).replace("rad", motion) for _, kind in kinds]
    told = [respelled(unit, own) for unit in (inertia_unit(drive, motion), *sizes)]
    both_ways = any(name == "coulomb" for name, _ in kinds)
    names = ("inertia", *(n if both_ways or n not in ONE_WAY else LEVEL for n, _ in kinds), "delay")
    columns = np.column_stack([x[at] * [by for by, _ in told], rate[at]])
    units = (*(unit for _, unit in told), "s")
    time, path = view.time[:: view.every][at], path_of(view)
    speed = view.motion.velocity[:: view.every][at]
    turns = reversals_of(speed - (np.mean(speed) if LEVEL in names else 0.0), view.slowest)
    slowest = slowest_of(path, time)
    nuisances, of = drifting(columns, names, time, slowest)
    shapes = by_shape(view, model)[at]
    covers = {t.name: t.kind.cls.covers for t in model.terms if t.kind.cls.covers}
    return Regression(
        label, names, units, columns, view.drive[at] + late * rate[at], at, view.step, time, path,
        blocks_between(turns, at.size), np.column_stack([nuisances, shapes]), of,
        np.array([view.rms(view.drive[at])]), slowest, covers,
        frozenset({"inertia", *(n for n, kind in kinds if kind.positive and n in LAW and both_ways)}),
        (*(by for by, _ in told), 1.0), parts=("", *(part for t in model.terms for part in parts_of(t)), ""),
    )  # fmt: skip


def parts_of(term: ServoTerm) -> list[str]:
    """What tells the numbers of one effect apart: those of a wave are its cosine and sine.

    >>> from whsklearn.gap.plants.servo_candidates import candidate
    >>> parts_of(ServoTerm(candidate("cogging"), (0.1, 0.2, 12.0))), parts_of(ServoTerm(candidate("coulomb"), (0.2,)))
    (['cos 12 q', 'sin 12 q'], [''])
    """
    if term.kind.linear != 2:
        return [""] * term.kind.linear
    order = f"{term.q[2]:.4g} " if term.kind.scanned == "position" else ""
    return [f"cos {order}q", f"sin {order}q"]
