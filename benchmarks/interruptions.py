"""Commands that are ended in mid-run: how long they take to go, and what stands in the tracking store after them.

    python -m benchmarks.interruptions --repeats 3
    python -m benchmarks.interruptions --deaths

(extra ``mlflow``.) Each command runs in a process of its own and records in a store of its own. Once a run is RUNNING
there it gets SIGTERM or SIGINT (Ctrl-C) after a drawn time, or twice in a second as an impatient hand does. A
run that is still RUNNING afterwards would stand in the table for ever.

With ``--deaths`` it is the tracking server that is ended: a real one, which is killed, stopped (SIGSTOP: it takes
connections and answers none) or becomes slow (every piece of an answer comes 5 s late) once it has opened the command's
run. What counts is the time from its death to the end. Some of it is the command's own work, which a living server
would have seen too: each command is first run on one, from the same moment, and the time beyond that is told beside it.
``simulate`` and ``export`` ask no server, ``ui`` asks it for its experiments, and a ``stream`` goes on without its
record to the end of its log, or to SIGTERM; `benchmarks.dead_server` measures one that follows a growing log.
"""

from __future__ import annotations

import contextlib
import os
import re
import resource
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
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import click
import numpy as np

from whsklearn import ServoAxis
from whsklearn.cli.job import ENDED
from whsklearn.cli.ui import free_port, serve, stop, wait_for
from whsklearn.datasets import make_servo_log
from whsklearn.gap.report import as_model
from whsklearn.models import save_model
from whsklearn.tracking.store import initialise

LOG = "--drive torque_nm --position position_rad".split()
LOG_BY_INPUT = "--input torque_nm --output position_rad".split()
ROWS = "--input torque_nm --output velocity_rad_s --time time_s".split()
COMMANDS = {
    "gap": ["gap", "axis.csv", *LOG, "--report", "report"],
    "identify": ["identify", "axis.csv", *LOG_BY_INPUT, "--out", "model"],
    "tune": ["tune", "--samples", "5000", "--p", "1,2,4,8", "--P0", "1,100,1e6"],
    "stream": ["stream", "axis.csv", *ROWS, "--estimator", "rls", "--follow", "--every", "2000", "--out", "out.jsonl"],
    "demo": ["demo", "--out", "reports"],
    "compare": ["compare", "axis.csv", "later.csv", *LOG, "--out", "compared"],
    "fleet": ["fleet", "logs", *ROWS, "--in-process", "--out", "fleet.parquet"],
}
OTHERS = {  # that open no run: what becomes of them where the server is dead from the start, or dies under `ui`
    "simulate": ["simulate", "model.json", "axis.csv", *LOG_BY_INPUT, "--out", "simulated.csv"],
    "export": ["export", "model.json", "--to", "mjcf", "--out", "export"],
    "ui": ["ui", "--no-browser", "--port", "0"],
}
REPORTS = {"gap": "report/gap.html", "identify": "model/identify.html", "fleet": "fleet.parquet"}
REPORTS |= {"demo": "reports/gap/gap.html", "compare": "compared/compare.html", "stream": "out.jsonl"}
REPORTS |= {"simulate": "simulated.csv", "export": "export/model.xml"}
PRINTED = {"tune": "The best"}  # the report of a command that writes none begins so
DEATHS = ("killed", "stopped", "slow", "stopped, then SIGTERM")
ALLOWED = 15.0  # s from the server's death to the end
AT_RUN = b"mlflow/runs/create"  # the request at which a server dies: the first run is open, and nothing is in it
AT = {"ui": b"mlflow/experiments/search"}
LATE = 5.0  # s, each piece of a slow server's answer
DEADLINE = 60.0


def material(folder: Path, duration: float = 40.0, axes: int = 12, rate: float = 1000.0) -> None:
    """Two servo logs as files, a fleet of the first, and a model."""
    frame, later = (make_servo_log(["cogging"], duration=duration, sample_rate=rate, random_state=k) for k in range(2))
    later.to_csv(folder / "later.csv", index=False)
    save_model(as_model(ServoAxis(0.05, sample_rate=rate), ("Nm", "rad")), folder / "model.json")
    frame["velocity_rad_s"] = np.gradient(frame["position_rad"], frame["time_s"])
    frame.to_csv(folder / "axis.csv", index=False)
    for k in range(axes):
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
    """A real MLflow server with a store of its own."""

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

    def answers(self) -> bool:
        """Whether it is well."""
        try:
            urllib.request.urlopen(f"http://127.0.0.1:{self.port}/health", timeout=2).close()
        except OSError:
            return False
        return True

    def strike(self, how: str) -> None:
        """Kill or stop the process itself."""
        if how == "killed":
            os.killpg(self.process.pid, signal.SIGKILL)
        elif how.startswith("stopped"):
            os.killpg(self.process.pid, signal.SIGSTOP)

    def close(self) -> None:
        """End it."""
        with contextlib.suppress(ProcessLookupError):
            os.killpg(self.process.pid, signal.SIGCONT)
        stop(self.process)


class Door:
    """The way to a server, which counts as dead once it has answered a request that holds ``at``.

    A death at a fixed request is the same on a fast machine and on a slow one.  Behind the door the server lives on,
    so that several commands can lose it at the same time.

    Parameters
    ----------
    server : Server
    how : str
        ``killed``: connections are cut and refused; ``stopped``: they are taken, and nothing is answered; ``slow``:
        every piece of an answer comes 5 s late; ``alive``: nothing happens.
    at : bytes
        Of the request.
    on_death : callable, optional
        Called when it happens.
    """

    def __init__(self, server: Server, how: str, at: bytes, on_death: Callable[[str], None] | None = None):
        self.how, self.at, self._on_death = how, at, on_death
        self.died = threading.Event()
        self._server, self._open_ones = server, set[socket.socket]()
        self._socket = socket.create_server(("127.0.0.1", 0))
        self.address = f"http://127.0.0.1:{self._socket.getsockname()[1]}"
        threading.Thread(target=self._take, daemon=True).start()

    def close(self) -> None:
        """Cut every connection, and take no more."""
        with contextlib.suppress(OSError):
            self._socket.shutdown(socket.SHUT_RDWR)  # closed alone, it would take one more
        self._socket.close()
        for s in list(self._open_ones):
            with contextlib.suppress(OSError):
                s.shutdown(socket.SHUT_RDWR)

    def _take(self) -> None:
        with contextlib.suppress(OSError):  # closed
            while True:
                client, _ = self._socket.accept()
                server = socket.create_connection(("127.0.0.1", self._server.port))
                self._open_ones |= {client, server}
                asked = threading.Event()  # the request at which the server dies has been seen on this connection
                threading.Thread(target=self._carry, args=(client, server, asked, False), daemon=True).start()
                threading.Thread(target=self._carry, args=(server, client, asked, True), daemon=True).start()

    def _carry(self, source: socket.socket, target: socket.socket, asked: threading.Event, answer: bool) -> None:
        whole = b""
        with source, contextlib.suppress(OSError):  # the other direction closes its own
            while data := source.recv(65536):
                if self.died.is_set() and self.how.startswith("stopped"):
                    continue  # nobody reads it
                if self.died.is_set() and answer and self.how == "slow":
                    time.sleep(LATE)
                if not answer and self.at in data:
                    asked.set()
                target.sendall(data)
                if answer and asked.is_set() and not self.died.is_set():
                    whole += data
                    if is_whole(whole):
                        self._die()
            target.shutdown(socket.SHUT_WR)

    def _die(self) -> None:
        self.died.set()
        if self._on_death is not None:
            self._on_death(self.how)
        if self.how == "killed":
            self.close()


def is_whole(answer: bytes) -> bool:
    """Whether an answer of HTTP has come to its end."""
    head, _, body = answer.partition(b"\r\n\r\n")
    length = re.search(rb"content-length: *(\d+)", head, re.IGNORECASE)
    return length is not None and len(body) >= int(length[1])


@dataclass(frozen=True)
class Ending:
    """How a command ended.

    Attributes
    ----------
    whole, after : float
        Seconds from the death of its server, and from the later of death and report.
    code : int
        Exit status.
    said : str
    report : bool
        Whether its report is on the disk.
    lost : bool
        Whether its server died at all.
    streams : bool
        Whether it goes on without its record, and that is no failure.
    cpu : float
        Seconds of CPU that it used after the death, if no other command ran at the same time.
    """

    whole: float
    after: float
    code: int
    said: str
    report: bool
    lost: bool
    streams: bool = False
    cpu: float = 0.0

    def faults(self, how: str, most: float = ALLOWED) -> list[str]:
        """What is wrong with it; empty if nothing."""
        sigterm = how.endswith("SIGTERM")
        found = {
            f"it took {self.after:.1f} s": self.lost and self.after > most,  # a living server may be busy
            "no report": not (self.report or sigterm),
            "a traceback": "Traceback" in self.said,
            f"exit status {self.code}": self.code != self._expected(sigterm),
        }
        return [text for text, wrong in found.items() if wrong]

    def _expected(self, sigterm: bool) -> int:
        """The exit status that it should have."""
        if not self.lost or self.streams:
            return 0
        return ENDED if sigterm else 1


def death(name: str, door: Door, folder: Path) -> Ending:
    """A command whose server dies in mid-run; SIGTERM follows the death where the door says so."""
    env = os.environ | {"MLFLOW_TRACKING_URI": door.address}
    printed, before = float("-inf"), cpu_of_children()
    with (folder / "said.txt").open("w") as said:
        words = [word for word in (COMMANDS | OTHERS)[name] if word != "--follow"]
        command = [sys.executable, "-m", "whsklearn", *words]
        process = subprocess.Popen(command, cwd=folder, env=env, stdout=said, stderr=said)
    while process.poll() is None and not door.died.wait(0.02):
        pass
    died, used = time.time(), cpu_of(process.pid)
    if process.poll() is None and door.how.endswith("SIGTERM"):
        time.sleep(0.2)
        process.send_signal(signal.SIGTERM)
    while process.poll() is None and time.time() - died < 4 * DEADLINE:
        time.sleep(0.05)
        if name in PRINTED and printed < died and PRINTED[name] in (folder / "said.txt").read_text():
            printed = time.time()
    ended = time.time()
    if process.poll() is None:
        process.kill()
        process.wait()
    cpu = cpu_of_children() - before - used
    report = folder / REPORTS[name] if name in REPORTS else None
    there = report is None or report.exists()
    written = max(died, printed, report.stat().st_mtime if report is not None and there else died)
    told = (folder / "said.txt").read_text()
    lost = door.died.is_set() and door.how != "alive"
    return Ending(ended - died, ended - written, process.returncode, told, there, lost, name == "stream", cpu)


def cpu_of(pid: int) -> float:
    """Seconds of CPU that a process and its children, as far as they have ended, have used; 0 if it is gone."""
    try:
        fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    except OSError:
        return 0.0
    return sum(map(int, fields[11:15])) / os.sysconf("SC_CLK_TCK")


def cpu_of_children() -> float:
    """Seconds of CPU of all children that have ended."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def deaths(only: str) -> None:
    """Every command with every death; a line each."""
    worst, most, good, count = 0.0, 0.0, 0, 0
    template = Path(tempfile.mkdtemp()) / "mlflow.db"
    initialise(template)  # migrating a database takes a minute on a busy machine, copying it none
    for name in COMMANDS | OTHERS:
        if only and name not in only.split(","):
            continue
        alive = 0.0
        for how in ("alive", *DEATHS):
            with tempfile.TemporaryDirectory() as name_of_folder:
                folder = Path(name_of_folder)
                material(folder)
                server = Server(folder, template)
                door = Door(server, how, AT.get(name, AT_RUN), server.strike)
                try:
                    ending = death(name, door, folder)
                finally:
                    door.close()
                    server.close()
            last = (ending.said.strip().splitlines() or [""])[-1][:70]
            if how == "alive":
                alive = ending.whole
                click.echo(
                    f"{name:<10}{how:<23}{alive:6.1f} s ({ending.cpu:.1f} of CPU), exit {ending.code}; "
                    f"load {os.getloadavg()[0]:.1f}"
                )
                continue
            faults = ending.faults(how)
            if ending.whole > ALLOWED:
                faults.append(f"{ending.whole:.1f} s from the death")
            beyond = ending.whole - alive
            worst, most = max(worst, ending.whole), max(most, beyond)
            good, count = good + (not faults), count + 1
            asks = "" if ending.lost else ", asks no server"
            click.echo(
                f"{name:<10}{how:<23}{ending.whole:6.1f} s from the death ({ending.cpu:.1f} of CPU), "
                f"{beyond:+5.1f} beyond, "
                f"{ending.after:5.1f} s from the report, exit {ending.code}{asks}; "
                f"load {os.getloadavg()[0]:.1f}   {'; '.join([*faults, last])}"
            )
    click.echo(
        f"{good} of {count} end within {ALLOWED:g} s of the death, report on the disk; the slowest took {worst:.1f} s, "
        f"{most:.1f} s beyond a server that lives"
    )


@click.command(help=__doc__)
@click.option("--repeats", default=3, help="Trials of every command and signal.")
@click.option("--seed", default=0, help="Of the times after which a signal is sent.")
@click.option("--deaths", "servers", is_flag=True, help="End the tracking server in mid-run, not the command.")
@click.option("--only", default="", help=f"Only these commands, joined by commas: {','.join(COMMANDS | OTHERS)}.")
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
