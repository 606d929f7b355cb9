"""The output of `identify`: identify.json for programs, model.json, and a page for people."""

from __future__ import annotations

import base64
import io
import json
import math
import os
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from whsklearn.effects import Effect
from whsklearn.identification.axis_numbers import axis_theta
from whsklearn.identification.compare import Compared, Identification
from whsklearn.identification.windows import horizons, lead, residual, rms_of, window_errors
from whsklearn.logs.check import lattice
from whsklearn.logs.files import atomic_write
from whsklearn.logs.units import UNKNOWN, own_units, respelled
from whsklearn.models import AxisModel, ChainModel, LinearModel, save_model
from whsklearn.plot.look import html_of, titled

if TYPE_CHECKING:
    from matplotlib.axes import Axes

MODEL_FILE = "model.json"
MOST_DIGITS = 12  # of a number whose interval is next to nothing
DIVERGED = 1e6  # times the error of a constant: a diverged run rather than a poor model


def write(found: Identification, folder: str | os.PathLike[str], origins: Sequence[str] = ()) -> Path:
    """Write ``identify.json``, ``model.json`` and ``identify.html`` into a folder, created if it does not exist.

    ``origins``: a line on each log, for the head of the page. Returns the path of the page.
    """
    out = Path(folder)
    out.mkdir(parents=True, exist_ok=True)
    save_model(found.model, out / MODEL_FILE)
    atomic_write(out / "identify.json", json.dumps(document(found), indent=1, allow_nan=False).encode() + b"\n")
    atomic_write(out / "identify.html", page(found, origins).encode())
    return out / "identify.html"


def document(found: Identification) -> dict[str, Any]:
    """What identify.json holds."""
    return {
        "recommended": found.recommended.kind,
        "recommended_name": found.recommended.name,
        "reason": found.reason,
        "models": [_entry(c) for c in found.models],
        "trivial": {"name": found.trivial.name, "windows": _windows(found.trivial, found)},
        "parameters": parameters(found),
        "logs": [
            {"name": log.label, "drive_lead_s": log.lead * found.train.dt, "drive_offset": log.offset}
            for log in found.own
        ],
        "residuals_white": found.white,
        "noise_floor_rmse": found.floor,
        "logged": found.train.logged,
        "rows": {"used": int(found.train.y.size), "given": found.rows, "segments": len(found.train.starts) + 1},
        "units": {"time": "s", "input": UNKNOWN, "output": UNKNOWN} | dict(found.model.units),
        "model_file": MODEL_FILE,
    }


def on_intervals(found: Identification) -> str:
    """Note on the intervals; empty if the residual is white."""
    if found.white:
        return ""
    is_axis = isinstance(found.model, AxisModel)
    how = " The intervals are widened by sums over blocks"
    if isinstance(found.model, AxisModel):  # not of two masses: see `axis_fit`
        two = axis_theta(found.model)[1].coupled
        how = "" if two else " The intervals are widened to the difference between two estimators"
    grid = lattice(found.train.y)
    if is_axis and grid and rms_of(residual(found.model, found.train)) < grid * found.train.si[1]:
        return (
            f"The residual of the model is below a step of the encoder ({number(grid)}), whose grid is not white; "
            f"nothing else is seen to be missing.{how and how + '.'}"
        )
    how = how or " The intervals do not include what that does to the numbers"
    noise = ", unless the drive was logged with noise, which adds up along a run" if is_axis else ""
    return (
        f"The residual of the model is not white, so something may be missing{noise}.{how}; whsklearn gap tells "
        "whether something is, and what."
    )


def spelled(value: float, error: float | None) -> tuple[str, str]:
    """A number and its 95 % interval, with as many digits as the width of the interval asks for.

    >>> spelled(1.5, 2e-7), spelled(0.0212345, 0.004), spelled(3.0, None)
    (('1.5', '1.49999961 to 1.50000039'), ('0.0212', '0.0134 to 0.0291'), ('3', '-'))
    """
    if not error:
        return f"{value:.5g}", "-"
    ends = value - 1.96 * error, value + 1.96 * error
    digits = int(np.clip(2 + math.ceil(math.log10(max(map(abs, ends)) / error)), 3, MOST_DIGITS))
    return f"{value:.{digits}g}", f"{ends[0]:.{digits}g} to {ends[1]:.{digits}g}"


def parameters(found: Identification) -> list[dict[str, Any]]:
    """Name, value, standard error and unit of every number of the recommended model, in the units of the log."""
    model = found.model
    own = own_units(model.si, (model.units.get("input", ""), model.units.get("output", "")))
    rows = []
    for name, value in model.parameters.items():
        error = model.standard_errors.get(name)
        si = model.parameter_units[name]
        by, unit = (1.0, si) if name.endswith("__phase") else respelled(si, own)
        unit = "" if unit in ("1", UNKNOWN) else unit
        rows.append(
            {
                "name": name,
                "value": value / by,
                "standard_error": None if error is None or not np.isfinite(error) else error / by,
                "unit": unit,
            }
        )
    return rows


def _entry(c: Compared) -> dict[str, Any]:
    entry: dict[str, Any] = {
        "name": c.name,
        "kind": c.kind,
        "structure": c.structure,
        "criterion": c.criterion,
        "train": c.train or {"nmse": None, "rmse": None},
        "test": c.test or {"nmse": None, "rmse": None},
        "score": c.score if np.isfinite(c.score) else None,
        "seconds": c.seconds,
    }
    return entry | ({"failure": c.failure} if c.failure else {})


def _windows(c: Compared, found: Identification) -> dict[str, float]:
    return {f"{h * found.train.dt:.4g}": e for h, e in c.windows.items() if np.isfinite(e)}


def page(found: Identification, origins: Sequence[str] = ()) -> str:
    """The page as HTML with embedded pictures; without matplotlib it has none. ``origins``: a line on each log."""
    try:
        picture = as_png(figure(found))
    except ImportError:
        picture = ""
    lengths = list(found.trivial.windows)
    return html_of(
        Path(__file__).with_name("page.html.j2"),
        found=found,
        origins=origins,
        picture=picture,
        parameters=parameters(found),
        lengths=lengths,
        unit=found.model.units.get("output", ""),
        on_intervals=on_intervals(found),
        on_drive=found.on_drive,
        seconds=found.window_names,
        number=number,
        spelled=spelled,
        error_of=error_of,
    )


def error_of(value: float | None, trivial: float = 1.0) -> str:
    """An error with three significant digits; a word if the run diverged.

    >>> error_of(0.0336), error_of(None), error_of(5.6e103, trivial=0.73)
    ('0.0336', '-', 'diverges')
    """
    return "diverges" if value is not None and value > DIVERGED * trivial else number(value)


def number(value: float | None, digits: int = 3) -> str:
    """A number with a few significant digits; a dash for None."""
    return f"{value:.{digits}g}" if value is not None and np.isfinite(value) else "-"


# --- figure of an identification: overlay, Bode, poles and characteristic ------------------------------------------
def figure(found: Identification) -> Any:
    """Overlay on the test, Bode magnitude, poles or the force over the position, and the friction or static law."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    page = Figure(figsize=(11, 7.5), layout="constrained")
    FigureCanvasAgg(page)
    axes = page.subplots(2, 2)
    _overlay(axes[0, 0], found)
    _bode(axes[0, 1], found)
    forces = [e for e in getattr(found.model, "effects", ()) if e.place == "position"]
    _force(axes[1, 0], found, forces) if forces else _poles(axes[1, 0], found.model)
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
    units = found.model.units
    since = f"{'s' if units.get('time', 's') == 's' else 'samples'} since the state was fitted"
    title = f"Last window of {found.judged_on}" + ("" if found.tested else ",\nto which this model is fitted too")
    ax.set(xlabel=since, ylabel=titled("output", units.get("output", "")), title=title)
    ax.legend(fontsize=8)


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


def _speed_unit(model: Any) -> str:
    """Unit of what the linear part of a model puts out: of a position, its velocity; empty if none is known."""
    out = model.units.get("output", "")
    return f"{out}/s" if out and model.logged == "position" else out


def _bode(ax: Axes, found: Identification) -> None:
    from scipy.signal import freqz

    model = found.model
    by, far = found.train.si if isinstance(model, AxisModel) else (1.0, 1.0)  # an axis is in SI
    units = _speed_unit(model), model.units.get("input", "")
    of = f" of {units[0]} per {units[1]}" if all(units) and not isinstance(model, ChainModel) else ""
    hertz = np.geomspace(1e-4, 0.5, 400) / model.dt
    for name, b, a in blocks(model):
        _, response = freqz(b, a, hertz, fs=1 / model.dt)
        ax.semilogx(hertz, 20 * np.log10(np.maximum(np.abs(response) * by / far, 1e-300)), label=name)
    ax.set(xlabel="Hz", ylabel=f"dB{of}", title="Bode magnitude")
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


def _force(ax: Axes, found: Identification, effects: Sequence[Effect]) -> None:
    """What depends on the position, over the positions of the log."""
    (by, far), units = found.train.si, found.model.units
    place = np.linspace(found.train.y.min(), found.train.y.max(), 801)
    ax.plot(place, sum(e.value(position=place * far) for e in effects) / by)
    output, drive = (titled(k, units.get(k, "")) for k in ("output", "input"))
    ax.set(xlabel=output, ylabel=drive, title="Force over the position")
    ax.grid(alpha=0.3)


def _characteristic(ax: Axes, found: Identification) -> None:
    model = found.model
    if isinstance(model, AxisModel):
        speed = np.linspace(-1, 1, 801) * np.abs(found.train.target).max()
        by, far = found.train.si
        ax.plot(speed, model.law(0.0, speed * far) / by)
        ax.set(
            xlabel=titled("velocity", _speed_unit(model)),
            ylabel=titled("input", found.model.units.get("input", "")),
            title="Friction",
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
