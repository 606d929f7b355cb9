"""The format of a file, determined from its first bytes rather than its extension, and its reader."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path

from whsklearn.logs import binary, labelled, objects, packed, parts, robots, text
from whsklearn.logs.errors import LogError
from whsklearn.logs.source import Source

_MAGIC: tuple[tuple[bytes, Callable[[Path], Source]], ...] = (
    (b"PAR1", binary.open_parquet),
    (b"ARROW1", binary.open_feather),
    (b"\x89HDF", binary.open_hdf5),
    (b"MATLAB", binary.open_matlab),
    (b"\x93NUMPY", binary.open_numpy),
    (b"TDSm", binary.open_tdms),
    (b"MDF ", binary.open_mdf),
    (b"UnFinMF", binary.open_mdf),
    (b"\x89MCAP", robots.open_mcap),
    (b"#ROSBAG", robots.open_bag),
)
_BINARY = set(".parquet .pq .feather .h5 .hdf5 .npz .npy .tdms .mf4 .mdf .mcap .bag".split())  # all but MATLAB
# Module of an optional reader -> its package, and the extra that installs it.
_EXTRAS = {
    "pyarrow": ("pyarrow", "parquet"), "h5py": ("h5py", "logs"), "nptdms": ("npTDMS", "logs"),
    "asammdf": ("asammdf", "logs"), "mcap": ("mcap", "robots"), "mcap_ros2": ("mcap-ros2-support", "robots"),
    "rosbags": ("rosbags", "robots"),
}  # fmt: skip
_SHEETS = {".xlsx", ".xls", ".ods"}
_SCOPE = {".svdx", ".tcscopex", ".svbx"}  # no library can read them


def open_source(path: str | os.PathLike[str]) -> Source:
    r"""The columns of a log.

    Parameters
    ----------
    path : str or path
        A CSV of any dialect or JSON (also packed: gz, bz2, xz, zip), Parquet, MATLAB, HDF5, NumPy, TDMS, MDF4, MCAP or
        ROS 1 file, or the folder of a ROS 2 bag, of a LeRobot data set, or with a table for each signal.

    Returns
    -------
    Source

    Raises
    ------
    FileNotFoundError
        If there is no such file.
    ImportError
        If the format needs a package that is not installed; the message has the line that installs it.
    LogError
        If the file is empty, damaged or in an unknown format.

    Examples
    --------
    >>> import pathlib, tempfile
    >>> from whsklearn.logs import open_source
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = pathlib.Path(folder, "log.csv")
    ...     _ = path.write_text("time_s;torque_nm\n0,0;0,1\n0,1;0,2\n0,2;0,3\n")
    ...     open_source(path).names
    ['time_s', 'torque_nm']
    """
    file = Path(path)
    try:
        return parts.with_nanoseconds(_opened(file))
    except ModuleNotFoundError as error:
        module = (error.name or "").partition(".")[0]
        if module not in _EXTRAS:
            raise
        package, extra = _EXTRAS[module]
        raise ImportError(
            f"Reading {file.name} needs {package}; install it with `pip install 'whsklearn[{extra}]'`, or export CSV."
        ) from None


def _opened(file: Path) -> Source:
    """The reader that the first bytes ask for."""
    if file.is_dir():
        return _folder(file)
    if not file.exists():
        raise FileNotFoundError(f"There is no file {file}; give the path of a log, such as axis.csv.")
    if not file.is_file():
        raise LogError(f"{file} is a device or a pipe; copy the log into a file first.")
    ending = file.suffix.lower()
    if ending in _SHEETS:
        raise LogError(f"{file.name} is a spreadsheet; save its sheet as CSV.")
    if ending in _SCOPE:
        raise LogError(f"{file.name} is a TwinCAT Scope project; open it in Scope View and export its channels as CSV.")
    with file.open("rb") as stream:
        head = stream.read(512)
    for magic, reader in _MAGIC:
        if head.startswith(magic):
            return reader(file)
    if packed.is_packed(head):
        return _unpacked(file, head)
    if what := packed.foreign(head):
        raise LogError(f"{file.name} is {what}.")
    if ending == ".mat" and head:  # of version 4, without a signature
        return binary.open_matlab(file)
    if ending in _BINARY:
        raise LogError(f"{file.name} is {f'not a {ending[1:]} file: its first bytes differ' if head else 'empty'}.")
    return _of_text(file)


def _of_text(path: Path) -> Source:
    """JSON, lines of labelled numbers, or a table."""
    head = _inside(path)
    if objects.is_json(head):
        return objects.open_json(path)
    if labelled.is_labelled(head):
        return labelled.open_labelled(path)
    whole = parts.with_milliseconds(parts.with_nanoseconds(text.open_text(path)))
    return parts.by_motor(parts.by_signal(whole))


def _inside(path: Path) -> bytes:
    """The first bytes of a file, unpacked; none of a damaged one, which the reader of tables reports."""
    with packed.opened(path) as stream:
        try:
            return stream.read(4096)
        except packed.DAMAGE:
            return b""


def _unpacked(path: Path, head: bytes) -> Source:
    """A compressed log; NumPy archives are ZIP archives of binary."""
    if head.startswith(packed.ZIP) and all(n.endswith(".npy") for n in packed.members(path) or [""]):
        return binary.open_numpy(path)
    inside = _inside(path)
    if inside.startswith(tuple(magic for magic, _ in _MAGIC)):
        raise LogError(f"{path.name} is packed, and its content is not a text table; unpack it first.")
    if what := packed.foreign(inside):
        raise LogError(f"{path.name} is packed, and its content is {what}.")
    return _of_text(path)


def _folder(path: Path) -> Source:
    """The reader for a folder."""
    if (path / "meta" / "info.json").exists():
        return robots.open_lerobot(path)
    if (path / "metadata.yaml").exists():
        return robots.open_bag(path)
    return parts.open_folder(path, open_source)
