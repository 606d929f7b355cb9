"""Which number changed: how much of the whole difference between two estimates a change in each would explain.

The difference delta of two estimates with covariance S speaks for a hypothesis "delta = E s" by a Student law with as
many degrees of freedom as S has: twice the log likelihood falls from (nu + p) ln(1 + chi0 / nu) to the same of chi_E.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.stats import f as snedecor
from scipy.stats import t as student

Array = NDArray[Any]

PRIOR = 0.3  # of the rms drive: a typical change, for the price of a free number (Occam)
BESIDE = 4.0  # nats: what explains the difference e^4 times worse is no rival
LEAST = 0.005  # of the rms drive: smaller changes are not reported
MOST_CHANGES = 3


@dataclass(frozen=True)
class Difference:
    """The second estimate minus the first.

    Attributes
    ----------
    names : tuple of str
        Names of the p numbers.
    covers : dict
        Name -> names of numbers that change with it.
    values : ndarray of shape (p,)
    covariance : ndarray of shape (p, p)
    degrees : float
        Degrees of freedom of the covariance.
    mean, errors : ndarray of shape (p,)
        The numbers themselves, pooled, and their standard errors.
    sizes : ndarray of shape (p,)
        Rms drive per unit of each number.
    scale : float
        Rms drive.
    """

    names: tuple[str, ...]
    covers: dict[str, tuple[str, ...]]
    values: Array
    covariance: Array
    degrees: float
    mean: Array
    errors: Array
    sizes: Array
    scale: float


@dataclass(frozen=True)
class Hypothesis:
    """One possible change.

    Attributes
    ----------
    name : str
    basis : ndarray of shape (p, k)
        Directions in which the numbers change.
    """

    name: str
    basis: Array


@dataclass(frozen=True)
class Found:
    """A hypothesis, fitted together with others.

    Attributes
    ----------
    hypothesis : Hypothesis
    step : ndarray of shape (k,)
        Step along its basis.
    errors : ndarray of shape (k,)
        Standard errors.
    chi2 : float
        Improvement in chi-squared of the difference.
    evidence : float
        In nats, after subtracting the price of its numbers.
    p_value : float
        Probability of such an improvement by chance, for one hypothesis.
    size : float
        Rms of the change in the drive, as a share of the rms drive.
    """

    hypothesis: Hypothesis
    step: Array
    errors: Array
    chi2: float
    evidence: float
    p_value: float
    size: float


def hypotheses(d: Difference) -> list[Hypothesis]:
    """One hypothesis per named number, and one for the gain of the drive: all numbers scaled alike except its age."""
    unit = np.eye(d.values.size)
    out = []
    for name in dict.fromkeys(d.names):
        those = (name, *d.covers.get(name, ()))
        out.append(Hypothesis(name, unit[:, [i for n in those for i, m in enumerate(d.names) if m == n]]))
    forces = np.array([n != "delay" for n in d.names])
    return [*out, Hypothesis("gain", np.where(forces, d.mean, 0.0)[:, None])]


def weigh(d: Difference, h: Hypothesis, given: Array) -> Found:
    """Fit a hypothesis in addition to the directions ``given``, shape (p, m), that are assumed to have changed."""
    w = np.linalg.inv(d.covariance)
    nu, p = d.degrees, d.values.size
    rest = d.values - _project(d.values, w, given)
    beside = h.basis - _project(h.basis, w, given)
    information = beside.T @ w @ beside
    inverse = np.linalg.pinv(information, rcond=1e-10, hermitian=True)
    step = inverse @ (beside.T @ w @ rest)
    chi0 = float(rest @ w @ rest)
    chi2 = float(np.clip(step @ information @ step, 0.0, chi0))
    k = h.basis.shape[1]
    gained = 0.5 * (nu + p) * (np.log1p(chi0 / nu) - np.log1p((chi0 - chi2) / nu))
    size = float(np.linalg.norm(d.sizes * (h.basis @ step))) / d.scale
    return Found(
        h, step, np.sqrt(np.maximum(np.diag(inverse), 0.0)), chi2, gained - _occam(d, h, information),
        float(snedecor.sf(chi2 / k, k, nu)), size,
    )  # fmt: skip


def _project(x: Array, w: Array, given: Array) -> Array:
    if given.shape[1] == 0:
        return np.zeros_like(x)
    return given @ (np.linalg.pinv(given.T @ w @ given, rcond=1e-10, hermitian=True) @ (given.T @ w @ x))


def _occam(d: Difference, h: Hypothesis, information: Array) -> float:
    """Price of the hypothesis's numbers, 1/2 ln det(1 + prior information): the posterior's share of the prior."""
    one = np.linalg.norm(d.sizes[:, None] * h.basis, axis=0)  # rms drive a unit step
    prior = PRIOR * d.scale / np.maximum(one, 1e-300)
    return 0.5 * float(np.linalg.slogdet(np.eye(prior.size) + np.outer(prior, prior) * information)[1])


def moved(d: Difference, alpha: float) -> list[tuple[Found, list[Found]]]:
    """What changed, the most certain first, each with its rivals; empty if nothing did.

    A second change must be as sure as the first beside it, and explain e^4 times more than the first alone.
    """
    out: list[tuple[Found, list[Found]]] = []
    given = np.zeros((d.values.size, 0))
    open_to = hypotheses(d)
    while open_to and len(out) < MOST_CHANGES:
        found = sorted((weigh(d, h, given) for h in open_to), key=lambda f: -f.evidence)
        best = found[0]
        if best.p_value * len(found) > alpha or best.evidence < BESIDE or best.size < LEAST:
            break
        rivals = [f for f in found[1:] if f.evidence > best.evidence - BESIDE]
        out.append((best, rivals))
        given = np.column_stack([given, best.hypothesis.basis])
        open_to = [h for h in open_to if h.name != best.hypothesis.name]
    return out


def smallest(d: Difference, alpha: float) -> dict[str, float]:
    """Name -> the smallest change that would have been detected, in the number's unit (for a pair, its amplitude)."""
    w = np.linalg.inv(d.covariance)
    every = hypotheses(d)
    z = float(student.isf(alpha / len(every) / 2.0, d.degrees))
    out = {}
    for h in every:
        one = np.linalg.norm(d.sizes[:, None] * h.basis, axis=0)
        information = h.basis.T @ w @ h.basis
        error = 1.0 / np.sqrt(np.maximum(np.linalg.eigvalsh(information)[0], 1e-300))
        price = 2.0 * (BESIDE + _occam(d, h, information)) / (d.degrees + d.values.size)
        need = max(z, float(np.sqrt(d.degrees * np.expm1(price))))
        out[h.name] = max(need * float(error), LEAST * d.scale / max(float(one.max()), 1e-300))
    return out
