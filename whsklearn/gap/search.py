"""The search: is there an effect, which one, and is that all?  Each is tested on records simulated with the model.

It uses a plant's looks, fits and errors, and contains no physics (see `whsklearn.gap.plant`).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from whsklearn.gap.calibration import gain, least_lead, n_effective, p_value, separable, vuong
from whsklearn.gap.diagnosis import spoken
from whsklearn.gap.record import Array
from whsklearn.gap.tangent import Look

# Largest number of sound fits of looks, jointly with the model. A fit takes a few tenths of a second, so this limits
# the cost. Refused fits do not count: a slow cogging that physics forbids took the place of SO-101's cable spring, and
# three wrong names were certain. Whether the right one is ever below the sixth was not measured.
MOST_FITTED = 6
# Share of what the strongest look explains, below which polishing its shapes cannot make a look a rival: backlash and
# Stribeck curves double what their first shape explains.
WORTH_FITTING = 0.2
# Share of the power explained by nameless functions of the motion that a name must explain, and of the gap that all
# names together must explain. The largest of three effects explains a third or more; the neighbours of an effect
# outside the catalogue explain little. `benchmarks.learned` prints the shares of both.
LEAST_SHARE = 0.25
# Share of a power: only what explains more than half of it is called its cause.
HALF = 0.5
SAME = 1e-3  # of a residual: two fits of one structure that differ by less are at one minimum, two runs leave the same
# Share of the rms gap that may still follow the motion without a name beside a verdict of ``named``
# (`benchmarks.learned --effects named` and without: what true names and the neighbours of other effects leave).
STILL = 0.04


def meet(a: Look, b: Look) -> bool:
    """Whether two looks share a place, so that one can replace the other."""
    return not a.place or not b.place or bool(a.place & b.place)


def stands(plant: Any, model: Any, index: int) -> bool:
    """Whether physics does not object to one term of a model, beside all others and at its present numbers."""
    terms = model.terms
    last = model.with_terms((*terms[:index], *terms[index + 1 :], terms[index]))
    return not plant.objection(model.without(index), last)


def renamed(found: Found) -> None:
    """Name the effects by their terms, where a simulation has put another in the place of one."""
    for i, (taken, term) in enumerate(zip(found.taken, found.model.terms[found.model.n_base :], strict=True)):
        if term.name != taken.name:
            rivals = [r for r in taken.rivals if r != term.name]
            found.taken[i] = replace(taken, look=replace(taken.look, name=term.name), rivals=rivals)


def shares(look: Look, nameless: Look) -> bool:
    """Whether `LEAST_SHARE` of the power that nameless functions explain lies along what a look explains."""
    a, b = look.explained, nameless.explained
    if look.swapped or a is None or b is None or a.size != b.size:
        return bool(look.size**2 >= LEAST_SHARE * nameless.size**2)
    return bool(float(a @ b) ** 2 >= LEAST_SHARE * float(a @ a) * float(b @ b) > 0.0)


def lead_over(nameless: Look, look: Look, size: float, n: float) -> float:
    """Lead of a function without a name over an effect that, fitted, explains ``size``; none if it has more numbers.

    Both explain part of one power among ``n`` samples. A stop in a leg explained 0.814 of the drive and some bump of
    the position 0.816, a lead of less than one.
    """
    if nameless.n_numbers > look.n_numbers:
        return -np.inf
    part = -np.expm1(-nameless.gain / n) * (size / nameless.size) ** 2
    fitted = -n * np.log1p(-min(part, 1.0 - 1e-12))
    return float(nameless.gain - fitted - 2.0 * (np.mean(nameless.null) - np.mean(look.null)))


@dataclass(frozen=True)
class Named:
    """One effect of a model, with its evidence."""

    look: Look
    model: Any  # the model with it, fitted
    before: Array = field(repr=False)  # before, errors (n,): residual without it and with it
    errors: Array = field(repr=False)
    gain: float = 0.0  # g of the fitted effect
    size: float = 0.0  # rms of what it explains, as a share of the drive or the output
    reason: str = ""  # physical objection to it; empty if there is none
    # rivals, same: names that this record cannot distinguish from it, and names that describe the same with more
    # numbers
    rivals: list[str] = field(default_factory=list)
    same: list[str] = field(default_factory=list)

    @property
    def name(self) -> str:
        """Canonical name."""
        return self.look.name

    @property
    def whole(self) -> float:
        """`size` if all samples count alike, see `Look.whole`."""
        return self.size / self.look.diluted

    @property
    def effect(self) -> Any:
        """The library's effect with its numbers."""
        return self.model.terms[-1].effect

    @property
    def score(self) -> float:
        """g - 2 mean g* of the fitted effect."""
        return self.gain - 2.0 * float(np.mean(self.look.null))

    @property
    def delta_bic(self) -> float:
        """g minus the penalty for its numbers, for tables."""
        return self.gain - self.look.n_numbers * np.log(max(self.errors.size, 2))


@dataclass
class Step:
    """One round: what was tested, what was fitted, what was added."""

    number: int
    gap: float
    n_effective: float
    looks: list[Look]
    fitted: list[Named]
    taken: Named | None


@dataclass
class Found:
    """Result of the search."""

    base: Any
    model: Any
    taken: list[Named] = field(default_factory=list)  # in the order of what they explain
    steps: list[Step] = field(default_factory=list)
    # of the last look, at the final model; nameless families are included
    remainder: list[Look] = field(default_factory=list)
    refused: dict[str, str] = field(default_factory=dict)  # name that was taken -> why the proof has refused it
    interrupted: bool = False


@dataclass
class Search:
    """The search of one plant."""

    plant: Any
    rng: np.random.Generator
    alpha: float  # probability of a false name in a record in which nothing is missing
    max_effects: int  # at one place
    on_round: Callable[[Step], None] | None = None  # called with each finished `Step`

    def run(self, base: Any) -> Found:
        """Find what the base model lacks; an interruption ends it with the rounds that are finished.

        If nothing is found, the record is searched once more up to higher frequencies, at half the level.
        """
        found = self._searched(base)
        kept = self.plant.snapshot()
        if found.taken or found.interrupted or not self.plant.sharpened(found.model):
            return found
        again = replace(self, alpha=0.5 * self.alpha)._searched(base)
        if not again.taken:
            self.plant.restore(kept)
        return again if again.taken else found

    def _searched(self, base: Any) -> Found:
        """One search, at the plant's present resolution."""
        model = self.plant.settled(base)
        found = Found(model, model)
        try:
            while self._one_more(found):
                pass
            if self._fewer(found):
                while self._one_more(found):
                    pass
            self._review(found)
            while self._sized(found) and self._lost(found):
                pass
        except KeyboardInterrupt:
            found.interrupted, found.remainder = True, []
        return found

    # --- is there an effect, and which one? -------------------------------------------------------
    def _one_more(self, found: Found) -> bool:
        """Add one more effect and refit all parameters; False if there was none."""
        looks = found.remainder = self.plant.looks(found.model, self.rng)
        names = {t.name for t in found.taken}
        left = self.plant.rms(self.plant.errors(found.model))
        there = {t.name: t.look for t in found.taken}.values()
        # What a complete model leaves is not worth naming, however sharply a record shows it: friction by the load was
        # added to a Stribeck curve that left 0.25 % of the drive, because it halved the noise of the inertia's torque.
        done = bool(found.taken) and self.plant.silent(found.model)
        room = [k for k in looks if not done and sum(meet(k, t) for t in there) < self.max_effects]
        fitted = self.fitted(found.model, room)
        better = self._better_minimum(found.model, fitted)
        if better is not None:
            found.base, found.model = found.base if found.taken else better, better
            return True
        step = Step(len(found.steps) + 1, left, self.plant.n_effective, looks, fitted, None)
        found.steps.append(step)
        while (taken := self._chosen(found.model, step.fitted, looks)) is not None:
            # the others of this round are compared in the view that fitted them, and not in one that this one allows
            more, state = [taken], self.plant.snapshot()
            if taken.name in names:  # it beat all others twice: the rest of its family need not
                for grown in self.plant.family(taken.model):
                    more.append(self._named(more[-1].model, taken.look, grown))
            model = self.plant.settled(more[-1].model)
            failed = self.plant.too_little(model) or self._unseats(found, model, left)
            if not failed and (taken.name in names or self.plant.rms(self.plant.errors(model)) < left):
                model, rivals = self.plant.told_by_run(model, more[-1].rivals)
                more[-1] = replace(more[-1], rivals=rivals)
                found.model, found.taken = self.plant.along_the_run(model), found.taken + more
                renamed(found)
                step.taken = found.taken[-1]
                break
            self.plant.restore(state)
            failed = failed or "with all numbers fitted, the residual is no smaller than without it"
            step.fitted = [replace(f, reason=failed) if f.look is taken.look else f for f in step.fitted]
        if self.on_round is not None:
            self.on_round(step)
        return step.taken is not None

    def _unseats(self, found: Found, model: Any, left: float) -> str:
        """Why an effect beside which others would be unphysical is no name: empty if it leaves less without them.

        ``left``: what they leave without it.  Beside the cogging of a motor a coupling that explained a tenth as much
        drove a change of the friction out of its range, and was all that the last part of the search kept.
        """
        n = found.base.n_base
        fallen = [i for i in range(n, n + len(found.taken)) if not stands(self.plant, model, i)]
        if not fallen:
            return ""
        state = self.plant.snapshot()
        rest = self.plant.settled(model.with_terms(t for i, t in enumerate(model.terms) if i not in fallen))
        worse = self.plant.rms(self.plant.errors(rest)) >= left
        self.plant.restore(state)
        names = dict.fromkeys(spoken(model.terms[i].name) for i in fallen)
        return f"beside it {' and '.join(names)} would be unphysical, and without that it leaves more" if worse else ""

    def _better_minimum(self, model: Any, fitted: list[Named]) -> Any | None:
        """The model refitted from where the best candidate left it, if that gains what the candidate seemed to.

        A model that is simulated from its input has local minima, and the fit with a candidate may leave one.  Without
        this test the candidate is named for it: a dead zone of almost no width had a delta BIC of 1,132.
        """
        if not self.plant.exact or not fitted:
            return None
        best, least = fitted[0].model, self.plant.tolerance * self.plant.scale
        bare = self.plant.settled(best.without(len(best.terms) - 1))
        before, after, grown = (self.plant.errors(m) for m in (model, bare, best))
        needless = self.plant.size(before, after) > least >= self.plant.size(after, grown)
        return bare if needless else None

    def fitted(self, model: Any, looks: list[Look]) -> list[Named]:
        """The looks that chance does not explain and that are worth naming, fitted; the best score first.

        If looks have a place, those that share one with the best are fitted first, and the others only if none of these
        is sound.
        """
        least = self.plant.tolerance * self.plant.scale
        worth = [k for k in self._shown(looks) if k.name and k.p_value <= self.alpha and k.whole >= least]
        out: list[Named] = []
        while worth and all(f.reason for f in out):
            here = [k for k in worth if meet(k, worth[0])]
            worth = [k for k in worth if not meet(k, here[0])]
            nameless = [k for k in looks if not k.name and k.p_value <= self.alpha and meet(k, here[0])]
            out += self._fitted(model, here, nameless)
        return sorted(out, key=lambda f: -f.score)

    def _shown(self, looks: list[Look]) -> list[Look]:
        """The looks; one that shares what nameless functions explain gets their p-value if smaller.

        The null records take their colour from a residual that contains what is missing, so strong slow effects hide
        themselves and each other.  That something is missing is then shown by the functions together, at the same
        level.  How certain a name is depends on the residual that it leaves.
        """
        nameless = [k for k in looks if not k.name and k.p_value <= self.alpha]

        def p_of(k: Look) -> float:
            stands_for = (s for s in nameless if meet(s, k))
            most = max(stands_for, key=lambda s: s.size, default=None)
            return most.p_value if most is not None and shares(k, most) else 1.0

        def seen(k: Look) -> bool:
            return bool(k.name) and k.gain >= least_lead(self.alpha)  # below it, the whole catalogue would do as well

        return [replace(k, p_value=min(k.p_value, p_of(k))) if seen(k) else k for k in looks]

    def _fitted(self, model: Any, looks: list[Look], nameless: list[Look]) -> list[Named]:
        """The looks of one place, fitted; ``nameless`` are those at functions without a name there."""
        out: list[Named] = []
        most = max((k.size for k in nameless), default=0.0)
        strongest = 0.0
        for look in looks:
            # only sound fits make others not worth fitting: one that is refused is no standard of comparison
            if sum(not f.reason for f in out) == MOST_FITTED or look.size**2 < WORTH_FITTING * strongest**2:
                continue
            f = self._named(model, look, self.plant.refine(model, look))
            size, reason = f.size * self.plant.scale, ""
            if f.score <= 0.0:
                reason = "fitted, it explains no more than it does of the model's own records"
            elif f.whole < self.plant.tolerance:
                reason = "fitted, it explains less than the tolerance"
            elif size**2 < LEAST_SHARE * most**2:
                reason = "it explains too little of what follows the motion"
            elif any(lead_over(k, look, size, self.plant.n_effective) >= least_lead(self.alpha) for k in nameless):
                reason = "a function without a name explains more with as few numbers"
            reason = self.plant.objection(model, f.model) or reason
            if not reason:
                strongest = max(strongest, look.size)
            out.append(replace(f, reason=reason))
        return out

    def _named(self, model: Any, look: Look, grown: Any) -> Named:
        """A fitted effect with what it explains."""
        g, size = self.plant.explained(model, grown, look)
        errors = (self.plant.errors(m) for m in (model, grown))
        return Named(look, grown, next(errors), next(errors), g, float(size / self.plant.scale))

    def _chosen(self, model: Any, fitted: list[Named], looks: list[Look]) -> Named | None:
        """The best sound fit with its rivals; of those that this record cannot distinguish, a simpler or commoner."""
        sound = [f for f in fitted if not f.reason]
        taken = sound[0] if sound else None
        while taken is not None:
            rivals, same = self.rivals(taken, sound)
            near = [f for f in sound if f.name in rivals]
            common = next((f for f in near if self._needless(f, taken) or f.effect.name in taken.effect.commoner), None)
            if common is None:
                rivals = [*rivals, *self._unsettled(taken, sound), *self._as_good(model, taken, looks)]
                return replace(taken, rivals=list(dict.fromkeys(rivals)), same=same)
            taken = common
        return None

    def rivals(self, taken: Named, sound: list[Named]) -> tuple[list[str], list[str]]:
        """(names that the record cannot distinguish from the one taken, names that describe it with more numbers)."""
        rivals, same = [], []
        for other in (f for f in sound if meet(f.look, taken.look)):
            if other.name == taken.name or other.name in self.plant.aliases(taken.name):
                continue
            if other.effect.parent == taken.effect.name:  # it contains the one taken, and is tested next
                continue
            if self._needless(taken, other):
                same.append(other.name)
            elif not self._told_apart(taken, other):
                rivals.append(other.name)
        return list(dict.fromkeys(rivals)), same

    def _told_apart(self, taken: Named, other: Named) -> bool:
        """Whether the lead of one over the other exceeds what chance, and records simulated with the other, would give.

        Both are scored by the number of independent samples in the residual without either, which a strong slow effect
        makes small.  With a wrong name the residual is smaller and faster, so its independent samples are counted as
        well.  Blocks tell which of two wrong models is less wrong.  If the one taken is complete, nothing is left to
        ask them, and the few events in which two laws differ, such as the touches of a stop, cannot make a rival of
        the other.  A rival with fewer numbers that leaves only noise is not ruled out by a better fit: a spring took
        the place of an offset, beside a spring.
        """
        lead = taken.score - other.score
        if lead < 0.0:  # the one taken is the commoner
            return False
        simpler = other.look.n_numbers < taken.look.n_numbers
        if simpler and self.plant.complete(taken.before, other.model):
            return False
        worse, better = (float(e @ e) for e in (other.errors, taken.errors))
        null = float(np.mean(taken.look.null) - np.mean(other.look.null))
        lead = max(lead, gain(worse, better, n_effective(other.errors)) - 2.0 * null)
        if lead < least_lead(self.alpha):
            return False
        z = vuong(other.errors, taken.errors)
        if self.plant.exact:  # records simulated with the rival would cost a joint fit each, and blocks suffice
            return separable(lead, z, np.zeros(0), self.alpha) or (self._is_all(taken) and not self._is_all(other))
        if self.plant.complete(taken.before, taken.model):
            z = np.inf
        return separable(lead, z, self.plant.leads(taken, other, taken.before, self.rng), self.alpha)

    def _is_all(self, taken: Named) -> bool:
        """Whether nothing is shown to be missing beside the effect, with all numbers fitted.

        Where that is so for one of two and not for the other, the lead is a likelihood ratio of the true model: a wrong
        one reaches 2 ln(1 / alpha) over it with a probability of alpha at most (Royall 1997, Statistical Evidence,
        ch. 1).  It need not be where both pass: a slew rate of 2 % left neither a tone nor a limit anything to see.
        """
        return bool(self.plant.p_of_all(taken.model, self.rng) > self.alpha)

    def _needless(self, taken: Named, other: Named) -> bool:
        """Whether a rival describes the same with more numbers: the two differ by less than is worth naming."""
        apart = self.plant.rms(taken.errors - other.errors)
        more = self.plant.exact and other.look.n_numbers > taken.look.n_numbers
        return more and apart < self.plant.tolerance * self.plant.scale

    def _unsettled(self, taken: Named, sound: list[Named]) -> list[str]:
        """Names that leave less than twice the power, if the one taken leaves more than noise.

        What neither of two explains may favour the wrong one by as much as it is: beside friction that grows with the
        load, a spring left 0.77 of the power that the true gravity of a pendulum left.
        """
        if self.plant.exact or self.plant.complete(taken.before, taken.model):
            return []
        most = float(taken.errors @ taken.errors) / HALF
        near = (f for f in sound if meet(f.look, taken.look) and float(f.errors @ f.errors) < most)
        return [f.name for f in near if f.name != taken.name and f.name not in self.plant.aliases(taken.name)]

    def _as_good(self, model: Any, taken: Named, looks: list[Look]) -> list[str]:
        """Names that are not significant, but to first order explain no less than the one taken, nor fitted less well.

        Where fitting its shape has multiplied what the one taken explains, theirs would have to gain as much.
        """
        least = max(taken.look.gain - least_lead(self.alpha), WORTH_FITTING * taken.gain)
        asked = {taken.name, *self.plant.aliases(taken.name)}
        out = []
        for k in looks:
            if not k.name or k.name in asked or k.p_value <= self.alpha or k.gain < least or not meet(k, taken.look):
                continue
            asked.add(k.name)
            other = self._named(model, k, self.plant.refine(model, k))
            # beside the weight of a slide, to first order, a spring of any stiffness did as well
            sound = other.score > 0.0 and not self.plant.objection(model, other.model)
            if sound and not self._told_apart(taken, other):
                out.append(other.name)
        return out

    # --- is that all, and is each of them needed? -------------------------------------------------
    def _fewer(self, found: Found) -> bool:
        """Put a rival in the place of an effect and of all that came after it, if alone it leaves as little.

        The commoner of two that the first look cannot distinguish is taken, and may need a second beside it to do what
        the other does alone: gravity and a hardening spring stood for a cable spring.
        """
        least = self.plant.tolerance * self.plant.scale
        for i, taken in enumerate(found.taken[:-1]):
            step = next((s for s in found.steps if s.taken is not None and s.taken.look is taken.look), None)
            for f in self._rivals_of(found, i, step) if step else []:
                state, model = self.plant.snapshot(), self.plant.settled(f.model)
                # both after the fit, which weights the joints of an arm anew, so that each model's errors are one
                if self.plant.size(*(self.plant.errors(m) for m in (model, found.model))) >= least:
                    self.plant.restore(state)
                    continue
                bare = model.without(found.model.n_base + i)
                alone, other = (self._named(bare, k.look, k.model) for k in (replace(f, model=model), taken))
                rivals = [] if self._told_apart(alone, other) else [taken.name]
                found.model, found.taken = model, [*found.taken[:i], replace(alone, rivals=rivals)]
                return True
        return False

    def _rivals_of(self, found: Found, i: int, step: Step) -> list[Named]:
        """The sound rivals of an effect in its round, and what is one by its look alone but explains more, once fitted,
        than all that were fitted there.

        Of a spring that nearly balanced the inertia, looks showed so little that friction that changes and a hardening
        spring stood for it.
        """
        names, most = set(found.taken[i].rivals), max(f.score for f in step.fitted)
        there = [f for f in step.fitted if f.name in names]
        rest = [k for k in step.looks if k.name in names - {f.name for f in there}]
        if rest:
            state, terms = self.plant.snapshot(), found.model.terms[: found.model.n_base + i]
            more = self._fitted(self.plant.settled(found.model.with_terms(terms)), rest, [])
            there += [f for f in more if f.score > most]
            self.plant.restore(state)
        return [f for f in there if not f.reason]

    def _review(self, found: Found) -> None:
        """Test every effect again beside all others, the last one first, because more was missing when each was added.

        An effect that the others make superfluous is dropped; one that another explains better is replaced.  A family
        of waves is kept or dropped with its first member.
        """
        names, changed, state = [t.name for t in found.taken], False, self.plant.snapshot()
        alone = [i for i, name in enumerate(names) if names.count(name) == 1]
        for i in reversed(alone if len(names) > 1 else []):
            index = found.model.n_base + i
            # the shapes are polished too: those of the others were found beside the effect under test
            without = self.plant.settled(found.model.without(index))
            if len(found.taken) > 1 and self._sound(without) and not self._needed(without, found, i):
                if self._contained(found, i):
                    continue
                found.model, changed = without, True
                del found.taken[i]
                continue
            if i == len(names) - 1:  # it was tested last, beside all others
                continue
            others = {t.name for t in found.taken} - {found.taken[i].name}  # what is there is not added twice
            looks = self.plant.looks(without, self.rng, found.model)
            fitted = [f for f in self.fitted(without, looks) if f.name not in others]
            best = self._chosen(without, fitted, looks)
            kept = next((f for f in fitted if f.name == found.taken[i].name and not f.reason), None)
            if best is not None and kept is not None and kept.name in best.rivals:
                best = replace(kept, rivals=[best.name, *(r for r in best.rivals if r != kept.name)], same=best.same)
            # beside the others it is no longer significant and stays as it is; so it does for one that is too little
            if best is None or self.plant.too_little(best.model):
                continue
            here, other = (self.plant.rms(self.plant.errors(m)) for m in (found.model, best.model))
            # polished anew beside the others, the present one may be no longer sound that is so as it stands
            if (
                other >= (1.0 - SAME) * here
                and best.name != found.taken[i].name
                and stands(self.plant, found.model, index)
            ):
                continue
            if best.name != found.taken[i].name or other < (1.0 - SAME) * here:
                terms, changed = best.model.terms, True
                found.model = best.model.with_terms((*terms[:index], terms[-1], *terms[index:-1]))
            found.taken[i] = best
        if changed:
            found.model = self.plant.settled(found.model)
            found.remainder = self.plant.looks(found.model, self.rng)
        else:
            self.plant.restore(state)
        there = {t.name for t in found.taken}
        found.taken = [replace(t, rivals=[r for r in t.rivals if r not in there]) for t in found.taken]

    @staticmethod
    def _contained(found: Found, i: int) -> bool:
        """Whether the effect ``i`` is elementary and contained in a law of the same place that was taken after it.

        Presliding friction is Coulomb friction with a gradual start.  The elementary law keeps its name, and the other
        is named for what it adds (the principle of marginality: Nelder 1977, A reformulation of linear models, JRSS A
        140(1), 48-77).
        """
        one = found.taken[i]
        laws = (t for t in found.taken[i + 1 :] if t.effect.place == one.effect.place and meet(t.look, one.look))
        return bool(one.effect.elementary) and any(not t.effect.elementary for t in laws)

    def _sound(self, model: Any) -> bool:
        """Whether physics objects to no effect of a model: others may only replace one while they stay what they are.

        A change of the friction with the time of the record's beginning took the place of a pendulum's gravity.
        """
        return all(stands(self.plant, model, i) for i in range(model.n_base, len(model.terms)))

    def _needed(self, without: Any, found: Found, i: int) -> bool:
        """Whether the effect ``i`` explains more than chance and the tolerance beside all others."""
        look = found.taken[i].look
        g, size = self.plant.explained(without, found.model, look)
        families = max(len(s.looks) for s in found.steps)
        if self.plant.exact:
            shown = p_value(g, look.null, families) <= self.alpha
        else:  # strong slow effects hide in the colour of their own null records
            shown = g >= least_lead(self.alpha)
        return bool(shown) and size / look.diluted >= self.plant.tolerance * self.plant.scale

    def _lost(self, found: Found) -> bool:
        """Drop the effect that explains least if that is no longer worth naming; False if all of them are.

        Fitted together, two effects may take over from a third, or cancel: a lag of 240 ms and a drive that is as much
        too early, beside the gravity of a pendulum.
        """
        i = min(range(len(found.taken)), key=lambda i: found.taken[i].size)
        if found.taken[i].whole >= self.plant.tolerance:
            return False
        found.model = self.plant.settled(found.model.without(found.model.n_base + i))
        del found.taken[i]
        found.remainder = self.plant.looks(found.model, self.rng)
        return True

    def _sized(self, found: Found) -> bool:
        """Size each of several effects by what it explains beside those that explain more; False if there is but one.

        The numbers are the present ones.
        """
        base, terms = found.model.terms[: found.model.n_base], found.model.terms[found.model.n_base :]
        names = [t.name for t in found.taken]
        if len(set(names)) < 2:
            return False
        said: list[str] = []

        def explained(name: str) -> float:
            """Its size by the look that found it, because the drive's error shows little of free swings."""
            known, grown = (
                found.model.with_terms((*base, *(t for t, n in zip(terms, names, strict=True) if n in kept)))
                for kept in (said, (*said, name))
            )
            look = found.taken[names.index(name)].look
            return float(self.plant.explained(known, grown, look)[1] / self.plant.scale)

        while rest := [n for n in dict.fromkeys(names) if n not in said]:
            sizes = {n: explained(n) for n in rest}
            best = max(rest, key=lambda n: sizes[n])
            i = names.index(best)
            found.taken[i] = replace(found.taken[i], size=sizes[best])
            said.append(best)
        return True
