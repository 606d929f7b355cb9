"""A stream of rows by plain least squares, short enough to be run many times."""

from __future__ import annotations

import numpy as np
from click.testing import CliRunner

from whsklearn.cli.stream import main
from whsklearn.state import read_state

QUICK = ["--no-track", "--time", "t", "--p", "1", "--every", "100", "--estimator", "rls"]


def rows(n, first=0):
    rng = np.random.default_rng(first)
    u = rng.normal(size=n)
    return [f"{0.01 * (first + i):.2f},{a:.9g},{0.5 * a:.9g}\n" for i, a in enumerate(u)]


def write(path, lines):
    path.write_text("t,u,y\n" + "".join(lines))
    return path


def run(log, *args):
    return CliRunner().invoke(main, [str(log), *map(str, args), *QUICK])


def carried(path):
    return read_state(path, "stream")[1]["carried"]
