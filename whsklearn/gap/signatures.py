"""Candidates against the gap: screen all by their signature, refit the promising ones in full.

The signature of an effect is what the bench would show if a little of it were there, with the
sensitivities of the model in force projected out.  The screen is linear and cheap; what passes
is fitted jointly with everything else by simulation, so large effects are judged by what they do.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from whsklearn.gap import axis_kernel as k
from whsklearn.gap.axis_model import AxisModel, Term, size_unit
from whsklearn.gap.bench import Bench
from whsklearn.gap.candidates import CATALOGUE, Candidate, change_times
from whsklearn.gap.fit import Fit, gain_of
from whsklearn.gap.scan import scan, zoom

Array = NDArray[Any]
SMALL = 0.01  # share of the rms drive at which signatures are taken


TWO_MASS = {k.BACKLASH, k.BACKLASH_LOAD, k.FLEXIBLE, k.FLEXIBLE_LOAD}

# Heredity: what modifies dry or viscous friction is asked for only once that friction is there.
PARENTS = {
    k.STRIBECK: "coulomb",
    k.PRESLIDING: "coulomb",
    k.POSITION_FRICTION: "coulomb",
    k.LOAD_FRICTION: "coulomb",
    k.FRICTION_DRIFT: "coulomb",
    k.CHANGE_COULOMB: "coulomb",
    k.CHANGE_VISCOUS: "viscous",
    k.ASYMMETRIC_VISCOUS: "viscous",
    k.QUADRATIC_DRAG: "viscous",
}


@dataclass
class Trial:
    """One candidate, tried on top of a model.

    Attributes
    ----------
    kind : Candidate
    screened : float
        Drop of the whitened sum of squares that the signature promises.
    visible : float
        Share of the signature left after projection on the model's own sensitivities.
    expected : float
        Delta BIC that an effect of two percent of the rms drive would give in this record.
    model : AxisModel or None
        The joint refit, if it was worth one.
    cost : float
        Whitened training sum of squares of the refit.
    """

    kind: Candidate
    screened: float
    visible: float
    expected: float = np.inf
    start: tuple[float, ...] = ()
    sizes: tuple[float, ...] = ()
    model: AxisModel | None = None
    fit: Fit | None = None
    cost: float = np.inf
    scanned: tuple[Array, Array] | None = field(default=None, repr=False)

    @property
    def n_parameters(self) -> int:
        """Numbers that the refit added, shape included."""
        return self.kind.n_slots - len(self.kind.held)


def _signature(bench: Bench, model: AxisModel, residual: Array, kind: Candidate, shape: tuple[float, ...]) -> Array:
    """Columns of the whitened residual, one a linear slot, or the difference for a block."""
    if kind.linear == 0:
        return (bench.residual(model.with_term(Term(kind, shape))) - residual)[:, None]
    unit = SMALL * size_unit(kind, (0.0,) * kind.linear + shape, bench.scene)
    columns = []
    for j in range(kind.linear):
        sizes = tuple(unit if i == j else 0.0 for i in range(kind.linear))
        columns.append((bench.residual(model.with_term(Term(kind, (*sizes, *shape)))) - residual) / unit)
    return np.column_stack(columns)


def screen(bench: Bench, model: AxisModel, fit: Fit, kinds: tuple[Candidate, ...]) -> list[Trial]:
    """Every candidate at its best start, most promising first."""
    r = fit.residual
    low, high = model.bounds()
    base = fit.jacobian[:, (fit.x > low + 1e-6) & (fit.x < high - 1e-6)]  # a pinned number explains nothing more
    _, angle, speed = bench.follow(model)
    q, _ = np.linalg.qr(base)
    quiet = bench.quiet_variance()
    trials = []
    for kind in kinds:
        scanned = None
        starts = kind.starts(bench.scene)
        if kind.scanned:
            scanned = scan(kind, bench, r, base, angle, speed)
            starts = zoom(kind, bench, r, base, (angle, speed), *scanned)
        best = Trial(kind, -np.inf, 0.0, scanned=scanned)
        for shape in starts:
            columns = _signature(bench, model, r, kind, shape)
            if not np.all(np.isfinite(columns)):
                continue
            total = float(np.sum(columns**2))
            if total <= 0.0:
                continue
            visible = float(np.sqrt(max(0.0, 1 - np.sum((q.T @ columns) ** 2) / total)))
            drop, c = gain_of(r, base, columns)
            if kind.linear == 0 and c[0] < 0:
                drop = 0.0
            if drop > best.screened or not best.start:
                best = Trial(
                    kind, drop, visible, start=shape, sizes=tuple(map(float, c)) if kind.linear else (), scanned=scanned
                )
                if kind.linear:
                    unit = 0.02 * size_unit(kind, (0.0,) * kind.linear + shape, bench.scene)
                    best.expected = total * visible**2 * unit**2 / kind.linear / quiet
        trials.append(best)
    return sorted(trials, key=lambda t: -t.screened)


def refine(bench: Bench, model: AxisModel, trial: Trial, *, max_iterations: int = 12) -> Trial:
    """Fit the candidate jointly with the model from its best start."""
    starts = [(*trial.sizes, *trial.start)]
    if trial.kind.code in TWO_MASS:
        starts = _two_mass_variants(bench, trial)
        best = min(
            (bench.fit(model.with_term(Term(trial.kind, q)), max_iterations=3) for q in starts), key=lambda f: f[1].cost
        )
        trial.model, trial.fit = _settle(bench, best[0])
        if trial.model.has_play:  # the contact's frequency has ripples of its own
            others = [_settle(bench, _contact_at(trial.model, factor)) for factor in (0.8, 1.25)]
            trial.model, trial.fit = min(
                ((trial.model, trial.fit), *others), key=lambda f: bench.rms(bench.missing(f[0]), "train")
            )
    else:
        trial.model, trial.fit = bench.fit(model.with_term(Term(trial.kind, starts[0])), max_iterations=max_iterations)
    if trial.kind.scanned == "time":
        trial.model, trial.fit = bench.fit(_locate_change(bench, trial.model), max_iterations=max_iterations)
    trial.cost = trial.fit.cost
    return trial


def _settle(bench: Bench, model: AxisModel) -> tuple[AxisModel, Fit]:
    """Fits in a row, each weighted for the gap that the one before left: a large gap's weights hide a small one."""
    gap = bench.rms(bench.missing(model), "all")
    for _ in range(3):
        bench.weigh(gap)
        model, fit = bench.fit(model, max_iterations=12, tolerance=2e-3)
        before, gap = gap, bench.rms(bench.missing(model), "all")
        if gap > 0.8 * before:
            break
    return model, fit


def _contact_at(model: AxisModel, factor: float) -> AxisModel:
    """The model with its play's contact frequency moved, and its damping back at a usual one."""
    i = next(i for i, t in enumerate(model.terms) if t.kind.code in (k.BACKLASH, k.BACKLASH_LOAD))
    term = model.terms[i]
    hz = min(factor * term.q[2], term.kind.ranged(model.scene)[1][1])
    moved = term.with_slot(2, hz).with_slot(3, min(term.q[3], 0.3))
    return model.with_terms((*model.terms[:i], moved, *model.terms[i + 1 :]))


def resettle(bench: Bench, model: AxisModel) -> AxisModel:
    """The model with its play fitted anew, from its own contact frequency and from a lower one."""
    fits = [_settle(bench, m)[0] for m in (model, _contact_at(model, 0.7))]
    return min(fits, key=lambda m: bench.rms(bench.missing(m), "train"))


def _two_mass_variants(bench: Bench, trial: Trial) -> list[tuple[float, ...]]:
    """Starts of other load shares (and contact frequencies), since the two trade against each other."""
    q = trial.start
    if trial.kind.n_slots == 3:  # compliance, share, damping
        return [(q[0], share, q[2]) for share in (0.25, 0.45, 0.7)]
    top = bench.scene.resonance
    return [(q[0] * g, share, hz, q[3]) for g in (1.0, 2.0) for share, hz in ((0.3, 0.7 * top), (0.5, 0.9 * top))]


def _locate_change(bench: Bench, model: AxisModel) -> AxisModel:
    """The time of a change, looked for on the whole record, since one stretch alone holds it."""
    index = len(model.terms) - 1
    term = model.terms[index]
    span, best = 0.12 * bench.scene.seconds, term.q[1]
    low, high = change_times(bench.scene)

    def cost(t: float) -> float:
        w = bench.whitened(bench.missing(model.with_terms((*model.terms[:index], term.with_slot(1, t)))), on="all")
        return float(w @ w)

    for _ in range(4):
        grid = np.clip(best + span * np.linspace(-1, 1, 13), low, high)
        best = float(grid[int(np.argmin([cost(float(t)) for t in grid]))])
        span /= 5.0
    return model.with_terms((*model.terms[:index], term.with_slot(1, best)))


def usable_kinds(model: AxisModel, catalogue: tuple[Candidate, ...] = CATALOGUE) -> tuple[Candidate, ...]:
    """Candidates that the model does not hold yet; one two-mass effect at the most, one term of a name.

    Effects that come in several copies (cogging of two orders, two tones) may come again.
    """
    present = [t.kind for t in model.terms]
    names = {p.name for p in present}
    several = {"cogging", "disturbance_tone", "torque_ripple", "position_friction"}
    out = []
    for kind in catalogue:
        if any(p.name == kind.name for p in present) and kind.name not in several:
            continue
        if kind.code in TWO_MASS and any(p.code in TWO_MASS for p in present):
            continue
        if kind.name == "sensor_rectification" or PARENTS.get(kind.code, kind.name) not in names | {kind.name}:
            continue
        out.append(kind)
    return tuple(out)
