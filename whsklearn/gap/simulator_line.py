"""A user's own simulator: the workflow asks it three things, simulate, refit and simulate with an effect.

.. code-block:: python

    class MySimulator:
        def simulate(self, record): ...           # predicted position, shape (n,)
        def refit(self, record, keep): ...        # a new simulator fitted to the samples where keep is True
        def with_effect(self, effect): ...        # a new simulator with an effect of the catalogue added
        effects_to_try = [Cogging(1.0, 12.0)]     # optional; sizes do not matter, shapes do

Each effect is screened by the sensitivity of the simulated position to its size, then added at the size
found, refitted and judged on held-out samples.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from whsklearn.gap import judge
from whsklearn.gap.check import Problem, check_servo
from whsklearn.gap.close import closure
from whsklearn.gap.diagnosis import CandidateLine, Diagnosis, NamedEffect
from whsklearn.gap.lens import autoregression, whiten
from whsklearn.gap.record import ServoRecord, blocks, noise_level

Array = NDArray[Any]


@dataclass
class _Trial:
    effect: Any
    model: Any
    error: Array
    delta_bic: float


class SimulatorLine:
    """The line of a simulator that offers simulate, refit and with_effect."""

    kind = "servo"
    headline = 0.0
    gap_word = "error of the simulated position"

    def __init__(self, model: Any, log: Any, *, tolerance: float):
        self.given_model, self.tolerance = model, tolerance
        self.record = log if isinstance(log, ServoRecord) else ServoRecord.from_frame(pd.DataFrame(log))

    def check(self) -> list[Problem]:
        """See `whsklearn.gap.check.check_servo`."""
        return check_servo(self.record)

    def diagnose(self, finder: Any, rng: np.random.Generator) -> tuple[Diagnosis, Any]:
        """Add the best effect until none helps."""
        held, train = blocks(len(self.record))
        model = self.given_model.refit(self.record, train)
        first = error = self._error(model)
        floor = max(noise_level(self.record.position), 1e-300)
        taken: list[_Trial] = []
        lines: dict[str, CandidateLine] = {}
        finder._say("search")
        while len(taken) < finder.max_effects and _rms(error, ~train) > 1.2 * floor:
            trials = sorted(
                (t for e in self._effects(model) if (t := self._try(model, error, e, train))),
                key=lambda t: -t.delta_bic,
            )
            for t in trials:
                before, after = _rms(error, ~train), _rms(t.error, ~train)
                share = closure(before, after, floor)
                lines.setdefault(
                    t.effect.name, CandidateLine(t.effect.name, t.delta_bic, share, "ruled_out", "explains less")
                )
            if not trials or trials[0].delta_bic < judge.MOST_EVIDENCE or not _better(error, trials[0].error, held):
                break
            taken.append(trials[0])
            model, error = trials[0].model, trials[0].error
        return self._diagnosis(first, error, floor, ~train, taken, lines), model

    def _error(self, model: Any) -> Array:
        y = np.asarray(model.simulate(self.record), dtype=float)
        if y.shape != self.record.position.shape:
            raise ValueError(
                f"simulate gave shape {y.shape}, expected {self.record.position.shape}: one value a sample."
            )
        return self.record.position - y

    def _effects(self, model: Any) -> list[Any]:
        given = getattr(self.given_model, "effects_to_try", None)
        if given is not None:
            return list(given)
        from whsklearn.effects import effect_names, get_effect

        out = []
        for name in effect_names():
            cls = get_effect(name)
            if cls.place in ("friction", "position") and not any(f in cls.quantities for f in ("order", "angle")):
                out.append(cls())
        return out

    def _try(self, model: Any, error: Array, effect: Any, train: NDArray[np.bool_]) -> _Trial | None:
        size = 1e-3 * float(np.sqrt(np.mean(self.record.drive**2)))
        change = self._error(model.with_effect(effect.resized(size))) - error
        power = float(change[train] @ change[train])
        if not np.isfinite(power) or power == 0.0:
            return None
        best = -size * float(change[train] @ error[train]) / power
        grown = model.with_effect(effect.resized(best)).refit(self.record, train)
        after = self._error(grown)
        if not np.all(np.isfinite(after)):
            return None
        ar = autoregression(after[train], 12, 1e-300)
        w0, w1 = whiten(error, ar)[train], whiten(after, ar)[train]
        return _Trial(effect.resized(best), grown, after, judge.delta_bic(w0, w1, 1, 1))

    def _diagnosis(
        self, first: Array, last: Array, floor: float, held: Array, taken: list[_Trial], lines: dict[str, CandidateLine]
    ) -> Diagnosis:
        before, after = _rms(first, held), _rms(last, held)
        total = closure(before, after, floor) if taken else 0.0
        quiet = before < 1.2 * floor
        verdict = "no_gap" if quiet else "unknown"
        if taken and total >= judge.PARTIAL:
            verdict = "named" if total >= judge.NAMED else "partial"
        for t in taken:
            lines[t.effect.name].status, lines[t.effect.name].reason = "named", "accepted"
        var = float(np.var(self.record.position[held]))
        d = Diagnosis(
            verdict, "", candidates=sorted(lines.values(), key=lambda c: -c.delta_bic), closure=total, floor=floor
        )
        if verdict in ("named", "partial"):
            d.effects = [NamedEffect(t.effect, {}, t.delta_bic, 0.9, total, list(t.effect.aliases)) for t in taken]
        for target, e in (("before", first), ("after", last)):
            rms = _rms(e, held)
            setattr(d, target, {"nmse": rms**2 / var, "mu_e": float(np.mean(e[held])), "rmse": rms})
        names = ", ".join(t.effect.name for t in taken) or "nothing"
        d.sentence = (
            f"The simulated position is off by {before:.3g} rms; with {names} added by {after:.3g} (noise {floor:.3g})."
        )
        d.next_experiment = "Validate the repaired simulator on a second record."
        return d


def _rms(e: Array, mask: Array) -> float:
    return float(np.sqrt(np.mean(np.square(e[mask]))))


def _better(before: Array, after: Array, held: Array) -> bool:
    wins = [np.sum(after[held == i] ** 2) < np.sum(before[held == i] ** 2) for i in range(5)]
    return float(np.mean(wins)) >= judge.BLOCKS_BETTER
