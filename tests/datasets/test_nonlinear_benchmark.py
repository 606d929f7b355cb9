"""Published files of nonlinearbenchmark.org, in their layout: made here, as the real ones are not ours to ship."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest
from scipy.io import savemat

from whsklearn.datasets import fetch_cascaded_tanks, fetch_coupled_drives, fetch_silverbox

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
