"""Evidence: what speaks for a candidate, when it earns a name, and the thresholds of these rules.

Evidence is a difference of BIC (Schwarz 1978, Ann. Stat. 6(2)) between two models judged on the same errors,

    n ln(RSS_before / RSS_after) - c p ln n - 2 ln(places looked at),

with n the independent samples, p the added numbers and c = 1 for errors of fitted samples or 1/2 for
cross-validated ones, which have paid for over-fitting already.  A name further needs held-out blocks that improve,
a size above the tolerance, and numbers that are physical.

Here stand the thresholds of the engine and of what all plants share.  Those that only one kind of model knows stand
beside it, in `plants.servo_evidence`.  How finely a fit steps
or where a search begins is no rule: such numbers stand where they are used.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from whsklearn.gap.values import ModelErrors

Array = NDArray[Any]

# Above each threshold stands what it guards against and how it was found.  "blind" is `python -m benchmarks.blind`,
# "real" is `python -m benchmarks.real_axes`: both print the rates that a change of a number moves.

# Standard deviation of a Gaussian over its median absolute deviation: what "robust deviations" are counted in.
MAD = 1.4826

# --- a name ---------------------------------------------------------------------------------------

# Share of the rms drive or output: no effect below is worth a name. Surrogates of records with nothing missing leave
# 0.0037 to 0.0047 of the drive in the inverse view. The one default of every entry.
DEFAULT_TOLERANCE = 0.004
# Closure below which the name of the nearest neighbour says nothing: wrong names close 0.2 in the median ("blind").
PARTIAL = 0.3
# Share of the base model's gap that the motion may still predict at the floor beside a sure name. What is left is
# worth no name, but friction that grows above a speed leaves 0.05 to 0.09 as `stribeck` and a spring that gives way
# 0.08 as three effects (`benchmarks.learned`); true names leave up to 0.03 ("blind --kinds named").
OWN_SHAPE = 0.04
# Multiple of what the encoder's noise leaves of own records, below which nothing is missing: five records know it to a
# tenth.
QUIET = 1.35
# Share of the floor, or of the gap before, below which a difference is rounding and no gap.
NO_GAP = 1e-3

# --- held-out blocks ------------------------------------------------------------------------------

# Parts of a record, and the share at the end of each that is held out: 60 % fit and 40 % judge, and every part of a
# record that drifts is seen by both.
PARTS, HELD_OUT = 5, 0.4
# Share of held-out blocks that must not be worse: 4 of 5, 8 of 10.
BLOCKS_BETTER = 0.8
# Share of the total gain that a block may lose: blocks at rest cannot improve, and vetoed gravity on XL330 ("real").
NOT_WORSE = 0.05

# --- one name or another --------------------------------------------------------------------------

# Delta BIC to the runner-up: "very strong" of Kass and Raftery 1995, JASA 90(430).
LEAST_MARGIN = 10.0

# --- what has no name, and what a record cannot show ----------------------------------------------

# Learned curves of one record: each is a function of one or two signals (`benchmarks.learned`).
MOST_CURVES = 2
# Share of the cross-validated power left over that a learned curve must explain (`benchmarks.learned`).
LEARNED_SHARE = 0.1
# Share of the gap in simulation that learned curves must close, or they are left out (`benchmarks.learned`).
LEARNED_CLOSURE = 0.1
# Delta BIC that two percent of the rms drive must be able to reach, or an effect is not testable ("blind").
VISIBLE = 150.0
# Share of effects that are not testable above which "nothing is missing" is "not testable".
MOSTLY_BLIND = 0.5

# --- what is worth the time of a joint fit ("blind") ----------------------------------------------

# Looks refined where the gap is at the floor already, and a fit costs seconds as an axis's does.
FEW_REFINED = 2
# Share of what is left that counts as a gap over the floor: at the floor itself no share of it means anything.
LEAST_GAP = 1e-3

# --- what is read off the record itself ("blind" with quantization) -------------------------------

# Differences of sorted readings up to this times the smallest one are one step of a grid, whose median is taken: a
# difference of two steps must stay out, and digits cut off in the file move one step a little.
ONE_STEP = 1.5
# Share of a step (times the root of their number) that a difference may miss whole steps by: digits cut off.
ON_GRID = 0.02
# Share of differences that must be whole steps.
MOSTLY_ON_GRID = 0.99
# Distinct values a sample: above, each is met once and a grid is no coarser than the noise.
DISTINCT = 0.9
# Share of a step: the mean distance of readings from the grid above which the step was rounded in the file and is
# taken from the whole span. A right step leaves hundredths, a wrong one a quarter.
STEP_ROUNDED = 0.15
# Share of the sixth differences that tells the noise, and what makes up for the largest ones, which impacts and steps
# of the drive make: 1.07 for a Gaussian.
NOISE_KEPT, NOISE_MADE_UP = 0.98, 1.06

# --- what a record must have before any diagnosis (`tests/gap/test_data_check.py`, "real") --------

# s: a third of a record is lost to restarts and filters, and the rest must hold several reversals.
SHORTEST_RECORD = 3.0
FEWEST_SAMPLES = 300
# Typical steps: five samples lost are a kick of several percent of the drive in any derivative.
HOLE = 5.5
# Share of steps that may differ from the typical one by more than this share of it.
UNEVEN, UNEVEN_STEP = 0.01, 0.5
# s a sample: ten samples a period of 2 Hz.
SLOWEST_SAMPLING = 0.05
# Share of samples at which the position must change.
MOVING = 0.002
# Changes of the drive: a torque step has two.
FEWEST_CHANGES = 4
# Share of samples at an extreme that is worth a word; runs of at least so many samples count.
FLAT, FLAT_RUN = 0.02, 3
# s over which a halt at an extreme is compared with the rest of the path.
TURNING = 0.01
# Multiple of the usual change of path (this quantile of it): a turn stays below 0.6 on eight pendulum logs and, by v
# = a t, below 1; sines clipped at their median or at nine tenths reach 1.9 to 7.6 (blind records of
# `benchmarks.blind_logs`).
SHARPER, USUAL = 1.4, 0.99
# Multiple of the 0.999 quantile of second differences; how many of them a record may have.
SPIKE, SPIKES_BORNE = 60.0, 2
# Share of what is left without a delay, below which the delay of a position servo's command is believed: a delay
# trades against viscous friction (`benchmarks.real_axes --only so101`).
WORTH_A_DELAY = 0.9

# --- what a report says of places and constants; no name depends on it ----------------------------

# Level of the p-value of a place, adjusted over the signals.
PLACE_LEVEL = 0.05
# Share of the gap beyond the share of samples: below, a range is not worth a sentence.
PLACE_EXCESS = 0.08
# Level of the p-value of a constant's drift, of some twenty pairs that are looked at.
DRIFT_LEVEL = 0.02
# Share of the gap that a drifting constant must take up, and of its drift, that one signal must explain.
DRIFT_SHARE = 0.1
# Multiple of the floor: what no uncertainty of a floor explains, so that a page does not call it noise.
ABOVE_NOISE = 2.0


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


# Errors of fitted samples, whitened: 200 at 2450 samples separates the least true (418) from the best by chance (195)
# of the "blind" development set (seeds below 900); never below 40, where AR whitening of few samples is itself
# uncertain. A noise-limited floor is known to about 5 %, hence quiet at 1.1 of it.
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
    chance_weight : float
        Weight of what chance reaches on surrogates: that was measured beside the whole gap, and falls with it.
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
    errors = view.compare([current, *(f.model for f in fits)], best + 1)
    first, out = errors[0], []
    for fitted, after, e in zip(fits, left, errors[1:], strict=True):
        look = fitted.look
        gain = delta_bic(first.errors, e.errors, look.n_numbers, look.n_looks, e.n_effective, view.limits.price)
        out.append(
            Evidence(
                fitted,
                delta_bic=gain,
                explained=view.explained(current, fitted.model),
                better=blocks_not_worse(first, e),
                held_gain=1.0 - float(e.held @ e.held) / max(float(first.held @ first.held), 1e-300),
                closure=1.0 - (after - floor) / max(before - floor, LEAST_GAP * before + 1e-300),
                left=after,
                chance_weight=min(1.0, (floor / max(after, 1e-300)) ** 2),
            )
        )
    return sorted(out, key=lambda evidence: -evidence.delta_bic)
