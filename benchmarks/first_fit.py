"""What the first fit of a process costs with nothing compiled, function by function, and where all is compiled.

    python benchmarks/first_fit.py                # RMILSRegressor, half a minute of CPU
    python benchmarks/first_fit.py --estimator PEMRegressor

Seconds are of the CPU, of a function without those that it calls; a function is compiled by itself and once more in
each kernel that it is written into, so what stands deep costs several times what it says.  The last lines tell how much
of that is LLVM's and how much is Numba's start, which the smallest function pays too: no choice of ours makes it less.
"""

from __future__ import annotations

import argparse
import collections
import os
import subprocess
import sys
import tempfile
import time
from typing import Any

TOP = 25  # lines of the table


def measure(name: str) -> None:
    """Fit and predict in this process, whose cache is empty."""
    import numba
    from numba.core import event

    import whsklearn
    from whsklearn import WienerHammersteinLags
    from whsklearn._numba import compiling_seconds

    own: collections.Counter[str] = collections.Counter()
    open_: list[list[float]] = []

    class Listener(event.Listener):
        def on_start(self, _: Any) -> None:
            open_.append([time.process_time(), 0.0])

        def on_end(self, e: Any) -> None:
            began, inside = open_.pop()
            spent = time.process_time() - began
            if open_:
                open_[-1][1] += spent
            function = e.data["dispatcher"].py_func
            own[f"{function.__module__}.{function.__name__}".removeprefix("whsklearn.")] += spent - inside

    import numpy as np

    class Native(event.Listener):
        seconds, began = 0.0, 0.0

        def on_start(self, _: Any) -> None:
            self.began = time.process_time()

        def on_end(self, _: Any) -> None:
            self.seconds += time.process_time() - self.began

    native = Native()
    began = time.process_time()
    numba.njit(lambda x: x)(1.0)
    start = time.process_time() - began
    rng = np.random.default_rng(0)
    X = rng.standard_normal((1000, 1))
    y = np.convolve(np.tanh(2.0 * X[:, 0]), [0.0, 1.0, 0.5, 0.2])[:1000] + 0.1 * rng.standard_normal(1000)
    model = getattr(whsklearn, name)(WienerHammersteinLags(n_a=2, n_b=2, n_c=2, n_d=2), random_state=0)
    event.register("numba:compile", Listener())
    event.register("numba:llvm_lock", native)
    marks, llvm = [time.process_time()], [0.0]
    for step in (lambda: model.fit(X, y), lambda: model.predict(X), lambda: model.fit(X, y)):
        step()
        marks.append(time.process_time())
        llvm.append(native.seconds)
    fit, predict, again = np.diff(marks)
    print(f"{name}: fit {start + fit:.1f} s, predict {predict:.1f} s; a second fit {again:.3f} s")
    in_fit, in_predict, _ = np.diff(llvm)
    print(f"of the fit {start:.1f} s is Numba's start and {in_fit:.1f} s LLVM's; of predict {in_predict:.1f} s LLVM's")
    if not own:
        return
    print(f"{len(own)} functions compiled in {compiling_seconds():.1f} s of that")
    for function, seconds in own.most_common(TOP):
        print(f"{seconds:8.2f}  {function}")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("--estimator", default="RMILSRegressor")
    parser.add_argument("--here", action="store_true", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.here:
        measure(options.estimator)
        return
    with tempfile.TemporaryDirectory() as folder:
        run = [sys.executable, __file__, "--estimator", options.estimator, "--here"]
        for state in ("nothing compiled", "all compiled, as after `whsklearn warm` or in a new environment"):
            print(f"\n{state}:", flush=True)
            subprocess.run(run, check=True, env=os.environ | {"NUMBA_CACHE_DIR": folder})


if __name__ == "__main__":
    main()
