"""The line of a Wiener-Hammerstein record: from u and y to a `Diagnosis`, as `GapFinder` calls it."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from whsklearn.effects import as_law
from whsklearn.estimators import _model as wh
from whsklearn.gap.blocks.check import check_blocks
from whsklearn.gap.blocks.model import BlockModel, Setting
from whsklearn.gap.check import Problem
from whsklearn.gap.diagnosis import Diagnosis
from whsklearn.gap.record import blocks
from whsklearn.systems.wiener_hammerstein import WienerHammersteinSystem

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

SKIP = 40  # samples at the start, where the state is not known


class BlockLine:
    """u -> L1 -> law -> L2 -> y, whose input and output are logged.

    Parameters
    ----------
    model : str or WienerHammersteinSystem
        A system gives the orders and the law; its numbers are refitted.  A name stands for orders of two.
    u, y : ndarray of shape (n,)
    law : str, optional
        The base model's law, (4) by default.
    tolerance : float
        Smallest change of the output worth a name, share of its rms.
    dt : float
        Sampling time; one where the log has no time, so that frequencies are in cycles a sample.
    """

    kind = "wiener-hammerstein"
    headline = 0.0
    units = ("", "")
    gap_word = "unexplained output"

    def __init__(
        self, model: Any, u: Array, y: Array, *, law: str | None = None, tolerance: float = 0.002, dt: float = 1.0
    ):
        system = model if isinstance(model, WienerHammersteinSystem) else None
        self.given_model = system
        self.u, self.y = (np.ascontiguousarray(v, dtype=float) for v in (u, y))
        self.law = as_law(law) if law is not None else (system.law if system is not None else as_law(None))
        self.orders = (
            (2, 2, 2, 2) if system is None else tuple(v.size for v in (system.a, system.b, system.c, system.d))
        )
        self.tolerance, self.dt = tolerance, dt

    def check(self) -> list[Problem]:
        """See `whsklearn.gap.blocks.check.check_blocks`."""
        return check_blocks(self.u, self.y)

    def setting(self) -> Setting:
        """Record, split, orders and law as the search takes them."""
        held, train = blocks(self.u.size)
        fit = train.copy()
        fit[:SKIP] = False
        held = np.where(np.arange(self.u.size) < SKIP, -1, held)
        dims = np.array([*self.orders, len(self.law)], dtype=np.int64)
        return Setting(self.u, self.y, self.dt, dims, self.law, fit, held)

    def diagnose(self, finder: Any, rng: np.random.Generator) -> tuple[Diagnosis, Any]:
        """(diagnosis, repaired system)."""
        from whsklearn.gap.blocks.diagnose import diagnose

        return diagnose(
            self, self.setting(), rng, max_effects=finder.max_effects, tolerance=self.tolerance,
            progress=finder._say,
        )  # fmt: skip

    def export(self, m: BlockModel, *, grid: float = 0.0) -> WienerHammersteinSystem:
        """The model as the library's own system, with its effects and the grid of its readings."""
        from whsklearn.effects import Quantization
        from whsklearn.gap.blocks.effects import library_effect

        dims = np.array([*self.orders, len(self.law)], dtype=np.int64)
        s = wh.Structure(dims, 1, self.law, -1 if self.law.key is None else self.law.key)
        named = wh.named(m.theta, s)
        law = self.law.reweighted(m.theta[s.slices()[2]])
        effects = [e for e in map(library_effect, m.terms) if e is not None]
        if grid:
            effects.append(Quantization(grid))
        return WienerHammersteinSystem(
            named["a"], wh.inside(named["b"]), named["c"], wh.inside(named["d"]), law, effects=effects, dt=self.dt
        )


def sampling_time(log: Any, column: str | None = None) -> float:
    """Step of an evenly sampled time column (``time_s`` where none is named); 1 where there is none."""
    if not isinstance(log, pd.DataFrame):
        return 1.0
    name = column or "time_s"
    if name not in log.columns:
        return 1.0
    time = pd.to_numeric(log[name], errors="coerce").to_numpy(dtype=float)
    steps = np.diff(time)
    if time.size < 2 or not np.all(np.isfinite(steps)) or np.any(steps <= 0):
        return 1.0
    return float((time[-1] - time[0]) / (time.size - 1))
