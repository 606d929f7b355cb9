"""Addresses of published records, and how a copy is fetched into pooch's cache."""

from __future__ import annotations

from pathlib import Path
from typing import Any
from urllib.parse import quote

_DRIVE = "https://drive.google.com/uc?export=download&id={}"
_EMPS_ADDRESS = _DRIVE.format("1zwoXYa9-3f8NQ0ohzmjpF7UxbNgRTHkS")
_CED_ADDRESS = (
    "http://www.it.uu.se/research/publications/reports/2017-024/CoupledElectricDrivesDataSetAndReferenceModels.zip"
)
_KR300_ADDRESS = "https://raw.githubusercontent.com/JonasWeigand/Robot_Identification"
_KR300_COMMIT = "454c8e6d4f6f9a9ec0b2fcb10b4cb958ac702e55"
KR300_FOLDER = "data/recorded_trajectories/2020-10-21 10s FF {} 08ms"


def download_emps() -> Path | None:
    """Fetch and unpack the EMPS archive; None without pooch or the network."""
    return _folder_of("DATA_EMPS.mat", _EMPS_ADDRESS, "EMPS.zip")


def download_silverbox() -> Path | None:
    """Fetch and unpack the Silverbox' archive; None without pooch or the network."""
    return _folder_of("SNLS80mV.mat", _DRIVE.format("17iS-6oBUUgrmiAcrZoG9S5sOaljZnDSy"), "SilverboxFiles.zip")


def download_cascaded_tanks() -> Path | None:
    """Fetch and unpack the archive of the cascaded tanks; None without pooch or the network."""
    return _folder_of("dataBenchmark.mat", _DRIVE.format("1HnQf_gu0g_UlggoBqy2s34l9YJiFdN01"), "CascadedTanksFiles.zip")


def download_coupled_drives() -> Path | None:
    """Fetch and unpack the archive of the coupled electric drives; None without pooch or the network."""
    return _folder_of("DATAUNIF.MAT", _CED_ADDRESS, "CoupledElectricDrives.zip")


def _folder_of(wanted: str, address: str, archive: str) -> Path | None:
    """Path of a file after its archive was fetched and unpacked; None without pooch or the network."""
    pooch = _pooch()
    if pooch is None:
        return None
    try:
        files = pooch.retrieve(
            address, known_hash=None, fname=archive, path=pooch.os_cache("whsklearn"), processor=pooch.Unzip()
        )
    except Exception:  # whatever the network does wrong, the message of the caller says what to do
        return None
    return {Path(f).name: Path(f).parent for f in files}.get(wanted)


def download_kr300() -> Path | None:
    """Fetch the three files of the KR300; None without pooch or the network."""
    pooch = _pooch()
    if pooch is None:
        return None
    cache = Path(pooch.os_cache("whsklearn")) / "kr300"
    try:
        for name in "ABC":
            place = KR300_FOLDER.format(name)
            address = f"{_KR300_ADDRESS}/{_KR300_COMMIT}/{quote(place)}/data.mat"
            pooch.retrieve(address, known_hash=None, fname="data.mat", path=cache / Path(place).name)
    except Exception:  # whatever the network does wrong, the message of the caller says what to do
        return None
    return cache


def _pooch() -> Any:
    """The downloader; None if it is not installed."""
    try:
        import pooch
    except ImportError:
        return None
    return pooch
