"""The picture of the front page: simulation and measurement apart, then together, with the name between them.

    python docs/front_picture.py

Not part of a build, as it diagnoses the log of ``whsklearn demo``; run it when the finder or the demo changes, and
look at it.
"""

from __future__ import annotations

import tempfile
from pathlib import Path

import matplotlib.pyplot as plt

from whsklearn.cli.demo import hidden_effect
from whsklearn.gap import GapFinder
from whsklearn.logs import load_log

SECONDS = 2.0
MEASURED, BEFORE, AFTER = "#1f2430", "#c2552d", "#2a7f6f"


def main() -> None:
    """Diagnose the demo's log and draw the two seconds in which the base model is furthest off."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "hidden.csv")
        hidden_effect.main(["--seed", "0", "--out", str(path)], standalone_mode=False)
        log = load_log(path, time="time_s", drive="torque_nm", position="position_rad")
    finder = GapFinder("servo", random_state=0).fit(log.frame, time="time", drive="drive", position="position")
    found, pictures = finder.effects_[0], finder.diagnosis_.pictures
    time, measured, runs = pictures["time"], pictures["measured"], pictures["runs"]
    step = float(time[1] - time[0])
    n = int(SECONDS / step)
    worst = max(range(0, len(time) - n, n // 4), key=lambda i: abs(runs["before"] - measured)[i : i + n].mean())
    part = slice(worst, worst + n)
    figure, (left, right) = plt.subplots(1, 2, figsize=(9.6, 3.4), sharey=True, layout="constrained")
    figure.get_layout_engine().set(wspace=0.32)
    for ax, run, colour, title in (
        (left, runs["before"], BEFORE, "the fitted model"),
        (right, runs["after"], AFTER, "the model with what was missing"),
    ):
        ax.plot(time[part], measured[part], color=MEASURED, lw=2.2, label="measured")
        ax.plot(time[part], run[part], color=colour, lw=1.6, ls="--" if ax is right else "-", label="simulated")
        ax.fill_between(time[part], measured[part], run[part], color=colour, alpha=0.25, lw=0)
        ax.set(title=title, xlabel="time, s")
        ax.spines[["top", "right"]].set_visible(False)
        ax.legend(frameon=False, loc="upper left")
    left.set_ylabel("position, rad")
    (label, size), *_ = found.parameters.items()
    words = f"{found.name}\norder {found.effect.order:.0f}\n{size:.3f} Nm"
    figure.text(0.515, 0.6, words, ha="center", va="bottom", fontsize=11, fontweight="bold")
    figure.text(0.515, 0.5, "\N{LONG RIGHTWARDS ARROW}", ha="center", va="center", fontsize=26)
    figure.savefig(Path(__file__).parent / "_static" / "apart_and_together.png", dpi=110, facecolor="white")
    print(finder.verdict_, label, size, finder.diagnosis_.sentence)


if __name__ == "__main__":
    main()
