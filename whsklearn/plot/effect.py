"""One effect alone: the drive that it takes, or what it adds to the reading, against the signal that it depends on."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from whsklearn.effects import Effect
from whsklearn.plot.look import COLOURS, Display

if TYPE_CHECKING:
    from sklearn.utils import Bunch

# What an effect is drawn against, where that is not the usual one of its place.
_USUAL = {"friction": "velocity", "drive": "drive", "position": "position", "sensor": "position", "time": "time"}
_AGAINST = {
    "position_friction": "position",
    "presliding_hysteresis": "position",
    "friction_drift": "time",
    "input_offset": "time",
    "torque_ripple": "position",
    "output_drift": "time",
}
_LABELS = {"velocity": "velocity, rad/s", "drive": "drive, Nm", "position": "position, rad", "time": "time, s"}
_THIN = 4000  # points; more only make a picture heavy


class EffectDisplay(Display):
    """An effect along a simulated run, against the signal that it depends on.

    Effects that are a function of one signal are drawn against it. A transmission is drawn by its twist over time,
    a late drive and a sensor's lattice by the signal before (grey) and after, over a few samples.

    Parameters
    ----------
    x, values : array-like of shape (n,)
        Abscissa and effect.
    xlabel, ylabel : str
        Their names with units.
    before : array-like of shape (n,), optional
        The signal that the effect changes, drawn grey.
    line : bool, default=False
        Draw a line; points by default, as an effect along a run may have several values at one abscissa.

    References
    ----------
    scikit-learn developer's guide, Developing with the plotting API.

    Examples
    --------
    >>> import numpy as np
    >>> from whsklearn import ServoAxis
    >>> from whsklearn.effects import Cogging
    >>> from whsklearn.plot import EffectDisplay
    >>> cogging = Cogging(0.05, order=12.0)
    >>> run = ServoAxis(effects=[cogging]).simulate_drive(0.5 * np.sin(np.arange(500) / 50), noise=False)
    >>> display = EffectDisplay.from_run(cogging, run)
    >>> display.xlabel, bool(np.abs(display.values).max() <= 0.05)
    ('position, rad', True)
    """

    def __init__(
        self,
        x: ArrayLike,
        values: ArrayLike,
        xlabel: str,
        ylabel: str,
        *,
        before: ArrayLike | None = None,
        line: bool = False,
    ):
        self.x, self.values = np.asarray(x, dtype=float), np.asarray(values, dtype=float)
        self.xlabel, self.ylabel, self.line = xlabel, ylabel, line
        self.before = None if before is None else np.asarray(before, dtype=float)

    @classmethod
    def from_run(cls, effect: Effect, run: Bunch, *, ax: Any = None) -> EffectDisplay:
        """Draw an effect along the run of an axis that has it.

        Parameters
        ----------
        effect : Effect
            The effect.
        run : Bunch
            What `ServoAxis.simulate` or `ServoAxis.simulate_drive` returned.
        ax : matplotlib axes, optional
            Where to draw; a new figure by default.
        """
        return cls._of(effect, run).plot(ax)

    @classmethod
    def _of(cls, effect: Effect, run: Bunch) -> EffectDisplay:
        n = run.time.size
        late = slice(n // 4, n // 4 + min(n // 2, 1500))  # after the start
        few = slice(n // 4, n // 4 + min(n // 2, 60))
        if effect.place == "transmission":
            twist = 1e3 * (run.true_position - run.load_position)[late]
            return cls(run.time[late], twist, _LABELS["time"], "twist, mrad", line=True)
        if effect.name in ("input_delay", "actuator_lag"):
            return cls(run.time[few], run.torque[few], _LABELS["time"], "torque, Nm", before=run.drive[few], line=True)
        if effect.name == "quantization":
            true = run.true_position[few]
            return cls(run.time[few], run.position[few], _LABELS["time"], "position, rad", before=true, line=True)
        from sklearn.utils import Bunch

        signals = Bunch(
            time=run.time,
            position=run.true_position,
            velocity=run.velocity,
            acceleration=np.gradient(run.velocity, run.time),
            drive=run.drive,
        )
        against = _AGAINST.get(effect.name, _USUAL.get(effect.place, "velocity"))
        windows = {"presliding_hysteresis": late, "disturbance_tone": slice(0, min(n, 1000))}
        window = windows.get(effect.name, slice(None, None, max(1, n // _THIN)))
        ylabel = "position, rad" if effect.port == "output" else "torque, Nm"
        return cls(signals[against][window], effect.contribution(signals)[window], _LABELS[against], ylabel)

    def plot(self, ax: Any = None) -> EffectDisplay:
        """Draw the effect, and the signal before it where there is one.

        Parameters
        ----------
        ax : matplotlib axes, optional
            Where to draw; a new figure by default.
        """
        (ax,) = self._axes(ax, 1, 1, (4.8, 2.8))[:1]
        if self.before is not None:
            ax.step(self.x, self.before, where="post", color="0.6", linewidth=1.0)
        if self.line:
            ax.plot(self.x, self.values, color=COLOURS[0], linewidth=1.2)
        else:
            ax.plot(self.x, self.values, ".", color=COLOURS[0], markersize=1.5)
        if np.ptp(self.values) == 0.0 and self.values[0] != 0.0:  # a constant is seen by its distance from zero
            ax.set_ylim(sorted((0.0, 1.5 * self.values[0])))
        ax.set(xlabel=self.xlabel, ylabel=self.ylabel)
        return self
