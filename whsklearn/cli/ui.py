"""Show the recorded runs in a browser."""

from __future__ import annotations

import contextlib
import os
import signal
import socket
import subprocess
import sys
import time
import webbrowser

import click

from whsklearn.cli.job import command, root

_START_SECONDS = 120
_END_SECONDS = 5.0


def free_port(wanted: int) -> int:
    """`wanted` if it is free, else any other."""
    for port in (wanted, 0):
        with socket.socket() as probe, contextlib.suppress(OSError):
            probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            probe.bind(("127.0.0.1", port))
            return probe.getsockname()[1]
    raise OSError("No free port on 127.0.0.1; close a program that listens there.")


def serve(store: str, port: int) -> subprocess.Popen[bytes]:
    """Start MLflow's page on a local store; the settings save half a minute and a gigabyte."""
    call = [sys.executable, "-m", "mlflow", "server", "--backend-store-uri", store]
    call += ["--default-artifact-root", str(root() / "mlruns" / "artifacts")]
    call += ["--host", "127.0.0.1", "--port", str(port), "--workers", "1"]
    quiet = {"MLFLOW_DISABLE_TELEMETRY": "true", "MLFLOW_SERVER_ENABLE_JOB_EXECUTION": "false"}
    return subprocess.Popen(
        call, env={**os.environ, **quiet}, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
        start_new_session=True,  # its workers are ended with it, see `stop`
    )  # fmt: skip


def stop(server: subprocess.Popen[bytes]) -> None:
    """Stop the page and its workers."""
    with contextlib.suppress(ProcessLookupError):
        os.killpg(server.pid, signal.SIGTERM)
        try:
            server.wait(_END_SECONDS)
        except subprocess.TimeoutExpired:  # it is stopped (SIGSTOP) or hangs
            os.killpg(server.pid, signal.SIGKILL)
    server.wait()


def wait_for(server: subprocess.Popen[bytes], port: int) -> None:
    """Return when the page answers; raise if it never does."""
    deadline = time.monotonic() + _START_SECONDS
    while time.monotonic() < deadline:
        if server.poll() is not None:
            raise OSError(f"MLflow's page ended at once with code {server.returncode}; the store may be damaged.")
        with contextlib.suppress(OSError), socket.create_connection(("127.0.0.1", port), timeout=1):
            return
        time.sleep(0.2)
    stop(server)
    raise OSError(f"MLflow's page did not answer within {_START_SECONDS} s.")


@command
@click.option("--port", default=5000, help="Port to listen on; another one is taken if it is not free.")
@click.option("--browser/--no-browser", default=True, help="Open a browser, or print the address only.")
def main(port: int, browser: bool) -> None:
    """Show the recorded runs in a browser, until interrupted.

    Example: whsklearn ui --port 5001
    """
    from whsklearn import tracking

    store = tracking.tracking_uri(root())
    found = tracking.experiments(root())
    if store.startswith(("http://", "https://")):
        _announce(store, found, browser)
        return
    port = free_port(port)
    click.echo("Starting MLflow's page (about 10 s) ...", err=True)
    server = serve(store, port)
    try:
        wait_for(server, port)
        _announce(f"http://127.0.0.1:{port}", found, browser)
        click.echo("Stop it with Ctrl-C.")
        server.wait()
    except KeyboardInterrupt:
        click.echo("")
    finally:
        stop(server)


def _announce(server: str, found: list[tuple[str, str]], browser: bool) -> None:
    """Print an address for every experiment, with its own columns, and open the newest in a browser."""
    from whsklearn.tracking.store import page_of

    addresses = {name: page_of(server, experiment_id) for name, experiment_id in found} or {"no runs yet": server}
    width = max(map(len, addresses))
    click.echo("Runs, most recent first:")
    for name, address in addresses.items():
        click.echo(f"  {name:<{width}}  {address}")
    if browser and (os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY") or sys.platform != "linux"):
        webbrowser.open(next(iter(addresses.values())))
