"""From what the search found to a `Diagnosis`: proof, verdict, effects with errors and rivals, tables, places."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from whsklearn.gap import evidence as rules
from whsklearn.gap import localisation, parameter_drift
from whsklearn.gap.aliases import rivals_of
from whsklearn.gap.diagnosis import Diagnosis, LearnedTorques, NamedEffect, families
from whsklearn.gap.old_candidate_table import candidate_table
from whsklearn.gap.old_search import Found
from whsklearn.gap.own_units import curve_in, pictures_in, place_in, rows_in
from whsklearn.gap.proof import closure, prove
from whsklearn.gap.sentences import next_experiment, summary
from whsklearn.gap.standard_errors import errors_of, labelled_errors
from whsklearn.gap.verdict import verdict_of
from whsklearn.logs.units import respelled

UNFINISHED = ("unknown", "partial", "coloured_noise")  # verdicts beside which a nameless torque is learned


def conclude(plant: Any, found: Found, rng: np.random.Generator, say: Callable[[str], None]) -> Diagnosis:
    """The diagnosis in the units of the log; ``found.model``, in SI, is left at the model that is handed back."""
    say("prove")
    own, motion = plant.own_units, plant.units[1]
    gap = plant.units[0] if plant.whole == "drive" else motion
    diagnosis, rows = _proved(plant, found, rng)
    if diagnosis.verdict in UNFINISHED and not diagnosis.shortfall:
        rows = _learned(plant, found, diagnosis, rows, rng)
    rows = rows_in(rows, motion, own, "before", "after", "floor")
    diagnosis.horizons = [{k: v for k, v in r.items() if k not in ("first", "last")} for r in rows]
    headline = next(r for r in rows if r["horizon"] == plant.headline)
    both = [headline["first"].as_dict(), headline["last"].as_dict()]
    diagnosis.before, diagnosis.after = rows_in(both, motion, own, "rmse", "mu_e")
    diagnosis.floor, diagnosis.closure = headline["floor"], headline["closure"]
    view = plant.verdict_view(found.base)
    diagnosis.need = view.limits.need(view.compare([found.base], 0)[0].n_effective, 0.0)
    diagnosis.interrupted = found.interrupted
    diagnosis.candidates = candidate_table(found, diagnosis)
    say("locate")
    _located(plant, found, diagnosis, gap, rng)
    rounds = [
        {"number": r.number, "gap": r.gap, "gap_share": r.gap / plant.scale, "tried": len(r.looks),
         "taken": r.taken.name if r.taken else "nothing",
         "delta_bic": r.taken.delta_bic if r.taken else (r.evidence[0].delta_bic if r.evidence else 0.0)}
        for r in found.rounds
    ]  # fmt: skip
    diagnosis.rounds = rows_in(rounds, gap, own, "gap")
    diagnosis.residual_tests = plant.residual_tests(found.base, found.model)
    diagnosis.base_parameters = _base_numbers(plant, found)
    diagnosis.next_experiment = next_experiment(diagnosis)
    for e in diagnosis.effects:
        e.units = (own.get(plant.units[0], plant.units[0]), own.get(motion, motion))
    if diagnosis.learned is not None:
        curves = diagnosis.learned.curves
        diagnosis.learned.curves = tuple(curve_in(c, plant.units, own) for c in curves)
    diagnosis.logged = plant.logged
    diagnosis.units = {role: own.get(u, u) for role, u in zip(("drive", "position"), plant.units, strict=True) if u}
    diagnosis.notes = plant.notes(found.base, found.model)
    diagnosis.pictures = pictures_in(plant.pictures(found.base, found.model) | {"units": plant.units}, gap, own)
    diagnosis.horizon, diagnosis.horizon_unit = plant.headline, plant.horizon_unit
    before, after, floor = (x / plant.scale for x in plant.figures(found.base, found.model))
    diagnosis.figures = (before, after, floor)
    diagnosis.sentence = summary(diagnosis, plant)
    return diagnosis


def _base_numbers(plant: Any, found: Found) -> list[dict[str, Any]]:
    """The base model's own numbers before and after the repair, with standard errors and units."""
    first, last = plant.parameters(found.base), plant.parameters(found.model)
    before, after = (errors_of(plant.linearised(m), plant.parameters) for m in (found.base, found.model))
    units = plant.parameter_units(found.base)
    own = plant.own_units if plant.whole == "drive" else {}  # a simulator's numbers stay as its file has them
    out = []
    for name, value in first.items():
        unit = units.get(name, "")
        row = {"name": name, "before": value, "after": last[name], "before_error": before.get(name),
               "after_error": after.get(name), "unit": respelled(unit, own)[1]}  # fmt: skip
        out += rows_in([row], unit, own, "before", "after", "before_error", "after_error")
    return out


def _proved(plant: Any, found: Found, rng: np.random.Generator) -> tuple[Diagnosis, list[dict[str, Any]]]:
    """Verdict, effects and the rows of the proof, which agree with each other.

    While the repaired model runs worse than the base model at the headline horizon, its last effect is taken back.
    """
    shortfall = plant.falls_short(found.base, found.model)
    if shortfall:
        _give_back(found)
    while True:
        if found.taken:
            found.model = plant.settle(found.model)
        rows = prove(plant, found.base, found.model, rng)
        headline = next(r for r in rows if r["horizon"] == plant.headline)
        if not found.taken or headline["closure"] >= 0.0:
            break
        last = len(found.taken) - 1
        found.model = found.views[last].fit(found.model.without(len(found.model.terms) - 1))
        found.drop(last)
        if not found.taken:
            found.model = found.base
    if shortfall:
        return Diagnosis("unknown", "", shortfall=shortfall), rows
    seen = plant.read_off(found.model)
    if seen and not found.taken:
        return Diagnosis("named", "", effects=seen), rows
    verdict, *beside = _verdict(plant, found, rows, rng)
    diagnosis = Diagnosis(verdict, "")
    if verdict in ("named", "ambiguous", "partial"):
        diagnosis.effects = _effects(plant, found, *beside) + seen
    elif found.taken:  # nothing earned a name: the base model is handed back, and its figures
        _give_back(found)
        rows = prove(plant, found.base, found.base, rng)
    return diagnosis, rows


def _learned(
    plant: Any, found: Found, diagnosis: Diagnosis, rows: list[dict[str, Any]], rng: np.random.Generator
) -> list[dict[str, Any]]:
    """Add what has no name to the model as learned curves, where the free run gains by them at every horizon."""
    learned = plant.learn(found.model)
    if learned is None:
        return rows
    grown = prove(plant, found.base, learned.model, rng)
    before, after = (next(r["after"] for r in rs if r["horizon"] == plant.headline) for rs in (rows, grown))
    floor = min(r["floor"] for r in grown if r["horizon"] == plant.headline)
    share = closure(before, after, floor)
    worse = any(new["after"] > old["after"] for new, old in zip(grown, rows, strict=True))
    if share < rules.LEARNED_CLOSURE or worse:
        return rows
    found.model = learned.model
    diagnosis.learned = LearnedTorques(learned.curves, share)
    if diagnosis.verdict == "coloured_noise":  # it follows a signal of the motion after all
        diagnosis.verdict = "unknown"
    return grown


def _give_back(found: Found) -> None:
    """Leave the base model."""
    found.model = found.base
    while found.taken:
        found.drop(0)


def _verdict(
    plant: Any, found: Found, rows: list[dict[str, Any]], rng: np.random.Generator
) -> tuple[str, list, list, list]:
    """(verdict, rivals of every effect, share of draws in which it beats the next, names that are the same)."""
    view = plant.verdict_view(found.base)
    gap, floor = view.rms(view.gap(found.base)), view.floor(found.base)
    quiet = view.quiet(found.base, plant.tolerance * plant.scale)
    if not found.taken:
        follows = 0.0 if quiet else plant.follows(found.base)
        verdict = verdict_of([], 0.0, [], quiet=bool(quiet), follows=follows)
        if verdict == "no_gap" and _blind_share(found) > rules.MOSTLY_BLIND:
            verdict = "not_testable"
        return verdict, [], [], []
    after, floor = view.rms(view.gap(found.model)), min(floor, view.floor(found.model))
    left = after / max(floor, plant.tolerance * plant.scale)
    headline = next(r for r in rows if r["horizon"] == plant.headline)
    total = closure(gap, after, floor)
    if view.demand(found.model) > 0.0:  # knocks a sample early or late are no path
        total = max(total, headline["closure"])
    elif view.limits.run_counts:
        most = 1.0 if total >= rules.RUN_STANDS else rules.RUN_STANDS
        total = max(total, min(headline["closure"], most))
    at_floor = view.quiet(found.model, plant.tolerance * plant.scale)
    still = plant.follows(found.model)
    if at_floor and after * np.sqrt(max(still, 0.0)) < view.limits.own_shape * gap:
        still = 0.0
    rivals, shares, same = rivals_of(plant, found, rng)
    names = list(dict.fromkeys(t.name for t in found.model.terms[found.model.n_base :]))
    verdict = verdict_of(names, total, rivals, quiet=bool(quiet), follows=1.0, left=left, still=still)
    return verdict, rivals, shares, same


def _blind_share(found: Found) -> float:
    """Share of the catalogue that this record could not show at two percent of the rms drive."""
    unseen = [k.expected < rules.VISIBLE for k in found.looks if np.isfinite(k.expected)]
    return float(np.mean(unseen)) if unseen else 0.0


def _effects(plant: Any, found: Found, rivals: list, shares: list, same: list) -> list[NamedEffect]:
    fit = plant.linearised(found.model)
    out = []
    for i, (taken, others, share, equal) in enumerate(zip(found.taken, rivals, shares, same, strict=True)):
        index = found.model.n_base + i
        effect = found.model.terms[index].effect
        aliases = list(dict.fromkeys([*plant.aliases(effect.name), *equal, *others]))
        out.append(NamedEffect(
            effect, labelled_errors(fit, index), taken.delta_bic, share, min(max(taken.closure, -1.0), 1.0), aliases
        ))  # fmt: skip
    return families(out)


def _located(plant: Any, found: Found, diagnosis: Diagnosis, gap_unit: str, rng: np.random.Generator) -> None:
    """Where the gap lies, and which constant of the base model moves along the record."""
    signals, gap = plant.signals(found.base), plant.gap_to_locate(found.base)
    diagnosis.where = [place_in(p, gap_unit, plant.own_units) for p in localisation.locate(signals, gap, rng)]
    diagnosis.where_sentence = localisation.sentence(diagnosis.where) if diagnosis.verdict != "no_gap" else ""
    units = plant.parameter_units(found.base)
    for row in parameter_drift.drift(plant, found.base, rng):
        factor, unit = respelled(units.get(row["name"], ""), plant.own_units)
        diagnosis.drifting.append(row | {"mean": row["mean"] / factor, "unit": unit})
    moves = parameter_drift.sentence(diagnosis.drifting) if diagnosis.where_sentence else ""
    if moves:
        stays = diagnosis.where_sentence == localisation.NOWHERE
        diagnosis.where_sentence = moves if stays else f"{diagnosis.where_sentence} {moves}"
