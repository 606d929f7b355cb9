"""Five stories of a stranger, with the built wheel in an environment that holds nothing else.

    python .ci/clean_room.py [--python PYTHON]

Builds the wheel, makes a virtual environment outside the checkout, installs ``dist/*.whl[all]`` into it and runs the
commands as a new user would, in a folder of their own: a CSV in degrees to a named effect, validated on a second
record; an MCAP file to an MJCF; a drive log to a C compensator; an MJCF without its dry friction to ``repaired.xml``.
Where no package index can be reached it says so and ends with status 0.  ``--python`` runs the stories in an
environment that is there already.
"""

from __future__ import annotations

import argparse
import json
import os
import shutil
import subprocess
import sys
import tempfile
import time
import xml.etree.ElementTree as ET
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).resolve().parents[1]
LOGS = """
import json
import mujoco
import numpy as np
import pandas as pd
from mcap.writer import Writer
from whsklearn.datasets import make_servo_log
from whsklearn.effects import Cogging

for name, seed in (("axis", 0), ("second", 1)):
    log = make_servo_log([Cogging(0.3, 12.0)], duration=12.0, random_state=seed)
    table = {"Time [ms]": 1e3 * log.time_s, "Motor torque [Nm]": log.torque_nm}
    table["Joint angle [deg]"] = np.degrees(log.position_rad)
    pd.DataFrame(table).to_csv(f"{name}.csv", sep=";", decimal=",", index=False)

log = make_servo_log([], duration=8.0, random_state=2).iloc[::4]
with open("robot.mcap", "wb") as file:
    writer = Writer(file)
    writer.start()
    schema = writer.register_schema("JointState", "jsonschema", b"{}")
    channel = writer.register_channel("/joint_states", "json", schema)
    for t, u, y in zip(log.time_s, log.torque_nm, log.position_rad):
        at = int(1.7e18) + round(t * 1e9)
        state = {"name": ["base", "elbow"], "position": [0.0, y], "effort": [0.0, u]}
        writer.add_message(channel, at, json.dumps(state).encode(), at)
    writer.finish()

XML = '''<mujoco><compiler angle="radian"/><option timestep="0.001" integrator="implicitfast" gravity="0 0 0"/>
<worldbody><body><joint name="axis" type="hinge" axis="0 -1 0" damping="0.1" %s/>
<inertial pos="0 0 0" mass="1" diaginertia="0.05 0.05 0.05"/></body></worldbody>
<actuator><general name="motor" joint="axis" gainprm="1"/></actuator></mujoco>'''
open("model.xml", "w").write(XML % "")
model = mujoco.MjModel.from_xml_string(XML % 'frictionloss="0.2" solreffriction="0.002 1"')
data, rng, rows = mujoco.MjData(model), np.random.default_rng(0), []
for k in range(10_000):
    t = 1e-3 * k
    wanted = np.sin(2 * np.pi * 0.3 * t) + 0.3 * np.sin(2 * np.pi * 1.7 * t)
    u = 8.0 * (wanted - data.qpos[0]) - 0.6 * data.qvel[0]
    if k % 4 == 0:
        rows.append((t, u, data.qpos[0] + 1e-5 * rng.standard_normal()))
        data.ctrl[0] = u
    mujoco.mj_step(model, data)
pd.DataFrame(rows, columns=["time_s", "torque_nm", "position_rad"]).to_csv("robot.csv", index=False)
"""


def clean(python: Path) -> dict[str, str]:
    """The environment of a stranger: nothing of the checkout, the new commands first."""
    out = {k: v for k, v in os.environ.items() if k not in ("PYTHONPATH", "VIRTUAL_ENV", "MLFLOW_TRACKING_URI")}
    return out | {"PATH": f"{python.parent}{os.pathsep}{out['PATH']}", "MLFLOW_DISABLE_TELEMETRY": "true"}


def install(folder: Path) -> Path | None:
    """Python of a new environment with the built wheel; None where packages cannot be had."""
    uv = shutil.which("uv") or shutil.which("uv", path=str(Path(sys.executable).parent))
    made, dist = folder / "venv", folder / "dist"
    python = made / "bin" / "python"
    subprocess.run([sys.executable, "-m", "venv", *(["--without-pip"] if uv else []), str(made)], check=True)
    build = [uv, "build", "--quiet", "--wheel"] if uv else [str(python), "-m", "pip", "wheel", "--quiet", "--no-deps"]
    if subprocess.run([*build, *(["-o"] if uv else ["-w"]), str(dist), str(ROOT)]).returncode:
        return None
    (wheel,) = dist.glob("*.whl")
    tool = [uv, "pip", "install", "--python", str(python)] if uv else [str(python), "-m", "pip", "install"]
    done = subprocess.run([*tool, "--quiet", f"{wheel}[all]"])
    return python if done.returncode == 0 else None


class Stories(NamedTuple):
    """A stranger's commands, run one after the other in one folder; each story says what it ended with."""

    python: Path
    folder: Path

    def command(self, *arguments: str) -> str:
        """What a command prints; a failure is raised with the end of its errors."""
        done = subprocess.run(
            [str(self.python.parent / "whsklearn"), *arguments],
            cwd=self.folder,
            env=clean(self.python),
            capture_output=True,
            text=True,
        )
        if done.returncode:
            raise AssertionError(
                f"whsklearn {' '.join(arguments)} ended with {done.returncode}:\n{done.stderr[-2000:]}"
            )
        return done.stdout

    def found(self, report: str) -> dict:
        """Diagnosis in a report."""
        return json.loads((self.folder / report / "gap.json").read_text())

    def degrees(self) -> str:
        """a CSV in degrees to a named effect"""
        self.command("gap", "axis.csv", "--test", "second.csv", "--report", "gap", "--no-track")
        (effect,) = self.found("gap")["effects"]
        numbers = effect["parameters"]
        assert effect["name"] == "cogging", effect
        assert abs(numbers["amplitude_nm"] - 0.3) < 0.02, numbers
        assert abs(numbers["order"] - 12) < 0.05, numbers
        return f"cogging, {numbers['amplitude_nm']:.3g} Nm, order {numbers['order']:.4g}"

    def second(self) -> str:
        """a second record validates"""
        rows = self.found("gap")["test"]
        assert all(r["after"] < 0.2 * r["before"] for r in rows), rows
        return f"free run over {rows[-1]['horizon']:g} s from {rows[-1]['before']:.3g} to {rows[-1]['after']:.3g} rad"

    def compensator(self) -> str:
        """a drive log to a C compensator"""
        self.command("export", "gap/repaired.json", "--to", "c", "--what", "compensator", "--out", "compensator")
        source = self.folder / "compensator"
        if shutil.which("cc") is None:
            return "written; no C compiler here"
        main = '#include "model.h"\n#include <stdio.h>\nint main(void)'
        main += (
            '{printf("%.6f", model_torque(0.0, 0.0) - model_torque(15.0, 0.0)); return 0;}'  # half a period, in degrees
        )
        (source / "main.c").write_text(main)
        subprocess.run("cc -std=c99 -Wall -Werror model.c main.c -o try -lm".split(), cwd=source, check=True)
        told = float(subprocess.run([source / "try"], capture_output=True, text=True, check=True).stdout)
        assert abs(abs(told) - 0.6) < 0.05, told
        return f"{abs(told):.3f} Nm of cogging from crest to trough"

    def mcap(self) -> str:
        """an MCAP file to an MJCF"""
        names = "--input /joint_states.effort.elbow --output /joint_states.position.elbow".split()
        self.command("identify", "robot.mcap", *names, "--out", "model", "--no-track", "--logged", "position")
        self.command("export", "model/model.json", "--to", "mjcf", "--out", "axis.xml")
        text = (self.folder / "axis.xml").read_text()
        assert ET.fromstring(text).tag == "mujoco"
        look = "import mujoco; print(mujoco.MjModel.from_xml_path('axis.xml').njnt)"
        joints = subprocess.run(
            [self.python, "-c", look], cwd=self.folder, env=clean(self.python), capture_output=True, text=True
        )
        assert joints.stdout.strip() == "1", joints.stderr
        return "axis.xml, which MuJoCo loads"

    def repaired(self) -> str:
        """an MJCF without its friction to repaired.xml"""
        self.command("gap", "robot.csv", "--simulator", "model.xml", "--joint", "axis", "--report", "sim", "--no-track")
        names = [e["name"] for e in self.found("sim")["effects"]]
        assert names[:1] == ["coulomb"], names
        (joint,) = ET.parse(self.folder / "sim" / "repaired.xml").getroot().iter("joint")
        told = float(joint.get("frictionloss", "0"))
        assert abs(told - 0.2) < 0.03, told
        return f"repaired.xml with a frictionloss of {told:.3g} (0.2 was taken out)"

    def each(self) -> tuple[Callable[[], str], ...]:
        """The stories, in their order; some use the files of those before."""
        return self.degrees, self.second, self.compensator, self.mcap, self.repaired


def main() -> int:
    """Run the stories; the number of those that fail."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--python", type=Path, help="of an environment in which whsklearn is installed")
    asked = parser.parse_args()
    failed, began = 0, time.monotonic()
    with tempfile.TemporaryDirectory() as made:
        folder = Path(made)
        python = asked.python or install(folder)
        if python is None:
            print("No package index can be reached, so no empty environment can be filled; the stories are skipped.")
            return 0
        print(f"the wheel and its extras installed: {time.monotonic() - began:.0f} s", flush=True)
        subprocess.run([python, "-c", LOGS], cwd=folder, env=clean(python), check=True)
        for story in Stories(python, folder).each():
            start = time.monotonic()
            try:
                ending, mark = story(), "ok"
            except Exception as error:
                ending, mark, failed = f"{type(error).__name__}: {error}", "FAILED", failed + 1
            print(f"{mark:<7}{time.monotonic() - start:5.0f} s  {story.__doc__}: {ending}", flush=True)
    print(f"{failed} of 5 stories failed; {time.monotonic() - began:.0f} s in all.")
    return failed


if __name__ == "__main__":
    sys.exit(main())
