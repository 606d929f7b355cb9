"""Logs that are stored as arrays: Parquet, MATLAB, HDF5 and NumPy files."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any
from zipfile import BadZipFile

import numpy as np

from whsklearn.logs.errors import LogError
from whsklearn.logs.source import Column, Source


def missing(path: Path, package: str, extra: str) -> ImportError:
    """The error for an optional reader that is not installed."""
    return ImportError(
        f"Reading {path.name} needs {package}; install it with `pip install 'whsklearn[{extra}]'`, or export CSV."
    )


def open_parquet(path: Path) -> Source:
    """A Parquet file; a column of lists becomes one column per element, ``state.0``."""
    try:
        from pyarrow import ArrowException
        from pyarrow.parquet import ParquetFile
    except ImportError:
        raise missing(path, "pyarrow", "parquet") from None
    try:
        file = ParquetFile(path)
        schema = file.schema_arrow
        width = {n: _list_width(file, n) for n in schema.names if "list" in str(schema.field(n).type)}
    except (ArrowException, OSError) as error:
        raise _damaged(path, "Parquet", error) from None
    names = [n for n in schema.names if n not in width]
    names += [f"{n}.{i}" for n, k in width.items() for i in range(k)]

    def fetch(wanted: Sequence[str]) -> dict[str, Column]:
        out = {}
        for name in wanted:
            stem, _, number = name.rpartition(".")
            if stem in width:
                lists = file.read([stem]).column(stem).to_pylist()
                out[name] = Column(np.array([v[int(number)] if v else np.nan for v in lists], dtype=float))
            else:
                out[name] = Column(file.read([name]).column(name).to_pandas().to_numpy())
        return out

    return Source(path.name, names, fetch)


def open_feather(path: Path) -> Source:
    """A Feather file, the Arrow format of version 2."""
    try:
        from pyarrow import ArrowException, feather
    except ImportError:
        raise missing(path, "pyarrow", "parquet") from None
    try:
        table = feather.read_table(path)
    except (ArrowException, OSError) as error:
        raise _damaged(path, "Feather", error) from None
    return Source(
        path.name,
        list(table.column_names),
        lambda wanted: {w: Column(table.column(w).to_pandas().to_numpy()) for w in wanted},
    )


def _list_width(file: Any, name: str) -> int:
    first = next(file.iter_batches(1, columns=[name])).column(0).to_pylist() if file.metadata.num_rows else [[]]
    return len(first[0] or [])


def _damaged(path: Path, what: str, error: BaseException) -> LogError:
    reason = (str(error).strip() or type(error).__name__).splitlines()[0].rstrip(".")
    return LogError(f"{path.name} is not a complete {what} file ({reason[:160]}); copy or export it again.")


def open_matlab(path: Path) -> Source:
    """A MATLAB file, including version 7.3; fields of structures are ``log.torque``, columns of a matrix ``data.0``."""
    with path.open("rb") as file:
        if file.read(512).startswith(b"MATLAB 7.3"):
            return open_hdf5(path)
    from scipy.io import loadmat
    from scipy.io.matlab import MatReadError

    try:
        data = loadmat(path, squeeze_me=True, struct_as_record=False)
    except (MatReadError, ValueError, TypeError, OSError, NotImplementedError) as error:
        raise _damaged(path, "MATLAB", error) from None
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
    return Source(path.name, list(flat), lambda wanted: {w: Column(np.asarray(flat[w])) for w in wanted})


def open_numpy(path: Path) -> Source:
    """A NumPy archive of vectors, without pickled objects; the columns of a matrix are ``data.0``."""
    flat: dict[str, Any] = {}
    try:
        data = np.load(path, allow_pickle=False)
        if hasattr(data, "files"):
            with data:
                parts = dict(data)
        else:
            parts = {"data": data}
    except (ValueError, OSError, EOFError, KeyError, BadZipFile) as error:
        raise _damaged(path, "NumPy", error) from None
    for name, value in parts.items():
        if value.dtype.names:
            flat.update({f: value[f] for f in value.dtype.names})
        elif value.dtype.kind in "fiub" and value.size > 1:
            _columns(flat, name, value)
    return _of_arrays(path, flat)


def _field(name: str) -> Callable[[Any], Any]:
    return lambda data: data[name]


def _slice(i: int, tall: bool) -> Callable[[Any], Any]:
    return lambda data: data[:, i] if tall else data[i, :]


def open_hdf5(path: Path) -> Source:
    """An HDF5 file: data sets by their paths, the columns of a matrix are ``group/data.0``, as are fields of
    records.
    """
    try:
        import h5py
    except ImportError:
        raise missing(path, "h5py", "logs") from None
    readers: dict[str, tuple[str, Callable[[Any], Any]]] = {}
    units: dict[str, str] = {}

    def note(name: str, item: Any) -> None:
        if not isinstance(item, h5py.Dataset) or item.size < 2:
            return
        if item.dtype.names:
            readers.update({f"{name}.{f}": (name, _field(f)) for f in item.dtype.names})
        elif item.dtype.kind in "fiub":
            shape = tuple(n for n in item.shape if n > 1)
            if len(shape) == 1:
                readers[name] = (name, lambda d: np.squeeze(d[()]))
            elif len(shape) == 2 and min(shape) <= 256 and len(item.shape) == 2:
                tall = shape[0] >= shape[1]
                for i in range(min(shape)):
                    readers[f"{name}.{i}"] = (name, _slice(i, tall))
        unit = item.attrs.get("unit", item.attrs.get("units", ""))
        if name in readers and unit:
            units[name] = unit.decode() if isinstance(unit, bytes) else str(unit)

    try:
        with h5py.File(path, "r") as file:
            file.visititems(note)
    except OSError as error:
        raise _damaged(path, "HDF5", error) from None
    if not readers:
        raise LogError(f"{path.name} holds no vector of numbers; save time, drive and position as data sets.")

    def fetch(wanted: Sequence[str]) -> dict[str, Column]:
        with h5py.File(path, "r") as file:
            return {w: Column(np.asarray(readers[w][1](file[readers[w][0]]))) for w in wanted}

    return Source(path.name, list(readers), fetch, units=units)
