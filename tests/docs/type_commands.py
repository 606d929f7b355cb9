"""Type every command of the README and the pages, in their order, in a folder that holds the files they name.

    python tests/docs/type_commands.py           # some minutes; ends with status 1 if a command failed
    python tests/docs/type_commands.py --list    # what would be typed, and what is left out and why

No test module: it runs by `make commands`. Options are held against ``--help`` by `test_links`, at every test run.
"""

from __future__ import annotations

import argparse
import os
import re
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
import pandas as pd

ROOT = Path(__file__).resolve().parents[2]
PAGES = "README index your_log units odd_files reading_the_report when_it_says_unknown faq user_guide which_model"
PAGES += " identify choosing tuning your_effect your_simulator export streaming fleets tracking comparison measured"
PAGES += " reproduction compare your_robot"  # the last one writes the report of an arm over that of the axis
FENCED = re.compile(r"^```(\w*)\n(.*?)^```", re.DOTALL | re.MULTILINE)
PLACEHOLDER = re.compile(r"\b(LOG|MODEL\.json|FORMAT|PATH|DIR|COMMAND|TRAIN|NAME)\b")
LEFT_OUT = {
    "pip install": "CI installs the wheel in clean environments",
    "make ": "a target of the Makefile",
    "python -m benchmarks": "a benchmark",
    "python benchmarks": "a benchmark",
    "python -m pipelines.reproduce": "a benchmark",
    "python -m pipelines.turntable": "tests/test_pipelines runs it",
    "--scheduler": "asks for a cluster",
    "docker run": "an option for your own container",
    "mlflow models serve": "serves until it is stopped",
    "export MLFLOW_TRACKING_URI": "belongs to the line below it",
    "whsklearn ui": "serves until it is stopped; tests/test_ui opens it",
}
SECONDS = 1800  # of a busy machine


def commands() -> list[tuple[str, str]]:
    """Commands by page, each once: lines of blocks, and what stands in a sentence without a placeholder."""
    found: dict[str, str] = {}
    for name in PAGES.split():
        page = ROOT / f"{name}.md" if name == "README" else ROOT / "docs" / f"{name}.md"
        text = page.read_text(encoding="utf-8")
        blocks = [b for language, b in FENCED.findall(text) if language in ("bash", "console", "sh")]
        lines = [line.strip() for b in blocks for line in b.replace("\\\n", " ").splitlines()]
        sentences = [" ".join(c.split()) for c in re.findall(r"(?<!`)`([^`]+)`(?!`)", FENCED.sub("", text))]
        lines += [s for s in sentences if re.match(r"whsklearn [a-z]+ .*--", s) and not PLACEHOLDER.search(s)]
        for line in lines:
            if line and not line.startswith("#"):
                found.setdefault(" ".join(line.partition(" #")[0].split()), name)
    return [(page, line) for line, page in found.items()]


def furnish(folder: Path) -> None:
    """The files that the pages name: logs of an axis that cogs, a record of a chain, a fleet, an effect."""
    from whsklearn.datasets import default_arm, make_arm_log, make_servo_log, make_wiener_hammerstein
    from whsklearn.effects import Cogging
    from whsklearn.export import export_model

    arm = default_arm()
    for name, robot in (("arm", arm), ("empty", arm), ("loaded", arm.with_body("pitch", 2.5, (0.15, 0.02, 0.02)))):
        make_arm_log(robot, duration=12.0).to_csv(folder / f"{name}.csv", index=False)
    for name, seed, size in (
        ("axis", 0, 0.2), ("second", 1, 0.2), ("before", 2, 0.2), ("after", 3, 0.3),
        ("monday", 4, 0.2), ("tuesday", 5, 0.2), ("wednesday", 6, 0.3), ("thursday", 7, 0.3),
    ):  # fmt: skip
        table = pd.DataFrame(make_servo_log([Cogging(size, 12.0)], duration=20.0, random_state=seed))
        table["velocity_rad_s"] = np.gradient(table["position_rad"], table["time_s"])
        table.to_csv(folder / f"{name}.csv", index=False)
    for form, name in (("mjcf", "arm.xml"), ("urdf", "arm.urdf")):
        export_model(arm, to=form, out=folder / name)
    X, y = make_wiener_hammerstein(2000, random_state=0)
    pd.DataFrame({"time_s": np.arange(2000) * 0.01, "u": X[:, 0], "y": y}).to_csv(folder / "log.csv", index=False)
    for axis in range(3):
        X, y = make_wiener_hammerstein(600, random_state=axis)
        part = folder / "logs" / f"axis={axis}"
        part.mkdir(parents=True)
        rows = pd.DataFrame({"time_s": np.arange(600) * 0.01, "u": X[:, 0], "y": y})
        rows.to_parquet(part / "log.parquet")
    effect = FENCED.findall((ROOT / "docs" / "your_effect.md").read_text(encoding="utf-8"))[0][1]
    (folder / "my_effects.py").write_text(effect, encoding="utf-8")
    rows = pd.read_csv(folder / "log.csv").head(1000)
    (folder / "logger").write_text("#!/bin/sh\ncat rows.jsonl\n")
    (folder / "logger").chmod(0o755)
    (folder / "rows.jsonl").write_text(rows.to_json(orient="records", lines=True))


def main() -> int:
    """Type them; print status, seconds and the last line of what failed."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("--list", action="store_true", help="Only say what would be typed.")
    parser.add_argument("--only", default="", help="A pattern of lines, as they are listed.")
    parser.add_argument("--show", action="store_true", help="Print what each command prints.")
    wanted = parser.parse_args()
    failed = 0
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        if not wanted.list:
            furnish(folder)
        (folder / "bin").mkdir()
        (folder / "bin" / "whsklearn").write_text(f'#!/bin/sh\nexec {sys.executable} -m whsklearn "$@"\n')
        (folder / "bin" / "whsklearn").chmod(0o755)
        path = os.pathsep.join([str(folder / "bin"), str(folder), os.environ.get("PATH", "")])
        tree = os.pathsep.join(filter(None, [str(ROOT), os.environ.get("PYTHONPATH", "")]))
        env = os.environ | {"PATH": path, "PYTHONPATH": tree, "MLFLOW_DISABLE_TELEMETRY": "true"}
        for page, line in commands():
            why = next((reason for part, reason in LEFT_OUT.items() if part in line), "")
            if why or wanted.list or not re.search(wanted.only, f"{page}: {line}"):
                print(f"{'left out' if why else 'to type':>9}  {page}: {line}{f'  ({why})' if why else ''}", flush=True)
                continue
            began = time.monotonic()
            typed = f"timeout -s INT 20 {line}" if "--follow" in line else line  # it follows until it is stopped
            done = subprocess.run(
                typed, shell=True, cwd=folder, env=env, capture_output=True, text=True, timeout=SECONDS, check=False
            )
            well = done.returncode == 0 or ("--follow" in line and done.returncode == 124)
            failed += not well
            print(f"{done.returncode:>9}  {page}: {line}  ({time.monotonic() - began:.0f} s)", flush=True)
            if not well or wanted.show:
                said = (done.stdout + done.stderr).strip().splitlines()
                print("\n".join(f"           {t}" for t in (said if wanted.show else said[-4:])), flush=True)
    return int(failed > 0)


if __name__ == "__main__":
    sys.exit(main())
