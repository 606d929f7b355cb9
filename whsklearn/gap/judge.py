"""Rules: when an effect earns its name, and when silence is the answer.

A candidate is measured after whitening with what the best candidate leaves over, so neither a tone nor
coloured noise passes for evidence; it must pay for its numbers and for every place that a scan looked at
(Schwarz 1978, Ann. Stat. 6(2)), improve held-out blocks, have a physical sign and be worth the tolerance.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[Any]

EVIDENCE_PER_SAMPLE = 200.0 / 2450.0  # of delta BIC, calibrated on records with nothing missing
LEAST_EVIDENCE, MOST_EVIDENCE = 40.0, 200.0
LEAST_MARGIN = 10.0
NAMED, PARTIAL = 0.88, 0.3  # closure
LEFT_BY_SEVERAL = 2.5  # floors
FOLLOWS = 0.04  # share of a gap that nameless functions of the motion must explain to be no noise
BLOCKS_BETTER = 0.8
STEEPEST_ERROR = 0.3  # rad a rad
BESIDE_A_PLAY = 0.66  # share of the rms left beside a play: what impacts leave over follows everything a little
SIMPLEST_FIRST = 0.7  # share of the best one's explained power that an elementary effect must reach
ELEMENTARY = ("viscous", "coulomb", "input_offset", "asymmetric_coulomb")


@dataclass
class Evidence:
    """What speaks for one candidate on top of the model in force."""

    trial: Any
    delta_bic: float
    explained: float  # rms torque
    better: float  # share of held-out blocks improved
    held_gain: float  # drop of held-out whitened sum of squares, share
    closure: float  # of missing torque, held-out
    null_weight: float = 1.0  # the twins' null is one of the floor; it fades where more than the floor is left
    reason: str = ""

    @property
    def name(self) -> str:
        """Canonical name."""
        return str(self.trial.kind.name)

    @property
    def passes(self) -> bool:
        """Whether nothing speaks against it."""
        return not self.reason


def delta_bic(before: Array, after: Array, n_parameters: int, looks: int) -> float:
    """n ln(RSS before / after) - p ln n - 2 ln(places looked at)."""
    n = before.size
    ratio = float(before @ before) / max(float(after @ after), 1e-300)
    return n * float(np.log(ratio)) - n_parameters * float(np.log(n)) - (2 * float(np.log(looks)) if looks > 1 else 0.0)


def threshold(n: int, null: float) -> float:
    """Least delta BIC for a name, given the samples and the best score on twins."""
    return max(LEAST_EVIDENCE, min(MOST_EVIDENCE, EVIDENCE_PER_SAMPLE * n), 4.0 * null)


def weigh_evidence(bench: Any, current: Any, trials: list[Any], floor: float) -> list[Evidence]:
    """Evidence for every refitted trial, best first; the bench is left whitened by the best one's leftover."""
    d0 = bench.missing(current)
    lacking = [bench.missing(t.model) for t in trials]
    if not trials:
        return []
    best = min(range(len(trials)), key=lambda i: trials[i].cost)
    bench.weigh(bench.rms(lacking[best], "all"))  # held-out samples are compared without the colour of what is left
    held = [bench.whitened(d, on="held") for d in lacking]
    h0 = bench.whitened(d0, on="held")
    bench.tune_whitening(lacking[best])
    w0 = bench.whitened(d0)
    number = bench.held[(bench.held >= 0) & bench.usable]
    before = bench.rms(d0)
    out = []
    for trial, d, h in zip(trials, lacking, held, strict=True):
        w = bench.whitened(d)
        looks = trial.scanned[0].size if trial.scanned is not None else len(trial.kind.starts(bench.scene))
        per_block = [np.sum(h[number == i] ** 2) < np.sum(h0[number == i] ** 2) for i in np.unique(number)]
        after = bench.rms(d)
        out.append(
            Evidence(
                trial,
                delta_bic(w0, w, trial.n_parameters, looks),
                float(np.sqrt(max(bench.rms(d0, "all") ** 2 - bench.rms(d, "all") ** 2, 0.0))),
                float(np.mean(per_block)),
                1.0 - float(h @ h) / float(h0 @ h0),
                1.0 - (after - floor) / max(before - floor, 1e-12),
                min(1.0, (floor / max(after, 1e-300)) ** 2),
            )
        )
    return sorted(out, key=lambda e: -e.delta_bic)


def objections(bench: Any, evidence: Evidence, null: float, n: int, *, judge_sign: bool = True) -> str:
    """Why the candidate earns no name; empty if it does."""
    need = threshold(n, null * evidence.null_weight)
    if evidence.delta_bic < need:
        return f"evidence {evidence.delta_bic:.0f} is below the {need:.0f} that chance and noise may reach"
    share = evidence.explained / bench.scene.torque
    if share < bench.tolerance:
        return f"it explains {100 * share:.2f} % of the rms drive, below the tolerance of {100 * bench.tolerance:.2f} %"
    if evidence.better < BLOCKS_BETTER or evidence.held_gain <= 0:
        return f"it improves only {100 * evidence.better:.0f} % of the held-out blocks"
    return unphysical(evidence.trial) if judge_sign else ""


def unphysical(trial: Any) -> str:
    """What is wrong with the sign or the range of the numbers; empty if nothing."""
    q = trial.model.terms[-1].q
    if trial.kind.name == "encoder_eccentricity" and float(np.hypot(q[0], q[1])) * q[2] > STEEPEST_ERROR:
        return "an encoder error so steep would let the reading stand still while the axis turns"
    if trial.kind.positive and q[0] <= 0:
        return f"its size would be {q[0]:.3g}, and a physical one is positive"
    return at_the_end(trial.model, len(trial.model.terms) - 1)


def at_the_end(model: Any, index: int) -> str:
    """Whether the first shape number of an effect has run to the end of its range; empty if not."""
    kind = model.terms[index].kind
    low, high = model.bounds()
    for value, a, b, (i, j, _) in zip(model.vector()[2:], low[2:], high[2:], model.free(), strict=True):
        if i == index and j == kind.linear and j < kind.n_slots:
            if value <= a + 1e-6 * abs(a) or value >= b - 1e-6 * abs(b):
                return f"its {kind.fields[j]} runs to the end of the plausible range"
    return ""


def bootstrap_share(winner: Array, rival: Array, rng: np.random.Generator, n_resamples: int = 200) -> float:
    """How often the winner's squared error is the smaller one when blocks of the record are redrawn."""
    n_blocks = 40
    size = max(1, winner.size // n_blocks)
    gain = (rival**2 - winner**2)[: size * (winner.size // size)].reshape(-1, size).sum(axis=1)
    draws = rng.integers(0, gain.size, (n_resamples, gain.size))
    return float((np.sum(gain[draws].sum(axis=1) > 0) + 0.5) / (n_resamples + 1.0))
