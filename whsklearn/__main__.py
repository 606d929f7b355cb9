"""``python -m whsklearn``, and the command of that name."""

from __future__ import annotations

import atexit
import io
import multiprocessing
import os
import sys
import threading

from whsklearn.cli import main

CLEANING_SECONDS = 2.0


def run() -> None:
    """The command; at its end it does not wait for a tracking server that does not answer."""
    status: int | str | None = 0
    for stream in (sys.stdout, sys.stderr):  # what a terminal has no sign for becomes "?", and the job goes on
        if isinstance(stream, io.TextIOWrapper) and stream.encoding.lower() not in ("utf-8", "utf8"):
            stream.reconfigure(errors="replace")
    try:
        main(prog_name="whsklearn")
    except SystemExit as end:
        status = end.code
    store = sys.modules.get("whsklearn.tracking.store")  # not imported for this: without it there is no such thread
    if store is not None and any(thread.name.startswith(store.THREAD) for thread in threading.enumerate()):
        workers = multiprocessing.active_children()
        for worker in workers:  # of a search; nobody else will end them
            worker.terminate()
        # joblib and Dask remove at exit what their workers left; a handler that asks the server must not hold the
        # command up.  Without workers none is run: beside the threads that go on, `gap` once ended in a fault of the
        # interpreter after it had said that it was interrupted.
        loky = sys.modules.get("joblib.externals.loky.reusable_executor")
        if workers or getattr(loky, "_executor", None) is not None:
            cleaning = threading.Thread(target=atexit._run_exitfuncs, daemon=True)
            cleaning.start()
            cleaning.join(CLEANING_SECONDS)
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(status if isinstance(status, int) else 1)  # else the interpreter waits for MLflow's own threads
    sys.exit(status)


if __name__ == "__main__":
    run()
