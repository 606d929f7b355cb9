"""Odd logs and what the commands say of each: made here, read by ``whsklearn gap --no-track``, printed as a table.

    python -m benchmarks.odd_files [--diagnose] [--markdown]

Each file is a 12 s log of the library's servo with cogging hidden in it and one thing wrong.  Without ``--diagnose``
the log is read and the notes are printed, which takes seconds; with it every readable file is diagnosed too, which
takes minutes, and the verdict, the names and the exit status of the command stand in the table.
"""

from __future__ import annotations

import argparse
import gzip
import io
import json
import tempfile
import warnings
import zipfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd
from click.testing import CliRunner

from whsklearn.cli.gap import main as gap
from whsklearn.datasets import make_servo_log
from whsklearn.effects import Cogging

COLUMNS = ["time_s", "torque_nm", "position_rad"]


def base() -> pd.DataFrame:
    """The log with nothing wrong."""
    return make_servo_log([Cogging(0.3, 12.0)], duration=12.0, random_state=0)[COLUMNS]


def csv(frame: pd.DataFrame, **options: object) -> bytes:
    """A frame as CSV."""
    return frame.to_csv(index=False, **options).encode()  # type: ignore[arg-type]


def changed(f: pd.DataFrame, **columns: object) -> pd.DataFrame:
    """The frame with columns replaced."""
    return f.assign(**columns)


def hole(f: pd.DataFrame, n: int) -> pd.DataFrame:
    """Without n rows in the middle."""
    return f.drop(f.index[len(f) // 2 : len(f) // 2 + n])


def stop(f: pd.DataFrame) -> pd.DataFrame:
    """With two seconds of emergency stop."""
    rate = round(1 / (f["time_s"][1] - f["time_s"][0]))
    rows = slice(4 * rate, 6 * rate)
    u, y = f["torque_nm"].to_numpy().copy(), f["position_rad"].to_numpy().copy()
    u[rows], y[rows] = 0.0, y[4 * rate]
    return changed(f, torque_nm=u, position_rad=y)


def dates(f: pd.DataFrame) -> pd.Series:
    """The stamps as ISO 8601."""
    return (pd.Timestamp("2026-05-21 12:00:00") + pd.to_timedelta(f.time_s, unit="s")).astype(str)


def renamed(f: pd.DataFrame) -> pd.DataFrame:
    """Other names, other units."""
    f = f.set_axis(["Time [ms]", "Motor current [A]", "Joint angle [rad]"], axis=1)
    return f.assign(**{"Time [ms]": 1e3 * f["Time [ms]"]})


def with_value(f: pd.DataFrame, column: str, row: int, value: object) -> pd.DataFrame:
    """One cell replaced."""
    values = f[column].astype(object)
    values[row] = value
    return f.assign(**{column: values})


def parquet(f: pd.DataFrame) -> bytes:
    """A frame as Parquet."""
    buffer = io.BytesIO()
    f.to_parquet(buffer)
    return buffer.getvalue()


def lines(f: pd.DataFrame, header: str, row: Callable[[float, float, float], str]) -> bytes:
    """A table written line by line."""
    return (header + "\n" + "\n".join(row(*r) for r in f.to_numpy().tolist()) + "\n").encode()


def clock(f: pd.DataFrame, start: float) -> list[str]:
    """The stamps as hours, minutes and seconds of a day that began `start` seconds before."""
    seconds = (f.time_s + start) % 86400
    return [f"{int(t // 3600):02d}:{int(t // 60) % 60:02d}:{t % 60:09.6f}" for t in seconds]


def zipped(**members: bytes) -> bytes:
    """A ZIP archive of CSV files."""
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w") as archive:
        for name, data in members.items():
            archive.writestr(f"{name}.csv", data)
    return buffer.getvalue()


def arrays(f: pd.DataFrame) -> bytes:
    """A NumPy archive."""
    buffer = io.BytesIO()
    np.savez(buffer, **{k: v.to_numpy() for k, v in f.items()})
    return buffer.getvalue()


def german(x: float) -> str:
    """A number with points between thousands and a decimal comma."""
    return f"{x:,.6f}".translate(str.maketrans(",.", ".,"))


HEADER = ",".join(COLUMNS)
Maker = Callable[[pd.DataFrame], bytes]
FILES: dict[str, tuple[str, Maker, list[str]]] = {
    "decimal comma": ("a.csv", lambda f: csv(f, sep=";", decimal=","), []),
    "tabs": ("a.txt", lambda f: csv(f, sep="\t"), []),
    "comment lines": ("a.csv", lambda f: b"# rig 7\n# ann\n" + csv(f), []),
    "BOM": ("a.csv", lambda f: b"\xef\xbb\xbf" + csv(f), []),
    "no header": ("a.csv", lambda f: f.to_csv(index=False, header=False).encode(), ["--columns", "0,1,2"]),
    "no header, no --columns": ("a.csv", lambda f: f.to_csv(index=False, header=False).encode(), []),
    "Parquet": ("a.parquet", parquet, []),
    "ISO time": ("a.csv", lambda f: csv(changed(f, time_s=dates(f))), []),
    "epoch in ms": (
        "a.csv",
        lambda f: csv(changed(f, time_s=np.round(f.time_s * 1e3).astype(np.int64) + 1_700_000_000_000)),
        [],
    ),
    "wrapped at 2 pi": ("a.csv", lambda f: csv(changed(f, position_rad=np.mod(4 * f.position_rad, 2 * np.pi))), []),
    "wrapped at 360, degrees": (
        "a.csv",
        lambda f: csv(
            f.assign(position_deg=np.mod(np.degrees(4 * f.position_rad), 360.0)).drop(columns="position_rad")
        ),
        [],
    ),
    "16-bit counts": (
        "a.csv",
        lambda f: csv(
            f.assign(position_counts=np.mod(np.round(f.position_rad / (2 * np.pi) * 65536), 65536).astype(int)).drop(
                columns="position_rad"
            )
        ),
        ["--unit", "position=counts/65536"],
    ),
    "hole of 0.1 s": ("a.csv", lambda f: csv(hole(f, max(6, round(0.1 / (f.time_s[1] - f.time_s[0]))))), []),
    "repeated rows": ("a.csv", lambda f: csv(pd.concat([f.iloc[:900], f.iloc[890:]])), []),
    "jitter of 10 %": (
        "a.csv",
        lambda f: csv(
            changed(
                f,
                time_s=f.time_s + 0.1 * (f.time_s[1] - f.time_s[0]) * np.random.default_rng(0).uniform(-1, 1, len(f)),
            )
        ),
        [],
    ),
    "clock restarts": (
        "a.csv",
        lambda f: csv(changed(f, time_s=np.where(f.time_s < 8.0, f.time_s, f.time_s - 8.0))),
        [],
    ),
    "one stamp of 1e9": ("a.csv", lambda f: csv(with_value(f, "time_s", 700, 1e9)), []),
    "rows without a number": ("a.csv", lambda f: csv(with_value(f, "torque_nm", 500, np.nan)), []),
    "a value of 1e300": ("a.csv", lambda f: csv(with_value(f, "torque_nm", 500, 1e300)), []),
    "all values 1e-300": ("a.csv", lambda f: csv(changed(f, torque_nm=1e-300 * np.sign(f.torque_nm))), []),
    "the word 'off'": ("a.csv", lambda f: csv(with_value(f, "torque_nm", 500, "off")), []),
    "emergency stop": ("a.csv", lambda f: csv(stop(f)), []),
    "degrees called rad": ("a.csv", lambda f: csv(changed(f, position_rad=np.degrees(f.position_rad))), []),
    "ms called s": ("a.csv", lambda f: csv(changed(f, time_s=1e3 * f.time_s)), []),
    "drive without its sign": ("a.csv", lambda f: csv(changed(f, torque_nm=f.torque_nm.abs())), []),
    "inverted drive": ("a.csv", lambda f: csv(changed(f, torque_nm=-f.torque_nm)), []),
    "encoder reset": (
        "a.csv",
        lambda f: csv(changed(f, position_rad=f.position_rad - (f.index >= 5000) * f.position_rad[5000])),
        [],
    ),
    "counts, no unit": (
        "a.csv",
        lambda f: csv(f.assign(position=np.round(f.position_rad * 651.9)).drop(columns="position_rad")),
        ["--position", "position"],
    ),
    "velocity as position": (
        "a.csv",
        lambda f: csv(changed(f, position_rad=np.gradient(f.position_rad, f.time_s))),
        [],
    ),
    "amperes and other names": ("a.csv", lambda f: csv(renamed(f)), []),
    "amperes and a torque constant": ("a.csv", lambda f: csv(renamed(f)), ["--torque-constant", "0.12+-0.01"]),
    "empty file": ("a.csv", lambda f: b"", []),
    "header only": ("a.csv", lambda f: ",".join(COLUMNS).encode() + b"\n", []),
    "zero bytes at the end": ("a.csv", lambda f: csv(f) + bytes(4096), []),
    "zero bytes within the data": ("a.csv", lambda f: csv(f)[:5000] + bytes(3) + csv(f)[5000:], []),
    "a binary file": ("a.csv", lambda f: b"\x7fELF\x02\x01\x01" + bytes(range(256)) * 64, []),
    "a spreadsheet": ("a.xlsx", lambda f: b"PK\x03\x04" + bytes(64), []),
    "markup in names": (
        "<b>a&b.csv",
        lambda f: csv(f.rename(columns={"torque_nm": "<script>torque"})),
        ["--drive", "<script>torque"],
    ),
    "a units row": (
        "a.csv",
        lambda f: lines(f, "time,torque,position\n[ms],[Nm],[rad]", lambda t, u, q: f"{1e3 * t},{u},{q}"),
        [],
    ),
    "two header lines": ("a.csv", lambda f: b"Rig 7,,\n" + csv(f), []),
    "a spreadsheet's first line": (
        "a.csv",
        lambda f: b"sep=;\r\n" + csv(f, sep=";", decimal=",", lineterminator="\r\n"),
        [],
    ),
    "Windows text": (
        "a.csv",
        lambda f: csv(f.set_axis(["Zeit (s)", "Drehmoment (Nm)", "Winkel (°)"], axis=1)).decode().encode("cp1252"),
        [],
    ),
    "UTF-16 without a mark": ("a.txt", lambda f: csv(f, sep="\t").decode().encode("utf-16-le"), []),
    "thousands 1,234.5": (
        "a.csv",
        lambda f: lines(f, "time_s,torque_mnm,position_rad", lambda t, u, q: f'{t},"{1e6 * u:,.3f}",{q}'),
        [],
    ),
    "thousands 1.234,5": (
        "a.csv",
        lambda f: lines(
            f, "time_s;torque_mnm;position_rad", lambda t, u, q: f"{german(t)};{german(1e6 * u)};{german(q)}"
        ),
        [],
    ),
    "numbers with units": (
        "a.csv",
        lambda f: lines(f, "time,torque,position", lambda t, u, q: f"{t} s,{u} Nm,{q} rad"),
        [],
    ),
    "quoted numbers": ("a.csv", lambda f: csv(f.astype(str), quoting=1), []),
    "hexadecimal counts": (
        "a.csv",
        lambda f: lines(
            f, "time_s,torque_nm,position_counts", lambda t, u, q: f"{t},{u},0x{int(32768 + 5000 * q):04X}"
        ),
        ["--unit", "position=counts/65536"],
    ),
    "mixed line ends": (
        "a.csv",
        lambda f: b"".join(t + (b"\n", b"\r\n")[i % 2] for i, t in enumerate(csv(f).split(b"\n"))),
        [],
    ),
    "old Mac line ends": ("a.csv", lambda f: csv(f, lineterminator="\r"), []),
    "trailing commas": ("a.csv", lambda f: csv(f).replace(b"\n", b",,\n"), []),
    "commas at the end of rows only": ("a.csv", lambda f: lines(f, HEADER, lambda t, u, q: f"{t},{u},{q},"), []),
    "one name twice": ("a.csv", lambda f: lines(f, HEADER + ",position_rad", lambda t, u, q: f"{t},{u},{q},0.5"), []),
    "a footer": ("a.csv", lambda f: csv(f) + b"*** end of log ***\n", []),
    "the header again": ("a.csv", lambda f: csv(f.iloc[:9000]) + csv(f.iloc[9000:]), []),
    "a cut last line": ("a.csv", lambda f: csv(f)[:-20], []),
    "newest row first": ("a.csv", lambda f: csv(f.iloc[::-1]), []),
    "N/A and -": (
        "a.csv",
        lambda f: csv(with_value(with_value(f, "torque_nm", 50, "N/A"), "position_rad", 70, "-")),
        [],
    ),
    "-9999 for none": ("a.csv", lambda f: csv(with_value(f, "position_rad", 70, -9999.0)), []),
    "time of the day": ("a.csv", lambda f: csv(changed(f, time_s=clock(f, 32400.0))), []),
    "over midnight": ("a.csv", lambda f: csv(changed(f, time_s=clock(f, 86394.0))), []),
    "days of a spreadsheet": (
        "a.csv",
        lambda f: csv(changed(f, time_s=[f"{45000 + t / 86400:.12f}" for t in f.time_s])),
        [],
    ),
    "a 32-bit counter of us": (
        "a.csv",
        lambda f: lines(
            f, "time_us,torque_nm,position_rad", lambda t, u, q: f"{(round(1e6 * t) + 2**32 - 2000000) % 2**32},{u},{q}"
        ),
        [],
    ),
    "time in ms, no unit": (
        "a.csv",
        lambda f: lines(f, "time,torque_nm,position_rad", lambda t, u, q: f"{1e3 * t:.0f},{u},{q}"),
        [],
    ),
    "gz without its ending": ("a.csv", lambda f: gzip.compress(csv(f)), []),
    "a cut gz": ("a.csv.gz", lambda f: gzip.compress(csv(f))[:20000], []),
    "a ZIP archive": ("a.zip", lambda f: zipped(a=csv(f)), []),
    "a ZIP archive of two": ("a.zip", lambda f: zipped(a=csv(f), b=csv(f)), []),
    "JSON lines": ("a.jsonl", lambda f: f.to_json(orient="records", lines=True).encode(), []),
    "JSON of vectors": ("a.json", lambda f: json.dumps({"data": f.to_dict("list")}).encode(), []),
    "cut JSON": ("a.json", lambda f: f.to_json(orient="records").encode()[:5000], []),
    "NumPy archive": ("a.npz", arrays, []),
    "one column for two": ("a.csv", csv, ["--drive", "torque_nm", "--position", "torque_nm"]),
}


def said(name: str, folder: Path, diagnose: bool) -> tuple[int, str]:
    """Exit status and what the command says of one file."""
    file, make, options = FILES[name]
    path = folder / file
    path.write_bytes(make(base()))
    if diagnose:
        done = CliRunner().invoke(gap, [str(path), "--no-track", "--report", str(folder / "gap"), *options])
        text = [t.removeprefix("Note: ") for t in done.output.splitlines() if t.startswith(("Note:", "Error:"))]
        if done.exit_code == 0:
            data = json.loads((folder / "gap" / "gap.json").read_text(encoding="utf-8"))
            names = ", ".join(e["name"] for e in data["effects"])
            text.append(f"=> {data['verdict']} {names}".strip() + ".")
        return done.exit_code, " ".join(text)
    return read_only(path, options)


def read_only(path: Path, options: list[str]) -> tuple[int, str]:
    """What the reader and the look for slips say, without a diagnosis."""
    from whsklearn.cli.gap import read_log
    from whsklearn.cli.job import UNUSABLE, USAGE
    from whsklearn.cli.records import long_segments
    from whsklearn.logs import ColumnError, LogError
    from whsklearn.logs.slips import slips_in

    with gap.make_context("gap", [str(path), *options]) as context:
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                log = long_segments(read_log(context.params))
        except LogError as error:
            return (USAGE if isinstance(error, ColumnError) else UNUSABLE), str(error)
    quiet = ("LOG005", "LOG006", "LOG007", "LOG008", "LOG009")
    notes = [f"{f.title}. {f.explanation}" for f in log.report.findings if f.code not in quiet]
    notes += log.notes[len(log.report.findings) :]
    return 0, " ".join([*notes, *map(str, slips_in(log))]) or "Read as it is."


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--diagnose", action="store_true", help="run the whole command on every file")
    parser.add_argument("--only", help="one file of the table")
    options = parser.parse_args()
    print("| input | exit | what is said |\n|---|---|---|")
    for name in FILES if options.only is None else [options.only]:
        with tempfile.TemporaryDirectory() as folder:
            status, text = said(name, Path(folder), options.diagnose)
        print(f"| {name} | {status} | {text.replace('|', ' ')} |", flush=True)


if __name__ == "__main__":
    main()
