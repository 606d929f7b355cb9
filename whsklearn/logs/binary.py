"""Logs in binary files: Parquet, Feather, MATLAB, HDF5, NumPy, TDMS (National Instruments) and MDF (ASAM)."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any, cast
from zipfile import BadZipFile

import numpy as np

from whsklearn.logs.errors import LogError, damaged
from whsklearn.logs.source import Column, Source

_UNIT_KEYS = {b"unit", b"units"}  # in the metadata of a column of Parquet


def open_parquet(path: Path) -> Source:
    """A Parquet file; a column of lists becomes one column per element, ``state.0``."""
    from pyarrow import ArrowException
    from pyarrow.parquet import ParquetFile

    with damaged(path, "Parquet file", ArrowException, OSError):
        file = ParquetFile(path)
        schema = file.schema_arrow
        lists = [n for n in schema.names if "list" in str(schema.field(n).type)]
        first = next(file.iter_batches(1, columns=lists)).to_pylist() if lists and file.metadata.num_rows else [{}]
        width = {n: len(first[0].get(n) or []) for n in lists}
    names = [n for n in schema.names if n not in width]
    names += [f"{n}.{i}" for n, k in width.items() for i in range(k)]

    def fetch(wanted: Sequence[str]) -> dict[str, Column]:
        out = {}
        for name in wanted:
            stem, _, number = name.rpartition(".")
            if stem in width:
                rows = file.read([stem]).column(stem).to_pylist()
                out[name] = Column(np.array([v[int(number)] if v else np.nan for v in rows], dtype=float))
            else:
                out[name] = Column(file.read([name]).column(name).to_pandas().to_numpy())
        return out

    kept = {n: schema.field(n).metadata or {} for n in names if n not in width and n in schema.names}
    units = {n: next((v.decode() for k, v in of.items() if k.lower() in _UNIT_KEYS), "") for n, of in kept.items()}
    return Source(path.name, names, fetch, units={n: u for n, u in units.items() if u})


def open_feather(path: Path) -> Source:
    """A Feather file, the Arrow format of version 2."""
    from pyarrow import ArrowException, feather

    with damaged(path, "Feather file", ArrowException, OSError):
        table = feather.read_table(path)
    return Source.of_arrays(path.name, table.to_pandas(ignore_metadata=True))


def open_matlab(path: Path) -> Source:
    """A MATLAB file, including version 7.3; fields of structures are ``log.torque``, columns of a matrix ``data.0``."""
    with path.open("rb") as file:
        if file.read(512).startswith(b"MATLAB 7.3"):
            return open_hdf5(path)
    from scipy.io import loadmat
    from scipy.io.matlab import MatReadError

    with damaged(path, "MATLAB file", MatReadError, ValueError, TypeError, OSError, NotImplementedError):
        data = loadmat(path, squeeze_me=True, struct_as_record=False)
    flat: dict[str, Any] = {}
    for name, value in data.items():
        if not name.startswith("__"):
            _flatten(flat, name, value)
    return _of_arrays(path, flat)


def _flatten(out: dict[str, Any], name: str, value: Any, depth: int = 0) -> None:
    """Numeric arrays by path; elements of cells and of structure arrays are numbered from 0."""
    if hasattr(value, "_fieldnames") and depth < 6:
        if {"values", "label"} <= set(value._fieldnames) and str(value.label).strip():  # "structure with time"
            called = f"{re.sub(r'[.][0-9]+$', '', name)}.{str(value.label).strip()}"
            if called not in out:
                _flatten(out, called, value.values, depth + 1)
                return
        for field in value._fieldnames:
            _flatten(out, f"{name}.{field}", getattr(value, field), depth + 1)
        return
    array = np.asarray(value)
    if array.dtype == object and array.size <= 256 and depth < 6:
        for i, item in enumerate(array.ravel()):
            _flatten(out, f"{name}.{i}", item, depth + 1)
        return
    if array.dtype.kind in "fiub" and array.size > 1:
        _columns(out, name, array)


def _columns(out: dict[str, Any], name: str, array: Any) -> None:
    """A vector as it is, or a matrix column by column; the longer side is time."""
    array = np.squeeze(array)
    if array.ndim == 1:
        out[name] = array
    elif array.ndim == 2 and min(array.shape) <= 256:
        table = array if array.shape[0] >= array.shape[1] else array.T
        out.update({f"{name}.{i}": table[:, i] for i in range(table.shape[1])})


def _of_arrays(path: Path, flat: dict[str, Any]) -> Source:
    """A source of arrays in memory."""
    if not flat:
        raise LogError(f"{path.name} holds no vector of numbers; save time, drive and position as vectors.")
    return Source.of_arrays(path.name, flat)


def open_numpy(path: Path) -> Source:
    """A NumPy archive of vectors, without pickled objects; the columns of a matrix are ``data.0``."""
    flat: dict[str, Any] = {}
    with damaged(path, "NumPy file", ValueError, OSError, EOFError, KeyError, BadZipFile):
        data = np.load(path, allow_pickle=False)
        if isinstance(data, np.ndarray):
            parts = {"data": data}
        else:
            with data:
                parts = dict(data)
    for name, value in parts.items():
        if value.dtype.names:
            flat.update({f: value[f] for f in value.dtype.names})
        elif value.dtype.kind in "fiub" and value.size > 1:
            _columns(flat, name, value)
    return _of_arrays(path, flat)


def open_hdf5(path: Path) -> Source:
    """An HDF5 file: data sets by their paths, columns of a matrix as ``group/data.0``, fields of records likewise."""
    import h5py

    places: dict[str, tuple[str, Any]] = {}  # data set, and where in it
    units: dict[str, str] = {}

    def note(name: str, item: Any) -> None:
        if not isinstance(item, h5py.Dataset) or item.size < 2:
            return
        if item.dtype.names:
            places.update({f"{name}.{f}": (name, f) for f in item.dtype.names})
        elif item.dtype.kind in "fiub":
            shape = tuple(n for n in item.shape if n > 1)
            if len(shape) == 1:
                places[name] = (name, ())
            elif len(shape) == 2 and min(shape) <= 256 and len(item.shape) == 2:
                tall = shape[0] >= shape[1]
                places.update({f"{name}.{i}": (name, np.s_[:, i] if tall else i) for i in range(min(shape))})
        named = {str(k).lower(): v for k, v in item.attrs.items()}
        stated = np.atleast_1d(np.asarray(named.get("unit", named.get("units", []))))
        columns = [c for c, (dataset, _) in places.items() if dataset == name]
        if len(stated) == len(columns):  # one for the data set, or one for each of its columns
            texts = [u.decode() if isinstance(u, bytes) else str(u) for u in stated]
            units.update({c: u for c, u in zip(columns, texts, strict=True) if u})

    with damaged(path, "HDF5 file", OSError), h5py.File(path, "r") as file:
        file.visititems(note)
    if not places:
        raise LogError(f"{path.name} holds no vector of numbers; save time, drive and position as data sets.")

    def fetch(wanted: Sequence[str]) -> dict[str, Column]:
        with h5py.File(path, "r") as file:
            return {w: Column(np.squeeze(file[places[w][0]][places[w][1]])) for w in wanted}

    return Source(path.name, list(places), fetch, units=units)


def open_tdms(path: Path) -> Source:
    """A TDMS file: channels are ``group/channel``, or ``channel`` if the name is unique."""
    from nptdms import TdmsFile

    with damaged(path, "TDMS file", ValueError, OSError, EOFError, KeyError), TdmsFile.read_metadata(path) as file:
        channels = [(g.name, c.name, c.properties) for g in file.groups() for c in g.channels()]
    once = [c for _, c, _ in channels]
    where = {c if once.count(c) == 1 else f"{g}/{c}": (g, c, told) for g, c, told in channels}
    units = {n: str(told["unit_string"]) for n, (_, _, told) in where.items() if told.get("unit_string")}
    if not where:
        raise LogError(f"{path.name} has no channels; record the log again.")

    def fetch(wanted: Sequence[str]) -> dict[str, Column]:
        with TdmsFile.open(path) as file:
            out = {}
            for name in wanted:
                group, called, told = where[name]
                channel = file[group][called]
                values = channel[:]
                # Without a waveform increment, the stamps are a separate channel.
                stamps = channel.time_track() if told.get("wf_increment") and len(values) else None
                out[name] = Column(np.asarray(values), stamps)
            return out

    return Source(path.name, list(where), fetch, units=units)


def open_mdf(path: Path) -> Source:
    """An MDF file, version 3 or 4: channels with the stamps of their group."""
    from asammdf import MDF

    with path.open("rb") as raw:
        head = raw.read(68)
    where: dict[str, tuple[int, int]] = {}
    units: dict[str, str] = {}
    with damaged(path, "MDF file", Exception):  # asammdf raises any error of its parser, such as a bare struct.error
        if b"HD" not in head[64:68]:  # it would leave behind a partly built object, which raises when it is deleted
            raise ValueError("no header block")
        with MDF(path) as file:
            for g, group in enumerate(cast("Any", file.groups)):
                master = file.masters_db.get(g)
                for i, channel in enumerate(group.channels):
                    if i == master:
                        continue
                    name = channel.name if channel.name not in where else f"{channel.name}.{g}"
                    where[name] = (g, i)
                    unit = getattr(channel, "unit", "") or getattr(getattr(channel, "conversion", None), "unit", "")
                    if unit:
                        units[name] = str(unit)
    if not where:
        raise LogError(f"{path.name} has no channels; record the log again.")

    def fetch(wanted: Sequence[str]) -> dict[str, Column]:
        with MDF(path) as file:
            out = {}
            for name in wanted:
                signal = file.get(group=where[name][0], index=where[name][1])
                out[name] = Column(np.asarray(signal.samples), np.asarray(signal.timestamps, dtype=float), signal.unit)
            return out

    return Source(path.name, list(where), fetch, units=units)
