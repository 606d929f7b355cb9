"""What each extra weighs: megabytes, packages and seconds of an installation, beside those of none.

Every extra of `pyproject.toml` is installed with uv into an environment of its own, on top of nothing.  Seconds are of
a warm download cache if there is one, so they tell what unpacking takes, not what a line carries.

    python -m benchmarks.weight [--extras plot,mlflow]
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import tempfile
import time
import tomllib
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
FOR_DEVELOPERS = {"bench", "dev", "docs"}


def installed(extra: str, folder: Path) -> tuple[float, int, float]:
    """Megabytes, packages and seconds of an environment with one extra, or with none."""
    place = folder / (extra or "none")
    subprocess.run([sys.executable, "-m", "venv", "--without-pip", place], check=True)
    target = f"{ROOT}[{extra}]" if extra else str(ROOT)
    began = time.perf_counter()
    command = [sys.executable, "-m", "uv", "pip", "install", "--quiet", "--link-mode", "copy", "--python"]
    subprocess.run([*command, place / "bin" / "python", target], check=True)
    seconds = time.perf_counter() - began
    size = sum(p.stat().st_size for p in place.rglob("*") if p.is_file() and not p.is_symlink())
    return size / 1e6, len(list(place.glob("lib/python*/site-packages/*.dist-info"))), seconds


def main() -> None:
    """Print a line an extra."""
    options = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]["optional-dependencies"]
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--extras", default=",".join(e for e in options if e not in FOR_DEVELOPERS))
    extras = parser.parse_args().extras.split(",")
    with tempfile.TemporaryDirectory() as folder:
        size, packages, seconds = installed("", Path(folder))
        print(f"{'none':10s} {size:6.0f} MB {packages:4d} packages {seconds:5.1f} s")
        for extra in extras:
            more = installed(extra, Path(folder))
            print(
                f"{extra:10s} {more[0] - size:+6.0f} MB {more[1] - packages:+4d} packages {more[2]:5.1f} s", flush=True
            )


if __name__ == "__main__":
    main()
