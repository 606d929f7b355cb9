"""The search: is there an effect, which one, is that all?  Each asked of records that the model makes itself.

It knows a plant's looks, fits and errors, and no physics (see `whsklearn.gap.plant`).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from whsklearn.gap.calibration import gain, n_effective, p_value, separable, vuong
from whsklearn.gap.tangent import Look

Array = NDArray[Any]

# Looks that are fitted jointly with the model, of those that chance does not explain: the fit of a name takes some
# tenths of a second. A limit of cost; whether the right one is ever below the sixth has not been measured.
MOST_FITTED = 6


# Share of what the strongest look explains, below which no polish of shapes makes a rival of another: plays and
# Stribeck curves double what their first shape explains.
WORTH_FITTING = 0.2
# Share of what nameless functions of the motion explain that a name must explain: an effect outside the catalogue has
# neighbours in it that explain little. Set on a handful of our own logs (0.09 there), not yet calibrated.
LEAST_SHARE = 0.2

# Of a power that is to be explained: what explains more than half of it is its cause, by the word.
HALF = 0.5

# Multiple of what two effects leave that one which covers both may leave (`benchmarks.blind_large`: 1.7 and more where
# both are there).
AS_WELL = 1.02


def meet(a: Look, b: Look) -> bool:
    """Whether two looks have a place in common, so that one may stand for the other."""
    return not a.place or not b.place or bool(a.place & b.place)


@dataclass(frozen=True)
class Named:
    """One effect of a model, and what speaks for it.

    Attributes
    ----------
    look : Look
    model : object
        The model with it, fitted.
    before, errors : ndarray of shape (n,)
        What is left without it and with it.
    gain : float
        g of the fitted effect.
    size : float
        Rms of what it explains, as a share of the drive or the output.
    reason : str
        What physics has against it; empty if nothing.
    same : list of str
        Names of what says the same with more numbers.
    """

    look: Look
    model: Any
    before: Array = field(repr=False)
    errors: Array = field(repr=False)
    gain: float = 0.0
    size: float = 0.0
    reason: str = ""
    same: list[str] = field(default_factory=list)

    @property
    def name(self) -> str:
        """Canonical name."""
        return self.look.name

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
        """g less the price of its numbers, for tables."""
        return self.gain - self.look.n_numbers * np.log(max(self.errors.size, 2))


@dataclass
class Step:
    """One round: what was asked, what was fitted, what was taken."""

    number: int
    gap: float
    n_effective: float
    looks: list[Look]
    fitted: list[Named]
    taken: Named | None


@dataclass
class Found:
    """Where the search ended.

    Attributes
    ----------
    base, model : object
    taken : list of Named
        In the order of what they explain.
    rivals : list of list of str
        For every effect, what else could stand in its place.
    steps : list of Step
    remainder : list of Look
        Of the last look, at the final model: nameless families too.
    interrupted : bool
    """

    base: Any
    model: Any
    taken: list[Named] = field(default_factory=list)
    rivals: list[list[str]] = field(default_factory=list)
    steps: list[Step] = field(default_factory=list)
    remainder: list[Look] = field(default_factory=list)
    interrupted: bool = False


@dataclass
class Search:
    """The search of one plant.

    Parameters
    ----------
    plant : Plant
    rng : Generator
    alpha : float
        Probability of a false name in a record in which nothing is missing.
    max_effects : int
    on_round : callable, optional
        Called with each finished `Step`.
    """

    plant: Any
    rng: np.random.Generator
    alpha: float = 0.01
    max_effects: int = 3
    on_round: Callable[[Step], None] | None = None

    def run(self, base: Any) -> Found:
        """Find what the base model lacks; an interruption ends it with the rounds that are finished."""
        found = Found(base, base)
        try:
            while self._step(found):
                pass
            self._review(found)
            names = {t.name for t in found.taken}
            found.rivals = [[r for r in rivals if r not in names] for rivals in found.rivals]
        except KeyboardInterrupt:
            found.interrupted, found.remainder = True, []
        return found

    def _step(self, found: Found) -> bool:
        """One effect more; whether there was one."""
        before = found.model.without(len(found.model.terms) - 1) if found.taken else found.model
        found.model = self.plant.settled(found.model)
        if not found.taken:
            found.base = found.model
        worse = self._worse_settled(found, before)
        looks = found.remainder = self.plant.looks(found.model, self.rng)
        left = self.plant.rms(self.plant.errors(found.model))
        full = worse or len({t.name for t in found.taken}) >= self.max_effects
        fitted = [] if full else self.fitted(found.model, looks)
        taken = self._chosen(fitted)
        found.steps.append(Step(len(found.steps) + 1, left, self.plant.n_effective, looks, fitted, taken))
        if taken is None:
            self._said(found)
            return False
        found.taken.append(taken)
        found.rivals.append(self.rivals(taken, fitted) + self._as_good(taken, looks))
        found.model = taken.model
        # a second of its name that beat all others: it is a family, and the rest of it need not beat them again
        if taken.name in {t.name for t in found.taken[:-1]}:
            for grown in self.plant.family(found.model):
                self._add(found, taken.look, grown)
        self._said(found)
        return True

    def _worse_settled(self, found: Found, before: Any) -> bool:
        """Take the last effect back if, all numbers settled, the model leaves no less than it did before."""
        names = [t.name for t in found.taken]
        if not names or names.count(names[-1]) > 1:
            return False
        if self.plant.rms(self.plant.errors(found.model)) < found.steps[-1].gap:
            return False
        found.model = self.plant.settled(before)
        del found.taken[-1], found.rivals[-1]
        found.steps[-1].taken = None
        return True

    def _chosen(self, fitted: list[Named]) -> Named | None:
        """The best sound fit; of those that this record does not tell from it, the commonest."""
        sound = [f for f in fitted if not f.reason]
        taken = sound[0] if sound else None
        while taken is not None:
            tied = self.rivals(taken, sound)
            common = next((f for f in sound if f.name in tied and f.effect.name in taken.effect.commoner), None)
            if common is None:
                break
            taken = common
        return taken

    def _said(self, found: Found) -> None:
        if self.on_round is not None:
            self.on_round(found.steps[-1])

    def _add(self, found: Found, look: Look, grown: Any) -> None:
        """Take one more member of the last effect's family."""
        found.taken.append(self._named(found.model, look, grown))
        found.rivals.append([])
        found.model = grown

    def _named(self, model: Any, look: Look, grown: Any, reason: str = "") -> Named:
        """A fitted effect with what it explains."""
        before, errors = self.plant.errors(model), self.plant.errors(grown)
        g, size = self.plant.explained(model, grown, look)
        return Named(look, grown, before, errors, g, float(size / self.plant.scale), reason)

    def fitted(self, model: Any, looks: list[Look]) -> list[Named]:
        """The looks that chance does not explain and that are worth a name, fitted; the best score first.

        Where looks have a place, those are asked first that share one with the best; the others only where none of
        them is sound.
        """
        least = self.plant.tolerance * self.plant.scale
        worth = [k for k in self._shown(looks) if k.name and k.p_value <= self.alpha and k.size >= least]
        out: list[Named] = []
        while worth and all(f.reason for f in out):
            here = [k for k in worth if meet(k, worth[0])]
            worth = [k for k in worth if not meet(k, here[0])]
            nameless = (k.size for k in looks if not k.name and k.p_value <= self.alpha and meet(k, here[0]))
            out += self._fitted(model, here, max(nameless, default=0.0))
        return sorted(out, key=lambda f: -f.score)

    def _shown(self, looks: list[Look]) -> list[Look]:
        """The looks, those with the p-value of nameless functions of the motion that explain `LEAST_SHARE` of theirs.

        What is missing is in the residual that the null records take their colour from, so that strong slow effects
        hide themselves, and each other.  That something is missing is then shown by the functions together, at the
        same level; how sure a name is, is decided by what it leaves.
        """
        nameless = [k for k in looks if not k.name and k.p_value <= self.alpha]

        def p_of(k: Look) -> float:
            stands_for = (s for s in nameless if meet(s, k))
            most = max(stands_for, key=lambda s: s.size, default=None)
            return most.p_value if most is not None and k.size**2 >= LEAST_SHARE * most.size**2 else 1.0

        return [replace(k, p_value=min(k.p_value, p_of(k))) if k.name else k for k in looks]

    def _fitted(self, model: Any, looks: list[Look], nameless: float) -> list[Named]:
        """Looks of one place fitted, where nameless functions of the motion explain so much."""
        out: list[Named] = []
        strongest = 0.0
        for look in looks:
            # one that physics forbids is no yardstick: only sound ones make others not worth a fit
            if len(out) == MOST_FITTED or look.size**2 < WORTH_FITTING * strongest**2:
                continue
            grown = self.plant.refine(model, look)
            f = self._named(model, look, grown)
            size = f.size * self.plant.scale
            reason = ""
            if f.score <= 0.0:
                reason = "fitted, it explains no more than it does of the model's own records"
            elif f.size < self.plant.tolerance:
                reason = "fitted, it explains less than the tolerance"
            elif size**2 < LEAST_SHARE * nameless**2:
                reason = "it explains too little of what follows the motion"
            reason = self.plant.objection(model, grown) or reason
            if not reason:
                strongest = max(strongest, size)
            out.append(replace(f, reason=reason))
        return out

    def rivals(self, taken: Named, fitted: list[Named]) -> list[str]:
        """Names of the sound fits that this record does not tell from the one taken."""
        names = []
        for other in (f for f in fitted if meet(f.look, taken.look)):
            if other.reason or other.name == taken.name or other.name in self.plant.aliases(taken.name):
                continue
            if other.effect.parent == taken.effect.name:  # it holds the one taken and more, and is asked next
                continue
            if self.plant.exact and self._needless(taken, other):
                taken.same.append(other.name)
                continue
            lead = self._lead(taken, other)
            if lead < 0.0:  # the one taken is the commoner
                names.append(other.name)
                continue
            if not self._told_apart(lead, taken, other):
                names.append(other.name)
        return list(dict.fromkeys(names))

    def _lead(self, taken: Named, other: Named) -> float:
        """Score of the one taken less the other's, by as many independent samples as are in what the other leaves.

        A strong slow effect leaves few of them in the model that lacks it, by which both are scored; what a wrong name
        leaves of it is less, and faster.
        """
        lead = taken.score - other.score
        if self.plant.exact or lead < 0.0:
            return lead
        power = (float(e @ e) for e in (other.errors, taken.errors))
        own = gain(next(power), next(power), n_effective(other.errors))
        return max(lead, own - 2.0 * float(np.mean(taken.look.null) - np.mean(other.look.null)))

    def _told_apart(self, lead: float, taken: Named, other: Named) -> bool:
        """Whether the lead of one over another is beyond what accident, and records made by the other, would give.

        Where a plant's own records are exact, those that the rival makes say more than blocks of this one.
        """
        z = vuong(other.errors, taken.errors)
        if not self.plant.exact:
            apart = separable(lead, z, self.plant.leads(taken, other, taken.before, self.rng), self.alpha)
            return apart and self._still_apart(taken, other)
        if separable(lead, z, np.zeros(0), self.alpha):
            return True
        leads = self.plant.leads(taken, other, taken.before, self.rng)
        return bool(leads.size) and separable(lead, np.inf, leads, self.alpha)

    def _still_apart(self, taken: Named, other: Named) -> bool:
        """Whether they are still told apart where each is judged beside its own artefacts, not those of their base.

        A rival that leaves more than twice the power has lost.
        """
        powers = (float(f.errors @ f.errors) for f in (taken, other))
        if next(powers) < HALF * next(powers):
            return True
        left, rest = (self.plant.alone(f.model) for f in (taken, other))
        n = max(self.plant.n_effective, n_effective(rest))
        lead = gain(float(rest @ rest), float(left @ left), n)
        lead -= 2.0 * float(np.mean(taken.look.null) - np.mean(other.look.null))
        return separable(lead, vuong(rest, left), np.zeros(0), self.alpha)

    def _as_good(self, taken: Named, looks: list[Look]) -> list[str]:
        """Names that are not shown by themselves, and explain no less than the one taken to first order."""
        least = taken.look.gain - 2.0 * np.log(1.0 / self.alpha)
        names = [k.name for k in looks if k.name and k.p_value > self.alpha and k.gain >= least and meet(k, taken.look)]
        return [n for n in dict.fromkeys(names) if n != taken.name and n not in self.plant.aliases(taken.name)]

    def _needless(self, taken: Named, other: Named) -> bool:
        """Whether a rival says the same with more numbers: they differ by less than is worth a name."""
        apart = self.plant.rms(taken.errors - other.errors)
        return other.look.n_numbers > taken.look.n_numbers and apart < self.plant.tolerance * self.plant.scale

    def _prune(self, found: Found) -> bool:
        """Give back what the others, now that they are fitted beside it, say without it; whether anything was."""
        changed = False
        for i in reversed(range(len(found.taken))):
            if len(found.taken) == 1 or [t.name for t in found.taken].count(found.taken[i].name) > 1:
                continue
            without = self.plant.settled(found.model.without(found.model.n_base + i))
            look = found.taken[i].look
            g, size = self.plant.explained(without, found.model, look)
            families = max(len(s.looks) for s in found.steps)
            if p_value(g, look.null, families) > self.alpha or size < self.plant.tolerance * self.plant.scale:
                found.model, changed = without, True
                del found.taken[i], found.rivals[i]
        return changed

    def _review(self, found: Found) -> None:
        """Ask every effect but the last anew beside all others: it was taken when more was missing."""
        changed = self.plant.exact and self._prune(found)
        names = [t.name for t in found.taken]
        # a family stands and falls with its first
        alone = [i for i in range(len(names) - 1) if names.count(names[i]) == 1]
        for i in reversed(alone):
            index = found.model.n_base + i
            # shapes polished too: those of the others were found beside the one that is asked for
            without = self.plant.settled(found.model.without(index))
            if any(found.taken[i].name in getattr(t.effect, "covers", ()) for t in found.model.terms):
                # a place of rest says it already, unless it would lie too far off
                left = (self.plant.rms(self.plant.errors(m)) for m in (without, found.model))
                if next(left) < AS_WELL * next(left):
                    found.model, changed = without, True
                    self._inherit(found, i)
                    del found.taken[i], found.rivals[i]
                continue
            looks = self.plant.looks(without, self.rng, found.model)
            others = names[:i] + names[i + 1 :]  # what is there already takes no second place
            fitted = [f for f in self.fitted(without, looks) if f.name not in others]
            best = self._chosen(fitted)
            kept = next((f for f in fitted if f.name == found.taken[i].name and not f.reason), None)
            if best is not None and kept is not None and kept.name in self.rivals(best, fitted):
                best = kept
            if best is None:  # chance explains it, now that the others are in; else it stays as it is
                left = (float(np.sum(self.plant.errors(m) ** 2)) for m in (without, found.model))
                g = gain(next(left), next(left), self.plant.n_effective)
                if g < 2.0 * np.log(1.0 / self.alpha):
                    found.model, changed = without, True
                    self._inherit(found, i)
                    del found.taken[i], found.rivals[i]
                continue
            if best.name == found.taken[i].name:
                # told by what it explained when its place was taken, not beside the others
                best = replace(best, size=max(best.size, found.taken[i].size))
            else:
                changed = True
                self._inherit(found, i)
            found.taken[i] = best
            found.rivals[i] = self.rivals(best, fitted) + self._as_good(best, looks)
            terms = best.model.terms
            found.model = best.model.with_terms((*terms[:index], terms[-1], *terms[index:-1]))
        if alone or changed:
            found.model = self.plant.settled(found.model)
            found.remainder = self.plant.looks(found.model, self.rng)

    @staticmethod
    def _inherit(found: Found, i: int) -> None:
        """Tell those beside the effect ``i``, which goes, by the most that they explained in any round.

        They were taken beside it, and what it had explained is theirs.
        """
        most: dict[str, float] = {}
        for f in (f for s in found.steps for f in s.fitted if not f.reason):
            most[f.name] = max(most.get(f.name, 0.0), f.size)
        for j, t in enumerate(found.taken):
            if j != i:
                found.taken[j] = replace(t, size=max(t.size, most.get(t.name, 0.0)))
