"""``python -m whsklearn``, and the command of that name."""

from __future__ import annotations

import os
import sys
import threading

from whsklearn.cli import main


def run() -> None:
    """The command; a record that still waits for a server that does not answer holds nobody up at its end."""
    status: int | str | None = 0
    try:
        main(prog_name="whsklearn")
    except SystemExit as end:
        status = end.code
    beside = sys.modules.get("whsklearn.tracking.beside")  # not imported for this: without it there is no such thread
    if beside is not None and any(thread.name.startswith(beside.THREAD) for thread in threading.enumerate()):
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(status if isinstance(status, int) else 1)  # else the interpreter waits for MLflow's own threads
    sys.exit(status)


if __name__ == "__main__":
    run()
