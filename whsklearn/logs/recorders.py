"""Logs of measurement recorders: TDMS (National Instruments) and MDF4 (ASAM)."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any, cast

import numpy as np

from whsklearn.logs.arrays import _damaged, missing
from whsklearn.logs.errors import LogError
from whsklearn.logs.source import Column, Source


def open_tdms(path: Path) -> Source:
    """A TDMS file: channels are ``group/channel``, or ``channel`` if the name is unique."""
    try:
        from nptdms import TdmsFile
    except ImportError:
        raise missing(path, "npTDMS", "logs") from None
    try:
        with TdmsFile.read_metadata(path) as file:
            channels = [(g.name, c.name, c.properties) for g in file.groups() for c in g.channels()]
    except (ValueError, OSError, EOFError, KeyError) as error:
        raise _damaged(path, "TDMS", error) from None
    once = [c for _, c, _ in channels]
    where = {c if once.count(c) == 1 else f"{g}/{c}": (g, c) for g, c, _ in channels}
    units = {n: str(p["unit_string"]) for n, (_, _, p) in zip(where, channels, strict=True) if p.get("unit_string")}
    steps = {n: p.get("wf_increment") for n, (_, _, p) in zip(where, channels, strict=True)}
    if not where:
        raise LogError(f"{path.name} has no channels; record the log again.")

    def fetch(wanted: Sequence[str]) -> dict[str, Column]:
        with TdmsFile.open(path) as file:
            out = {}
            for name in wanted:
                channel = file[where[name][0]][where[name][1]]
                values = channel[:]
                # Without a waveform increment, the stamps are a separate channel.
                stamps = channel.time_track() if steps[name] and len(values) else None
                out[name] = Column(np.asarray(values), stamps)
            return out

    return Source(path.name, list(where), fetch, units=units)


def open_mdf(path: Path) -> Source:
    """An MDF file, version 3 or 4: channels with the stamps of their group."""
    try:
        from asammdf import MDF
    except ImportError:
        raise missing(path, "asammdf", "logs") from None
    with path.open("rb") as raw:
        head = raw.read(68)
    if b"HD" not in head[64:68]:  # asammdf would leave behind a partly built object, which raises when it is deleted
        raise _damaged(path, "MDF", ValueError("no header block"))
    try:
        with MDF(path) as file:
            where: dict[str, tuple[int, int]] = {}
            units: dict[str, str] = {}
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
    except Exception as error:  # asammdf raises any error of its parser, such as a bare struct.error
        raise _damaged(path, "MDF", error) from None
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
