"""What a search keeps: candidates refitted on top of a model, what held-out samples and physics say of them."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from whsklearn.gap.blocks.candidates import Candidate, Scales
from whsklearn.gap.blocks.model import BlockModel, Setting, chain, coloured, free_run, raw_errors
from whsklearn.gap.blocks.score import Remainder, Screened

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]


MEMORY = 8  # samples for which L2 remembers a sign


@dataclass
class Trial:
    """A candidate refitted on top of a model."""

    screened: Screened
    model: BlockModel
    cost: float
    delta_bic: float
    moved: float = 0.0  # rms change of the simulated output, share of rms y
    better: float = 0.0  # share of held-out blocks improved
    held_gain: float = 0.0  # fall of the sum of squares over held-out samples, in variances
    worse: float = 1.0  # held-out mean square of the free run, over that without the effect
    reason: str = ""

    @property
    def kind(self) -> Candidate:
        """What was tried."""
        return self.screened.term.kind

    @property
    def name(self) -> str:
        """Canonical name."""
        return self.kind.name


@dataclass
class Round:
    """One pass over the catalogue."""

    before: BlockModel
    cost: float
    screened: list[Screened]
    trials: list[Trial]
    taken: Trial | None = None


@dataclass
class Found:
    """Where the search ended."""

    base: BlockModel
    base_cost: float
    minima: list[tuple[BlockModel, float]]
    scales: Scales
    model: BlockModel
    cost: float
    rounds: list[Round] = field(default_factory=list)
    taken: list[Trial] = field(default_factory=list)
    left: Remainder | None = None
    base_left: Remainder | None = None
    interrupted: bool = False


def delta_bic(n: int, before: float, after: float, numbers: int, places: int) -> float:
    """n ln(before / after) - p ln n - 2 ln(places), sums of squares on n samples."""
    return float(n * np.log(before / max(after, 1e-300)) - numbers * np.log(n) - 2 * np.log(max(places, 1)))


def turned(s: Setting, a: BlockModel, b: BlockModel) -> NDArray[np.intp]:
    """Samples at which x moves one way under one model and the other way under the other."""
    steps = [np.diff(chain(s, m)[0], prepend=0.0) for m in (a, b)]
    return np.flatnonzero(np.sign(steps[0]) != np.sign(steps[1]))


def behind(n: int, events: NDArray[np.intp]) -> NDArray[np.intp]:
    """For each of n samples, which event L2 still remembers, by number; -1 for none."""
    if not events.size:
        return np.full(n, -1)
    time = np.arange(n)
    last = np.searchsorted(events, time, side="left") - 1
    return np.where((last >= 0) & (time - events[last] <= MEMORY), last, -1)


def weigh(s: Setting, before: BlockModel, trial: Trial) -> None:
    """What held-out samples and the free run say of a trial.

    Samples beside a reversal that only one of the two models has are left out: there one is off by the sign's height,
    and which one is chance.  Of the others none counts beyond four robust deviations, what a fit lets it cost.  A
    block counts where the two models differ by more than noise may move it.
    """
    plain = (s.held >= 0) & (behind(s.u.size, turned(s, before, trial.model)) < 0)
    block = s.held[plain]
    e0, e1 = (coloured(raw_errors(s, m), m.ar)[plain] for m in (before, trial.model))
    sigma = 1.4826 * np.median(np.abs(e0)) + 1e-300
    e0, e1 = np.clip(e0 / sigma, -4.0, 4.0), np.clip(e1 / sigma, -4.0, 4.0)
    gains = np.array([np.sum(e0[block == i] ** 2) - np.sum(e1[block == i] ** 2) for i in np.unique(block)])
    telling = np.abs(gains) > 1.0
    trial.better = float(np.mean(gains[telling] > 0.0)) if telling.any() else 1.0
    trial.held_gain = float(gains.sum())
    run = free_run(s, trial.model)
    apart = run - free_run(s, trial.model.without(len(trial.model.terms) - 1))
    trial.moved = float(np.sqrt(np.mean(apart**2) / np.mean(s.y**2)))
    trial.worse = worsened(s, before, trial.model)


def worsened(s: Setting, before: BlockModel, after: BlockModel) -> float:
    """Mean square of the free run over held-out samples, over that before; the same samples count as in `weigh`."""
    plain = (s.held >= 0) & (behind(s.u.size, turned(s, before, after)) < 0)
    miss0, miss1 = ((s.y - free_run(s, m))[plain] for m in (before, after))
    limit = 6.0 * 1.4826 * np.median(np.abs(miss0)) + 1e-300
    return float(np.mean(np.clip(miss1, -limit, limit) ** 2) / np.mean(np.clip(miss0, -limit, limit) ** 2))


def objection(s: Setting, trial: Trial, z: Scales, need: float, tolerance: float) -> str:
    """Why a trial earns no name; empty if it does."""
    if trial.delta_bic < need:
        return f"evidence {trial.delta_bic:.0f} is below the {need:.0f} that chance may reach"
    if trial.moved < tolerance:
        return f"it moves the output by {100 * trial.moved:.2f} % of its rms, below the tolerance"
    if trial.better < 0.5:
        return f"it improves only {100 * trial.better:.0f} % of the held-out blocks"
    if trial.held_gain < -0.05 * trial.delta_bic:
        return f"held-out errors grow, against its evidence of {trial.delta_bic:.0f} where it was fitted"
    if trial.worse > 1.01:
        return "the free run over held-out samples is worse with it"
    kind, q = trial.kind, trial.model.terms[-1].q
    if kind.positive and q[0] <= 0:
        return f"its size would be {q[0]:.3g}, and a physical one is positive"
    for j in range(kind.linear, kind.n_numbers):
        low, high = kind.ranges(z)[j - kind.linear]
        full = kind.name == "sensor_rectification" and q[j] > 0.5
        if kind.is_free(j) and not full and (q[j] <= low * (1 + 1e-6) or q[j] >= high * (1 - 1e-6)):
            return f"its {kind.fields[j]} runs to the end of the plausible range"
    return ""
