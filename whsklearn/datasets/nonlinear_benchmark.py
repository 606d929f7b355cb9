"""Records of nonlinearbenchmark.org with one input and one output, in volts, with the usual splits.

The splits are those of the publishers' own loader (``nonlinear_benchmarks``); files are read as published, from a local
folder or through pooch. They could not be fetched when this was written, so addresses and names in the files are from
the source code of that loader, and there is no checksum.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from sklearn.utils import Bunch

from whsklearn.datasets.publishers import CASCADED_TANKS, COUPLED_DRIVES, SILVERBOX, Publication
from whsklearn.effects.base import Array

if TYPE_CHECKING:
    pass


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
    >>> import tempfile
    >>> from whsklearn.datasets import fetch_silverbox
    >>> with tempfile.TemporaryDirectory() as empty:
    ...     try:
    ...         fetch_silverbox(empty, download=False)
    ...     except FileNotFoundError as error:
    ...         print("SNLS80mV" in str(error))
    True
    """
    path = _file(SILVERBOX, folder, download)
    u, y = _signals(path, ("V1", "V2"))
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

    Raises
    ------
    FileNotFoundError, ValueError
        As `fetch_silverbox`.

    References
    ----------
    Wigren and Schoukens 2017, Coupled Electric Drives Data Set and Reference Models, Uppsala University 2017-024.
    """
    path = _file(COUPLED_DRIVES, folder, download)
    u11, u12, z11, z12 = _signals(path, ("u11", "u12", "z11", "z12"))
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

    Raises
    ------
    FileNotFoundError, ValueError
        As `fetch_silverbox`.

    References
    ----------
    Schoukens, Mattson, Wigren and Noel 2016, Cascaded tanks benchmark combining soft and hard nonlinearities.
    """
    path = _file(CASCADED_TANKS, folder, download)
    u, v, y, z = _signals(path, ("uEst", "uVal", "yEst", "yVal"))
    return Bunch(
        train=(u, y),
        test=(v, z),
        sample_rate=0.25,
        citation="M. Schoukens, P. Mattson, T. Wigren, J.P. Noel: Cascaded tanks benchmark combining soft and hard "
        "nonlinearities. Workshop on Nonlinear System Identification Benchmarks, Brussels, 2016.",
    )


def _file(record: Publication, folder: str | os.PathLike[str] | None, download: bool) -> Path:
    """The file of a benchmark, as MAT before CSV, its extension in any case."""

    def files(where: Path) -> list[Path]:
        found = where.glob(f"{Path(record.wanted).stem}.*")
        return sorted((p for p in found if p.suffix.lower() in (".mat", ".csv")), key=lambda p: p.suffix.lower())

    return files(record.folder(folder, download, files))[-1]


def _signals(path: Path, names: Sequence[str]) -> list[Array]:
    """Signals (n,) of a published file by name."""
    if path.suffix.lower() == ".mat":
        from scipy.io import loadmat

        table = {k: np.ravel(v) for k, v in loadmat(path).items() if not k.startswith("__")}
    else:
        import pandas as pd

        frame = pd.read_csv(path, skipinitialspace=True)
        table = {str(k).strip(): frame[k].to_numpy() for k in frame.columns}
    if absent := [n for n in names if n not in table]:
        raise ValueError(f"{path.name} has no signal {', '.join(absent)}; expected the publishers' file.")
    rows = np.column_stack([table[n] for n in names]).astype(float)
    return list(rows[np.isfinite(rows).all(axis=1)].T)
