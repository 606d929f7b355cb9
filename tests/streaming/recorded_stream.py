"""The command ``stream`` on a recorded axis: run in this process or in one of its own, and what it leaves."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
from click.testing import CliRunner

from whsklearn import WienerHammersteinSystem
from whsklearn.cli.stream import main
from whsklearn.effects import reduced_law
from whsklearn.state import read_state

ROOT = Path(__file__).resolve().parents[2]
QUICK = ["--no-track", "--time", "t", "--p", "1", "--every", "500"]
KILLS = int(os.environ.get("WHSKLEARN_KILLS", "2"))


def axis(n, seed, coulomb=0.7):
    u = np.random.default_rng(seed).normal(size=n)
    law = reduced_law(coulomb=coulomb)
    return u, WienerHammersteinSystem([1, 2.2], [1, 0.5], [1, 0.2], [0.15, 0.4], law=law).simulate(u[:, None])


def write(path, rows):
    path.write_text("t,u,y\n" + "".join(rows))
    return path


def stream(*args, **kwargs):
    return CliRunner().invoke(main, [str(a) for a in args], **kwargs)


def records(path, kind=None):
    found = [json.loads(line) for line in Path(path).read_text().splitlines()]
    return [r for r in found if kind in (None, r["kind"])]


def carried(path):
    """What a checkpoint holds, without the place of the source."""
    _, state = read_state(path, "stream")
    return {k: v for k, v in state.items() if k != "place"}


def start(log, out, *args):
    command = [sys.executable, "-m", "pipelines.stream", str(log), "--out", str(out), *QUICK, *args]
    return subprocess.Popen(command, cwd=ROOT, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)


def wait_for(condition, process, seconds=60):
    end = time.monotonic() + seconds
    while not condition():
        assert process.poll() is None, process.stderr.read()
        assert time.monotonic() < end, "nothing happened in time"
        time.sleep(0.02)
