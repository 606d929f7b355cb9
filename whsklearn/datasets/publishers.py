"""Published records: where they are looked for, and how a copy is fetched into pooch's cache.

The folder is the argument of a loader, or the environment variable ``WHSKLEARN_DATA``.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from urllib.parse import quote

_DRIVE = "https://drive.google.com/uc?export=download&id="
_PAGE = "https://www.nonlinearbenchmark.org/benchmarks/"
KR300_FOLDER = "data/recorded_trajectories/2020-10-21 10s FF {} 08ms"
_KR300_COMMIT = "454c8e6d4f6f9a9ec0b2fcb10b4cb958ac702e55"
_KR300_FILES = f"https://raw.githubusercontent.com/JonasWeigand/Robot_Identification/{_KR300_COMMIT}/"


@dataclass(frozen=True)
class Publication:
    """The records of one publisher."""

    # name, wanted, page: what they are called, the files that a folder should hold, and where a person gets them
    name: str
    wanted: str
    page: str
    folders: tuple[str, ...]  # where the files may be below the user's folder; they may also lie directly in it
    fetch: Callable[[Any], Path | None]  # from pooch to the folder of the files, or None

    def folder(self, given: str | os.PathLike[str] | None, download: bool, complete: Callable[[Path], object]) -> Path:
        """The first folder for which ``complete`` is true, or that of the files which the publisher sends.

        Raises
        ------
        FileNotFoundError
            If there is none; the message says where the records are to be had.
        """
        root = given if given is not None else os.environ.get("WHSKLEARN_DATA")
        places = [Path(root) / name for name in (*self.folders, "")] if root else []
        found = next(filter(complete, places), None) or (self.fetched() if download else None)
        if found is not None:
            return found
        where = (
            f"{given} does not hold" if given is not None else "No folder was given and WHSKLEARN_DATA does not hold"
        )
        raise FileNotFoundError(
            f"The {self.name} records are not here: {where} {self.wanted}; get them from {self.page} and name their "
            "folder."
        )

    def fetched(self) -> Path | None:
        """The folder of the publisher's files in the cache; None without pooch or the network."""
        try:
            import pooch

            return self.fetch(pooch)
        except Exception:  # whatever the network does wrong, the message above says what to do
            return None


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
        place = f"{KR300_FOLDER.format(name)}/data.mat"
        folder = cache / Path(place).parent.name
        pooch.retrieve(f"{_KR300_FILES}{quote(place)}", known_hash=None, fname="data.mat", path=folder)
    return cache


EMPS = Publication(
    "EMPS", "emps/emps_train.csv and emps/emps_test.csv", f"{_PAGE}emps", ("emps",),
    _archive("DATA_EMPS.mat", "EMPS.zip", f"{_DRIVE}1zwoXYa9-3f8NQ0ohzmjpF7UxbNgRTHkS"),
)  # fmt: skip
KR300 = Publication(
    "KR300", "kr300/kr300_axis1_A.csv, _B and _C", "https://github.com/JonasWeigand/Robot_Identification", ("kr300",),
    _kr300,
)  # fmt: skip
SILVERBOX = Publication(
    "silverbox", "SNLS80mV.mat", f"{_PAGE}silverbox", ("silverbox", "SilverboxFiles"),
    _archive("SNLS80mV.mat", "SilverboxFiles.zip", f"{_DRIVE}17iS-6oBUUgrmiAcrZoG9S5sOaljZnDSy"),
)  # fmt: skip
CASCADED_TANKS = Publication(
    "cascaded tanks", "dataBenchmark.mat", f"{_PAGE}cascaded-tanks", ("cascaded_tanks", "CascadedTanksFiles"),
    _archive("dataBenchmark.mat", "CascadedTanksFiles.zip", f"{_DRIVE}1HnQf_gu0g_UlggoBqy2s34l9YJiFdN01"),
)  # fmt: skip
COUPLED_DRIVES = Publication(
    "coupled electric drives", "DATAUNIF.mat", f"{_PAGE}coupled-electric-drives", ("ced",),
    _archive(
        "DATAUNIF.MAT", "CoupledElectricDrives.zip", "http://www.it.uu.se/research/publications/reports/2017-024/"
        "CoupledElectricDrivesDataSetAndReferenceModels.zip",
    ),
)  # fmt: skip
