"""FMI 2.0 for co-simulation: a source FMU around the C code, with a binary if a compiler is available."""

from __future__ import annotations

import io
import shutil
import subprocess
import sys
import tempfile
import uuid
import zipfile
from pathlib import Path

from whsklearn.export.code import c_files, identifier, render
from whsklearn.export.model import Exported, Loss
from whsklearn.logs.files import atomic_write
from whsklearn.logs.units import factor_of

_COMPILER = ("gcc", "cc", "clang")
# Exponents of the base units of FMI 2.0, sec. 2.2.2, from which an importer can convert units
_BASE = {
    "Nm": {"kg": 1, "m": 2, "s": -2}, "N": {"kg": 1, "m": 1, "s": -2}, "A": {"A": 1},
    "V": {"kg": 1, "m": 2, "s": -3, "A": -1}, "rad": {"rad": 1}, "m": {"m": 1}, "rad/s": {"rad": 1, "s": -1},
    "m/s": {"m": 1, "s": -1},
}  # fmt: skip


def unit_definitions(units: dict[str, str]) -> dict[str, dict[str, float]]:
    """Each unit with the exponents of its base units and its factor, if it has any.

    >>> unit_definitions({"input": "mNm", "output": "counts"})
    {'mNm': {'kg': 1, 'm': 2, 's': -2, 'factor': 0.001}, 'counts': {}}
    """
    out: dict[str, dict[str, float]] = {}
    for unit in units.values():
        factor, si = factor_of(unit)
        out[unit] = {**_BASE[si], "factor": factor} if si in _BASE else {}
    return out


def write_fmu(model: Exported, out: Path) -> tuple[Path, list[Loss]]:
    """Write ``out`` (an .fmu): sources, description, and a Linux binary if there is a C compiler.

    The input is ``drive``, the output ``y``; one step is one sample. ``y`` of an axis is its position at the end of
    the step; that of a chain belongs to the sample in which the input acted.

    Returns ``losses``: with one more entry if no binary could be built.
    """
    path = out if out.suffix == ".fmu" else out / "model.fmu"
    path.parent.mkdir(parents=True, exist_ok=True)
    name = identifier(path.stem)
    files, losses = c_files(model, "model")
    dt = 1.0 / model.axis.sample_rate if model.axis is not None else (model.chain.dt if model.chain else 1.0)
    reading = ""
    if model.axis is not None:
        declared = next(line for line in files["model.c"].splitlines() if " reading(" in line)
        reading = f"reading(&c->state{', c->state.samples * c->dt' if 'double t)' in declared else ''})"
    guid = "{" + str(uuid.uuid5(uuid.NAMESPACE_OID, "".join(files.values()))) + "}"  # same model, same file
    names = {"name": name, "guid": guid, "dt": repr(dt), "units": model.units, "losses": losses, "reading": reading}
    names["defined"] = unit_definitions(model.units)
    sources = {**files, "fmi2.c": render("fmi2.c.j2", **names)}
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("modelDescription.xml", render("modelDescription.xml.j2", **names))
        for file, text in sources.items():
            archive.writestr(f"sources/{file}", text)
        binary = _binary(sources)
        if binary is not None:
            archive.writestr(f"binaries/linux64/{name}.so", binary)
        else:
            losses.append(Loss("binary", "linux64", "no C compiler found here; fmpy compiles the sources"))
    atomic_write(path, buffer.getvalue())
    return path, losses


def _binary(files: dict[str, str]) -> bytes | None:
    """A shared library of the sources, or None without a compiler."""
    compiler = next((c for c in _COMPILER if shutil.which(c)), None)
    if compiler is None or not sys.platform.startswith("linux"):
        return None
    with tempfile.TemporaryDirectory() as folder:
        for file, text in files.items():
            Path(folder, file).write_text(text, encoding="utf-8")
        done = subprocess.run(
            [compiler, "-std=c99", "-O2", "-shared", "-fPIC", "-o", "model.so", "fmi2.c", "-lm"],
            cwd=folder, capture_output=True, text=True, check=False,
        )  # fmt: skip
        if done.returncode:
            raise RuntimeError(f"{compiler} does not compile the FMU's sources: {done.stderr.strip()[:500]}")
        return Path(folder, "model.so").read_bytes()
