"""The search: add the best effect, refit, look again; exchange and prune at the end.

It knows a bench (missing torque, fit, screen, refine) and no physics, so a servo axis, a
Wiener-Hammerstein system and a user's own simulator go through the same lines.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from whsklearn.gap import judge
from whsklearn.gap.judge import Evidence, objections, weigh_evidence

MAX_REFITS = 7


@dataclass
class Round:
    """One pass of the search: what was tried and what was taken."""

    number: int
    gap: float
    evidence: list[Evidence]
    trials: list[Any]
    taken: Evidence | None
    base: Any = None


@dataclass
class Found:
    """Where the search ended.

    Attributes
    ----------
    base : object
        The base model, refitted.
    model : object
        With all effects that were taken.
    taken : list of Evidence
        In the order in which they were added, each against the model without it.
    rivals : list of list of Evidence
        For every effect taken, what else could stand in its place.
    """

    base: Any
    base_missing: Any
    model: Any
    floor: float
    taken: list[Evidence] = field(default_factory=list)
    rivals: list[list[Evidence]] = field(default_factory=list)
    rounds: list[Round] = field(default_factory=list)
    trials: list[Any] = field(default_factory=list)
    interrupted: bool = False


def fit_base(bench: Any, model: Any) -> tuple[Any, Any]:
    """The base model refitted, weighted by the size of its own gap."""
    for _ in range(2):
        bench.weigh(bench.rms(bench.missing(model), "all"))
        model, fit = bench.fit(model)
    return model, fit


def try_all(bench: Any, model: Any, *, deep: bool = True) -> tuple[Any, list[Any], list[Evidence]]:
    """(model refitted, all trials, evidence of the refitted ones) on top of a model.

    ``deep``: what changes the path itself is refitted too where nothing else closes the gap.
    """
    bench.weigh(bench.rms(bench.missing(model), "all"))
    model, fit = bench.fit(model, max_iterations=4)
    trials = bench.screen(model, fit)
    top = trials[0].screened if trials else 0.0
    worth = [t for i, t in enumerate(trials) if t.screened > 0.3 * top or (i < 5 and t.screened > 0.03 * top)]
    refined = [bench.refine(model, t) for t in worth[:MAX_REFITS]]
    evidence = weigh_evidence(bench, model, refined, bench.floor())
    if deep and (not evidence or evidence[0].closure < judge.NAMED):  # it shows little in a linear look
        more = [t for t in trials if t.model is None and t.kind.substeps > 1 and t.start]
        if more and len(model.terms) == model.n_base:
            bench.weigh(bench.rms(bench.missing(model), "all"))
            refined += [bench.refine(model, t) for t in more]
            evidence = weigh_evidence(bench, model, refined, bench.floor())
    return model, trials, evidence


def first_sound(bench: Any, evidence: list[Evidence], null: float) -> Evidence | None:
    """The best evidence to which nothing objects, if it is near the best of all."""
    n = int((bench.train & bench.usable).sum())
    for e in evidence:
        e.reason = objections(bench, e, null, n)
    sound = [e for e in evidence if e.passes]
    if not sound:
        return None
    best = sound[0]
    if best.name == "asymmetric_coulomb":  # a tie with its alias goes to the offset, the commoner of the two
        best = next((e for e in sound if e.name == "input_offset" and e.delta_bic > best.delta_bic - 10), best)
    if best.closure < judge.NAMED:  # no name reaches the floor: the model is short of more, take the elementary first
        for e in sound:
            if (
                e.name in judge.ELEMENTARY
                and e.name != "asymmetric_coulomb"
                and e.explained**2 >= judge.SIMPLEST_FIRST * best.explained**2
            ):
                return e
    return best if best.delta_bic >= 0.6 * evidence[0].delta_bic else None


def search(
    bench: Any,
    model: Any,
    *,
    null: float,
    max_effects: int = 3,
    on_round: Callable[[Round], None] | None = None,
) -> Found:
    """Find what the base model lacks, one effect after the other.

    An interruption ends it with the rounds that are finished.
    """
    base, _ = fit_base(bench, model)
    missing = bench.missing(base)
    found = Found(base, missing, base, bench.floor())
    quiet = np.hypot(1.1 * bench.floor(), bench.tolerance * bench.scene.torque)
    try:
        for number in range(1, max_effects + 1):
            gap = bench.rms(bench.missing(found.model), "all")
            if number > 1 and gap < quiet:
                break
            before, trials, evidence = try_all(bench, found.model, deep=gap >= quiet)
            if number == 1:
                found.base = found.model = before
                found.trials = trials
            taken = first_sound(bench, evidence, null)
            if (
                taken is not None
                and getattr(found.model, "has_play", False)
                and taken.explained < judge.BESIDE_A_PLAY * gap
            ):
                taken = None
            found.rounds.append(Round(number, gap, evidence, trials, taken, before))
            if taken is None:
                break
            found.model = taken.trial.model
            found.taken.append(taken)
            found.rivals.append(evidence)
            if on_round is not None:
                on_round(found.rounds[-1])
            if number > 1:
                exchange(bench, found, null)
        prune(bench, found, null)
    except KeyboardInterrupt:
        found.interrupted = True
    return found


def exchange(bench: Any, found: Found, null: float) -> None:
    """Try every effect taken against all others in its place: the first one was chosen when more was missing."""
    for i in range(len(found.taken)):
        index = found.model.n_base + i
        without = found.model.without(index)
        if getattr(found.model, "has_play", False) and not without.has_play:
            found.model = bench.resettle(found.model)  # nothing else disconnects a load
            continue
        _, _, evidence = try_all(bench, without)
        best = first_sound(bench, evidence, null)
        found.rivals[i] = evidence
        if best is None:
            continue
        found.model = _reorder(best.trial.model, index)
        found.taken[i] = best


def _reorder(model: Any, index: int) -> Any:
    """The model with its last term moved to ``index``, so that the order of adding stays."""
    terms = model.terms
    moved = (*terms[:index], terms[-1], *terms[index:-1])
    return model.with_terms(moved)


def prune(bench: Any, found: Found, null: float) -> None:
    """Drop effects that the others have made needless."""
    if len(found.taken) < 2:
        return
    n = int((bench.train & bench.usable).sum())
    for i in reversed(range(len(found.taken))):
        reason = objections(bench, found.taken[i], null, n, judge_sign=False) or judge.at_the_end(
            found.model, found.model.n_base + i
        )
        if reason:
            found.model, _ = bench.fit(found.model.without(found.model.n_base + i))
            del found.taken[i], found.rivals[i]
