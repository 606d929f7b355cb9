"""The FMU passes fmpy's check and replays the model."""

from __future__ import annotations

import numpy as np
import pytest

from whsklearn import ServoAxis
from whsklearn.effects import CableSpring, Cogging, OutputDrift
from whsklearn.export import export_model


def test_fmpy_finds_no_fault_and_simulates(compiler, drive, tmp_path):
    fmpy = pytest.importorskip("fmpy", reason="fmpy is not installed (extra fmu)")
    validation = pytest.importorskip("fmpy.validation")
    axis = ServoAxis(effects=[CableSpring(0.5), Cogging(0.1, 12.0), OutputDrift(0.01)], substeps=2)
    path = export_model(axis, to="fmu", out=tmp_path).paths[0]
    assert validation.validate_fmu(str(path)) == []
    n = 500
    log = np.array([(k / 1000.0, u) for k, u in enumerate(drive[:n])], dtype=[("time", float), ("drive", float)])
    result = fmpy.simulate_fmu(
        str(path), stop_time=(n - 1) / 1000.0, step_size=1e-3, output_interval=1e-3, input=log, output=["y"]
    )
    own = axis.simulate_drive(drive[:n], noise=False).position
    np.testing.assert_allclose(result["y"][:n], own, atol=1e-12)


def test_the_same_model_is_the_same_description(tmp_path):
    import zipfile

    texts = []
    for k in "ab":
        path = export_model(ServoAxis(), to="fmu", out=tmp_path / f"{k}/model.fmu").paths[0]
        texts.append(zipfile.ZipFile(path).read("modelDescription.xml"))
    assert texts[0] == texts[1]


def test_a_drive_that_is_no_number_is_held_and_warned_of(compiler, drive, tmp_path):
    fmpy = pytest.importorskip("fmpy", reason="fmpy is not installed (extra fmu)")
    fmi2 = pytest.importorskip("fmpy.fmi2")
    path = export_model(ServoAxis(), to="fmu", out=tmp_path).paths[0]
    guid = fmpy.read_model_description(str(path)).guid
    folder = fmpy.extract(str(path), unzipdir=str(tmp_path / "unzipped"))

    def run(values):
        said = []
        logger = fmi2.fmi2CallbackLoggerTYPE(lambda *given: said.append(given[4]))
        calls = fmi2.fmi2CallbackFunctions(
            logger, fmi2.defaultCallbacks.allocateMemory, fmi2.defaultCallbacks.freeMemory
        )
        unit = fmi2.FMU2Slave(guid=guid, unzipDirectory=folder, modelIdentifier="model", instanceName="one")
        unit.instantiate(callbacks=calls)
        y = []
        for k, u in enumerate(values):
            unit.setReal([0], [float(u)])
            unit.doStep(currentCommunicationPoint=k / 1000.0, communicationStepSize=1e-3)
            y += unit.getReal([1])
        unit.freeInstance()
        return np.array(y), said

    mended = drive[:300].copy()
    mended[100] = mended[99]
    broken = mended.copy()
    broken[100] = np.nan
    whole, silence = run(mended)
    held, said = run(broken)
    np.testing.assert_array_equal(held, whole)
    assert silence == []
    assert said == [b"The drive is no finite number; the one before it acts."]
