"""Every format gives the same log: files are made with the libraries that people write them with."""

from __future__ import annotations

import builtins

import pandas as pd
import pytest

from tests.logs.rig import TABLE, same
from whsklearn.logs import LogError, load_log, open_source


def test_a_wrong_ending_does_not_mislead(tmp_path):
    pytest.importorskip("pyarrow")
    pd.DataFrame(TABLE).to_parquet(tmp_path / "axis.csv")
    same(load_log(tmp_path / "axis.csv", time="time_s", drive="torque_nm", position="position_rad"))
    (tmp_path / "axis.tdms").write_text("time,u\n")
    with pytest.raises(LogError, match="is not a tdms file"):
        open_source(tmp_path / "axis.tdms")


@pytest.mark.parametrize(
    ("magic", "package"),
    [(b"PAR1", "pyarrow"), (b"\x89HDF\r\n", "h5py"), (b"TDSm", "nptdms"), (b"MDF     4.10", "asammdf"),
     (b"\x89MCAP0", "mcap"), (b"#ROSBAG V2.0", "rosbags")],
)  # fmt: skip
def test_an_absent_extra_is_one_sentence_with_the_line_that_installs_it(tmp_path, monkeypatch, magic, package):
    path = tmp_path / "log.bin"
    path.write_bytes(magic + bytes(64))
    real = builtins.__import__

    def without(name, *rest, **options):
        if name.split(".")[0] == package:
            raise ModuleNotFoundError(name=name)
        return real(name, *rest, **options)

    monkeypatch.setattr(builtins, "__import__", without)
    with pytest.raises(ImportError, match=r"pip install 'whsklearn\["):
        open_source(path)


@pytest.mark.parametrize("magic", [b"PAR1", b"\x89HDF\r\n", b"TDSm", b"MDF     4.10", b"\x89MCAP0", b"#ROSBAG V2.0"])
def test_a_damaged_file_is_one_sentence(tmp_path, magic):
    path = tmp_path / "log.bin"
    path.write_bytes(magic + bytes(range(200)))
    try:
        with pytest.raises(LogError, match=r"not a complete|has no channels"):
            open_source(path)
    except ImportError as error:
        pytest.skip(str(error))


def test_folders_sheets_and_files_that_are_not_there(tmp_path):
    with pytest.raises(LogError, match="is a folder"):
        open_source(tmp_path)
    (tmp_path / "log.xlsx").write_bytes(b"PK\x03\x04")
    with pytest.raises(LogError, match="spreadsheet"):
        open_source(tmp_path / "log.xlsx")
    with pytest.raises(FileNotFoundError, match="no file"):
        open_source(tmp_path / "nowhere.csv")
