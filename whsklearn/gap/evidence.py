"""Evidence: what speaks for a candidate, when it earns a name, and every threshold of these rules.

Evidence is a difference of BIC (Schwarz 1978, Ann. Stat. 6(2)) between two models judged on the same errors,

    n ln(RSS_before / RSS_after) - c p ln n - 2 ln(places looked at),

with n the independent samples, p the added numbers and c = 1 for errors of fitted samples or 1/2 for
cross-validated ones, which have paid for over-fitting already.  A name further needs held-out blocks that improve,
a size above the tolerance, and numbers that are physical.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from whsklearn.gap.plant import ModelErrors

Array = NDArray[Any]

# --- thresholds ------------------------------------------------------------------------------------
# Every rule of the engine takes its number from here.  "blind" is `python -m benchmarks.blind`, "real" is
# `python -m benchmarks.real_axes`; both print the rates that a change of a number moves.

DEFAULT_TOLERANCE = 0.004  # of the rms drive or output: no effect below is worth a name. Surrogates of records with
# nothing missing leave 0.0037 to 0.0047 of the drive in the inverse view; the one default of every entry.
NAMED = 0.88  # closure for a confident name: a neighbour of the true effect closes more than 0.8 in 3 % of blind cases
RUN_STANDS = (
    0.5  # closure of the gap from which that of the free run may stand for it: a floor of the restarts as large
)
# as what is left "closes" any run (SO-101's jaw: run 1.0, gap 0.33); true names close 0.98 of the gap ("blind")
PARTIAL = 0.3  # closure below which the name of the nearest neighbour says nothing: median closure of wrong names 0.2
LEFT_BY_SEVERAL = 2.5  # floors that several effects together may leave: three wrong ones can imitate one without a name
FOLLOWS = 0.04  # share of a gap that nameless functions of the motion must predict to be no noise; coloured-noise blind
# records reach 0.02, effects outside the catalogue 0.1 and more
OWN_SHAPE = 0.04  # of the base model's gap that the motion may still predict at the floor, beside a sure name: what is
# left is worth no name, but friction that grows above a speed leaves 0.05 to 0.09 as `stribeck`, a spring that gives
# way 0.08 as three effects (`benchmarks.learned`), true names up to 0.03 ("blind --kinds named")
BLOCKS_BETTER = 0.8  # share of held-out blocks that must not be worse: 4 of 5, 8 of 10
NOT_WORSE = 0.05  # of the total gain that a block may lose: blocks at rest cannot improve, and vetoed gravity on XL330
LEAST_MARGIN = 10.0  # delta BIC to the runner-up; "very strong" of Kass and Raftery 1995, JASA 90(430)
MOSTLY, MOSTLY_MARGIN = 0.9, 40.0  # or the commoner one explains nine tenths and is behind by less than this delta BIC
SURE = 0.9  # share of bootstrap draws in which the winner beats the runner-up
SAME_SIMULATION = (
    0.1  # of the noise: two simulators that differ by less are one. A spring where the simulator has one already
)
# differs from an offset by 0.006, a wave of order one from gravity by 0.05, other neighbours by 0.3 ("blind_simulator")
ELEMENTARY_SHARE = 0.7  # of the best one's explained power that suffices for an elementary law to go first: with two
# effects missing, the wrong one of two candidates reaches up to 0.65 of the right one's power (blind pairs)
MOST_CURVES = 2  # learned curves of one record: each is a function of one or two signals
LEARNED_SHARE = 0.1  # of the cross-validated power left over that a learned curve must explain (`benchmarks.learned`)
LEARNED_CLOSURE = 0.1  # of the gap in simulation that learned curves must close, or they are left out
HILL_DROPPED = 0.02  # of the largest height: a hill below is left out of the model, its torque is below the band
VISIBLE = 150.0  # delta BIC that two percent of the rms drive must be able to reach, or an effect is not testable
MOSTLY_BLIND = 0.5  # share of effects that are not testable above which "nothing is missing" is "not testable"

# What is worth the time of a joint fit ("blind").
MOST_REFINED = 7  # looks a round: a right effect ranked lower than fifth in no blind case
FEW_REFINED = 2  # where the gap is at the floor already, and a fit costs seconds as an axis's does
FIRST_LOOKS = 5  # that a small gain already makes worth it: the linear look underrates large effects
WORTH_REFINING = 0.3  # of the best look's gain
AS_WELL = 1.02  # times what two effects leave, that one may leave which is to hold both ("blind_large", seed 9002: 1.7)
SAME_FIT = (
    5e-4  # of the rms gap by which two fits of one model may differ: a fit ends at as much ("real": 1e-5 to 1e-4)
)
HALF_WAY = 0.5  # of the evidence for a name that the first steps of a two-mass refit must have earned to go on
WORTH_AMONG_FIRST = 0.03  # the same for the first looks

# Which view of an axis is to be trusted ("real", "blind").
LARGE_GAP = 0.2  # of the variation of the drive: above, a wrong model carries the observer's estimate along and hides
# what it lacks; blind records with effects of up to 15 % of the drive are named by the observer without error
DRIFTS = 1.5  # times the gap of inverse dynamics that the observer may see behind a filter that lets less through; more
# is its own drift: LAAS shows 5 to 6; the blind records are named under this rule, their ratio was not looked at
DRIVE_KNOWN = 0.35  # share of the rms drive that a model may leave for the torque it predicts to stand for the drive
LEAST_GAP = (
    1e-3  # of what is left, that counts as a gap over the floor: at the floor itself no share of it means anything
)
LARGEST_FLOOR = 0.1  # of the rms drive that noise may make behind any filter
OF_THE_GAP = 0.2  # of the gap that noise may make: cogging of order 72 needs a filter that lets it through (LAAS)
BLIND_SHARE = 0.03  # of the time, in motion, in which noise may hide the direction: each reversal costs friction

# What an effect may be beside others, and what no axis does.
BESIDE_A_PLAY = 0.66  # of the rms left beside a play that a further effect must explain: impacts follow everything a
# little ("blind --kinds named" with backlash)
PLAY_OR_DAMPER = 0.1  # of the evidence that a rival of the same transmission may be behind to be fitted and run beside
# it, and of the run's error that it must then leave more, or both names are given: a coupling of much damping slips as
# a play does (SO-101's jaw: 3 and 1 %; a play of MuJoCo behind a poor first fit: 5 % of the evidence)
SEVERAL_TURNS = 6 * np.pi  # rad of travel, over which a wave of one shaft must come back every turn
LITTLE_TRAVEL = (
    0.5  # rad, over which the cosine of gravity is a constant and a slope to 3 % of itself: names are shared
)
STANDS_OUT = 10.0  # times the median power around it that makes a line of a reference, on which no tone is believed
# Shares of the drive above which an effect that acts on it explains it by itself (SO-101: a ripple of 1 "closed" all).
LARGEST_SHARE = {"torque_ripple": 0.5, "load_friction": 0.75}
# Share of its effect that a drive must keep when its gain changes: with 0.4 % of it left, inertia and missing torque
# fall to 0.4 % too, and "explained" KR300 A with Coulomb friction hidden. Drawn changes leave 70 % and more.
LEAST_GAIN_LEFT = 0.1
STEEPEST_ERROR = 0.3  # rad a rad: an encoder error steeper than that would let the reading stand still
ORDER_NEED = 20.0  # cross-validated evidence for one more order of a family (three numbers); LAAS earns eight, blind
# records with one order none
MOST_ORDERS = 12  # of one family
WHOLE_ORDER = 1.1  # times the gain of the best whole order that a fractional one must have: teeth and poles are whole

# When the ends of the travel are struck (`python -m benchmarks.blind_mujoco --only range_one,range_both,forcerange`):
# the events are what a robust fit of the model leaves. Each number lies far from both sides.
STOP_FAR = 6.0  # robust standard deviations from which a sample is an event: stops reach 20 to 60
STOP_ENERGY = 0.8  # of what is left that the events at the ends must hold: stops 0.99
STOP_TIME = 0.25  # of the time at most: stops 0.02 to 0.06, saturation 0.78, backlash 0.94
STOP_SIGN = 0.9  # of the events at one end that push back: stops 0.97 to 1, saturation and backlash 0.5
STOP_STRUCK = 0.7  # of the deeper half of the region that must be an event: stops 0.8 to 1, all others below 0.15
STOP_EDGE = 0.03  # of the events' energy left outside the region: the blur carries some to before the contact
STOP_MINOR = 0.05  # of the events' energy below which an end has no stop

# What is read off the record itself ("blind" with quantization and sensor_rectification).
NEAR_GRID = 1.3  # gap over floor up to which an encoder's grid explains all that is left
ON_GRID = 0.02  # of a step (times the root of their number) that a difference may miss whole steps by: digits cut off
MOSTLY_ON_GRID = 0.99  # share of differences that must be whole steps
DISTINCT = 0.9  # distinct values a sample: above, each is met once and a grid is no coarser than the noise
COARSE_GRID = 2.5e-4  # step of the grid as a share of half the travel; finer ones are any encoder's
COARSER_THAN_STATED = 1.5  # times the encoder's stated step: one lost bit is twice
GRID_NOISE = 0.7  # of the noise that the grid's rounding must make up
UNFOLDED = 0.1  # of the misfit that an unfolded reading may leave: half of a folded record is on the wrong side

# Chains of blocks; "chains" is `python -m benchmarks.blind_blocks`, which prints the rates that these numbers move.
LEFT_OVER = 1e-4  # p-value of generic functions below which a finished model leaves something: 0.03 of 300 empty chains
STILL_LEFT = 2e-3  # the same while searching: another round costs seconds, a missed effect a name
LEFT_SHARE = 0.02  # of the mean square that they must then explain: long records make any trifle significant
FOLLOWS_SURE, FOLLOWS_LIKELY = LEFT_OVER, 0.05  # p-values at which what is left follows the motion, and may do so
FOLLOWS_MUCH = 0.1  # of the gap that it must be if it only may: guards "foreign effect not confidently named"
TOO_SMALL = 0.5  # of what the effects leave, below which more orders and a free law show that the base model is too
# small and no effect is missing. A second effect beside a named one is imitated by them too, but rarely to a half
# ("chains --pair 20"); the WH2009 circuit under orders of two ends at 0.2
SPOKEN_OF = 0.2  # of the mean square that orders, or a law, must take off to be put down to them in a sentence
ABSORBED = 0.02  # of a signature that the model's own numbers must leave over: below, no record shows the effect
SAME_SIGNATURE = 0.97  # coherence of two signatures beyond the model's own numbers from which on the names are aliases
BEYOND_DOUBT = 10.0  # times the evidence that a name needs: no chance and no other minimum of the base reached it
FEW_EVENTS = 5  # samples, or reversals, that may come right by chance; evidence that sits in them is none
WITHOUT_FEW = 0.5  # of the evidence a name needs that must be there without the five best samples
SIGN_REMEMBERED = 8  # samples for which L2 remembers a sign: a pole at 0.8 leaves a sixth of it
RUNS_WORSE = 1.01  # of the held-out mean square of the free run: above, an effect makes the model worse
WRONG_SIDE = 6.0  # robust deviations: beyond, a sample is on the wrong side of a sign; of 1e6 Gaussian ones none is
HELD_TO = 4.0  # robust deviations to which held-out errors are held, so that no block is one sample
SIGN_LOST = 0.5  # of the sum of squares that an unfolded reading may leave: a fold turns half of the output over
TOUCHES_ZERO = 0.02  # of the rms: a folded signal passes zero, one with an offset need not
OTHER_MINIMUM = 4.0  # times the least sum of squares up to which another minimum of the base may hold the truth
BETTER_ANEW = 0.98  # of the sum of squares that blocks fitted anew must leave, or the refit from the base model stands
COARSE_READING = 0.003  # of the output's rms in rounding errors: a finer grid is a converter's, and no effect
ROUNDING = 0.15  # of the errors' mean square that rounding must make up to be told
LITTLE_PROMISE = -5.0  # delta BIC that a linear look must promise: what it sees is a lower bound, a refit gains more
MODEST_PROMISE = 15.0  # below that a refit of a few steps tells enough
LOOKS_OF_ONE_KIND = 7  # best scores of one way of looking that become looks: as many as are refined
LONG_RECORD, SEARCHED = 12_000, 8_000  # samples: names of a longer record are looked for in the first ones; time only

# What a record must have before any diagnosis (`tests/gap/test_data_check.py`, "real").
SHORTEST_RECORD = 3.0  # s: a third of it is lost to restarts and filters, and the rest must hold several reversals
FEWEST_SAMPLES = 300
HOLE = 5.5  # typical steps: five samples lost are a kick of several percent of the drive in any derivative
UNEVEN = 0.01  # share of steps that may differ by half from the typical one
SLOWEST_SAMPLING = 0.05  # s a sample: ten samples a period of 2 Hz
MOVING = 0.002  # share of samples at which the position must change
FEWEST_CHANGES = 4  # of the drive: a torque step has two
FLAT = 0.02  # share of samples at an extreme that is worth a word
TURNING = 0.01  # s, over which a halt at an extreme is compared with the rest of the path
SHARPER = 1.4  # times the usual change of path: a turn stays below 0.6 on eight pendulum logs and, by v = a t, below 1;
# sines clipped at their median or at nine tenths reach 1.9 to 7.6 (blind records of `benchmarks.blind_logs`)
SPIKE, SPIKES_BORNE = 60.0, 2  # times the 0.999 quantile of second differences; how many of them a record may have

# A segment that follows another law than the rest, in inverse dynamics ("real --only laas").
ODD_WINDOW, ODD_SHARE = 0.02, 0.06  # of the record: a window, and the longest segment that may be left out
ODD, EVEN = 4.0, 2.0  # times the median window's rms: what is odd, and what nine of ten windows must stay below. LAAS
# has 6 and 1.1 with its first orders in, eight pendulum logs have no such segment
CAP = 6.0  # robust standard deviations, which a Gaussian never reaches; the first 0.15 s of LAAS (before the index
# pulse, 2 % of the samples and 60 % of what is left) reach 15

# How long a free run shows the model ("real").
OWN_MOTION = 0.2  # of the rms speed that a model's own motion may differ from its smoothed self: knocks reach 0.1
OWN_ERROR = 0.1  # of the path of a horizon that a model may miss of its own record by the noise of the restarts
OFF_PATH = 0.05  # of the path that a run may leave by a torque that is worth no name

# What a report says of places and constants; no name depends on it.
PLACE_LEVEL = 0.05  # of the p-value, adjusted over the signals
PLACE_EXCESS = 0.08  # share of the gap beyond the share of samples: below, a range is not worth a sentence
DRIFT_LEVEL = 0.02  # of the p-value of a constant's drift, of some twenty pairs that are looked at
DRIFT_SHARE = 0.1  # of the gap that a drifting constant must take up, and of its drift that one signal must explain


@dataclass(frozen=True)
class Limits:
    """What chance may reach in one view.

    Attributes
    ----------
    per_sample : float
        Delta BIC that an effect must earn per independent sample.
    least, most : float
        Between which that requirement is held.
    over_chance : float
        Times the best score on a surrogate that a name must exceed.
    price : float
        Weight of p ln n.
    blocks : float
        Share of held-out blocks that must not be worse.
    quiet : float
        Gap over floor below which nothing is missing.
    forgiven : float
        Times what the strongest candidate leaves, that a commoner one may leave and still go first.
    run_counts : bool
        Whether the closure of the free run stands for that of the gap where it is larger: not for a base model so
        wrong that its free run diverges, beside which any repair closes all.
    few_refined : int
        Looks that are fitted where the gap is at the floor already.
    drops : bool
        Whether evidence below zero in its own place takes an effect back: cross-validated errors weigh all models
        alike, whitened ones are weighed by what the best leaves.
    own_shape : float
        Share of the base model's gap that the motion may still predict where the rest is at its floor; infinite where
        that floor is known too roughly to ask.
    """

    per_sample: float
    least: float
    most: float
    over_chance: float
    price: float
    blocks: float = BLOCKS_BETTER
    quiet: float = 1.1
    forgiven: float = 1.0
    run_counts: bool = True
    few_refined: int = FEW_REFINED
    drops: bool = False
    own_shape: float = np.inf

    def need(self, n: float, chance: float) -> float:
        """Least delta BIC for a name, given the samples and the best score on surrogates."""
        return max(self.least, min(self.most, self.per_sample * n), self.over_chance * chance)


# Errors of fitted samples, whitened: 200 at 2450 samples separates the least true (418) from the best by chance (195) of the
# "blind" development set (seeds below 900); never below 40, where AR whitening of few samples is itself uncertain.
# A noise-limited floor is known to about 5 %, hence quiet at 1.1 of it.
WHITENED = Limits(
    per_sample=200.0 / 2450.0,
    least=40.0,
    most=200.0,
    over_chance=4.0,
    price=1.0,
    quiet=1.1,
    forgiven=1.0,
    own_shape=OWN_SHAPE,
)
# Cross-validated errors: 25 kept every true first effect and no false one on 15 real logs and 21 blind ones
# ("real"); the factor over chance is 2 since cross-validation has charged for fitting already.
# A spring of two numbers looks better than gravity wherever friction is still missing: gravity is forgiven 1.6 times
# its leftover (known pendulums, "real --only xl330": at most 1.3; "blind" with cable_spring, over gravity: 2.5 and
# more).
# Records with nothing missing reach 1.28 of their surrogate, with Stribeck 4.1, with drag 8: quiet at 1.35.
CROSS_VALIDATED = Limits(
    per_sample=0.0,
    least=25.0,
    most=25.0,
    over_chance=2.0,
    price=0.5,
    quiet=1.35,
    forgiven=1.6,
    run_counts=False,
    drops=True,
)

# One-step errors of a chain with outliers capped: white under the right model, so no share of n is asked beyond BIC's
# own; 30 is three times "very strong" and twice what the best of 34 candidates reached on 60 records with nothing
# missing (`python -m benchmarks.blind_blocks --none 60`). A record of 1800 samples in five held-out blocks cannot show
# an effect of 2 % in four of them, so half must do. A fit costs a tenth of a second: all looks are fitted even at the
# floor. With two, two right names of 62 were lost ("chains --first-seed 300000"); with seven none of 60 empty records
# has a name and CPU seconds are the same ("chains --named 2 --none 60 --samples 1500 --first-seed 410000").
CAPPED = Limits(per_sample=0.0, least=30.0, most=30.0, over_chance=2.0, price=1.0, blocks=0.5, few_refined=MOST_REFINED)


@dataclass
class Evidence:
    """What speaks for one candidate on top of the model in force.

    Attributes
    ----------
    fitted : CandidateFit
    delta_bic : float
    explained : float
        Rms of what it explains, in the gap's unit.
    better : float
        Share of held-out blocks that are not worse.
    held_gain : float
        Drop of the held-out sum of squares, as a share.
    closure : float
        Of the gap, between the model in force and the floor.
    left : float
        Rms of the gap that is left.
    reason : str
        What speaks against it; empty if nothing does.
    """

    fitted: Any
    delta_bic: float
    explained: float
    better: float
    held_gain: float
    closure: float
    left: float
    chance_weight: float = 1.0
    reason: str = ""

    @property
    def name(self) -> str:
        """Canonical name."""
        return str(self.fitted.name)

    @property
    def passes(self) -> bool:
        """Whether nothing speaks against it."""
        return not self.reason


def delta_bic(before: Array, after: Array, n_numbers: int, n_looks: int, n: float | None = None, price: float = 1.0):
    """n ln(RSS before / after) - price p ln n - 2 ln(places looked at).

    Examples
    --------
    >>> import numpy as np
    >>> round(delta_bic(np.full(100, 2.0), np.ones(100), 1, 1), 1)
    134.0
    """
    n = float(before.size) if n is None else n
    return delta_bic_of(n, float(before @ before), float(after @ after), n_numbers, n_looks, price)


def delta_bic_of(n: float, before: float, after: float, n_numbers: int, n_looks: int, price: float = 1.0) -> float:
    """The same from two sums of squares.

    Examples
    --------
    >>> round(delta_bic_of(100, 4.0, 1.0, 1, 1), 1)
    134.0
    """
    looks = 2 * float(np.log(n_looks)) if n_looks > 1 else 0.0
    return n * float(np.log(before / max(after, 1e-300))) - price * n_numbers * float(np.log(max(n, 2.0))) - looks


def blocks_not_worse(before: ModelErrors, after: ModelErrors) -> float:
    """Share of held-out blocks that lose no more than `NOT_WORSE` of the total gain."""
    gain = np.array([np.sum(before.held[before.block == b] ** 2) - np.sum(after.held[after.block == b] ** 2)
                     for b in np.unique(before.block)])  # fmt: skip
    return float(np.mean(gain >= -NOT_WORSE * max(float(gain.sum()), 0.0)))


def weigh(view: Any, current: Any, fits: Sequence[Any]) -> list[Evidence]:
    """Evidence for every fitted candidate, the strongest first."""
    if not fits:
        return []
    gap = view.gap(current)
    before, floor = view.rms(gap), view.floor(current)
    left = [view.rms(view.gap(f.model)) for f in fits]
    best = int(np.argmin(left))
    judged = view.compare([current, *(f.model for f in fits)], best + 1)
    first, out = judged[0], []
    for fitted, after, j in zip(fits, left, judged[1:], strict=True):
        out.append(Evidence(
            fitted,
            delta_bic(first.errors, j.errors, fitted.look.n_numbers, fitted.look.n_looks, j.n_effective,
                      view.limits.price),
            view.explained(current, fitted.model),
            blocks_not_worse(first, j),
            1.0 - float(j.held @ j.held) / max(float(first.held @ first.held), 1e-300),
            1.0 - (after - floor) / max(before - floor, LEAST_GAP * before + 1e-300),
                after,
            min(1.0, (floor / max(after, 1e-300)) ** 2),
        ))  # fmt: skip
    return sorted(out, key=lambda e: -e.delta_bic)


def objections(plant: Any, view: Any, evidence: Evidence, chance: float, n: float, least: float | None = None) -> str:
    """Why the candidate earns no name; empty if it does. ``least`` share of the drive: by default the tolerance."""
    need = view.limits.need(n, chance * evidence.chance_weight)
    if evidence.delta_bic < need:
        return f"evidence {evidence.delta_bic:.0f} is below the {need:.0f} that chance and noise may reach"
    share, least = evidence.explained / plant.scale, plant.tolerance if least is None else least
    if share < least:
        return f"it explains {100 * share:.2f} % of the rms {plant.whole}, below the tolerance of {100 * least:.2f} %"
    if evidence.better < view.limits.blocks or evidence.held_gain <= 0:
        return f"it improves only {100 * evidence.better:.0f} % of the held-out blocks"
    return evidence.fitted.look.reason or view.objection(evidence.fitted.model, len(evidence.fitted.model.terms) - 1)


def preferred(view: Any, common: Evidence, best: Evidence) -> bool:
    """Whether a commoner effect goes before the one with the strongest evidence."""
    behind = best.delta_bic - common.delta_bic
    mostly = common.held_gain > MOSTLY and view.limits.forgiven > 1.0
    margin = MOSTLY_MARGIN if mostly else LEAST_MARGIN
    return behind < margin or common.left < view.limits.forgiven * best.left


def bootstrap_share(winner: Array, rival: Array, rng: np.random.Generator, n_resamples: int = 200) -> float:
    """How often the winner's squared error is the smaller one when blocks of the record are redrawn."""
    n_blocks = 40
    size = max(1, winner.size // n_blocks)
    gain = (rival**2 - winner**2)[: size * (winner.size // size)].reshape(-1, size).sum(axis=1)
    draws = rng.integers(0, gain.size, (n_resamples, gain.size))
    return float((np.sum(gain[draws].sum(axis=1) > 0) + 0.5) / (n_resamples + 1.0))
