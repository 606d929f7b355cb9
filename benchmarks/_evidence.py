"""What a blind Wiener-Hammerstein record holds: the evidence for the truth, by whoever knows it, and the floor.

The model with every hidden effect starts at its true numbers and is refitted; so is the model without one of them,
from there and from the minima of a search.  The difference is all that anybody could find in the record.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from benchmarks.blind_logs.wiener_hammerstein import Case
from whsklearn.effects import reduced_law
from whsklearn.gap.plant import DEFAULT_TOLERANCE
from whsklearn.gap.plants.chain import ChainPlant
from whsklearn.gap.plants.chain_fit import base_starts, coloured, cost, minima, polished, sharpened
from whsklearn.gap.plants.chain_model import HARD, ChainHypothesis, ChainTerm, Record, catalogue, chain_free_run

PLACES = {"position": 20, "time": 2000, "step": 40}  # independent places that a scan looks at


@dataclass(frozen=True)
class Evidence:
    """``delta_bic`` of every hidden effect beside the others; what the truth, refitted, leaves of a free run."""

    delta_bic: dict[str, float]
    errors: np.ndarray


def term_of(name: str, numbers: dict[str, float]) -> ChainTerm | None:
    """A hidden effect as the finder's catalogue writes it; None for rounding, which is no term."""
    size, shape, phase = (numbers[k] for k in ("size", "shape", "phase"))
    kinds = [c for c in catalogue(reduced_law()) if c.name == name]
    if name == "parameter_change":
        changed = "viscous" if phase < 1 else "coulomb"
        kinds = [c for c in kinds if c.options["parameter"] == changed]
    if not kinds:
        return None
    kind = kinds[0]
    if kind.linear == 2:
        wave = (size * np.cos(phase), -size * np.sin(phase))
        return ChainTerm(kind, (*wave, shape)[: len(kind.fields)])
    return ChainTerm(kind, (size, *((0.0,) if kind.fields[-1] == "centre" else (shape, 2.0)))[: len(kind.fields)])


def record_of(case: Case) -> Record:
    """The record as the finder takes it."""
    dt = float(case.frame["time_s"].iloc[1])
    u, y = case.frame["u"].to_numpy(), case.frame["y"].to_numpy()
    return ChainPlant(u, y, (None, (2, 2, 2, 2), 0), tolerance=DEFAULT_TOLERANCE, dt=dt).readings()


def typical(e: np.ndarray, limit: float) -> float:
    """Root mean square of errors held to a limit."""
    return float(np.sqrt(np.mean(np.clip(e, -limit, limit) ** 2)))


def evidence(case: Case) -> Evidence:
    """See the module."""
    s, system = record_of(case), case.system
    theta = np.array([*system["a"][1:], *system["b"], *system["law"], *system["c"][1:], *system["d"]])
    terms = [term_of(n, p) for n, p in zip(case.truth, case.parameters, strict=True)]
    truth = coloured(s, ChainHypothesis(theta, tuple(t for t in terms if t is not None)))
    whole = polished(s, truth)
    value, n = cost(s, whole), int(s.fit.sum())
    bases = minima(s, base_starts(s, np.random.default_rng(0)))
    found = {}
    for i, term in enumerate(truth.terms):
        others = truth.without(i).terms
        without = [m.without(i) for m in (truth, whole)] + [m.with_terms(others) for m in bases]
        least = min(cost(s, polished(s, sharpened(s, m, (10.0, 30.0, *HARD)))) for m in without)
        price = term.kind.n_numbers * np.log(n) + 2.0 * np.log(PLACES.get(term.kind.scanned, 1))
        found[term.kind.name] = n * np.log(least / value) - price
    return Evidence(found, s.y - chain_free_run(s, whole))
