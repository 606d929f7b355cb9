"""Faults drawn at random over a stream, its checkpoint and its restarts: the end is that of the clean rows.

    python benchmarks/faults.py --sequences 200 --kills 100

A sequence is a log that is written while a stream follows it, with rows sent twice, swapped, cut in half or with a
wrong stamp in between, and a stream that dies now and then: killed, by an exception where it writes a record, or by
a disk that is full.  Started again each time, it must end in the state of an undisturbed stream over the clean rows, to
the bit, and have written the same estimates and predictions.  Kills are SIGKILL of a forked process.
"""

from __future__ import annotations

import argparse
import json
import math
import os
import signal
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any
from unittest import mock

import numpy as np

from whsklearn import RLSRegressor
from whsklearn.change import ChangeAlarm
from whsklearn.checks import state_difference
from whsklearn.state import read_state, write_state
from whsklearn.streaming import rows as _stream_rows
from whsklearn.streaming import service as stream
from whsklearn.streaming.files import Out, alone, check_files
from whsklearn.streaming.monitor import Options, StreamMonitor

COLUMNS = ["t", "u", "y"]
OPTIONS = Options(every=50, predictions=True, timed=True)


class Fault(Exception):
    """What a callback raises in the midst."""


class Rig:
    """A log in a folder and the stream that follows it."""

    def __init__(self, folder: Path, rng: np.random.Generator, name: str = "log.csv"):
        self.folder, self.rng = folder, rng
        self.log, self.out, self.kept = folder / name, folder / f"{name}.jsonl", folder / f"{name}.whs"
        self.log.write_bytes(b"t,u,y\n")
        self.clean: list[bytes] = []
        self.number = 0

    # -- the log -------------------------------------------------------------------------

    def rows(self, n: int) -> list[bytes]:
        """The next rows as they should be."""
        made = []
        for _ in range(n):
            u = self.rng.normal()
            made.append(b"%.3f,%.9g,%.9g\n" % (0.01 * self.number, u, 2.0 * u + 0.1 * self.rng.normal()))
            self.number += 1
        return made

    def write(self, lines: list[bytes]) -> None:
        """Append to the log."""
        with open(self.log, "ab") as file:
            file.writelines(lines)

    def append(self, n: int) -> None:
        """Rows as they should be."""
        rows = self.rows(n)
        self.clean += rows
        self.write(rows)

    def append_sent_again(self, back: int) -> None:
        """Rows that are there already, as a sender repeats them after a break."""
        self.write(self.clean[-back:])

    def append_swapped(self) -> None:
        """Two rows in the wrong order, amid others."""
        rows = self.rows(5)
        self.clean += rows
        self.write([rows[0], rows[2], rows[1], rows[3], rows[4]])

    def append_wrong_stamp(self, stamp: float) -> None:
        """A row whose clock lied; it is a bad row."""
        rows = self.rows(6)
        lied = b"%.9g," % stamp + rows[1].split(b",", 1)[1]
        self.clean += [rows[0], b"bad\n", *rows[2:]]
        self.write([rows[0], lied, *rows[2:]])

    def append_half(self) -> bytes:
        """Half of a row; what is missing is returned."""
        (row,) = self.rows(1)
        self.clean.append(row)
        cut = int(self.rng.integers(1, len(row) - 1))
        self.write([row[:cut]])
        return row[cut:]

    # -- the stream ----------------------------------------------------------------------

    def run(self, blocks: float = math.inf, fail_at: int = 0, full_at: int = 0) -> bool:
        """Start the stream, let it take so many blocks and a checkpoint now and then; whether it came to the end."""
        check_files(str(self.log), self.out, self.kept, False)
        place: dict[str, Any] = {"columns": COLUMNS, "offset": 0, "number": 0, "header": "", "out": 0, "run": ""}
        model = RLSRegressor(forgetting=0.999)
        with alone(self.kept, self.out):
            loaded = stream._load(self.kept, model, COLUMNS) if self.kept.exists() else {}
            place |= loaded.get("place", {})
            stream._check_source(str(self.log), place)
            out = Out(self.out, place["out"] if loaded else None)
            emitted = 0

            def emit(record: dict[str, Any]) -> None:
                nonlocal emitted
                emitted += 1
                if emitted == fail_at:
                    raise Fault
                out(record)

            life = StreamMonitor(model, ChangeAlarm(), OPTIONS, emit)
            if loaded:
                life.set_state(loaded)
            files = stream.Files(str(self.log), self.out, self.kept, False, False, math.inf, False)
            keeper = stream.Keeper(life, files, place, out)
            lines = stream._open(str(self.log), place, False)
            try:
                with mock.patch.object(stream, "write_state", _full_disk(full_at)):
                    if not loaded:
                        keeper.save(lines)
                    parse = stream._parser(str(self.log), place, OPTIONS.timed)
                    while blocks > 0 and (block := lines.read()) is not None:
                        blocks -= 1
                        if parse is None and block:
                            place["header"] = block.pop(0).decode()
                            parse = stream._parser(str(self.log), place, OPTIONS.timed)
                        if block:
                            life.feed(block, parse, lines.number - len(block) + 1)
                        if self.rng.random() < 0.3:
                            keeper.save(lines)
                    if blocks > 0:
                        keeper.save(lines)
                        return True
            except Fault:
                return False
            finally:
                out.close()
                lines.close()
        return False

    def state(self) -> dict[str, Any]:
        """What was learnt, without what tells of the faults."""
        _, state = read_state(self.kept, "stream")
        return {"rows": state["carried"]["rows"], **{k: state[k] for k in ("model", "alarms", "innovations")}}

    def records(self) -> list[Any]:
        """Estimates and predictions."""
        found = [json.loads(line) for line in self.out.read_bytes().splitlines()]
        return [r for r in found if r["kind"] in ("estimate", "prediction")]


def _full_disk(at: int) -> Any:
    """A write_state that fails from the ``at``-th call on, for three calls."""
    calls = 0

    def write(*args: Any) -> None:
        nonlocal calls
        calls += 1
        if at and at <= calls < at + 3:
            raise OSError(28, "No space left on device")
        write_state(*args)

    return write


@contextmanager
def small_blocks(size: int) -> Iterator[None]:
    """Sources that hand out few rows at a time."""
    with mock.patch.object(_stream_rows, "BLOCK", size):
        yield


def compared(rig: Rig) -> tuple[int, int, float]:
    """Rows lost, rows invented and the difference of the states, against an undisturbed stream over the clean rows."""
    with tempfile.TemporaryDirectory() as folder:
        clean = Rig(Path(folder), np.random.default_rng(0), rig.log.name)
        clean.write(rig.clean)
        assert clean.run()
        ours, theirs = rig.state(), clean.state()
        same_records = rig.records() == clean.records()
    difference = state_difference(ours, theirs) if same_records else math.inf
    return max(theirs["rows"] - ours["rows"], 0), max(ours["rows"] - theirs["rows"], 0), difference


def sequence(seed: int, folder: Path, steps: int = 12) -> tuple[int, int, float]:
    """One drawn sequence of faults, to its end."""
    rng = np.random.default_rng(seed)
    rig = Rig(folder, rng)
    rig.append(30)
    with small_blocks(int(rng.integers(100, 2000))):
        for _ in range(steps):
            fault = rng.integers(9)
            if fault == 0:
                rig.append_sent_again(int(rng.integers(1, len(rig.clean))) if b"bad\n" not in rig.clean else 1)
            elif fault == 1:
                rig.append_swapped()
            elif fault == 2:
                rig.append_wrong_stamp(float(rng.choice([1e9, -1e9, 0.01 * rig.number + 7])))
            elif fault == 3:
                rest = rig.append_half()
                rig.run()
                rig.write([rest])
            elif fault == 4:
                rig.run(blocks=int(rng.integers(1, 30)))
            elif fault == 5:
                rig.run(fail_at=int(rng.integers(1, 200)))
            elif fault == 6:
                rig.run(full_at=int(rng.integers(1, 8)))
            else:
                rig.append(int(rng.integers(1, 150)))
        rig.append(10)
        while not rig.run():
            pass
    return compared(rig)


def kills(n: int, folder: Path, seed: int = 0) -> tuple[int, int, float]:
    """A stream over a log that grows, killed again and again at random instants."""
    rng = np.random.default_rng(seed)
    rig = Rig(folder, rng)
    rig.append(100)
    with small_blocks(500):
        rig.run()  # compiled and begun
        for _ in range(n):
            rig.append(40)
            child = os.fork()
            if child == 0:
                rig.rng = np.random.default_rng(int(rng.integers(1 << 30)))
                while True:
                    rig.run(blocks=float(rig.rng.integers(1, 50)))
            time.sleep(rng.uniform(0, 0.1))
            os.kill(child, signal.SIGKILL)
            os.waitpid(child, 0)
        rig.append(10)
        rig.run()
    return compared(rig)


def main() -> None:
    """Run them and print the counts."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--sequences", type=int, default=200)
    parser.add_argument("--kills", type=int, default=100)
    asked = parser.parse_args()
    results = []
    for seed in range(asked.sequences):
        with tempfile.TemporaryDirectory() as folder:
            results.append(sequence(seed, Path(folder)))
    for what, found in (("sequences", results), ("kills", [])):
        if what == "kills":
            with tempfile.TemporaryDirectory() as folder:
                found = [kills(asked.kills, Path(folder))]
        lost, invented = sum(r[0] for r in found), sum(r[1] for r in found)
        same = sum(r[2] == 0.0 for r in found)
        n = asked.kills if what == "kills" else asked.sequences
        print(f"{n} {what}: {lost} rows lost, {invented} invented, {same} of {len(found)} ends the same to the bit")
        if same < len(found):
            print("  differ:", [i for i, r in enumerate(found) if r[2] != 0.0][:20])


if __name__ == "__main__":
    main()
