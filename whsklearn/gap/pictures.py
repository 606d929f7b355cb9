"""The pictures of the page: overlay, gap over its axes with the fitted effect, spectra, candidates."""

from __future__ import annotations

import base64
import io
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from whsklearn.gap.diagnosis import Diagnosis, spoken
from whsklearn.logs.units import respelled
from whsklearn.plot.look import titled

BEFORE, AFTER, MEASURED, FLOOR = "#c2552d", "#1b7f4d", "#1c2530", "#8a97a5"
WINDOW = 2.0  # s shown of the overlay
A_PERIOD = 24  # bins over one period of the fastest wave: its crest is accurate to a hundredth of its size
DRAWN = 3000  # pieces of a series whose extremes are drawn: two per pixel of a wide screen


def draw(d: Diagnosis) -> list[tuple[str, str, str]]:
    """(title, caption, SVG in base 64) of every picture that the diagnosis has data for."""
    out = []
    chain = "window" in d.pictures  # runs freely, in samples
    worst = (
        "The worst held-out part, in a free run."
        if chain
        else f"The held-out part of {width_of(d):.3g} s that is worst, restarted every {d.horizon:g} s."
    )
    turn = "in 2 pi of x" if chain else "a turn of the position"
    for title, caption, painter in (
        ("Simulation and measurement", worst, _overlay),
        ("The gap over time", "What the model lacks, before and after.", _over_time),
        (
            "The gap where it is densest",
            "Mean of the gap per bin with its standard error, the part that the repair removes, and the residual.",
            _where,
        ),
        ("Learned torque", "The part without a name: the learned curve, with two standard deviations.", _learned),
        (
            "Candidates",
            "What each candidate explains by itself, to first order; hollow bars are no more than chance.",
            _candidates,
        ),
        ("Frequency", "Amplitude spectrum of the gap.", _spectrum),
        ("Map over one turn", "The sum of all orders of a family over the angle in the turn.", _map),
        ("Order", f"Amplitude over periods {turn}: a line here is tied to the position, not to time.", _orders),
    ):
        image = _paint(painter, d)
        if image:
            out.append((title, caption, image))
    for joint in d.pictures.get("joints", {}):
        caption = "Filtered drive of the joint, and the part that the model lacks, before and after."
        out.append((f"Joint {joint}", caption, _paint(_of_joint(joint), d)))
    return out


def pictures_in(pictures: dict[str, Any], gap: str, own: Mapping[str, str]) -> dict[str, Any]:
    """Series of the page: the motion and its runs, the gap and its spectra, and the signals it may follow."""
    p = dict(pictures)
    drive, motion = p["units"]
    far, size = respelled(motion, own)[0], respelled(gap, own)[0]
    p["measured"] = p["measured"] / far
    p["runs"] = {k: y / far for k, y in p["runs"].items()}
    for name in ("gap_before", "gap_after", "floor"):
        p[name] = p[name] / size
    for name in ("spectrum", "order_spectrum"):
        p[name] = tuple(a / size for a in p[name])
    p["axes"] = {k: (x / respelled(u, own)[0], respelled(u, own)[1]) for k, (x, u) in p["axes"].items()}
    return p | {"units": (own.get(drive, drive), own.get(motion, motion)), "gap_unit": own.get(gap, gap)}


def width_of(d: Diagnosis) -> float:
    """Seconds of the overlay: `WINDOW`, or ten restarts if these are short."""
    return min(WINDOW, 10.0 * d.horizon) if d.horizon else WINDOW


def _paint(painter: Callable[[Any, Diagnosis], Any], d: Diagnosis) -> str:
    """A picture of lines, so that it stays sharp at any size; the same data give the same bytes.

    Empty if the diagnosis has not the series of this picture, or if the painter returns False.
    """
    import matplotlib
    from matplotlib.backends.backend_svg import FigureCanvasSVG
    from matplotlib.figure import Figure

    with matplotlib.rc_context({"svg.fonttype": "path", "svg.hashsalt": painter.__name__, "path.simplify": True}):
        figure = Figure(figsize=(6.2, 3.3))
        figure.subplots_adjust(left=0.13, right=0.98, bottom=0.15, top=0.91)  # a layout engine takes as long as drawing
        canvas = FigureCanvasSVG(figure)
        axes = figure.subplots()
        axes.spines[["top", "right"]].set_visible(False)
        try:
            if painter(axes, d) is False:
                return ""
        except KeyError:
            return ""
        if axes.get_legend_handles_labels()[0]:  # above the axes, where it covers no line
            where: dict[str, Any] = {"loc": "lower left", "bbox_to_anchor": (0.0, 1.0), "borderaxespad": 0.2}
            axes.legend(frameon=False, fontsize=8, ncols=3, **where)
        buffer = io.BytesIO()
        canvas.print_svg(buffer, metadata={"Date": None, "Creator": None})  # `savefig` draws twice, for the same bytes
    return base64.b64encode(buffer.getvalue()).decode("ascii")


def thinned(*series: Any) -> list[Any]:
    """Series at the smallest and the largest value of each piece, so that a long record can still be drawn.

    The first series is the axis. The extremes are those of the second; further ones are taken at the same samples.

    >>> import numpy as np
    >>> t = np.arange(1e6)
    >>> thinned(t, np.sin(t))[1].size <= 2 * DRAWN
    True
    """
    x, lead = series[0], np.asarray(series[1])
    if lead.size <= 2 * DRAWN:
        return list(series)
    width = -(-lead.size // DRAWN)
    whole = lead.size // width * width
    rows = lead[:whole].reshape(-1, width)
    at = np.sort(np.r_[rows.argmin(1), rows.argmax(1)].reshape(2, -1) + width * np.arange(len(rows)), axis=None)
    return [np.asarray(s)[at] for s in (x, lead, *series[2:])]


def _before_and_after(axes: Any, d: Diagnosis, x: Any, series: tuple[Any, Any], lw: float, what: str = "") -> None:
    """A series of the base model over ``x`` and, if there is one, of the repaired model."""
    for y, colour, label in zip(series[: 1 + d.repaired], (BEFORE, AFTER), ("before", "after"), strict=False):
        axes.plot(*thinned(x, y), color=colour, lw=lw, label=what + label)


def _overlay(axes: Any, d: Diagnosis) -> None:
    p = d.pictures
    t, y, held = p["time"], p["measured"], p["held"]
    error = np.where(held, np.abs(y - p["runs"]["before"]), 0.0)
    width = p.get("window", max(2, int(width_of(d) / (t[1] - t[0]))))
    power = np.convolve(error**2, np.ones(width), mode="valid")
    first = int(np.argmax(power)) if power.size else 0
    part = slice(first, first + width)
    axes.plot(t[part], y[part], color=MEASURED, lw=1.6, label="measured")
    axes.plot(t[part], p["runs"]["before"][part], color=BEFORE, lw=1.2, label="model before")
    if d.repaired:
        axes.plot(t[part], p["runs"]["after"][part], color=AFTER, lw=1.2, ls="--", label="model after")
    axes.fill_between(t[part], y[part], p["runs"]["before"][part], color=BEFORE, alpha=0.2, lw=0)
    axes.set(xlabel=titled("time", p.get("clock", "s")), ylabel=titled(p.get("output", "position"), p["units"][1]))


def _of_joint(joint: str) -> Callable[[Any, Diagnosis], None]:
    """The function that draws one joint of an arm."""

    def painter(axes: Any, d: Diagnosis) -> None:
        time, drive, before, after, unit = d.pictures["joints"][joint]
        axes.plot(*thinned(time, drive), color=MEASURED, lw=0.8, label="drive")
        _before_and_after(axes, d, time, (before, after), 0.8, "missing ")
        axes.set(xlabel="time (s)", ylabel=titled(f"drive of {joint}", unit))

    painter.__name__ = f"joint {joint}"
    return painter


def _over_time(axes: Any, d: Diagnosis) -> None:
    p = d.pictures
    keep = p["usable"]
    _before_and_after(axes, d, p["gap_time"][keep], (p["gap_before"][keep], p["gap_after"][keep]), 0.6)
    before, _, noise = d.figures  # the floor that the page states
    floor = noise / before * float(np.sqrt(np.mean(p["gap_before"][keep] ** 2))) if before > 0.0 else p["floor"]
    axes.axhspan(-2 * floor, 2 * floor, color=FLOOR, alpha=0.3, lw=0, label="twice the noise floor")
    axes.set(xlabel=titled("time", p.get("clock", "s")), ylabel=titled(p["what"], p.get("gap_unit", p["units"][0])))


def _where(axes: Any, d: Diagnosis) -> Any:
    if not d.where:
        return False
    p, best = d.pictures, _shown_axis(d)
    x = p["axes"][best.signal][0][p["usable"]]
    before, after = p["gap_before"][p["usable"]], p["gap_after"][p["usable"]]
    edges, period = bins_of(x, waves_of(d, best))
    name = f"{best.signal} within a period" if period else best.signal
    bins = np.clip(np.searchsorted(edges, np.mod(x, period) if period else x, side="right") - 1, 0, edges.size - 2)
    count = np.bincount(bins, minlength=edges.size - 1)
    seen = count > 0
    centres, count = (0.5 * (edges[1:] + edges[:-1]))[seen], count[seen]

    def mean(values: Any) -> Any:
        return np.bincount(bins, values, edges.size - 1)[seen] / count

    means = mean(before)
    errors = np.sqrt(np.maximum(mean(before**2) - means**2, 0.0) / count)
    axes.errorbar(
        centres, means, errors, color=BEFORE, fmt="o", ms=3.5 if seen.sum() < 80 else 1.5, lw=1, label="before"
    )
    if d.repaired:
        axes.plot(centres, mean(before - after), color=AFTER, lw=1.3, label="what the repair takes")
        axes.plot(centres, mean(after), color=FLOOR, lw=1, label="left after")
    axes.axhline(0, color=FLOOR, lw=0.6)
    axes.set(xlabel=titled(name, best.unit), ylabel=titled(p["what"], p.get("gap_unit", p["units"][0])))


def waves_of(d: Diagnosis, place: Any) -> list[float]:
    """Periods of the named waves per unit of the place's signal: orders over a turn of position, hertz over time."""
    if place.signal == "time":
        return [
            float(e.effect.frequency) for e in d.effects if e.effect.place == "time" and "frequency" in vars(e.effect)
        ]
    if not place.signal.startswith(("angle in the turn", "position", "x")):
        return []
    turn = 360.0 if place.unit == "deg" else 2.0 * np.pi
    named = (wave for e in d.effects for wave in (e, *e.orders) if "order" in vars(wave.effect))
    return [float(wave.effect.order) / turn for wave in named]


def bins_of(x: Any, waves: list[float]) -> tuple[Any, float]:
    """(edges of the bins of a signal, period that it is folded into or 0): as fine as the fastest wave needs.

    A wave is folded into its period, and several waves into the one that they share, if the signal covers that period
    at least twice; otherwise the whole travel is drawn. Without a wave the bins contain equally many samples.

    >>> x = np.linspace(0.0, 3.0, 4000)
    >>> edges, period = bins_of(x, [24.0 / (2 * np.pi), 16.0 / (2 * np.pi)])  # both repeat every eighth of a turn
    >>> round(2 * np.pi / period), edges.size - 1 >= 3 * A_PERIOD
    (8, True)
    """
    if not waves:
        return np.unique(np.quantile(x, np.linspace(0.0, 1.0, 61))), 0.0
    slow, fast = min(waves), max(waves)
    # the slowest wave of which all are multiples, to the precision of a fit
    shared = [k for k in range(1, 25) if all(abs(w * k / slow - round(w * k / slow)) < 0.01 for w in waves)]
    period = shared[0] / slow if shared else np.inf
    travel = float(np.ptp(x))
    if 2.0 * period > travel:
        period, low, span = 0.0, float(x.min()), travel
    else:
        low, span = 0.0, period
    count = int(np.clip(np.ceil(A_PERIOD * fast * span), A_PERIOD, max(A_PERIOD, x.size // 4)))
    return np.linspace(low, low + span, count + 1), period


def _shown_axis(d: Diagnosis) -> Any:
    """The axis of the named effect's place; otherwise the most informative one."""
    wanted = {
        "position": ("angle in the turn", "position", "x"), "friction": ("velocity", "dx"), "drive": ("drive", "input"),
        "transmission": ("reversal",), "time": ("time",), "sensor": ("angle in the turn", "position", "output"),
    }.get(d.effects[0].effect.place if d.effects else "", ())  # fmt: skip
    for name in wanted:
        for place in d.where:
            if place.signal == name or place.signal.startswith(f"{name} of "):
                return place
    return d.where[0]


def _learned(axes: Any, d: Diagnosis) -> Any:
    if d.learned is None or not d.learned.curves:
        return False
    curve, p = d.learned.curves[0], d.pictures
    axes.fill_between(curve.x, curve.y - curve.band, curve.y + curve.band, color=AFTER, alpha=0.25, lw=0)
    axes.plot(curve.x, curve.y, color=AFTER, lw=1.4)
    axes.axhline(0, color=FLOOR, lw=0.6)
    first, *second = curve.signals
    unit = {"velocity": f"{p['units'][1]}/s", "speed": f"{p['units'][1]}/s", "drive": p["units"][0]}
    by = {"direction": " x sign(velocity)", "velocity": " x velocity"}.get(second[0], "") if second else ""
    brake = " against the motion" if first == "speed" else ""
    axes.set(xlabel=titled(first, unit.get(first, p["units"][1])), ylabel=titled(f"learned{brake}{by}", p["units"][0]))


def _candidates(axes: Any, d: Diagnosis) -> Any:
    shown = sorted((c for c in d.candidates if c.closure > 0.0), key=lambda c: -c.closure)[:10][::-1]
    if not shown:
        return False
    colours = {"named": AFTER, "alias": BEFORE}
    bars = axes.barh([spoken(c.name) for c in shown], [100.0 * c.closure for c in shown])
    for bar, c in zip(bars, shown, strict=True):
        colour = colours.get(c.status, FLOOR)
        bar.set(edgecolor=colour, facecolor=colour if c.status == "named" or c.p_value <= d.alpha else "none")
    axes.set(xlabel="share of the gap that it explains (%)", xlim=(0, 100))
    axes.tick_params(axis="y", labelsize=8)
    axes.figure.set_layout_engine("tight")  # names may be long: they hold an arm's joint


def _spectrum(axes: Any, d: Diagnosis) -> None:
    p = d.pictures
    _before_and_after(axes, d, p["frequency"], p["spectrum"], 0.9)
    axes.set_yscale("log")
    axes.set(
        xlabel=titled("frequency", "Hz" if p.get("clock", "s") == "s" else "cycles a sample"),
        ylabel=titled("amplitude", p.get("gap_unit", p["units"][0])),
    )


def _map(axes: Any, d: Diagnosis) -> Any:
    families = [e for e in d.effects if e.of_orders]
    if not families:
        return False
    for e, colour in zip(families, (AFTER, BEFORE, MEASURED), strict=False):
        over = e.map_over_turn()
        axes.plot(np.rad2deg(over["angle_rad"]), over["value"], color=colour, lw=0.8, label=spoken(e.label))
    axes.axhline(0, color=FLOOR, lw=0.6)
    axes.set(xlabel="angle in the turn (deg)", ylabel=titled("size", families[0].amplitude_unit), xlim=(0, 360))
    axes.set_xticks(range(0, 361, 60))


def _orders(axes: Any, d: Diagnosis) -> Any:
    p = d.pictures
    if p["orders"].size < 5:
        return False
    _before_and_after(axes, d, p["orders"], p["order_spectrum"], 0.9)
    axes.set(
        xlabel="order (periods in 2 pi of x)" if "window" in p else "order (periods a turn)",
        ylabel=titled("amplitude", p.get("gap_unit", p["units"][0])),
    )
