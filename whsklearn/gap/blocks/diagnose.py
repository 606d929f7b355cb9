"""From what the search found to the verdict, the proof and the pictures of a u-y record."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from whsklearn.gap import judge, locate
from whsklearn.gap.blocks.alike import aliases_of
from whsklearn.gap.blocks.effects import FoundEffect, found_effect, standard_errors
from whsklearn.gap.blocks.fit import refit
from whsklearn.gap.blocks.model import BlockModel, Setting, chain, coloured, free_run, raw_errors
from whsklearn.gap.blocks.rounds import NEED
from whsklearn.gap.blocks.score import ABSORBED, whiteness
from whsklearn.gap.blocks.search import search
from whsklearn.gap.blocks.stretch import LONG, STRETCH
from whsklearn.gap.blocks.trial import Found, behind, turned
from whsklearn.gap.blocks.words import next_step, sentence
from whsklearn.gap.close import closure
from whsklearn.gap.diagnosis import CandidateLine, Diagnosis, NamedEffect
from whsklearn.gap.record import lattice

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

HORIZONS = (1, 10)  # samples, beside the free run
# what generic functions still find after a confident name: the plainer it is, the more must be explained beside it
LEAVES = ((1e-4, 0.97), (0.05, 0.9))  # p-value below which so large a share is asked for
QUIET = 1e-4  # p-value below which something is left


def diagnose(
    line: Any, s: Setting, rng: np.random.Generator, *, max_effects: int, tolerance: float, progress: Any
) -> tuple[Diagnosis, Any]:
    """(diagnosis, repaired system) of one record."""
    progress("twins")
    found = search(s, rng, max_effects=max_effects, tolerance=tolerance, progress=lambda _: None)
    progress("search")
    alike = [aliases_of(s, r, t, found.scales) for t, r in _rounds_of(found)]
    d = Diagnosis(verdict_of(s, found, [close for _, close in alike], tolerance), "")
    step = coarse_grid(s, found)
    if step and d.verdict in ("no_gap", "coloured_noise", "unknown"):
        d.verdict = "named"
    d.need = NEED
    d.interrupted = found.interrupted
    final = found.model
    if found.taken and d.verdict in ("named", "ambiguous", "partial"):
        whole = s.on_all(int(np.argmax(s.fit)))
        final, _ = refit(whole, found.model, found.scales)
        errors = standard_errors(whole, final, found.scales)
        for i, (t, r) in enumerate(_rounds_of(found)):
            aliases, close = alike[i]
            effect = found_effect(final.terms[i])
            share = _confidence(s, t, r, rng, aliases)
            d.effects.append(
                NamedEffect(effect, errors[i], t.delta_bic, share, 0.0, list(dict.fromkeys([*aliases, *close])))
            )
    if step:
        grid = FoundEffect("quantization", "sensor", "y = s round(q / s)", {"step": step})
        d.effects.append(NamedEffect(grid, {}, 0.0, 0.95, 0.0))
    progress("prove")
    _prove(s, found, d)
    d.candidates = table(found, d)
    progress("locate")
    d.horizon_unit = "samples"
    _locate(s, found, d, rng)
    d.rounds = [_round(i, r, found) for i, r in enumerate(found.rounds, start=1)]
    d.residual_tests = _tests(s, found)
    d.base_parameters = _parameters(s, found)
    d.next_experiment = next_step(d)
    d.notes = _notes(s, found)
    d.pictures = _pictures(s, found, d)
    d.sentence = sentence(d)
    return d, line.export(final if found.taken and d.effects else found.base, grid=step)


def _rounds_of(found: Found) -> list[tuple[Any, Any]]:
    """Every effect taken with the round it was taken in."""
    return [(t, next((r for r in found.rounds if t in r.trials), found.rounds[0])) for t in found.taken]


def verdict_of(s: Setting, found: Found, close: list[list[str]], tolerance: float) -> str:
    """The verdict, from what was taken and what is left.

    Parameters
    ----------
    close : list of list of str
        For each effect, the names that could stand in its place, aliases left out.
    tolerance : float
        Error of the free run, as a share of the output's rms, below which nothing is worth a word.
    """
    left = found.left
    assert left is not None
    if not found.taken:
        lost = found.rounds[0].screened if found.rounds else []
        if lost and np.mean([c.left < ABSORBED for c in lost]) > 0.5:
            return "not_testable"
        held = s.held >= 0
        if _rmse(s.y - free_run(s, found.base), held) < tolerance * float(np.sqrt(np.mean(s.y[held] ** 2))):
            return "no_gap"
        if left.p_value < QUIET and left.share > 0.02:
            return "unknown"
        if whiteness(_uncoloured(s, found.base)) < 1e-4:
            return "coloured_noise"
        return "no_gap"
    explained = found.base_cost - found.cost
    remains = left.share * found.cost
    closed = explained / max(explained + remains, 1e-300)
    if any(left.p_value < p and closed < share for p, share in LEAVES):
        return "partial" if closed >= 0.5 else "unknown"
    return "ambiguous" if any(close) else "named"


def coarse_grid(s: Setting, found: Found) -> float:
    """Step of the grid on which the readings lie, if rounding is a good part of what is left; 0 otherwise."""
    step = lattice(s.y)
    if not step or step / math.sqrt(12.0) < 0.003 * float(np.sqrt(np.mean(s.y**2))):
        return 0.0
    nd = int(s.dims[3])
    gain = 1.0 + float(np.sum(found.model.theta[found.model.theta.size - nd :] ** 2))
    errors = _capped(raw_errors(s, found.model))
    return step if gain * step**2 / 12.0 > 0.15 * float(np.mean(errors**2)) else 0.0


def _uncoloured(s: Setting, m: BlockModel) -> Array:
    """Prediction errors without the model of their colour."""
    return raw_errors(s, m)[s.fit]


def _confidence(s: Setting, t: Any, r: Any, rng: np.random.Generator, aliases: list[str]) -> float:
    """How often the winner stays ahead of the next other name when blocks of the record are redrawn."""
    rivals = [o for o in r.trials if o.name != t.name and o.name not in aliases]
    mine = _capped(coloured(raw_errors(s, t.model), t.model.ar))
    other = rivals[0].model if rivals else r.before
    return judge.bootstrap_share(mine, _capped(coloured(raw_errors(s, other), other.ar)), rng)


def _capped(e: Array) -> Array:
    """Errors held to six robust standard deviations."""
    limit = 6.0 * 1.4826 * float(np.median(np.abs(e))) + 1e-300
    return np.clip(e[40:], -limit, limit)


# --- proof ---------------------------------------------------------------------------------------
def ahead_errors(s: Setting, m: BlockModel, horizon: int) -> Array:
    """Prediction errors ``horizon`` samples ahead, sum_i h_i e(t-i) with h the response of L2's denominator."""
    e = raw_errors(s, m)
    nd = int(s.dims[3])
    d = m.theta[-nd:] if nd else np.zeros(0)
    h = np.zeros(horizon)
    h[0] = 1.0
    for i in range(1, horizon):
        h[i] = -sum(d[j] * h[i - 1 - j] for j in range(min(nd, i)))
    return np.convolve(e, h)[: e.size]


def beside_turned(s: Setting, found: Found) -> NDArray[np.bool_]:
    """Samples beside a reversal that the model has before the repair or after it, but not both."""
    return behind(s.u.size, turned(s, found.base, found.model)) >= 0


def _rmse(e: Array, mask: NDArray[np.bool_]) -> float:
    return float(np.sqrt(np.mean(np.clip(e[mask], -1e12, 1e12) ** 2)))


def _prove(s: Setting, found: Found, d: Diagnosis) -> None:
    """Errors on held-out samples before and after, at three horizons, the free run last."""
    held = s.held >= 0
    clear = held & ~beside_turned(s, found)
    share = found.left.share if found.left is not None and found.left.p_value < 0.01 else 0.0
    runs: list[tuple[float, Array, Array]] = [
        (float(h), ahead_errors(s, found.base, h), ahead_errors(s, found.model, h)) for h in HORIZONS
    ]
    runs.append((0.0, s.y - free_run(s, found.base), s.y - free_run(s, found.model)))
    quiet = math.sqrt(1.0 - min(share, 0.99))
    for horizon, before, after in runs:
        b, a = _rmse(before, held), _rmse(after, held)
        floor = a * quiet
        # beside a reversal that one of the two models has and the other not, an error is the sign's height: a few of
        # those make up most of the plain mean square, and on which side a model stands there is chance
        limit = 6.0 * 1.4826 * float(np.median(np.abs(before[clear]))) + 1e-300
        typical_b, typical_a = (_rmse(np.clip(e, -limit, limit), clear) for e in (before, after))
        d.horizons.append({
            "horizon": horizon if horizon else float(s.u.size), "before": b, "after": a, "floor": floor,
            "closure": closure(typical_b, typical_a, typical_a * quiet),
        })  # fmt: skip
        if horizon == 0.0:
            d.floor = floor
            d.before, d.after = (_indices(s.y, e, held) for e in (before, after))
    d.closure = d.horizons[-1]["closure"] if found.taken else 0.0
    for e in d.effects:
        e.closure = d.closure


def _indices(y: Array, e: Array, mask: NDArray[np.bool_]) -> dict[str, float]:
    """NMSE, mean error and RMSE."""
    e = np.clip(e[mask], -1e12, 1e12)
    return {
        "nmse": float(np.mean(e**2) / np.var(y[mask])), "mu_e": float(np.mean(e)), "rmse": float(np.sqrt(np.mean(e**2)))
    }  # fmt: skip


# --- tables ------------------------------------------------------------------------------------
def table(found: Found, d: Diagnosis) -> list[CandidateLine]:
    """Every catalogue name once, with its evidence and why it is or is not the answer."""
    lines: dict[str, CandidateLine] = {}
    named = {e.name: e for e in d.effects}
    aliases = {a for e in d.effects for a in e.aliases}
    full = max(found.base_cost - found.cost, 1e-300)
    for r in found.rounds:
        for t in r.trials:
            share = float(np.clip((r.cost - t.cost) / full, -1, 1)) if found.taken else 0.0
            better = found.rounds[0] is r and t.name not in lines
            if better:
                lines[t.name] = CandidateLine(
                    t.name, t.delta_bic, share, "ruled_out", t.reason or "another explains more"
                )
        for c in r.screened:
            if c.name in lines:
                continue
            if c.left < ABSORBED:
                text = "the model's own orders and law absorb it; no such record shows it"
                lines[c.name] = CandidateLine(c.name, 0.0, 0.0, "not_testable", text)
            else:
                lines[c.name] = CandidateLine(c.name, 0.0, 0.0, "ruled_out", "its signature does not follow the gap")
    for name, one in lines.items():
        if name in named:
            one.status, one.reason = "named", "accepted"
            one.delta_bic, one.closure = named[name].delta_bic, d.closure
        elif name in aliases:
            one.status, one.reason = "alias", "this record cannot tell it from the named effect"
    for name, e in named.items():
        if name not in lines:
            why = "all readings lie on its grid" if name == "quantization" else "accepted later"
            lines[name] = CandidateLine(name, e.delta_bic, d.closure, "named", why)
    return sorted(lines.values(), key=lambda c: (c.status != "named", -c.delta_bic))


def _round(number: int, r: Any, found: Found) -> dict[str, Any]:
    n = max(found.rounds[0].trials[0].model.theta.size, 1) if found.rounds and found.rounds[0].trials else 1
    gap = math.sqrt(r.cost / max(n, 1))
    return {
        "number": number, "gap": gap, "gap_share": math.sqrt(r.cost / max(found.base_cost, 1e-300)),
        "tried": len(r.screened), "taken": r.taken.name if r.taken else "nothing",
        "delta_bic": r.taken.delta_bic if r.taken else (r.trials[0].delta_bic if r.trials else 0.0),
    }  # fmt: skip


def _tests(s: Setting, found: Found) -> list[dict[str, Any]]:
    """Whiteness and dependence of the prediction errors, before and after."""
    out = []
    n = int(s.fit.sum())
    for word, m, left in (("before", found.base, found.base_left), ("after", found.model, found.left)):
        e = coloured(raw_errors(s, m), m.ar)[s.fit]
        e = e - e.mean()
        r = np.array([e[k:] @ e[:-k] for k in range(1, 21)]) / max(float(e @ e), 1e-300)
        out.append({"test": f"Ljung-Box, 20 lags, {word}", "statistic": float(n * np.sum(r**2)),
                    "p_value": whiteness(e),
                    "largest": float(np.abs(r).max()), "band": 1.96 / math.sqrt(n)})  # fmt: skip
        if left is not None:
            out.append({"test": f"generic functions at every port, {word}", "statistic": left.share,
                        "p_value": left.p_value, "largest": left.share, "band": 0.0})  # fmt: skip
    return out


def _parameters(s: Setting, found: Found) -> list[dict[str, Any]]:
    na, nb, nc, nd, _ = (int(i) for i in s.dims)
    names = [f"a_{i}" for i in range(2, na + 1)] + [f"b_{i}" for i in range(1, nb + 1)] + list(s.law.labels)
    names += [f"c_{i}" for i in range(2, nc + 1)] + [f"d_{i}" for i in range(1, nd + 1)]
    return [
        {"name": k, "before": float(b), "after": float(a)}
        for k, b, a in zip(names, found.base.theta, found.model.theta, strict=True)
    ]


def _notes(s: Setting, found: Found) -> list[str]:
    long = [
        f"Names were looked for in the first {STRETCH} samples, their numbers fitted to all {s.u.size}; what only the "
        "whole record shows had one more round."
    ]
    return [
        *(long if s.u.size > LONG else []),
        "Noise enters as equation error; under the right model the one-step errors are white.",
        "Closure leaves out samples beside a reversal that only one of the two models has, and holds the others to six "
        "robust deviations: a few samples on the wrong side of a reversal, which no fit can rule out, make up most of "
        "the plain mean square; before and after are plain.",
        "The base model was fitted from 24 starts.",
        f"{int(s.fit.sum())} samples in five stretches are used for fitting, the {int((s.held >= 0).sum())} between "
        "them for judging.",
    ]


# --- where and pictures ---------------------------------------------------------------------------
def axes(s: Setting, m: BlockModel) -> dict[str, Any]:
    """The signals that the gap may follow, one sample late as L2 is."""
    x, _, y_hat = chain(s, m, free=True)
    dx = np.diff(x, prepend=x[:1])
    late = {"input": s.u, "x": x, "dx": dx}
    out = {"time": (np.arange(s.u.size) * s.dt, "s" if s.dt != 1.0 else "samples")}
    out |= {k: (np.concatenate([v[:1], v[:-1]]), "") for k, v in late.items()}
    out["output"] = (y_hat, "")
    return out


def _locate(s: Setting, found: Found, d: Diagnosis, rng: np.random.Generator) -> None:
    gap = _capped(coloured(raw_errors(s, found.base), found.base.ar))
    d.where = locate.locate({k: (v[40:], unit) for k, (v, unit) in axes(s, found.base).items()}, gap, rng)
    quiet = d.verdict in ("no_gap", "coloured_noise")
    d.where_sentence = "" if quiet else locate.sentence(d.where)


def _pictures(s: Setting, found: Found, d: Diagnosis) -> dict[str, Any]:
    """Series that the page draws, as of a servo log."""
    g0, g1 = (coloured(raw_errors(s, m), m.ar) for m in (found.base, found.model))
    f, a0 = locate.spectrum(g0[40:], 1.0 / s.dt)
    _, a1 = locate.spectrum(g1[40:], 1.0 / s.dt)
    x = chain(s, found.base)[0]
    orders = np.linspace(0.3, 12.0, 160) / found.scales.x
    time = np.arange(s.u.size) * s.dt
    usable = np.arange(s.u.size) >= 40
    return {
        "time": time, "measured": s.y,
        "runs": {"before": free_run(s, found.base), "after": free_run(s, found.model)},
        "held": s.held >= 0, "beside_turned": beside_turned(s, found),
        "gap_time": time, "gap_before": g0, "gap_after": g1, "usable": usable, "floor": d.floor,
        "frequency": f, "spectrum": (a0, a1), "orders": orders,
        "order_spectrum": (locate.order_spectrum(g0, x, orders), locate.order_spectrum(g1, x, orders)),
        "axes": axes(s, found.base), "units": ("", ""), "what": "one-step prediction error",
        "output": "output", "window": 200, "clock": "s" if s.dt != 1.0 else "samples",
    }  # fmt: skip
