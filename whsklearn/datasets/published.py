"""Published records, none of which is shipped: from a local folder, or from their publishers through pooch.

The folder is the argument of a loader, or the environment variable ``WHSKLEARN_DATA``.
"""

from __future__ import annotations

import hashlib
import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any
from urllib.parse import quote

import numpy as np
from sklearn.utils import Bunch

from whsklearn.effects.base import Array

if TYPE_CHECKING:
    import pandas as pd


_DRIVE = "https://drive.google.com/uc?export=download&id="
_PAGE = "https://www.nonlinearbenchmark.org/benchmarks/"
_KR300_FOLDER = "data/recorded_trajectories/2020-10-21 10s FF {} 08ms"
_KR300_COMMIT = "454c8e6d4f6f9a9ec0b2fcb10b4cb958ac702e55"
_KR300_ADDRESS = f"https://raw.githubusercontent.com/JonasWeigand/Robot_Identification/{_KR300_COMMIT}/"


@dataclass(frozen=True)
class _Publication:
    """The records of one publisher."""

    # name, wanted, page: what they are called, the files that a folder should hold, and where a person gets them
    name: str
    wanted: str
    page: str
    folders: tuple[str, ...]  # where the files may be below the user's folder; they may also lie directly in it
    fetch: Callable[[Any], Path | None]  # from pooch to the folder of the files, or None

    def folder(self, given: str | os.PathLike[str] | None, download: bool, complete: Callable[[Path], object]) -> Path:
        """The first folder for which ``complete`` is true, or that of the files which the publisher sends.

        Raises FileNotFoundError if there is none; the message says where the records are to be had.
        """
        root = given if given is not None else os.environ.get("WHSKLEARN_DATA")
        places = [Path(root) / name for name in (*self.folders, "")] if root else []
        found = next(filter(complete, places), None) or (self.fetched() if download else None)
        if found is not None:
            return found
        where = given if given is not None else "No folder was given and WHSKLEARN_DATA"
        raise FileNotFoundError(
            f"The {self.name} records are not here: {where} does not hold {self.wanted}; get them from {self.page} and "
            "name their folder."
        )

    def fetched(self) -> Path | None:
        """The folder of the publisher's files in the cache; None without pooch or the network."""
        try:
            import pooch

            return self.fetch(pooch)
        except Exception:  # whatever the network does wrong, the message above says what to do
            return None


@dataclass(frozen=True)
class _Frames(_Publication):
    """Records that are read as frames, and have a checksum."""

    files: dict[str, tuple[str, str]]  # of each, as CSV and as MAT
    columns: list[str]
    read_mat: Callable[[Path], Array]


def _archive(wanted: str, archive: str, address: str) -> Callable[[Any], Path | None]:
    """Fetch and unpack an archive; the folder is that of one of its files."""

    def fetch(pooch: Any) -> Path | None:
        cache = pooch.os_cache("whsklearn")
        files = pooch.retrieve(address, known_hash=None, fname=archive, path=cache, processor=pooch.Unzip())
        return {Path(f).name: Path(f).parent for f in files}.get(wanted)

    return fetch


def _kr300(pooch: Any) -> Path:
    """Fetch the three files of one commit, each into a folder of its own."""
    cache = Path(pooch.os_cache("whsklearn")) / "kr300"
    for name in "ABC":
        place = f"{_KR300_FOLDER.format(name)}/data.mat"
        folder = cache / Path(place).parent.name
        pooch.retrieve(f"{_KR300_ADDRESS}{quote(place)}", known_hash=None, fname="data.mat", path=folder)
    return cache


def _columns(frame: pd.DataFrame, names: list[str], path: Path) -> Array:
    """Columns of a table by name, (n, n_names)."""
    if absent := [n for n in names if n not in frame.columns]:
        there = ", ".join(map(str, frame.columns))
        raise ValueError(f"{path.name} has no column {', '.join(absent)}; it has: {there}.")
    return frame[names].to_numpy(dtype=float)


def _from_mat(path: Path, names: Sequence[str], within: str = "") -> list[Array]:
    """Signals of a publisher's MAT file by name, in the struct ``within`` if it has one."""
    from scipy.io import loadmat

    try:
        found = loadmat(path, simplify_cells=bool(within))
    except NotImplementedError:
        raise ValueError(f"{path.name} is in MATLAB's format 7.3; save it in format 7 and read it again.") from None
    found, prefix = (found.get(within, {}), f"{within}.") if within else (found, "")
    if absent := [prefix + n for n in names if n not in found]:
        raise ValueError(f"{path.name} has no signal {', '.join(absent)}; expected the publishers' file.")
    return [np.asarray(found[n], dtype=float) for n in names]


FORCE_PER_VOLT = 35.15065188248547
# What the publishers' own programs read from ``rec`` in data.mat: one row per axis, one column per 4 ms.
_KR300_FIELDS = (
    "act_torque_abs_nm act_pos_mot_deg act_vel_mot_deg_per_s act_pos_se_deg act_vel_se_deg_per_s ref_pos_deg"
).split()


def _read_emps_mat(path: Path) -> Array:
    """The columns of a record from the publishers' file."""
    drive, position, reference = (x.ravel() for x in _from_mat(path, ("vir", "qm", "qg")))
    return np.column_stack([np.arange(len(drive)) / 1000.0, drive, FORCE_PER_VOLT * drive, position, reference])


def _read_kr300_mat(path: Path) -> Array:
    """The columns of the first axis from the publishers' file of all six."""
    axis = [np.atleast_2d(x)[0] for x in _from_mat(path, _KR300_FIELDS, "rec")]
    return np.column_stack([np.arange(axis[0].size) / 250.0, *axis])


# SHA-256 of the numbers, each as nine significant digits, so that CSV and MAT files of one record agree.
_SUMS = {
    "emps_train.csv": "f1d23e381b0257c2b4cb810ce23101d4827caaff77924504662e52771e8c97b2",
    "emps_test.csv": "b19fe36e6211fa2b3b45b7e4af8712fb0ca484a1984ba28869b900973463f3c7",
    "kr300_axis1_A.csv": "e79d29d879343f04492ab5b24b34a4d065f4c9249fa9a1ab72d582d8112f5d80",
    "kr300_axis1_B.csv": "77e75c1f266dfbadcbf37d1383fcd75d2a5a4fd8a009028071306fa8ada3db3d",
    "kr300_axis1_C.csv": "136865c4d63698eb8d94845097c049814886442ddfcf208c898e652424dd6813",
}
EMPS = _Frames(
    "EMPS", "emps/emps_train.csv and emps/emps_test.csv", f"{_PAGE}emps", ("emps",),
    _archive("DATA_EMPS.mat", "EMPS.zip", f"{_DRIVE}1zwoXYa9-3f8NQ0ohzmjpF7UxbNgRTHkS"),
    {"train": ("emps_train.csv", "DATA_EMPS.mat"), "test": ("emps_test.csv", "DATA_EMPS_PULSES.mat")},
    ["time_s", "drive_V", "force_N", "position_m", "reference_m"], _read_emps_mat,
)  # fmt: skip
KR300 = _Frames(
    "KR300", "kr300/kr300_axis1_A.csv, _B and _C", "https://github.com/JonasWeigand/Robot_Identification", ("kr300",),
    _kr300,
    {k: (f"kr300_axis1_{k}.csv", f"{Path(_KR300_FOLDER.format(k)).name}/data.mat") for k in "ABC"},
    [
        "time_s", "motor_torque_Nm", "motor_position_deg", "motor_velocity_deg_s", "load_position_deg",
        "load_velocity_deg_s", "reference_deg",
    ], _read_kr300_mat,
)  # fmt: skip
SILVERBOX = _Publication(
    "silverbox", "SNLS80mV.mat", f"{_PAGE}silverbox", ("silverbox", "SilverboxFiles"),
    _archive("SNLS80mV.mat", "SilverboxFiles.zip", f"{_DRIVE}17iS-6oBUUgrmiAcrZoG9S5sOaljZnDSy"),
)  # fmt: skip
CASCADED_TANKS = _Publication(
    "cascaded tanks", "dataBenchmark.mat", f"{_PAGE}cascaded-tanks", ("cascaded_tanks", "CascadedTanksFiles"),
    _archive("dataBenchmark.mat", "CascadedTanksFiles.zip", f"{_DRIVE}1HnQf_gu0g_UlggoBqy2s34l9YJiFdN01"),
)  # fmt: skip
COUPLED_DRIVES = _Publication(
    "coupled electric drives", "DATAUNIF.mat", f"{_PAGE}coupled-electric-drives", ("ced",),
    _archive(
        "DATAUNIF.MAT", "CoupledElectricDrives.zip", "http://www.it.uu.se/research/publications/reports/2017-024/"
        "CoupledElectricDrivesDataSetAndReferenceModels.zip",
    ),
)  # fmt: skip


# --- records of nonlinearbenchmark.org with one input and one output, in volts, with the usual splits ----------------
# The splits are those of the publishers' own loader (``nonlinear_benchmarks``); files are read as published, from a
# local folder or through pooch. They could not be fetched when this was written, so addresses and names in the files
# are from the source code of that loader, and there is no checksum.
def fetch_silverbox(folder: str | os.PathLike[str] | None = None, *, download: bool = True) -> Bunch:
    """The Silverbox: an electronic mass on a hardening spring, 610.35 Hz.

    Parameters
    ----------
    folder : str or path, optional
        Holds ``SNLS80mV.mat`` or ``SNLS80mV.csv``, directly, in ``silverbox/`` or in ``SilverboxFiles/``;
        ``WHSKLEARN_DATA`` by default.
    download : bool, default=True
        Fetch the publishers' archive if no folder has it; needs pooch and the network.

    Returns
    -------
    Bunch
        Pairs (u, y): ``train`` and ``test_multisine``, three quarters of the multisines and the remaining ones,
        ``test_arrow`` and ``test_arrow_inside``, the part whose amplitudes do not exceed those of ``train``;
        ``sample_rate``, ``citation``.

    Raises
    ------
    FileNotFoundError
        If the records are neither in a folder nor can be fetched; the message says where they are.
    ValueError
        If a file lacks a signal.

    References
    ----------
    Wigren and Schoukens 2013, Three free data sets for development and benchmarking in nonlinear system
    identification, ECC, 2933-2938.

    Examples
    --------
    >>> from whsklearn.datasets import fetch_silverbox
    >>> try:
    ...     fetch_silverbox("nowhere", download=False)
    ... except FileNotFoundError as error:
    ...     print("SNLS80mV" in str(error))
    True
    """
    u, y = _signals(SILVERBOX, folder, download, ["V1", "V2"])
    arrow, sines = slice(100, 40_575), slice(40_650, 127_400)
    cut = int(0.75 * u[sines].size)
    return Bunch(
        train=(u[sines][:cut], y[sines][:cut]),
        test_multisine=(u[sines][cut:], y[sines][cut:]),
        test_arrow=(u[arrow], y[arrow]),
        test_arrow_inside=(u[arrow][:32_000], y[arrow][:32_000]),
        sample_rate=1e7 / 2**14,
        citation="T. Wigren, J. Schoukens: Three free data sets for development and benchmarking in nonlinear system "
        "identification. European Control Conference, 2013, 2933-2938.",
    )


def fetch_coupled_drives(folder: str | os.PathLike[str] | None = None, *, download: bool = True) -> Bunch:
    """The coupled electric drives, whose sensor reads |speed|, 50 Hz.

    Parameters
    ----------
    folder : str or path, optional
        Holds ``DATAUNIF.MAT`` or ``DATAUNIF.csv``, directly or in ``ced/``; ``WHSKLEARN_DATA`` by default.
    download : bool, default=True
        As for `fetch_silverbox`.

    Returns
    -------
    Bunch
        ``train`` and ``test``, two pairs (u, y) each, of a small and a large input: the first 400 samples and the
        last 100; ``sample_rate``, ``citation``.

    References
    ----------
    Wigren and Schoukens 2017, Coupled Electric Drives Data Set and Reference Models, Uppsala University 2017-024.
    """
    u11, u12, z11, z12 = _signals(COUPLED_DRIVES, folder, download, ["u11", "u12", "z11", "z12"])
    both = ((u11, z11), (u12, z12))
    return Bunch(
        train=tuple((u[:400], y[:400]) for u, y in both),
        test=tuple((u[400:], y[400:]) for u, y in both),
        sample_rate=50.0,
        citation="T. Wigren, M. Schoukens: Coupled Electric Drives Data Set and Reference Models. Uppsala University, "
        "2017-024.",
    )


def fetch_cascaded_tanks(folder: str | os.PathLike[str] | None = None, *, download: bool = True) -> Bunch:
    """Two tanks, one above the other, that overflow; pump voltage to level, 0.25 Hz.

    A level that stays at 10 V is an overflow, not a clipped reading.

    Parameters
    ----------
    folder : str or path, optional
        Holds ``dataBenchmark.mat`` or ``dataBenchmark.csv``, directly, in ``cascaded_tanks/`` or in
        ``CascadedTanksFiles/``; ``WHSKLEARN_DATA`` by default.
    download : bool, default=True
        As for `fetch_silverbox`.

    Returns
    -------
    Bunch
        ``train`` and ``test``, pairs (u, y); ``sample_rate``, ``citation``.

    References
    ----------
    Schoukens, Mattson, Wigren and Noel 2016, Cascaded tanks benchmark combining soft and hard nonlinearities.
    """
    u, v, y, z = _signals(CASCADED_TANKS, folder, download, ["uEst", "uVal", "yEst", "yVal"])
    return Bunch(
        train=(u, y),
        test=(v, z),
        sample_rate=0.25,
        citation="M. Schoukens, P. Mattson, T. Wigren, J.P. Noel: Cascaded tanks benchmark combining soft and hard "
        "nonlinearities. Workshop on Nonlinear System Identification Benchmarks, Brussels, 2016.",
    )


def _signals(
    record: _Publication, folder: str | os.PathLike[str] | None, download: bool, names: list[str]
) -> list[Array]:
    """Signals (n,) of a benchmark's file by name; MAT goes before CSV, the extension in any case."""

    def files(where: Path) -> list[Path]:
        found = where.glob(f"{Path(record.wanted).stem}.*")
        return sorted((p for p in found if p.suffix.lower() in (".mat", ".csv")), key=lambda p: p.suffix.lower())

    path = files(record.folder(folder, download, files))[-1]
    if path.suffix.lower() == ".mat":
        rows = np.column_stack([np.ravel(x) for x in _from_mat(path, names)])
    else:
        import pandas as pd

        rows = _columns(pd.read_csv(path, skipinitialspace=True).rename(columns=str.strip), names, path)
    return list(rows[np.isfinite(rows).all(axis=1)].T)


# --- measured records of real axes, from a local folder or from their publishers; none of them is shipped ------------
def fetch_emps(folder: str | os.PathLike[str] | None = None, *, download: bool = True, verify: bool = True) -> Bunch:
    """The two records of the EMPS benchmark, a measured ball-screw axis.

    Parameters
    ----------
    folder : str or path, optional
        Holds ``emps_train.csv`` and ``emps_test.csv``, or the publishers' ``DATA_EMPS.mat`` and
        ``DATA_EMPS_PULSES.mat``, directly or in ``emps/``; ``WHSKLEARN_DATA`` by default.
    download : bool, default=True
        Fetch the publishers' files if no folder has them; needs pooch and the network.
    verify : bool, default=True
        Compare the numbers with the checksum of the published record.

    Returns
    -------
    Bunch
        ``train`` and ``test``, frames with ``time_s drive_V force_N position_m reference_m``;
        ``sample_rate`` in Hz, ``force_per_volt`` in N/V, ``units``, ``description``, ``citation``.

    Raises
    ------
    FileNotFoundError
        If the records are neither in a folder nor can be fetched; the message says where they are.
    ValueError
        If a file lacks a column or its numbers differ from the published ones.

    Examples
    --------
    >>> from whsklearn.datasets import fetch_emps
    >>> try:
    ...     fetch_emps("nowhere", download=False)
    ... except FileNotFoundError as error:
    ...     print("emps_train.csv" in str(error))
    True
    """
    frames = _frames(EMPS, folder, download, verify)
    return Bunch(
        **frames,
        sample_rate=1000.0,
        force_per_volt=FORCE_PER_VOLT,
        units={"time": "s", "drive": "V", "force": "N", "position": "m", "reference": "m"},
        description="Electro-mechanical positioning system (EMPS): a carriage on a ball screw, 1 kHz, two records of "
        "24.8 s under proportional-derivative control. ``train`` is DATA_EMPS, ``test`` is DATA_EMPS_PULSES, the same "
        "reference with force pulses, which are contained in ``drive_V``. force_N = 35.15065 N/V x drive_V.",
        citation="A. Janot, M. Gautier, M. Brunot: Data Set and Reference Models of EMPS. Workshop on Nonlinear System "
        "Identification Benchmarks, Eindhoven, 2019.",
    )


def fetch_kr300(folder: str | os.PathLike[str] | None = None, *, download: bool = True, verify: bool = True) -> Bunch:
    """Axis 1 of an industrial robot, a geared turntable with encoders on motor and load.

    Parameters
    ----------
    folder : str or path, optional
        Holds ``kr300_axis1_A.csv``, ``_B`` and ``_C``, or the publishers' folders
        ``2020-10-21 10s FF A 08ms`` and so on with a ``data.mat`` in each, directly or in ``kr300/``;
        ``WHSKLEARN_DATA`` by default.
    download, verify : bool, default=True
        As for `fetch_emps`.

    Returns
    -------
    Bunch
        ``A``, ``B`` and ``C``, frames with ``time_s motor_torque_Nm motor_position_deg
        motor_velocity_deg_s load_position_deg load_velocity_deg_s reference_deg``; ``sample_rate``
        in Hz, ``gear``, ``units``, ``description``, ``citation``.

    Notes
    -----
    The address is that of one commit of the publishers' repository, and the layout of ``data.mat`` is the one that
    their programs read (``rec``: six rows, one per axis). Both are taken from their sources. The download could not be
    tried when this was written, so the checksum of the numbers decides.

    Examples
    --------
    >>> from whsklearn.datasets import fetch_kr300
    >>> try:
    ...     fetch_kr300("nowhere", download=False)
    ... except FileNotFoundError as error:
    ...     print("kr300" in str(error))
    True
    """
    frames = _frames(KR300, folder, download, verify)
    return Bunch(
        **frames,
        sample_rate=250.0,
        gear=256.857,
        units={"time": "s", "torque": "Nm", "position": "deg", "velocity": "deg/s", "reference": "deg"},
        description="Axis 1 of a KUKA KR300, a turntable: vertical axis, gear 256.857:1, encoders on motor and load, "
        "250 Hz, three records of 10 s, in which the other joints move too. The torque is that of the motor, positions "
        "are in degrees of the load. ``A`` is for identification, ``B`` and ``C`` for validation.",
        citation="J. Weigand, J. Ulmen, A. Janot, M. Ruskowski, 2021: Robot Identification, records of a KUKA KR300. "
        "MIT licence. Not the benchmark that followed it (Weigand, Goetz, Ulmen, Ruskowski 2022, "
        "doi 10.26204/DATA/5), which has other records.",
    )


def _frames(
    record: _Frames, folder: str | os.PathLike[str] | None, download: bool, verify: bool
) -> dict[str, pd.DataFrame]:
    """Every record, from the first place where it is found: a folder, or its publishers."""
    import pandas as pd

    def complete(where: Path) -> bool:
        return all((where / csv).is_file() or (where / mat).is_file() for csv, mat in record.files.values())

    where = record.folder(folder, download, complete)
    measured = [c for c in record.columns if c not in ("time_s", "force_N")]  # those two are computed
    frames = {}
    for name, (csv, mat) in record.files.items():
        if (path := where / csv).is_file():
            table = _columns(pd.read_csv(path), record.columns, path)
        else:
            path = where / mat
            table = record.read_mat(path)
        frame = frames[name] = pd.DataFrame(table, columns=record.columns)
        if verify and checksum(frame[measured]) != _SUMS[csv]:
            raise ValueError(
                f"The numbers in {path.name} are not those of the published record; get the file again, or pass "
                "verify=False to use it as it is."
            )
    return frames


def checksum(frame: pd.DataFrame) -> str:
    """SHA-256 of a frame's numbers, each written with nine significant digits."""
    lines = (",".join(f"{x:.9g}" for x in row) for row in frame.itertuples(index=False))
    return hashlib.sha256("\n".join(lines).encode()).hexdigest()
