"""From the search result to a `Diagnosis`: proof, verdict, effects with errors and rivals, tables, places."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import replace
from typing import Any

import numpy as np

from whsklearn.effects.base import rms
from whsklearn.gap import localisation
from whsklearn.gap.calibration import gain, n_effective, p_value, separable, vuong
from whsklearn.gap.diagnosis import (
    CandidateLine,
    Diagnosis,
    LearnedTorques,
    NamedEffect,
    curve_in,
    families,
    place_in,
    rows_in,
    spoken,
)
from whsklearn.gap.pictures import pictures_in
from whsklearn.gap.plant import QUIET, WORTH_A_WORD, quiet
from whsklearn.gap.proof import closure, prove
from whsklearn.gap.search import HALF, LEAST_SHARE, STILL, Found, Named, Step, meet, renamed, stands
from whsklearn.gap.sentences import next_experiment, summary
from whsklearn.gap.standard_errors import errors_of, labelled_errors, p_of_zero
from whsklearn.gap.tangent import Look
from whsklearn.logs.units import respelled

UNFINISHED = ("unknown", "partial", "coloured_noise")  # verdicts beside which a nameless torque is learned
# Why the proof refuses a name that the search had taken.
NO_CLOSER = "a simulation with it comes no closer to the record"
NOT_SUPPORTED = "its numbers, with all others refitted, are not physical or cannot be told from zero"
MOST_LEFT = "the model with it leaves most of the gap"
ITSELF = "what the base model itself lacks explains more"
# Rms of an effect, as a share of the drive, that a record must be able to show, or the effect is not testable.
SHOWN = 0.02


def conclude(plant: Any, found: Found, rng: np.random.Generator, say: Callable[[str], None], alpha: float) -> Diagnosis:
    """The diagnosis in the units of the log; ``found.model``, in SI, becomes the model that is returned to the user."""
    say("prove")
    own, motion = plant.own_units, plant.units[1]
    gap = plant.gap_unit
    diagnosis, rows = _proved(plant, found, rng, alpha)
    diagnosis.alpha = alpha
    if diagnosis.verdict in UNFINISHED and not diagnosis.shortfall:
        rows = _learned(plant, found, diagnosis, rows, rng)
    rows = rows_in(rows, motion, own, "before", "after", "floor")
    diagnosis.horizons = [{k: v for k, v in r.items() if k not in ("first", "last")} for r in rows]
    headline = _headline(plant, rows)
    diagnosis.before, diagnosis.after = rows_in([headline["first"], headline["last"]], motion, own, "rmse", "mu_e")
    diagnosis.floor, diagnosis.closure = headline["floor"], headline["closure"]
    diagnosis.interrupted = found.interrupted
    diagnosis.candidates = candidates(found, diagnosis, plant, alpha)
    shown = plant.shown_by(found.model)
    before, after, floor = (shown * x / plant.scale for x in plant.figures(found.base, found.model)[:3])
    diagnosis.figures = (before, after, floor)
    say("locate")
    _located(plant, found, diagnosis, gap, rng)
    rounds = [
        {"number": s.number, "gap": shown * s.gap, "gap_share": shown * s.gap / plant.scale, "tried": len(s.looks),
         "taken": s.taken.name if s.taken else "nothing",
         "delta_bic": s.taken.delta_bic if s.taken else max((f.delta_bic for f in s.fitted), default=0.0)}
        for s in found.steps
    ]  # fmt: skip
    diagnosis.rounds = rows_in(rounds, gap, own, "gap")
    diagnosis.base_parameters = _base_numbers(plant, found)
    diagnosis.next_experiment = next_experiment(diagnosis)
    for e in diagnosis.effects:
        e.units = plant.units_at(e.joint)
    if diagnosis.learned is not None:
        curves = diagnosis.learned.curves
        diagnosis.learned.curves = tuple(curve_in(c, plant.units, own) for c in curves)
    diagnosis.logged = plant.logged
    diagnosis.units = {role: own.get(u, u) for role, u in zip(("drive", "position"), plant.units, strict=True) if u}
    told = plant.told(found.base, found.model)
    diagnosis.residual_tests, diagnosis.notes, diagnosis.joints = told.tests, told.notes, told.joints
    if diagnosis.verdict in UNFINISHED and not diagnosis.shortfall:
        diagnosis.next_experiment = told.experiment or diagnosis.next_experiment
    diagnosis.pictures = pictures_in(told.pictures | {"units": plant.units}, gap, own)
    diagnosis.horizon, diagnosis.horizon_unit = plant.headline, plant.horizon_unit
    diagnosis.sentence = summary(diagnosis, plant)
    return diagnosis


def _base_numbers(plant: Any, found: Found) -> list[dict[str, Any]]:
    """The base model's own numbers before and after the repair, with standard errors and units."""

    def values(model: Any) -> dict[str, float]:
        return {name: value for name, (value, _) in plant.numbers(model).items()}

    first, last = plant.numbers(found.base), plant.numbers(found.model)
    before, after = (errors_of(plant.linearised(m), values) for m in (found.base, found.model))
    own = plant.own_units if plant.whole == "drive" else {}  # a simulator's numbers keep the units of its file
    out = []
    for name, (value, unit) in first.items():
        row = {"name": name, "before": value, "after": last[name][0], "before_error": before.get(name),
               "after_error": after.get(name), "unit": respelled(unit, own)[1]}  # fmt: skip
        out += rows_in([row], unit, own, "before", "after", "before_error", "after_error")
    return out


def _proved(plant: Any, found: Found, rng: np.random.Generator, alpha: float) -> tuple[Diagnosis, list[dict[str, Any]]]:
    """Verdict, effects and the rows of the proof, which agree with each other."""
    asked = found.model
    reading = plant.reading(found.base, asked)
    if reading.shortfall:
        _give_back(found, ITSELF)
        rows = prove(plant, found.base, found.base, rng, reading.given)
        return Diagnosis("unknown", "", shortfall=reading.shortfall), rows
    rows = _closing(plant, found, rng, reading.given, alpha)
    if found.model is not asked:
        reading = plant.reading(found.base, found.model)
    if reading.effects and not found.taken:
        return Diagnosis("named", "", effects=reading.effects), rows
    row = _headline(plant, rows)
    verdict = verdict_of(plant, found, alpha, row)
    if verdict == "ambiguous" and not plant.exact:
        found.taken = [replace(t, rivals=_standing_rivals(plant, found, i, alpha)) for i, t in enumerate(found.taken)]
        verdict = verdict_of(plant, found, alpha, row)
    if plant.exact and found.taken and stays_open(rows):
        verdict = "unknown"  # no name without closure in simulation
    diagnosis = Diagnosis(verdict, "")
    if verdict in ("named", "ambiguous", "partial"):
        diagnosis.effects = reading.effects + _effects(plant, found)
    elif found.taken:  # nothing can be named: the base model is returned, with its figures
        _give_back(found, MOST_LEFT)
        rows = prove(plant, found.base, found.base, rng, reading.given)
    return diagnosis, rows


def _closing(plant: Any, found: Found, rng: np.random.Generator, given: Any, alpha: float) -> list[dict[str, Any]]:
    """The proof of the model with as many of the effects as close the gap in simulation; the last ones go first.

    What the record could not distinguish from the last effect to go is tried in its place (`_instead`): simulation
    tells a delay from a lag.
    """
    # as fair as the repaired model: what other numbers of the base alone close in simulation, no effect has closed
    found.base = plant.to_simulate(found.base)
    if found.taken:
        found.model = plant.retold(found.model)
        renamed(found)
    while found.taken:
        fitted = found.model
        # numbers refitted along the run may suit the samples that they were fitted to, and no others
        refitted = plant.to_simulate(fitted)
        models = (refitted, fitted) if refitted is not fitted else (fitted,)
        standing = _standing(plant, found.base, models, rng, given)
        if standing is not None:
            found.model, rows = standing
            if (i := _unsound(plant, found, alpha)) is None:
                return rows
            found.model = fitted
        else:
            i = len(found.taken) - 1
        gone: list[Named] = []
        why = NO_CLOSER if standing is None else NOT_SUPPORTED
        while i is not None:
            gone.append(found.taken.pop(i))
            found.model = plant.settled(found.model.without(found.model.n_base + i))
            i = _unsound(plant, found, alpha) if standing is not None else None
        found.refused |= {g.name: why for g in gone}
        other = _instead(found, max(gone, key=lambda g: g.size))
        if other is not None:
            found.model = plant.settled(found.model.with_terms((*found.model.terms, other.model.terms[-1])))
            found.taken.append(other)
        alike = standing is None and other is None  # the model is that of the round which added the effect
        step = found.steps[min(len(found.taken), len(found.steps) - 1)]
        found.remainder = step.looks if alike else plant.looks(found.model, rng)
    found.model = found.base
    return prove(plant, found.base, found.base, rng, given)


def _instead(found: Found, gone: Named) -> Named | None:
    """What takes the place of an effect that goes: what the record could not distinguish from it; None if nothing.

    In the place of the effect that explains most it is the next sound one of its round, or of another round that
    fitted it, first of the one in which it explained about as much.  The one that goes stays a rival, so that no such
    name is certain.
    """
    most = gone.size >= max((t.size for t in found.taken), default=0.0)
    there = {t.name for t in found.taken}

    def off(step: Step) -> float:
        return min((abs(f.size - gone.size) for f in step.fitted if f.name == gone.name), default=np.inf)

    later_first = found.steps[::-1]
    for step in sorted(later_first, key=off):
        for f in step.fitted if np.isfinite(off(step)) else []:
            alike = most or f.name in (*gone.rivals, *gone.effect.aliases)
            if alike and not f.reason and f.name not in there | found.refused.keys() and meet(f.look, gone.look):
                return replace(f, rivals=[gone.name, *(r for r in gone.rivals if r not in there | {f.name})])
    return None


def _standing(
    plant: Any, base: Any, models: Iterable[Any], rng: np.random.Generator, given: Any
) -> tuple[Any, list[dict[str, Any]]] | None:
    """The first of the models that closes the gap in simulation, with its proof; None if none does."""
    proofs = []
    for model in models:
        rows = prove(plant, base, model, rng, given)
        if _headline(plant, rows)["closure"] >= 0.0 or plant.contributes(base, model):
            return model, rows
        proofs.append((model, rows))
    # restarts may make a run useless at one horizon that still shows the torque at a shorter one
    for model, rows in proofs:
        shorter = [r["horizon"] for r in rows if r["horizon"] < plant.headline and r["closure"] >= LEAST_SHARE]
        if shorter:
            plant.headline = max(shorter)
            return model, rows
    return None


def _standing_rivals(plant: Any, found: Found, i: int, alpha: float) -> list[str]:
    """The rivals of the effect ``i`` that simulate held-out samples as well in its place, with all numbers refitted.

    A rival with which more than half of the error stays, as it does not with the one taken, would itself be no more
    than a part of the answer.  Blocks cannot show that of a stop that is touched twice: a limit of the drive had been
    left as its equal.
    The search compares effects by the drive, where the forms of some are of first order only: a play seen from the
    load, and a flexible coupling.  Over exact records its comparison is already one of simulations.  As there, blocks
    are not asked if nothing worth naming is left with the effect taken: a Stribeck curve left 0.03 % of the power and a
    change of friction 21 %, and blocks did not agree (z = 1.9).
    """
    done = plant.silent(found.model)
    index = found.model.n_base + i
    terms_of = {f.name: f.model.terms[-1] for s in found.steps for f in s.fitted if not f.reason}
    looks = {k.name: k for k in found.remainder} | {k.name: k for s in found.steps for k in s.looks}
    out = []
    for name in found.taken[i].rivals:
        if name not in terms_of and name in looks:  # the run, or what a look explains to first order, made it a rival
            terms_of[name] = plant.refine(found.model.without(index), looks[name]).terms[-1]
        if name in terms_of:
            state = plant.snapshot()  # the shapes of all others suited the one taken
            rival = plant.to_simulate(plant.settled(found.model.replaced(index, terms_of[name])))
            plant.restore(state)
            y, held = plant.measured(found.base, found.model, rival)
            gap, left, rest = ((y - plant.simulate(m, plant.headline))[held] for m in (found.base, found.model, rival))
            if rms(left) <= HALF * rms(gap) < rms(rest):
                continue
            lead = gain(float(rest @ rest), float(left @ left), n_effective(rest))
            told = done and rms(left) ** 2 < HALF * rms(rest) ** 2
            if separable(lead, np.inf if told else vuong(rest, left), np.zeros(0), alpha):
                continue
        out.append(name)
    return out


def _unsound(plant: Any, found: Found, alpha: float) -> int | None:
    """Index of the smallest effect that its final numbers do not support; None if there is none.

    Fits beside other effects and along the run may end at a limit, to which physics objects: a coupling whose load is
    as light as its range allows stands for something that has no name here.  Or any fit ends where the effect's size
    cannot be told from zero at ``alpha`` with all numbers free: a coupling beside a dead zone of MuJoCo had 1.3
    standard errors, and a Stribeck curve that had stood, alone, for a wrong age of the drive 0.2; true effects have
    eleven and more.  Or the numbers have made it too little for a name: a wave of one and a half periods over the
    travel had become one of a third.  Where own records are exact, the search itself ended there.
    """
    model, n = found.model, found.model.n_base
    if plant.exact:
        return None
    fit, unsound = plant.linearised(model), []
    for i in reversed(range(len(found.taken))):
        last = model.with_terms((*model.terms[: n + i], *model.terms[n + i + 1 :], model.terms[n + i]))
        if not stands(plant, model, n + i) or plant.half_shown(last) or p_of_zero(fit, n + i) > alpha:
            unsound.append(i)
    # An effect too many moves the numbers of the others: a spring's rest position was driven out of its range by
    # presliding friction that was not there.
    return min(unsound, key=lambda i: found.taken[i].size, default=None)


def _headline(plant: Any, rows: list[dict[str, Any]]) -> dict[str, Any]:
    """The row of the headline horizon."""
    return next(r for r in rows if r["horizon"] == plant.headline)


def stays_open(rows: list[dict[str, Any]]) -> bool:
    """Whether the named effects close almost nothing, at any horizon, of a gap that the proof shows at one.

    Noise of the record's own colour, or held-out samples that happen to be louder than the others, hide over the whole
    record what a prediction of one step shows.

    >>> [stays_open([{"closure": 0.03, "before": before, "floor": 1.0}]) for before in (2.0, 1.0)]
    [True, False]
    """
    seen = any(r["before"] > QUIET * r["floor"] for r in rows)
    return seen and all(r["closure"] < LEAST_SHARE for r in rows)


def verdict_of(plant: Any, found: Found, alpha: float, run: dict[str, float]) -> str:
    """The verdict, from the effects taken and the residual.

    ``alpha``: level of the test for what has no name. ``run``: row of the proof (`whsklearn.gap.proof.prove`) at the
    headline horizon.
    """
    least = plant.tolerance * plant.scale
    nameless = max((k.size for k in found.remainder if not k.name and k.p_value <= alpha), default=0.0)
    # Of what follows the motion or the drive, with or without a name: coloured noise, such as the torque of other
    # joints, could be no part of any name.  A lag refused for its free run explained 87 % of a gap, and gravity 2 %.
    follows = max((k.size for k in found.remainder if k.p_value <= alpha), default=0.0)
    # what only a refused name explains has no name either; looks at exact records are not so sharp
    figures = plant.figures(found.base, found.model, nameless if plant.exact else follows)
    before, after, floor, still = figures[:4]
    silent = quiet(after, floor, least)
    if plant.exact:  # own records that lack nothing but an effect need no margin
        silent = silent and nameless <= least
    if not found.taken:
        if found.interrupted and not silent:  # no round is finished, or none had found anything
            return "unknown"
        if silent or not found.steps:
            asked = {k.name for k in found.remainder if k.name}
            blind = len(_unseen(plant, found, alpha)) > HALF * len(asked)
            return "not_testable" if asked and blind else "no_gap"
        return "unknown" if follows > least else "coloured_noise"
    # a run that noise alone explains before the repair shows no closure
    shown = run["closure"] if run["before"] > QUIET * run["floor"] else 0.0
    explained = max(before**2 - after**2, shown * before**2 if figures.by_run else 0.0)
    if explained < LEAST_SHARE * (explained + follows**2) or after > QUIET * before:
        return "unknown"  # the second: no name closes in simulation what it opens in the drive
    if not plant.exact and max(explained, shown * before**2) < LEAST_SHARE * before**2:
        return "unknown" if follows > least else "coloured_noise"
    # Measured as in simulation: with half of the power gone 0.7 of the gap is left, as where two tones stand for a wave
    # of the position that a tone modulates.  Exact records: the errors are already those of a free run.
    closed = (before - after) / max(before - floor, 1e-300)
    if (closed if plant.exact else min(closed, run["closure"])) < HALF:
        return "partial"
    # Beside a play nothing counts as nameless, so that the run alone must say that little is left.
    if figures.by_run and run["closure"] < 1.0 - LEAST_SHARE:
        return "partial"
    # A remainder below the tolerance is not worth naming, unless the free run shows that it matters.
    if plant.exact and still > least:  # own records that lack nothing but an effect need no margin
        return "partial"
    if not figures.by_run and any(_leaves(f) < HALF * (after / before) ** 2 for f in found.steps[0].fitted):
        return "partial"  # one effect, which physics refuses, does better than all names: they stand for something else
    matters = still > least or run["after"] > QUIET * run["floor"]
    if (still > STILL * before and matters) or not plant.enough(found.model):
        return "partial"
    return "ambiguous" if any(t.rivals for t in found.taken) else "named"


def _leaves(fitted: Named) -> float:
    """Share of the gap's power that an effect leaves by itself."""
    return float(fitted.errors @ fitted.errors) / max(float(fitted.before @ fitted.before), 1e-300)


def _unseen(plant: Any, found: Found, alpha: float) -> set[str]:
    """Effects that this record could not show at `SHOWN` of the whole, after subtracting all that was found."""
    if not found.steps:
        return set()
    shown = {k.name for k in found.remainder if shown_at(k, found.steps[-1], alpha) <= SHOWN * plant.scale}
    return {k.name for k in found.remainder if k.name} - shown


def shown_at(look: Look, step: Any, alpha: float) -> float:
    """Rms of the smallest effect of a family that would be named, in the unit of the gap; infinite if none would."""
    n = step.n_effective
    g = float(np.mean(look.null)) + 2.0
    while g < 4.0 * n and p_value(g, look.null, len(step.looks)) > alpha:
        g *= 1.1
    if g >= 4.0 * n:
        return float("inf")
    return float(step.gap * np.sqrt(-np.expm1(-g / n)) / max(look.visible, 1e-12))


def candidates(found: Found, diagnosis: Diagnosis, plant: Any, alpha: float) -> list[CandidateLine]:
    """The table of candidates: every catalogue name once, with its evidence and why it is or is not the answer."""
    named = {e.label: e for e in diagnosis.effects}
    aliases = {a for e in diagnosis.effects for a in e.aliases}
    lines: dict[str, CandidateLine] = {}
    if found.steps:
        step = found.steps[0]
        unseen = _unseen(plant, found, alpha)
        fitted: dict[str, Named] = {}
        for f in step.fitted:
            fitted.setdefault(f.name, f)
        for look in sorted(step.looks, key=lambda k: k.p_value):
            if not look.name or look.name in lines:
                continue
            fit = fitted.get(look.name)
            status, reason = "ruled_out", _reason(look, fit, plant, alpha)
            if look.name in unseen and look.p_value > alpha:
                status = "not_testable"
                reason = f"{100 * SHOWN:.0f} % of the rms {plant.whole} would not show in this record"
            price = look.n_numbers * np.log(step.n_effective)
            g = look.gain - price if fit is None else fit.delta_bic
            share = plant.gap_share(
                look if fit is None else replace(look, gain=fit.gain, size=fit.size * plant.scale), step
            )
            lines[look.name] = CandidateLine(look.name, float(g), share, status, reason, look.p_value)
    for name, line in lines.items():
        if name in named:
            line.status, line.reason = "named", "accepted"
            line.delta_bic, line.closure, line.p_value = (
                named[name].delta_bic, float(np.clip(named[name].closure, -1, 1)), named[name].p_value
            )  # fmt: skip
        elif name in aliases:
            line.status, line.reason = "alias", "this record cannot distinguish it from the named effect"
        elif not line.reason:
            joint = name.partition(" at ")[2]
            here = [e.label for e in diagnosis.effects if e.joint in ("", joint)]
            little = f"explains less than {spoken(here[0])}" if here else "explains too little"
            line.reason = found.refused.get(name, little)
    for name, late in named.items():
        if name not in lines:
            share = float(np.clip(late.closure, -1, 1))
            lines[name] = CandidateLine(name, late.delta_bic, share, "named", "accepted later", late.p_value)
    return sorted(lines.values(), key=lambda c: -c.delta_bic)


def _reason(look: Look, fitted: Named | None, plant: Any, alpha: float) -> str:
    """Why a candidate is rejected before its rivals are considered; empty if it is not."""
    if look.whole < plant.tolerance * plant.scale:
        share = 100 * look.whole / plant.scale
        least = 100 * plant.tolerance
        return f"it explains {share:.2f} % of the rms {plant.whole}, below the tolerance of {least:.2f} %"
    if look.p_value > alpha:
        return f"the model's own records show as much (p = {look.p_value:.2g})"
    return fitted.reason if fitted is not None else ""


def _learned(
    plant: Any, found: Found, diagnosis: Diagnosis, rows: list[dict[str, Any]], rng: np.random.Generator
) -> list[dict[str, Any]]:
    """Add the unnamed residual to the model as learned curves, if they improve the free run at every horizon."""
    learned = plant.learn(found.model)
    if learned is None:
        return rows
    model, curves = learned
    grown = prove(plant, found.base, model, rng, plant.reading(found.base, found.model).given)
    last = _headline(plant, grown)
    share = closure(_headline(plant, rows)["after"], last["after"], last["floor"])
    worse = any(new["after"] > old["after"] for new, old in zip(grown, rows, strict=True))
    if share < WORTH_A_WORD or worse:
        return rows
    found.model = model
    diagnosis.learned = LearnedTorques(curves, share)
    if diagnosis.verdict == "coloured_noise":  # it follows a signal of the motion after all
        diagnosis.verdict = "unknown"
    return grown


def _give_back(found: Found, why: str) -> None:
    """Return to the base model without any effect, for the reason ``why``."""
    found.model = found.base
    found.refused |= {t.name: why for t in found.taken}
    found.taken.clear()


def _effects(plant: Any, found: Found) -> list[NamedEffect]:
    """The effects taken, with standard errors, in the order of what each explains."""
    fit = plant.linearised(found.model)
    out = []
    gap = found.steps[0].gap / plant.scale
    for i, taken in enumerate(found.taken):
        index = found.model.n_base + i
        effect = found.model.terms[index].effect
        aliases = list(dict.fromkeys([*plant.aliases(taken.name), *taken.rivals, *taken.same]))
        out.append(NamedEffect(
            effect, labelled_errors(fit, index), taken.delta_bic,
            float(min(taken.size / max(gap, 1e-300), 1.0) ** 2), aliases, p_value=taken.look.p_value,
            joint=getattr(found.model.terms[index], "joint", ""),
        ))  # fmt: skip
    order = sorted(range(len(out)), key=lambda i: -found.taken[i].size)
    return families([out[i] for i in order])


def _located(plant: Any, found: Found, diagnosis: Diagnosis, gap_unit: str, rng: np.random.Generator) -> None:
    """Where the gap lies, and which constant of the base model moves along the record."""
    gap = plant.gap(found.base)
    diagnosis.where = [place_in(p, gap_unit, plant.own_units) for p in localisation.locate(gap.signals, gap.left, rng)]
    where = localisation.sentence(diagnosis.where)
    if diagnosis.verdict != "no_gap" and not (diagnosis.effects and where == localisation.NOWHERE):
        diagnosis.where_sentence = where
    units = plant.numbers(found.base)
    for row in localisation.drift(gap, rng):
        factor, unit = respelled(units.get(row["name"], (0.0, ""))[1], plant.own_units)
        diagnosis.drifting.append(row | {"mean": row["mean"] / factor, "unit": unit})
    moves = localisation.drift_sentence(diagnosis.drifting) if diagnosis.where_sentence else ""
    if moves:
        stays = diagnosis.where_sentence == localisation.NOWHERE
        diagnosis.where_sentence = moves if stays else f"{diagnosis.where_sentence} {moves}"
