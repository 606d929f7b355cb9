"""What a wheel must do without a checkout and without extras: model, axis, state file, log, command.

`make wheel` runs it in clean environments; it is no test module, as pytest is not installed there.
"""

import importlib.util
import pathlib
import subprocess
import sys
import tempfile

import numpy as np

import whsklearn
from whsklearn import RLSRegressor, ServoAxis, WienerHammersteinLags
from whsklearn.datasets import load_turntable, make_wiener_hammerstein
from whsklearn.effects import Cogging
from whsklearn.gap import ServoRecord
from whsklearn.logs import load_log
from whsklearn.systems import record_frame

assert pathlib.Path(whsklearn.__file__).parts[-3] == "site-packages", whsklearn.__file__
assert importlib.util.find_spec("mlflow") is None, "the extras are installed; this is no clean environment"

X, y = make_wiener_hammerstein(200, snr_db=40, random_state=0)
model = RLSRegressor(WienerHammersteinLags(), gradient="pseudolinear").fit(X, y)  # the reading that compiles least
assert np.isfinite(model.theta_).all()
assert load_turntable("sine").shape == (4000, 4)

with tempfile.TemporaryDirectory() as folder:
    model.save(f"{folder}/axis.whs")
    assert np.array_equal(RLSRegressor.load(f"{folder}/axis.whs").theta_, model.theta_)
    record = ServoAxis(effects=[Cogging(0.05, 12.0)]).simulate(0.5 * np.sin(np.arange(4000) / 300), random_state=0)
    record_frame(record).to_csv(f"{folder}/axis.csv", index=False)
    log = load_log(f"{folder}/axis.csv", time="time_s", drive="torque_nm", position="position_rad")
    assert len(ServoRecord(log.time, log.X[:, 0], log.y)) == 4000
    told = subprocess.run([sys.executable, "-m", "whsklearn", "--help"], capture_output=True, text=True, check=True)
    assert "gap" in told.stdout

print(f"whsklearn {whsklearn.__version__} works with numpy {np.__version__} on Python {sys.version.split()[0]}")
