"""What a blind Wiener-Hammerstein record holds: the evidence for the truth, by whoever knows it, and the floor.

The model with every hidden effect starts at its true numbers and is refitted; so is the model without one of them,
from there and from the minima of a search.  The difference is all that anybody could find in the record.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from benchmarks.blind_logs.wiener_hammerstein import Case
from whsklearn.gap.evidence import DEFAULT_TOLERANCE, delta_bic_of
from whsklearn.gap.plants.chain import ChainPlant
from whsklearn.gap.plants.chain_candidates import CATALOGUE
from whsklearn.gap.plants.chain_fit import cost, fit_base, refit, rms_dx
from whsklearn.gap.plants.chain_law import law_choice
from whsklearn.gap.plants.chain_model import ChainModel, Setting, Term, free_run, signal_scales


@dataclass(frozen=True)
class Evidence:
    """``delta_bic`` of every hidden effect beside the others; what the truth, refitted, leaves of a free run."""

    delta_bic: dict[str, float]
    errors: np.ndarray


def term_of(name: str, numbers: dict[str, float]) -> Term | None:
    """A hidden effect as the finder's catalogue writes it; None for rounding, which is no term."""
    size, shape, phase = (numbers[k] for k in ("size", "shape", "phase"))
    kinds = [c for c in CATALOGUE if c.name == name]
    if name == "parameter_change":
        changed = "viscous" if phase < 1 else "coulomb"
        kinds = [c for c in kinds if c.options["parameter"] == changed]
    if not kinds:
        return None
    kind = kinds[0]
    if kind.linear == 2:
        wave = (size * np.cos(phase), -size * np.sin(phase))
        return Term(kind, wave if kind.n_numbers == 2 else (*wave, shape))
    rest = (shape, 2.0)[: kind.n_numbers - 1]
    return Term(kind, (size, *((0.0,) if kind.fields[-1] == "centre" else rest)))


def setting_of(case: Case) -> Setting:
    """The record as the finder splits it."""
    dt = float(case.frame["time_s"].iloc[1])
    u, y = case.frame["u"].to_numpy(), case.frame["y"].to_numpy()
    return ChainPlant(u, y, (law_choice(None), (2, 2, 2, 2), 0), tolerance=DEFAULT_TOLERANCE, dt=dt).setting()


def typical(e: np.ndarray, limit: float) -> float:
    """Root mean square of errors held to a limit."""
    return float(np.sqrt(np.mean(np.clip(e, -limit, limit) ** 2)))


def evidence(case: Case) -> Evidence:
    """See the module."""
    s, system = setting_of(case), case.system
    theta = np.array([*system["a"][1:], *system["b"], *system["law"], *system["c"][1:], *system["d"]])
    terms = [term_of(n, p) for n, p in zip(case.truth, case.parameters, strict=True)]
    truth = ChainModel(theta, tuple(t for t in terms if t is not None))
    truth = truth.at(1000.0 / rms_dx(s, truth))
    z = signal_scales(s, truth)
    whole, value = refit(s, truth, z)
    value = min(value, cost(s, truth))
    minima = [m for m, _ in fit_base(s, np.random.default_rng(0))]
    found, n = {}, int(s.fit.sum())
    for i, term in enumerate(truth.terms):
        others = truth.without(i).terms
        without = [refit(s, m.without(i), z, thorough=True)[1] for m in (truth, whole)]
        for m in minima:
            for other in others:
                m = m.plus(other)
            without.append(refit(s, m, z)[1] if others else cost(s, m))
        found[term.kind.name] = delta_bic_of(n, min(without), value, term.kind.n_estimated, term.kind.scanned)
    return Evidence(found, s.y - free_run(s, whole))
