"""Fetching measured records, without a network: what is asked for, and what is said when nothing comes."""

from __future__ import annotations

import re
import sys
import types
from pathlib import Path
from types import SimpleNamespace
from urllib.parse import urlsplit

import numpy as np
import pandas as pd
import pytest
from scipy.io import loadmat, savemat

from whsklearn.datasets import (
    fetch_cascaded_tanks,
    fetch_coupled_drives,
    fetch_emps,
    fetch_kr300,
    fetch_silverbox,
    published,
)

FETCHES = [published.EMPS, published.KR300, published.SILVERBOX]


def pooch_that(retrieve, folder="/cache"):
    return SimpleNamespace(os_cache=lambda name: folder, retrieve=retrieve, Unzip=lambda: "unzip")


@pytest.mark.parametrize("fetch", FETCHES, ids=lambda f: f.name)
def test_no_network_and_no_downloader_are_none(fetch, monkeypatch):
    def down(*args, **options):
        raise OSError("no route")

    monkeypatch.setitem(sys.modules, "pooch", pooch_that(down))
    assert fetch.fetched() is None
    monkeypatch.setitem(sys.modules, "pooch", None)  # not installed
    assert fetch.fetched() is None


def test_the_robots_files_are_those_of_one_commit_each_in_a_folder_of_its_own(monkeypatch):
    asked = {}

    def retrieve(address, *, known_hash, fname, path):
        asked[address] = path / fname

    monkeypatch.setitem(sys.modules, "pooch", pooch_that(retrieve))
    assert published.KR300.fetched() == Path("/cache/kr300")
    assert len(set(asked.values())) == 3
    for address in asked:
        parts = urlsplit(address)
        assert " " not in address
        assert (parts.scheme, published._KR300_COMMIT in parts.path) == ("https", True)


def test_the_archive_is_where_its_record_lies(monkeypatch):
    files = ["/cache/EMPS.zip.unzip/a/readme.txt", "/cache/EMPS.zip.unzip/b/DATA_EMPS.mat"]
    monkeypatch.setitem(sys.modules, "pooch", pooch_that(lambda *a, **k: files))
    assert published.EMPS.fetched() == Path("/cache/EMPS.zip.unzip/b")
    monkeypatch.setitem(sys.modules, "pooch", pooch_that(lambda *a, **k: files[:1]))
    assert published.EMPS.fetched() is None


def test_the_user_s_own_folder_outweighs_the_environment_and_a_subfolder_the_folder(monkeypatch, tmp_path):
    monkeypatch.setenv("WHSKLEARN_DATA", str(tmp_path / "elsewhere"))
    for place in (tmp_path, tmp_path / "emps"):
        place.mkdir(exist_ok=True)
        (place / "there").touch()
    assert published.EMPS.folder(tmp_path, False, lambda where: (where / "there").exists()) == tmp_path / "emps"
    with pytest.raises(FileNotFoundError, match=r"does not hold emps/emps_train\.csv and .* get them from https"):
        published.EMPS.folder(None, False, lambda where: (where / "there").exists())


RNG = np.random.default_rng(0)


@pytest.mark.parametrize("suffix", [".mat", ".csv"])
def test_silverbox_is_split_as_its_publishers_do(tmp_path, suffix):
    u, y = RNG.standard_normal((2, 131_072))
    if suffix == ".mat":
        savemat(tmp_path / "SNLS80mV.mat", {"V1": u[None], "V2": y[None]})
    else:  # a comma behind the last cell, a line of commas at the end
        text = pd.DataFrame({"V1": u, "V2": y, "": None}).to_csv(index=False, float_format="%.17g")
        (tmp_path / "SNLS80mV.csv").write_text(text + ",,\n")
    found = fetch_silverbox(tmp_path, download=False)
    assert [found[k][0].size for k in ("train", "test_multisine", "test_arrow", "test_arrow_inside")] == [
        65_062,
        21_688,
        40_475,
        32_000,
    ]
    np.testing.assert_array_equal(found.train[1][:9], y[40_650:40_659])
    np.testing.assert_array_equal(found.test_arrow[0][:9], u[100:109])


def test_coupled_drives_are_two_records_of_which_the_first_400_samples_are_learned(tmp_path):
    z = {k: RNG.standard_normal((500, 1)) for k in ("u11", "u12", "z11", "z12")}
    (tmp_path / "ced").mkdir()
    savemat(tmp_path / "ced" / "DATAUNIF.MAT", z, appendmat=False)
    found = fetch_coupled_drives(tmp_path, download=False)
    np.testing.assert_array_equal(found.train[1][1], z["z12"][:400, 0])
    np.testing.assert_array_equal(found.test[0][0], z["u11"][400:, 0])


def test_tanks_are_read_from_the_environment_s_folder(tmp_path, monkeypatch):
    table = pd.DataFrame(RNG.standard_normal((1024, 4)), columns=["uEst", "uVal", "yEst", "yVal"])
    table["Ts"] = [4.0] + [np.nan] * 1023
    table.to_csv(tmp_path / "dataBenchmark.csv", index=False)
    monkeypatch.setenv("WHSKLEARN_DATA", str(tmp_path))
    found = fetch_cascaded_tanks(download=False)
    np.testing.assert_allclose(found.test[1], table["yVal"])


def test_a_file_of_something_else_is_refused(tmp_path):
    savemat(tmp_path / "SNLS80mV.mat", {"a": np.zeros((1, 9))})
    with pytest.raises(ValueError, match="no signal V1, V2"):
        fetch_silverbox(tmp_path, download=False)


def test_a_missing_file_tells_where_it_is_to_be_had(tmp_path):
    with pytest.raises(FileNotFoundError, match=r"nonlinearbenchmark\.org/benchmarks/coupled-electric-drives"):
        fetch_coupled_drives(tmp_path, download=False)


@pytest.fixture(autouse=True)
def no_folder(monkeypatch):
    monkeypatch.delenv("WHSKLEARN_DATA", raising=False)


@pytest.fixture
def mat_folder(tmp_path):
    rng = np.random.default_rng(0)
    for name in ("DATA_EMPS.mat", "DATA_EMPS_PULSES.mat"):
        savemat(tmp_path / name, {k: rng.normal(size=(40, 1)) for k in ("vir", "qm", "qg", "t")})
    return tmp_path


def test_records_that_are_nowhere_are_told_with_their_address(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "pooch", None)
    with pytest.raises(FileNotFoundError, match=r"EMPS records are not here.*nonlinearbenchmark.org"):
        fetch_emps()
    with pytest.raises(FileNotFoundError, match=r"does not hold emps/emps_train\.csv"):
        fetch_emps(tmp_path, download=False)
    with pytest.raises(
        FileNotFoundError, match=r"KR300 records are not here.*github.com/JonasWeigand.*name their folder"
    ):
        fetch_kr300(tmp_path)
    with pytest.raises(FileNotFoundError, match=r"does not hold kr300/kr300_axis1_A\.csv"):
        fetch_kr300(tmp_path, download=False)


def test_the_publishers_files_are_read_under_our_names(mat_folder):
    emps = fetch_emps(mat_folder, verify=False)
    assert list(emps.train.columns) == ["time_s", "drive_V", "force_N", "position_m", "reference_m"]
    assert np.allclose(emps.test.force_N, emps.force_per_volt * emps.test.drive_V)
    assert np.allclose(np.diff(emps.train.time_s), 1 / emps.sample_rate)


def test_other_numbers_are_refused(mat_folder):
    with pytest.raises(ValueError, match=r"DATA_EMPS.mat are not those of the published record"):
        fetch_emps(mat_folder)


@pytest.fixture
def robot_folder(tmp_path):
    """Folders as the publishers lay them out: all six axes in ``rec`` of a data.mat."""
    rng = np.random.default_rng(1)
    fields = [*published._KR300_FIELDS, "ref_vel_deg_per_s"]
    for name in "ABC":
        folder = tmp_path / f"2020-10-21 10s FF {name} 08ms"
        folder.mkdir()
        savemat(folder / "data.mat", {"rec": {k: rng.normal(size=(6, 30)) for k in fields}, "para": {"u": 1.0}})
    return tmp_path


def test_the_publishers_robot_files_are_read_under_our_names(robot_folder):
    robot = fetch_kr300(robot_folder, verify=False)
    rec = loadmat(robot_folder / "2020-10-21 10s FF B 08ms" / "data.mat", simplify_cells=True)["rec"]
    np.testing.assert_allclose(robot.B["motor_torque_Nm"], rec["act_torque_abs_nm"][0])
    np.testing.assert_allclose(robot.B["load_position_deg"], rec["act_pos_se_deg"][0])
    np.testing.assert_allclose(np.diff(robot.B["time_s"]), 1 / robot.sample_rate)
    with pytest.raises(ValueError, match=r"data\.mat are not those of the published record"):
        fetch_kr300(robot_folder)


def test_a_robot_file_without_its_record_is_told(robot_folder):
    savemat(robot_folder / "2020-10-21 10s FF A 08ms" / "data.mat", {"para": 1.0})
    with pytest.raises(ValueError, match=r"has no signal rec\.act_torque_abs_nm, rec\."):
        fetch_kr300(robot_folder)


def test_pooch_brings_the_three_robot_files_of_one_commit(monkeypatch, robot_folder):
    asked = []
    fake = types.SimpleNamespace(retrieve=lambda url, **options: asked.append(url), os_cache=lambda name: robot_folder)
    monkeypatch.setitem(sys.modules, "pooch", fake)
    (robot_folder / "kr300").symlink_to(robot_folder)
    assert len(fetch_kr300(verify=False).A) == 30
    assert len(set(asked)) == 3
    assert all(re.fullmatch(r"https://\S+/[0-9a-f]{40}/data/\S+/data\.mat", url) for url in asked)


def test_a_checksum_sees_nine_digits():
    frame = pd.DataFrame({"a": [1.0, 2.0]})
    assert published.checksum(frame) == published.checksum(frame + 1e-13)
    assert published.checksum(frame) != published.checksum(frame + 1e-7)


def test_files_without_their_columns_are_told(tmp_path):
    for k in "ABC":
        pd.DataFrame({"time_s": [0.0]}).to_csv(tmp_path / f"kr300_axis1_{k}.csv", index=False)
    with pytest.raises(ValueError, match="has no column motor_torque_Nm"):
        fetch_kr300(tmp_path)
    savemat(tmp_path / "DATA_EMPS.mat", {"x": 1.0})
    savemat(tmp_path / "DATA_EMPS_PULSES.mat", {"x": 1.0})
    with pytest.raises(ValueError, match="no signal vir, qm, qg"):
        fetch_emps(tmp_path)


def test_pooch_brings_the_archive(mat_folder, monkeypatch):
    asked = {}

    def retrieve(url, **options):
        asked.update(options, url=url)
        return [str(p) for p in mat_folder.iterdir()]

    fake = types.SimpleNamespace(retrieve=retrieve, Unzip=lambda: None, os_cache=lambda name: Path(name))
    monkeypatch.setitem(sys.modules, "pooch", fake)
    assert len(fetch_emps(verify=False).train) == 40
    assert asked["url"].startswith("https://")
    with pytest.raises(ValueError, match="not those of the published record"):
        fetch_emps()


def test_a_network_that_is_down_is_told_like_missing_records(monkeypatch):
    def retrieve(url, **options):
        raise OSError("no route")

    fake = types.SimpleNamespace(retrieve=retrieve, Unzip=lambda: None, os_cache=lambda name: Path(name))
    monkeypatch.setitem(sys.modules, "pooch", fake)
    with pytest.raises(FileNotFoundError, match="EMPS records are not here"):
        fetch_emps()


def test_the_measured_records_carry_their_checksum(data_dir, monkeypatch):
    monkeypatch.setenv("WHSKLEARN_DATA", str(data_dir))
    emps, kr300 = fetch_emps(), fetch_kr300()
    assert len(emps.train) == len(emps.test) == 24841
    assert len(kr300.A) == 2501
    assert "Janot" in emps.citation
    assert "Weigand" in kr300.citation
