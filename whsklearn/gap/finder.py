"""`GapFinder`: the workflow as an estimator, one call from a log to a verdict."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any, Self

import numpy as np
from sklearn.base import BaseEstimator

from whsklearn.gap import judge, locate, restless
from whsklearn.gap.candidate_table import candidate_table
from whsklearn.gap.close import HORIZONS, closure
from whsklearn.gap.diagnosis import Diagnosis, NamedEffect, verdict_of
from whsklearn.gap.lines import make_line
from whsklearn.gap.null import explainable, twin_scores
from whsklearn.gap.search import Found, Round, search
from whsklearn.gap.words import next_experiment, summary

STEPS = ("check", "base model", "twins", "search", "locate", "prove", "done")


class GapFinder(BaseEstimator):
    """Find what a model lacks against a log, name it, add it, and show that the gap has closed.

    Parameters
    ----------
    model : str or object
        ``"servo"`` (a rigid axis with the friction law ``law``), ``"wiener-hammerstein"``, a `ServoAxis` or
        `WienerHammersteinSystem` whose law is the base model's, or a simulator of your own
        (see `whsklearn.gap.lines.SimulatorLine`).
    law : str, optional
        Friction terms of the base model, joined by commas; ``"viscous,coulomb"`` for an axis and law (4)
        for a Wiener-Hammerstein system by default.
    max_effects : int
        Effects added at the most.
    tolerance : float
        Smallest effect worth a name, rms as a share of the rms drive.
    n_twins : int
        Logs of the fitted model on which the whole line must find nothing.
    random_state : int
        Of twins, shifts and starts.
    progress : callable, optional
        Called with the name of each step as it begins.
    on_round : callable, optional
        Called with each finished `Round`.

    Attributes
    ----------
    verdict_ : str
        One of ``no_gap named ambiguous partial unknown coloured_noise not_testable data_problem``.
    effects_ : list of NamedEffect
        In the order of adding; empty unless the verdict is named, ambiguous or partial.
    model_ : ServoAxis, WienerHammersteinSystem or the simulator
        The repaired model.
    diagnosis_ : Diagnosis
        Everything, as the report shows it.

    Examples
    --------
    >>> from whsklearn.gap import GapFinder
    >>> from whsklearn.datasets import make_servo_log
    >>> from whsklearn.effects import Cogging
    >>> log = make_servo_log([Cogging(0.2, 12.0)], duration=12.0, random_state=0)
    >>> finder = GapFinder("servo", n_twins=1).fit(log)
    >>> finder.verdict_, [e.name for e in finder.effects_]
    ('named', ['cogging'])
    """

    def __init__(
        self,
        model: Any = "servo",
        *,
        law: str | None = None,
        max_effects: int = 3,
        tolerance: float = 0.002,
        n_twins: int = 1,
        random_state: int = 0,
        progress: Callable[[str], None] | None = None,
        on_round: Callable[[Round], None] | None = None,
    ):
        self.model = model
        self.law = law
        self.max_effects = max_effects
        self.tolerance = tolerance
        self.n_twins = n_twins
        self.random_state = random_state
        self.progress = progress
        self.on_round = on_round

    def fit(self, log: Any, y: Any = None, **columns: str | None) -> Self:
        """Diagnose one log.

        Parameters
        ----------
        log : DataFrame, record or array
            A frame with the columns named in ``columns`` (``time``, ``drive``, ``position``, ``reference``; or
            ``input``, ``output``), or u of shape (n,) or (n, 1) with ``y`` given.
        y : array-like of shape (n,), optional
            Output, if ``log`` is the input of a Wiener-Hammerstein system.

        Raises
        ------
        ValueError
            If a column is not there, or the model is of no known kind.
        """
        began = time.perf_counter()
        self._say("check")
        line = make_line(self.model, log, y, law=self.law, tolerance=self.tolerance, columns=columns)
        problems = line.check()
        if any(p.fatal for p in problems):
            self._close(line, _data_problem(problems), line.given_model, began)
            return self
        rng = np.random.default_rng(self.random_state)
        self._say("base model")
        if hasattr(line, "diagnose"):
            diagnosis, repaired = line.diagnose(self, rng)
            diagnosis.problems = problems
            self._close(line, diagnosis, repaired, began)
            return self
        bench, model = line.open(rng)
        found = self._search(line, bench, model, rng)
        self._say("prove")
        diagnosis = self._diagnose(line, bench, found, rng)
        diagnosis.problems = problems
        self._close(line, diagnosis, line.export(found.model), began)
        return self

    def report(self, path: Any) -> Any:
        """Write ``gap.html``, ``gap.json`` and ``repaired.json`` into the folder ``path``; returns the page's path."""
        from whsklearn.gap.report import write_report

        return write_report(self.diagnosis_, path, self.model_)

    # --- steps ------------------------------------------------------------------------------
    def _say(self, step: str) -> None:
        if self.progress is not None:
            self.progress(step)

    def _close(self, line: Any, diagnosis: Diagnosis, model: Any, began: float) -> None:
        diagnosis.seconds = time.perf_counter() - began
        self.line_ = line
        self.diagnosis_ = diagnosis
        self.verdict_ = diagnosis.verdict
        self.effects_ = diagnosis.effects
        self.model_ = model
        self._say("done")

    def _search(self, line: Any, bench: Any, model: Any, rng: np.random.Generator) -> Found:
        from whsklearn.gap.search import fit_base

        self._say("twins")
        base, _ = fit_base(bench, model)
        self.null_, self.twin_floors_ = twin_scores(bench, base, self.n_twins, rng) if self.n_twins else (0.0, [])
        self._say("search")
        return search(bench, base, null=self.null_, max_effects=self.max_effects, on_round=self.on_round)

    def _diagnose(self, line: Any, bench: Any, found: Found, rng: np.random.Generator) -> Diagnosis:
        before = bench.rms(found.base_missing)
        after = bench.rms(bench.missing(found.model))
        floor = bench.floor()
        total = closure(before, after, floor) if found.taken else 0.0
        quiet = bench.rms(found.base_missing, "all") < 1.1 * np.hypot(floor, bench.tolerance * bench.scene.torque)
        follows = 0.0
        if not found.taken and not quiet:
            follows = explainable(bench, found.base_missing, found.base)
        still = explainable(bench, bench.missing(found.model), found.model) if found.taken else 0.0
        if getattr(found.model, "has_play", False):  # knocks a sample early or late are torque for an instant, no path
            errors = [e if isinstance(e, float) else e.rmse for e in line.proof(bench, found, line.headline)]
            total, still = max(total, closure(*errors)), 0.0
        rivals, shares = self._rivals(bench, found, rng)
        special = line.special(bench, found)
        left = after / max(floor, bench.tolerance * bench.scene.torque)
        verdict = verdict_of(found.taken, total, rivals, bool(quiet), follows, left, still)
        diagnosis = Diagnosis(verdict, "")
        if special is not None and verdict == "no_gap":
            diagnosis.verdict, diagnosis.effects = special
        elif verdict in ("named", "ambiguous", "partial"):
            diagnosis.effects = [self._named(bench, found, i, rivals[i], shares[i]) for i in range(len(found.taken))]
        elif verdict == "no_gap" and line.blind_share(found.trials) > 0.5:
            diagnosis.verdict = "not_testable"
        n = int((bench.train & bench.usable).sum())
        diagnosis.need = judge.threshold(n, self.null_)
        diagnosis.interrupted = found.interrupted
        if not diagnosis.effects:
            _take_back(found)
        self._prove(line, bench, found, diagnosis)
        if found.taken and diagnosis.closure < 0.0:  # no repair makes a model worse
            diagnosis.verdict, diagnosis.effects, diagnosis.horizons = "unknown", [], []
            _take_back(found)
            self._prove(line, bench, found, diagnosis)
        diagnosis.candidates = candidate_table(found, diagnosis)
        self._say("locate")
        axes = line.axes(bench, found.base)
        gap = found.base_missing[bench.usable]
        diagnosis.where = locate.locate({k: (x[bench.usable], u) for k, (x, u) in axes.items()}, gap, rng)
        diagnosis.where_sentence = locate.sentence(diagnosis.where) if diagnosis.verdict != "no_gap" else ""
        diagnosis.restless = restless.restless(bench, found.base, axes, rng)
        diagnosis.rounds = [_round_line(r, bench) for r in found.rounds]
        diagnosis.residual_tests = line.residual_tests(bench, found)
        diagnosis.base_parameters = line.parameter_table(found)
        diagnosis.next_experiment = next_experiment(diagnosis, line, found)
        moves = restless.sentence(diagnosis.restless) if diagnosis.where_sentence else ""
        if moves:
            stays = diagnosis.where_sentence == locate.NOWHERE
            diagnosis.where_sentence = moves if stays else f"{diagnosis.where_sentence} {moves}"
        for e in diagnosis.effects:
            e.units = line.units
        diagnosis.notes = line.notes(bench, found)
        diagnosis.pictures = line.pictures(bench, found, diagnosis)
        diagnosis.sentence = summary(diagnosis, before, after, floor, bench.scene.torque, line)
        return diagnosis

    def _rivals(self, bench: Any, found: Found, rng: np.random.Generator) -> tuple[list[list[str]], list[float]]:
        """For each effect, who else could stand there, and how surely it beats the next one."""
        names: list[list[str]] = []
        shares: list[float] = []
        for taken, others in zip(found.taken, found.rivals, strict=True):
            if not others:
                names.append([])
                shares.append(1.0)
                continue
            best = bench.missing(taken.trial.model)
            bench.tune_whitening(best)
            w = bench.whitened(best, on="all")
            close, share = [], 1.0
            for other in others:
                if other.name == taken.name or other.name in bench.aliases(taken.name):
                    continue
                if judge.unphysical(other.trial):
                    continue
                if other.delta_bic > taken.delta_bic + judge.LEAST_MARGIN:  # the elementary one was taken on purpose
                    continue
                s = judge.bootstrap_share(w, bench.whitened(bench.missing(other.trial.model), on="all"), rng)
                share = min(share, s)
                if taken.delta_bic - other.delta_bic < judge.LEAST_MARGIN or s < 0.9:
                    close.append(other.name)
            names.append(list(dict.fromkeys(close)))
            shares.append(share)
        return names, shares

    def _named(self, bench: Any, found: Found, i: int, rivals: list[str], share: float) -> NamedEffect:
        taken = found.taken[i]
        effect, errors = bench.effect_with_errors(found.model, found.model.n_base + i)
        return NamedEffect(
            effect,
            errors,
            taken.delta_bic,
            share,
            taken.closure,
            list(dict.fromkeys([*bench.aliases(taken.name), *rivals])),
        )

    def _prove(self, line: Any, bench: Any, found: Found, diagnosis: Diagnosis) -> None:
        for horizon in HORIZONS:
            before, after, floor = line.proof(bench, found, horizon)
            diagnosis.horizons.append(
                {
                    "horizon": horizon,
                    "before": before.rmse,
                    "after": after.rmse,
                    "floor": floor,
                    "closure": closure(before.rmse, after.rmse, floor),
                }
            )
            if horizon == line.headline:
                diagnosis.before, diagnosis.after = before.as_dict(), after.as_dict()
                diagnosis.floor = floor
        best = max(diagnosis.horizons, key=lambda h: h["before"] / max(h["floor"], 1e-300))
        diagnosis.closure = best["closure"] if diagnosis.effects else 0.0


def _take_back(found: Found) -> None:
    """Leave the base model, where nothing earned a name."""
    found.model = found.base
    found.taken.clear()
    found.rivals.clear()


def _data_problem(problems: list[Any]) -> Diagnosis:
    fatal = [p for p in problems if p.fatal]
    return Diagnosis(
        "data_problem", " ".join(f"{p.title}: {p.explanation}" for p in fatal), problems=problems,
        next_experiment="Repair the log first: " + fatal[0].explanation,
    )  # fmt: skip


def _round_line(r: Round, bench: Any) -> dict[str, Any]:
    return {
        "number": r.number,
        "gap": r.gap,
        "gap_share": r.gap / bench.scene.torque,
        "tried": len(r.trials),
        "taken": r.taken.name if r.taken else "nothing",
        "delta_bic": r.taken.delta_bic if r.taken else (r.evidence[0].delta_bic if r.evidence else 0.0),
    }
