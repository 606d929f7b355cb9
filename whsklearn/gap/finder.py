"""`GapFinder`: the workflow as an estimator, which goes from log to verdict in one call."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any, Self

import numpy as np
from sklearn.base import BaseEstimator
from threadpoolctl import threadpool_limits

from whsklearn.gap.conclude import conclude
from whsklearn.gap.diagnosis import ALPHA, Diagnosis
from whsklearn.gap.joined import joined
from whsklearn.gap.plant import DEFAULT_TOLERANCE
from whsklearn.gap.plants import Base, make_plant
from whsklearn.gap.plants.from_log import servo_record
from whsklearn.gap.record import ServoRecord
from whsklearn.gap.search import Search, Step
from whsklearn.logs.load import Log
from whsklearn.logs.source import as_frame

STEPS = ("check", "base model", "search", "prove", "locate", "done")


class GapFinder(BaseEstimator):
    """Find what a model lacks compared with a log, name it, add it, and show that the gap has closed.

    Parameters
    ----------
    model : str or object
        ``"servo"`` (a rigid axis with the friction law ``law``), ``"wiener-hammerstein"``, a `ServoAxis` or
        `WienerHammersteinSystem` whose law is the base model's, an `Arm` (the effects of its joints are the base
        law), an `ArmModel` (its numbers stay fixed), or a simulator of your own with the methods ``simulate``,
        ``refit`` and ``with_effect``.
    law : str, optional
        Friction terms of the base model, joined by commas; ``"viscous,coulomb"`` for an axis and law (4)
        for a Wiener-Hammerstein system by default.
    orders : tuple of int, optional
        (n_a, n_b, n_c, n_d) of a Wiener-Hammerstein base model; two each by default.
    direct : int
        How many of its two blocks have a direct path.
    max_effects : int
        Largest number of effects to add, at each joint of an arm.
    tolerance : float
        Smallest effect that is named: its rms as a share of the rms drive or output.
    alpha : float
        Probability of naming an effect in a record in which nothing is missing.
    random_state : int
        Draws surrogates, shifts and starts.
    progress : callable, optional
        Called with the name of each step as it begins.
    on_round : callable, optional
        Called with each finished `Step`.

    Attributes
    ----------
    verdict_ : str
        One of ``no_gap named ambiguous partial unknown coloured_noise not_testable data_problem``.
    effects_ : list of NamedEffect
        In the order of what they explain, with their joints for an arm; empty unless the verdict is named,
        ambiguous or partial.
    model_ : ServoAxis, WienerHammersteinSystem or the simulator
        The repaired model.
    diagnosis_ : Diagnosis
        The complete result, as the report shows it.

    References
    ----------
    Davison and Hinkley 1997, Bootstrap Methods and their Application, ch. 4, for records simulated with the model;
    Vuong 1989, Econometrica 57(2), 307-333, and Cox 1962, JRSS B 24(2), 406-424, for which of two effects it is; Ljung
    1999, System Identification, 2nd ed., ch. 16, for held-out samples.

    Examples
    --------
    >>> from whsklearn.gap import GapFinder
    >>> from whsklearn.datasets import make_servo_log
    >>> from whsklearn.effects import Cogging
    >>> log = make_servo_log([Cogging(0.2, 12.0)], duration=12.0, random_state=0)
    >>> finder = GapFinder("servo").fit(log)
    >>> finder.verdict_, [e.name for e in finder.effects_]
    ('named', ['cogging'])
    """

    def __init__(
        self,
        model: Any = "servo",
        *,
        law: str | None = None,
        orders: tuple[int, int, int, int] | None = None,
        direct: int = 0,
        max_effects: int = 3,
        tolerance: float = DEFAULT_TOLERANCE,
        alpha: float = ALPHA,
        random_state: int = 0,
        progress: Callable[[str], None] | None = None,
        on_round: Callable[[Step], None] | None = None,
    ):
        self.model = model
        self.law = law
        self.orders = orders
        self.direct = direct
        self.max_effects = max_effects
        self.tolerance = tolerance
        self.alpha = alpha
        self.random_state = random_state
        self.progress = progress
        self.on_round = on_round

    @threadpool_limits.wrap(limits=1, user_api="blas")  # two threads take twice the CPU and sum in another order
    def fit(self, log: Any, y: Any = None, **columns: str | None) -> Self:
        """Diagnose one log.

        Parameters
        ----------
        log : Log, DataFrame, record, array, or list of logs, records or frames
            What `whsklearn.logs.load_log` returns, with its units; a frame with the columns named in ``columns``
            (``time``, ``drive``, ``position``, ``reference``; or ``input``, ``output``); or u of shape (n,) or (n, 1)
            together with ``y``.  For an arm: time (n,), positions and drives (n, n_joints), in SI and in the order of
            its joints, or the frame of `whsklearn.datasets.make_arm_log`.  For an axis, a list gives one diagnosis:
            the records share their parameters, but each has its own offset and timing.
        y : array-like of shape (n,), optional
            Output, if ``log`` is the input of a Wiener-Hammerstein system.

        Raises
        ------
        ValueError
            If a column does not exist, or the kind of model is unknown.
        """
        began = time.perf_counter()
        rng = np.random.default_rng(self.random_state)
        self._say("check")
        if isinstance(log, list) and log and (hasattr(log[0], "columns") or isinstance(log[0], ServoRecord | Log)):
            log = joined([servo_record(r, columns) for r in log])
        elif hasattr(log, "columns") and not isinstance(log, Log):
            log = as_frame(log)
        plant = make_plant(
            self.model, log, y, Base(self.law, self.orders, self.direct), tolerance=self.tolerance, columns=columns
        )
        problems = plant.check()
        if any(p.fatal for p in problems):
            return self._close(plant, data_problem(problems), plant.given_model, began)
        self._say("base model")
        base = plant.base(rng)
        self._say("search")
        found = self.found_ = Search(plant, rng, self.alpha, self.max_effects, self.on_round).run(base)
        diagnosis = conclude(plant, found, rng, self._say, self.alpha)
        diagnosis.problems = problems
        return self._close(plant, diagnosis, plant.system(found.model), began)

    def report(self, path: Any) -> Any:
        """Write ``gap.html``, ``gap.json`` and ``repaired.json`` to the folder ``path``; return the path of the page.

        The folder is created if it does not exist.
        """
        from whsklearn.gap.report import write_report

        return write_report(self.diagnosis_, path, self.model_)

    def _say(self, step: str) -> None:
        if self.progress is not None:
            self.progress(step)

    def _close(self, plant: Any, diagnosis: Diagnosis, model: Any, began: float) -> Self:
        diagnosis.seconds = time.perf_counter() - began
        self.plant_ = plant
        self.diagnosis_ = diagnosis
        self.verdict_ = diagnosis.verdict
        self.effects_ = diagnosis.effects
        self.model_ = model
        self._say("done")
        return self


def data_problem(problems: list[Any]) -> Diagnosis:
    """The diagnosis of a log that cannot be used."""
    fatal = [p for p in problems if p.fatal]
    return Diagnosis(
        "data_problem", " ".join(f"{p.title}: {p.explanation}" for p in fatal), problems=problems,
        next_experiment="Repair the log first: " + fatal[0].explanation,
    )  # fmt: skip
