"""Commands that are ended in mid-run: how long they take to go, and what stands in the tracking store after them.

    python -m benchmarks.interruptions --repeats 3
    python -m benchmarks.interruptions --deaths

(extra ``mlflow``.) Each command runs in a process of its own and records in a store of its own. Once a run is RUNNING
there it gets SIGTERM or SIGINT (Ctrl-C) after a drawn time, or twice in a second as an impatient hand does. A
run that is still RUNNING afterwards would stand in the table for ever.

With ``--deaths`` it is the tracking server that is ended: a real one, which is killed, stopped (SIGSTOP: it takes
connections and answers none) or becomes slow (every piece of an answer comes 5 s late) once the command has opened its
record there. What counts is the time from its death, or from the report on the disk if that comes later, to the end.
"""

from __future__ import annotations

import contextlib
import os
import shutil
import signal
import socket
import sqlite3
import subprocess
import sys
import tempfile
import threading
import time
import urllib.request
from collections import Counter
from collections.abc import Sequence
from pathlib import Path

import click
import numpy as np

from whsklearn.cli.ui import free_port, serve, stop, wait_for
from whsklearn.datasets import make_servo_log

LOG = "--drive torque_nm --position position_rad".split()
ROWS = "--input torque_nm --output velocity_rad_s --time time_s".split()
COMMANDS = {
    "gap": ["gap", "axis.csv", *LOG, "--report", "report"],
    "identify": ["identify", "axis.csv", "--input", "torque_nm", "--output", "position_rad", "--out", "model"],
    "tune": ["tune", "--samples", "5000", "--p", "1,2,4,8", "--P0", "1,100,1e6"],
    "stream": ["stream", "axis.csv", *ROWS, "--follow", "--every", "50", "--out", "out.jsonl"],
    "demo": ["demo"],
    "fleet": ["fleet", "logs", *ROWS, "--in-process", "--out", "fleet.parquet"],
}
EXPERIMENTS = {"gap": "close_gap", "demo": "simulated_example"}  # where it is not the command's name
REPORTS = {"gap": "report/gap.html", "identify": "model/identify.html", "fleet": "fleet.parquet"}
DEATHS = ("killed", "stopped", "slow", "stopped, then SIGTERM")
ALLOWED = 15.0  # s from the server's death, or from the report, to the end
BEGINS = ("gap", "tune", "demo")  # with a run that is RUNNING; the others record it when the work is done
OPENED = 3.0  # s after its experiment is there such a command has opened its record; before, it ends without its work
LATE = 5.0  # s, each piece of a slow server's answer
DEADLINE = 60.0


def material(folder: Path) -> None:
    """A servo log as a file, and a fleet of it."""
    frame = make_servo_log(["cogging"], duration=40.0, random_state=0)
    frame["velocity_rad_s"] = np.gradient(frame["position_rad"], frame["time_s"])
    frame.to_csv(folder / "axis.csv", index=False)
    for k in range(12):
        home = folder / "logs" / f"axis=joint{k:02d}"
        home.mkdir(parents=True)
        frame.to_parquet(home / "part.parquet", index=False)


def statuses(store: Path) -> list[str]:
    """Of all runs in a store; empty while there is none."""
    if not store.exists():
        return []
    try:
        with sqlite3.connect(f"file:{store}?mode=ro", uri=True, timeout=5.0) as db:
            return [row[0] for row in db.execute("select status from runs")]
    except sqlite3.OperationalError:  # tables not made yet
        return []


def trial(name: str, how: str, after: float, folder: Path) -> tuple[str, float, list[str], int]:
    """(what happened, seconds from the signal to the end, statuses afterwards, exit status)."""
    store = folder / f"{name}.db"
    env = os.environ | {"MLFLOW_TRACKING_URI": f"sqlite:///{store}"}
    with (folder / "said.txt").open("w") as said:
        process = subprocess.Popen(
            [sys.executable, "-m", "whsklearn", *COMMANDS[name]], cwd=folder, env=env, stdout=said, stderr=said,
            preexec_fn=lambda: signal.signal(signal.SIGINT, signal.default_int_handler),
        )  # fmt: skip
    began = time.monotonic()
    while "RUNNING" not in statuses(store) and process.poll() is None and time.monotonic() - began < DEADLINE:
        time.sleep(0.05)
    time.sleep(after)
    if process.poll() is not None:
        return "was over before", 0.0, statuses(store), process.returncode
    sent = time.monotonic()
    for _ in range(2 if how == "twice" else 1):
        process.send_signal(signal.SIGTERM if how == "SIGTERM" else signal.SIGINT)
        time.sleep(0.4 if how == "twice" else 0.0)
    try:
        process.wait(DEADLINE)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()
        return "did not end", DEADLINE, statuses(store), process.returncode
    return "ended", time.monotonic() - sent, statuses(store), process.returncode


class Server:
    """A real MLflow server with a store of its own, and a door before it that can hold answers up."""

    def __init__(self, folder: Path, database: Path | None = None):
        self.store = folder / "server.db"
        if database is not None:  # migrated already
            shutil.copy(database, self.store)
        self.port = free_port(5177)
        self.process = serve(f"sqlite:///{self.store}", self.port)
        wait_for(self.process, self.port)
        began = time.monotonic()
        while not self.answers() and time.monotonic() - began < DEADLINE:
            time.sleep(0.2)
        self._late = threading.Event()
        self._door = socket.create_server(("127.0.0.1", 0))
        threading.Thread(target=self._open, daemon=True).start()

    def answers(self) -> bool:
        """Whether it is well."""
        try:
            urllib.request.urlopen(f"http://127.0.0.1:{self.port}/health", timeout=2).close()
        except OSError:
            return False
        return True

    def address(self, how: str) -> str:
        """Through the door for a server that will be slow."""
        return f"http://127.0.0.1:{self._door.getsockname()[1] if how == 'slow' else self.port}"

    def strike(self, how: str) -> None:
        """Let it be killed, stopped or slow from now on."""
        if how == "slow":
            self._late.set()
        elif how != "alive":
            os.killpg(self.process.pid, signal.SIGKILL if how == "killed" else signal.SIGSTOP)

    def revive(self) -> None:
        """As before, unless it was killed."""
        self._late.clear()
        with contextlib.suppress(ProcessLookupError):
            os.killpg(self.process.pid, signal.SIGCONT)

    def forget(self) -> None:
        """Leave no experiment and no run open, so that a command's next one is seen."""
        with sqlite3.connect(self.store, timeout=30.0) as db:
            db.execute("update runs set status = 'KILLED' where status = 'RUNNING'")
            db.execute("update experiments set name = 'before ' || experiment_id || name where name != 'Default'")

    def close(self) -> None:
        """End it."""
        self.revive()
        self._door.close()
        stop(self.process)

    def _open(self) -> None:
        with contextlib.suppress(OSError):  # closed
            while True:
                client, _ = self._door.accept()
                server = socket.create_connection(("127.0.0.1", self.port))
                threading.Thread(target=self._carry, args=(client, server, False), daemon=True).start()
                threading.Thread(target=self._carry, args=(server, client, True), daemon=True).start()

    def _carry(self, source: socket.socket, target: socket.socket, answer: bool) -> None:
        with source, contextlib.suppress(OSError):  # the other direction closes its own
            while data := source.recv(65536):
                if answer and self._late.is_set():
                    time.sleep(LATE)
                target.sendall(data)
            target.shutdown(socket.SHUT_WR)

    def experiments(self) -> set[str]:
        """Names of those in its store."""
        try:
            with sqlite3.connect(f"file:{self.store}?mode=ro", uri=True, timeout=5.0) as db:
                return {row[0] for row in db.execute("select name from experiments")}
        except sqlite3.OperationalError:
            return set()


def death(server: Server, name: str, arguments: Sequence[str], how: str, folder: Path) -> tuple[float, float, int, str]:
    """(seconds from the death to the end, the same from the later of death and report, exit status, what was said)."""
    env = os.environ | {"MLFLOW_TRACKING_URI": server.address(how)}
    report, experiment = folder / REPORTS.get(name, "none"), EXPERIMENTS.get(name, name)
    before = server.experiments()
    with (folder / "said.txt").open("w") as said:
        process = subprocess.Popen(
            [sys.executable, "-m", "whsklearn", *arguments], cwd=folder, env=env, stdout=said, stderr=said
        )
    while process.poll() is None:
        if "RUNNING" in statuses(server.store) or (name not in BEGINS and experiment in server.experiments() - before):
            break
        time.sleep(0.02)
    time.sleep(0.2 if name in BEGINS else OPENED)
    server.strike(how)
    died, written = time.time(), None
    if how.endswith("SIGTERM"):
        process.send_signal(signal.SIGTERM)
    while process.poll() is None and time.time() - died < 4 * DEADLINE:
        if written is None and report.exists():
            written = report.stat().st_mtime
        time.sleep(0.05)
    ended = time.time()
    if process.poll() is None:
        process.kill()
        process.wait()
    server.revive()
    return ended - died, ended - max(died, written or died), process.returncode, (folder / "said.txt").read_text()


def deaths(only: str) -> None:
    """Every command with every death; a line each."""
    worst, good, count = 0.0, 0, 0
    for name, arguments in COMMANDS.items():
        if name == "stream" or (only and name not in only.split(",")):
            continue  # a stream goes on without its record, see `benchmarks.dead_server`
        for how in DEATHS:
            with tempfile.TemporaryDirectory() as name_of_folder:
                folder = Path(name_of_folder)
                material(folder)
                server = Server(folder)
                try:
                    whole, after, code, said = death(server, name, arguments, how, folder)
                finally:
                    server.close()
                there = how.endswith("SIGTERM") or name not in REPORTS or (folder / REPORTS[name]).exists()
            fine = after <= ALLOWED and there and "Traceback" not in said
            worst, good, count = max(worst, after), good + fine, count + 1
            last = (said.strip().splitlines() or [""])[-1][:70]
            click.echo(
                f"{name:<10}{how:<23}{whole:6.1f} s after the death, {after:5.1f} s after the report, exit {code}"
                f"{'' if there else ', NO REPORT'}   {last}"
            )
    click.echo(f"{good} of {count} end within {ALLOWED:g} s, report on the disk; the slowest took {worst:.1f} s")


@click.command(help=__doc__)
@click.option("--repeats", default=3, help="Trials of every command and signal.")
@click.option("--seed", default=0, help="Of the times after which a signal is sent.")
@click.option("--deaths", "servers", is_flag=True, help="End the tracking server in mid-run, not the command.")
@click.option("--only", default="", help=f"Only these commands, joined by commas: {','.join(COMMANDS)}.")
def main(repeats: int, seed: int, only: str, servers: bool) -> None:
    if servers:
        deaths(only)
        return
    rng = np.random.default_rng(seed)
    total: Counter[str] = Counter()
    for name in COMMANDS:
        if only and name not in only.split(","):
            continue
        for how in ("SIGTERM", "SIGINT", "twice"):
            for _ in range(repeats):
                after = float(rng.uniform(0.0, 3.0))
                with tempfile.TemporaryDirectory() as name_of_folder:
                    folder = Path(name_of_folder)
                    material(folder)
                    what, seconds, left, code = trial(name, how, after, folder)
                    said = (folder / "said.txt").read_text().strip().splitlines()
                open_runs = left.count("RUNNING")
                total.update(trials=1, **{what: 1}, open=int(open_runs > 0), traceback=int("Traceback" in str(said)))
                counts = ", ".join(f"{n} {s}" for s, n in sorted(Counter(left).items())) or "no run"
                last = said[-1][:60] if said else ""
                click.echo(
                    f"{name:<10}{how:<9}{after:5.1f} s  {what}, {seconds:5.1f} s, exit {code}: {counts}   {last}"
                )
    click.echo(
        f"{total['trials']} trials, {total['ended']} ended in mid-run, {total['was over before']} over before, "
        f"{total['did not end']} did not end; with a run left RUNNING: {total['open']}; with a traceback: "
        f"{total['traceback']}"
    )


if __name__ == "__main__":
    main()
