"""Figure of an identification: overlay, Bode, poles and characteristic."""

from __future__ import annotations

import base64
import io
from typing import TYPE_CHECKING, Any

import numpy as np

from whsklearn.identification.windows import horizons, lead, window_errors
from whsklearn.models import AxisModel, ChainModel, LinearModel

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from whsklearn.identification.compare import Identification


def figure(found: Identification) -> Any:
    """Overlay on the test, Bode magnitude, poles, and the friction curve or static law."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    page = Figure(figsize=(11, 7.5), layout="constrained")
    FigureCanvasAgg(page)
    axes = page.subplots(2, 2)
    _overlay(axes[0, 0], found)
    _bode(axes[0, 1], found.model)
    _poles(axes[1, 0], found.model)
    _characteristic(axes[1, 1], found)
    return page


def as_png(page: Any) -> str:
    """The figure as base64 text for an HTML page."""
    buffer = io.BytesIO()
    page.savefig(buffer, format="png", dpi=110)
    return base64.b64encode(buffer.getvalue()).decode("ascii")


def _overlay(ax: Axes, found: Identification) -> None:
    """The last of the longest held-out windows, measured and simulated."""
    log = found.test.longest
    before = lead(log.u.size, log.dt)
    horizon = horizons(log.u.size - before, log.dt)[-1]
    error = window_errors(found.model, log, horizon, before)[-1]
    seconds = np.arange(horizon) * log.dt
    measured = log.y[-horizon:]
    ax.plot(seconds, measured, color="0.2", label="measured")
    ax.plot(seconds, measured - error, color="C1", ls="--", label="replayed from the drive alone")
    ax.plot(seconds, error, color="C3", lw=0.8, label="difference")
    since = f"{model_time(found)} since the state was fitted"
    ax.set(xlabel=since, ylabel=_axis_label("output", found), title="Test, last window")
    ax.legend(fontsize=8)


def model_time(found: Identification) -> str:
    """Unit of the time axis."""
    return "s" if found.model.units.get("time", "s") == "s" else "samples"


def _axis_label(name: str, found: Identification) -> str:
    unit = found.model.units.get(name, "")
    return f"{name} ({unit})" if unit else name


def blocks(model: Any) -> list[tuple[str, np.ndarray, np.ndarray]]:
    """(name, numerator, denominator) of the linear parts; for an axis, motion above its dry friction."""
    if isinstance(model, LinearModel):
        return [("model", np.array(model.numerator), np.array(model.denominator))]
    if isinstance(model, ChainModel):
        return [("L1", np.array(model.b1), np.array(model.f1)), ("L2", np.array(model.b2), np.array(model.f2))]
    assert isinstance(model, AxisModel)
    h = model.dt / model.inertia
    pole = 1.0 / (1.0 + h * model.parameters.get("viscous", 0.0))
    return [("drive to velocity, above dry friction", np.array([0.0, h * pole]), np.array([1.0, -pole]))]


def _bode(ax: Axes, model: Any) -> None:
    from scipy.signal import freqz

    hertz = np.geomspace(1e-4, 0.5, 400) / model.dt
    for name, b, a in blocks(model):
        _, response = freqz(b, a, hertz, fs=1 / model.dt)
        ax.semilogx(hertz, 20 * np.log10(np.maximum(np.abs(response), 1e-300)), label=name)
    ax.set(xlabel="Hz", ylabel="dB", title="Bode magnitude")
    ax.grid(alpha=0.3)
    ax.legend(fontsize=8)


def _poles(ax: Axes, model: Any) -> None:
    turn = np.linspace(0, 2 * np.pi, 200)
    ax.plot(np.cos(turn), np.sin(turn), color="0.7", lw=0.8)
    for i, (name, b, a) in enumerate(blocks(model)):
        zeros, poles = np.roots(b), np.roots(a)
        zeros = zeros[np.abs(zeros) < 3]
        ax.plot(poles.real, poles.imag, "x", color=f"C{i}", label=f"{name}: poles")
        if zeros.size:
            ax.plot(zeros.real, zeros.imag, "o", mfc="none", color=f"C{i}", label=f"{name}: zeros")
    ax.set(
        xlabel="real", ylabel="imaginary", title="Poles and zeros", aspect="equal", xlim=(-1.6, 1.6), ylim=(-1.2, 1.9)
    )
    ax.legend(
        fontsize=8, loc="upper left"
    )  # above the circle, because a legend marker inside it would look like a pole


def _characteristic(ax: Axes, found: Identification) -> None:
    model = found.model
    if isinstance(model, AxisModel):
        speed = np.linspace(-1, 1, 801) * np.abs(found.train.target).max()
        by, far = found.train.si
        ax.plot(speed, model.law(0.0, speed * far) / by)
        out = model.units.get("output", "")
        unit = out if model.logged == "velocity" or not out else f"{out}/s"
        ax.set(
            xlabel=f"velocity ({unit})" if unit else "velocity", ylabel=_axis_label("input", found), title="Friction"
        )
    elif isinstance(model, ChainModel):
        x = model.signals(found.train.u)[0]
        low, high = np.quantile(x, [0.0005, 0.9995])
        grid = np.linspace(low, high, 400)
        ax.plot(grid, model.law(grid, 0.0))
        ax.set(xlabel="x, after L1", ylabel="v, before L2", title="Static law")
    else:
        ax.axis("off")
        ax.text(0.5, 0.5, "a linear model has no characteristic", ha="center", color="0.5")
    ax.grid(alpha=0.3)
