"""The search: add the best effect, refit, look again; exchange and prune at the end.

It knows views of a plant and no physics (see `whsklearn.gap.plant`).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any

from whsklearn.gap import evidence as rules
from whsklearn.gap.evidence import Evidence, objections, weigh
from whsklearn.gap.values import CandidateFit, Look


@dataclass
class Round:
    """One pass of the search: what was tried and what was taken."""

    number: int
    gap: float
    evidence: list[Evidence]
    looks: list[Look]
    taken: Evidence | None
    base: Any = None
    view: Any = None


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
    views : list of View
        In which each was taken.
    """

    base: Any
    model: Any
    taken: list[Evidence] = field(default_factory=list)
    rivals: list[list[Evidence]] = field(default_factory=list)
    views: list[Any] = field(default_factory=list)
    rounds: list[Round] = field(default_factory=list)
    looks: list[Look] = field(default_factory=list)
    interrupted: bool = False

    def add(self, evidence: Evidence, rivals: list[Evidence], view: Any) -> None:
        """Take an effect."""
        self.model = evidence.fitted.model
        self.taken.append(evidence)
        self.rivals.append(rivals)
        self.views.append(view)

    def drop(self, i: int) -> None:
        """Forget the i-th effect taken (the model is the caller's to refit)."""
        del self.taken[i], self.rivals[i], self.views[i]


@dataclass
class Search:
    """The greedy search of one plant.

    Parameters
    ----------
    plant : Plant
    by_chance : callable
        (view, model) -> best score on a surrogate in this view.
    max_effects : int
    on_round : callable, optional
        Called with each finished `Round`.
    """

    plant: Any
    by_chance: Callable[[Any, Any], float]
    max_effects: int = 3
    on_round: Callable[[Round], None] | None = None

    def run(self, base: Any) -> Found:
        """Find what the base model lacks; an interruption ends it with the rounds that are finished."""
        found = Found(base, base)
        try:
            view = self.plant.view(base, None)
            while view is not None:
                view = self._through(view, found)
                if self.plant.starts_over(found.base, found.model, view):
                    found = Found(base, base)
                    view = self.plant.view(base, None)
                else:
                    view = self.plant.view(found.model, view)
        except KeyboardInterrupt:
            found.interrupted = True
        return found

    def _through(self, view: Any, found: Found) -> Any:
        """One view, to its end; returns it, trimmed where a part of the record follows another law."""
        found.model = view.fit(found.model)
        if not found.taken:
            found.base = found.model
        chance = self.by_chance(view, found.model)
        n_before, first_round = len(found.taken), len(found.rounds)
        while (
            len({e.name for e in found.taken}) < self.max_effects
            and len(found.rounds) - first_round < rules.ROUNDS_A_NAME * self.max_effects
        ):
            gap = view.rms(view.gap(found.model))
            if found.taken and view.quiet(found.model, self.plant.tolerance * self.plant.scale):
                break
            looks, evidence = self.try_all(view, found.model)
            if not found.rounds:
                found.looks = looks
            taken = self.first_sound(view, evidence, chance)
            if taken is not None and taken.explained < view.demand(found.model) * gap:
                taken = None
            found.rounds.append(Round(len(found.rounds) + 1, gap, evidence, looks, taken, found.model, view))
            if taken is None:
                break
            found.add(taken, evidence, view)
            self._absorb(view, found)
            found.model = view.settled(found.model)
            self._widen(view, found, chance)
            self._grow(view, found)
            whole, view = view, view.trimmed(found.model)
            if view is not whole:
                found.views = [view if v is whole else v for v in found.views]
                found.model, found.base = view.fit(found.model), view.fit(found.base)
                self._grow(view, found)
            if self.on_round is not None:
                self.on_round(found.rounds[-1])
            if len(found.taken) > 1:
                self._exchange(view, found, chance)
        if len(found.taken) > max(n_before, 1):
            self._prune(view, found)
        return view

    def _grow(self, view: Any, found: Found) -> None:
        """Further members of the last effect's family."""
        for fitted in view.family(found.model):
            found.add(weigh(view, found.model, [fitted])[0], [], view)

    def _widen(self, view: Any, found: Found, chance: float) -> None:
        """Set numbers of the last effect free that a first look holds, if they earn it as an effect does.

        The name is the same: the level of bristles that falls with speed is no second effect beside them. So evidence
        counts, and not how much of the drive it is.
        """
        fitted = view.widened(found.model)
        if fitted is None:
            return
        gain = weigh(view, found.model, [fitted])[0]
        n = view.compare([fitted.model], 0)[0].n_effective
        if objections(self.plant, view, gain, chance, n, 0.0):
            return
        found.model, look = fitted.model, found.taken[-1].fitted.look
        whole = CandidateFit(replace(look, n_numbers=look.n_numbers + fitted.look.n_numbers), fitted.model)
        without = view.fit(fitted.model.without(len(fitted.model.terms) - 1))
        found.taken[-1] = weigh(view, without, [whole])[0]

    def _absorb(self, view: Any, found: Found) -> None:
        """Take back what the last effect's own numbers say already, unless they cannot: a place of rest has a range."""
        covered = getattr(found.model.terms[-1].effect, "covers", ())
        for i in reversed(range(len(found.taken) - 1)):
            if found.taken[i].name in covered:
                alone = view.absorbed(found.model, found.model.n_base + i)
                if view.rms(view.gap(alone)) < rules.AS_WELL * view.rms(view.gap(found.model)):
                    found.model = alone
                    found.drop(i)

    def try_all(self, view: Any, model: Any, beside: Any = None) -> tuple[list[Look], list[Evidence]]:
        """(all looks, evidence of the refined ones) on top of a model, which is ``beside`` without one effect."""
        looks = sorted(view.look(model) if beside is None else view.look_again(model, beside), key=lambda k: -k.gain)
        wanting = not view.quiet(model, self.plant.tolerance * self.plant.scale)
        cheap = [k for k in looks if k.gain > 0 and (wanting or not k.costly)]
        top = max(cheap[0].gain, 1e-300) if cheap else 0.0
        worth = [
            k for i, k in enumerate(cheap) if k.elementary or k.gain > rules.WORTH_REFINING * top
            or (i < rules.FIRST_LOOKS and k.gain > rules.WORTH_AMONG_FIRST * top)
        ]  # fmt: skip
        elementary = [k for k in worth if k.elementary]
        others = [k for k in worth if not k.elementary][: rules.MOST_REFINED]
        few = others if wanting else others[: view.limits.few_refined]
        fits = [CandidateFit(k, view.refine(model, k)) for k in (*elementary, *few)]
        evidence = weigh(view, model, fits)
        if len(few) < len(others) and any(e.delta_bic >= view.limits.least for e in evidence):
            # there is something after all: no name before its rivals have had the same chance
            fits += [CandidateFit(k, view.refine(model, k)) for k in others[len(few) :]]
            evidence = weigh(view, model, fits)
        if wanting and (not evidence or evidence[0].closure < rules.NAMED):
            tried = {id(t.look) for t in fits}
            more = [k for k in looks if k.costly and id(k) not in tried and k.start is not None]
            if more:
                fits += [CandidateFit(k, view.refine(model, k)) for k in more]
                evidence = weigh(view, model, fits)
        return looks, evidence

    def first_sound(
        self, view: Any, evidence: list[Evidence], chance: float, *, elementary_first: bool = True
    ) -> Evidence | None:
        """The best evidence to which nothing objects; a commoner law goes first where it explains as much.

        While no name reaches the floor an elementary law goes first too, but it pushes no better one out of its place.
        """
        if not evidence:
            return None
        n = view.compare([evidence[0].fitted.model], 0)[0].n_effective
        sound: list[Evidence] = []
        for e in evidence:  # behind the best sound one only those are looked at that could go before it
            if sound and not (e.name in self.plant.commoner(sound[0].name) or e.fitted.look.elementary):
                continue
            e.reason = objections(self.plant, view, e, chance, n)
            sound += [e] if e.passes else []
        if not sound:
            return None
        best = sound[0]
        for e in sound[1:]:  # ties go to the commoner name
            if e.name in self.plant.commoner(best.name) and rules.preferred(view, e, best):
                return e
        if (
            elementary_first and best.closure < rules.NAMED
        ):  # no name reaches the floor: several are missing, an elementary one goes first
            for e in sound:
                if e.fitted.look.elementary and e.explained**2 >= rules.ELEMENTARY_SHARE * best.explained**2:
                    return e
        return best

    def _exchange(self, view: Any, found: Found, chance: float) -> None:
        """Try every effect taken against all others in its place: the first was chosen when more was missing.

        An effect against which its own place speaks by now (a delta BIC of zero or less) is no effect.
        """
        for i in range(len(found.taken)):
            index = found.model.n_base + i
            if found.views[i] is not view or not view.replaceable(found.model, index):
                continue
            without = view.fit(found.model.without(index))
            evidence = self._known(view, found, i, without)
            if evidence is None:
                _, evidence = self.try_all(view, without, found.model)
            evidence = self._with_own(view, found, i, without, evidence)
            elementary = found.taken[i].fitted.look.elementary
            best = self.first_sound(view, evidence, chance, elementary_first=elementary)
            found.rivals[i] = evidence
            if best is None:
                own = max((e.delta_bic for e in evidence if e.name == found.taken[i].name), default=0.0)
                if view.limits.drops and own <= 0.0 and not found.taken[i].reason:
                    found.taken[i].reason = "the others leave nothing for it"
                continue
            same = best.name == found.taken[i].name
            found.taken[i] = best
            if same and best.left >= view.rms(view.gap(found.model)):
                continue  # found anew from a coarse start, its numbers are no better than those it has by now
            terms = best.fitted.model.terms
            found.model = view.settled(best.fitted.model.with_terms((*terms[:index], terms[-1], *terms[index:-1])))

    def _known(self, view: Any, found: Found, i: int, without: Any) -> list[Evidence] | None:
        """The evidence of the last round where the model without its effect is the one that the round began with.

        Then all rivals have been fitted beside it already; None where a view tries more beside the effect, or an
        exchange has changed what it stands on.
        """
        last = found.rounds[-1] if found.rounds else None
        if last is None or found.taken[i] is not last.taken or last.view is not view or view.looks_beside:
            return None
        if [t.name for t in without.terms] != [t.name for t in last.base.terms]:
            return None
        moved = abs(view.rms(view.gap(without)) / max(last.gap, 1e-300) - 1.0)
        return last.evidence if moved < rules.SAME_FIT else None

    def _with_own(self, view: Any, found: Found, i: int, without: Any, evidence: list[Evidence]) -> list[Evidence]:
        """The evidence for an effect's rivals beside its own: with the numbers that it has by now, if those are better.

        Found anew from a coarse start, a spring far from its place of rest would lose to the offset that it took in.
        """
        index, terms = found.model.n_base + i, found.model.terms
        last = found.model.with_terms((*terms[:index], *terms[index + 1 :], terms[index]))
        now = weigh(view, without, [CandidateFit(found.taken[i].fitted.look, last)])[0]
        anew = [e for e in evidence if e.name == now.name]
        own = max((now, *anew), key=lambda e: e.delta_bic)
        return sorted([own, *(e for e in evidence if e.name != own.name)], key=lambda e: -e.delta_bic)

    def _prune(self, view: Any, found: Found) -> None:
        """Drop effects that the others have made needless."""
        for i in reversed(range(len(found.taken))):
            e, index = found.taken[i], found.model.n_base + i
            if found.views[i] is view and (not e.passes or view.objection(found.model, index)):
                found.model = view.fit(found.model.without(index))
                found.drop(i)
