"""Logs as drives, controllers and their scripts write them: made here from the formats' documentation, and read back.

    python -m benchmarks.vendor_logs [--keep FOLDER]

One motion of the library's servo is written in each dialect; a line says whether time, drive and position that the
commands read are those that were written.  The dialects, by where they are documented:

- TwinCAT Scope: Beckhoff Infosys, TE13xx "Export in csv" (time lines: all, for each sample time, none; full time stamp;
  EOF tag; decimal mark) and TwinCAT 2 "Export to CSV" (StartRecord, a block for each channel)
- CODESYS and ctrlX: traces with a head of ``key; value`` lines; the sampling time in the head, or a time column for
  each variable
- ODrive: the control loop runs at 8 kHz, and scripts log its ticks; positions are turns, currents amperes
- Arduino: ``Serial.print`` of labels and numbers, as the Serial Plotter takes them (``label:value``)
- ROS: ``rostopic echo -p`` (``%time`` in ns, ``field.`` names), PlotJuggler's export of several topics
- LabVIEW: LVM measurement file (two heads, labels of units); Simulink: "structure with time" in a MAT file
- oscilloscopes and recorders, by their manuals: Hioki LR8400 and 8807, Yokogawa DLM (ASCII), Rigol (``Increment`` in
  the head), Tektronix TDS (the head stands beside the first rows), Rohde & Schwarz RTH (values only)
- Panasonic FPWIN traces (names in two rows, an interval, ``STOP TRG`` amid the data), Rexroth IndraMotion MTX (sections
  ``[Settings]``, ``[Data]``, ``[Statistics]``), InfluxDB's annotated CSV and other tables with one row per reading
- spreadsheets in GB 18030 and Shift JIS, with ``sep=;`` in the first line
- from what their tools write, without a document: VESC Tool, moteus, Dynamixel Wizard, Feetech scripts, EPOS Studio,
  Siemens and Elmo traces
"""

from __future__ import annotations

import argparse
import tempfile
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import numpy as np

from whsklearn.datasets import make_servo_log
from whsklearn.effects import Cogging

RATE = 1000.0
TURN = 2 * np.pi
FILETIME = 132959733843760000  # 100 ns since 1601: an instant in May 2022


class Motion(NamedTuple):
    """Time (s), torque (Nm) and position (rad), shape (n,) each, to so many digits."""

    t: np.ndarray
    u: np.ndarray
    q: np.ndarray


def motion() -> Motion:
    """Four seconds at 1 kHz."""
    frame = make_servo_log([Cogging(0.3, 12.0)], duration=4.0, sample_rate=RATE, random_state=0)
    return Motion(frame["time_s"].to_numpy(), frame["torque_nm"].to_numpy(), frame["position_rad"].to_numpy())


def table(*columns: object, sep: str = ",", end: str = "\n", comma: bool = False) -> str:
    """Rows of cells: numbers in eight digits, whole numbers and words as they are."""
    rows = zip(*(np.asarray(c).tolist() for c in columns), strict=True)  # type: ignore[arg-type]
    cells = [[f"{x:.8f}" if isinstance(x, float) else str(x) for x in row] for row in rows]
    text = end.join(sep.join(r) for r in cells) + end
    return text.replace(".", ",") if comma else text


def stacked(names: list[str], units: list[str], sample_ms: str, sep: str = "\t") -> str:
    """The head that TwinCAT 3 Scope writes; `names` and `units` say "" for a time column."""

    def row(label: str, values: list[str]) -> str:
        return sep.join(label if n == "" else v for n, v in zip(names, values, strict=True)) + "\n"

    whole = (
        ["Name", "axis"],
        ["File", "axis.csv"],
        ["Starttime of export", str(FILETIME), "Montag, 2. Mai 2022", "15:56"],
    )
    head = "".join(sep.join(r) + "\n" for r in (*whole, ["Endtime of export", str(FILETIME + 40000000)])) + "\n\n"
    same = {"SymbolComment": "", "Data-Type": "REAL64", "SampleTime[ms]": sample_ms, "VariableSize": "8", "Port": "851"}
    same |= {"SymbolBased": "True", "NetID": "192.168.0.20.1.1", "Offset": "0", "ScaleFactor": "1"}
    head += row("Name", names) + "".join(row(k, [v] * len(names)) for k, v in same.items())
    return head + row("Unit", units) + row("Unit ScaleFactor", ["1"] * len(names)) + "\n"


def twincat_all(m: Motion) -> str:
    """A time column for each channel."""
    ms = (1e3 * m.t).round().astype(int)
    return stacked(["", "ActPos", "", "ActTorque"], ["", "° (Angle)", "", "Nm (Torque)"], "1") + table(
        ms, np.degrees(m.q), ms, m.u, sep="\t"
    )


def twincat_rates(m: Motion) -> str:
    """Decimal commas, a slower channel that ends sooner, the tag at the end."""
    ms = (1e3 * m.t).round().astype(int).astype(str)
    slow = [f"{2 * k}\t{u:.8f}" if k < m.t.size // 2 else "\t" for k, u in enumerate(np.r_[m.u[::2], m.u[::2]])]
    head = stacked(["", "ActPos", "", "ActTorque"], ["", "deg (Angle)", "", "Nm (Torque)"], "1")
    rows = [f"{t}\t{p:.8f}\t{s}" for t, p, s in zip(ms, np.degrees(m.q), slow, strict=False)]
    return head + ("\n".join(rows) + "\nEOF\n").replace(".", ",")


def twincat_filetime(m: Motion) -> str:
    """Full time stamps, one time column for both channels."""
    stamps = FILETIME + (1e7 * m.t).round().astype(np.int64)
    return stacked(["", "ActPos", "ActTorque"], ["", "rad", "Nm"], "1") + table(stamps, m.q, m.u, sep="\t")


def twincat_none(m: Motion) -> str:
    """No time column at all: the sample time of the head is the clock."""
    head = stacked(["", "ActPos", "ActTorque"], ["", "rad", "Nm"], "1", sep=";")
    return head + table(m.q, m.u, sep=";")


def twincat2(m: Motion) -> str:
    """TwinCAT 2 Scope View: a block for each channel, decimal commas."""
    keys = {
        "NetId": "172.16.8.205.1.1",
        "Port": "801",
        "SampleTime[ms]": "1",
        "SymbolBased": "TRUE",
        "IndexGroup": "16448",
    }
    head = "Name\tScope01\nFile\t\nStartRecord\t128783093223690000\tDonnerstag, 5. Februar 2009\t13:08:42\n"
    head += "EndRecord\t128783093339880000\tDonnerstag, 5. Februar 2009\t13:08:53\n\n"
    head += "Name\tPosition_rad\tName\tTorque_Nm\n" + "".join(f"{k}\t{v}\t{k}\t{v}\n" for k, v in keys.items()) + "\n"
    ms = (1e3 * m.t).round().astype(int)
    return head + table(ms, m.q, ms, m.u, sep="\t", comma=True)


def ctrlx(m: Motion) -> str:
    """The sampling time in the head, no time column."""
    head = (
        "Device; ctrlX DRIVE; XCS2\nDate; 2026-05-21\nSampling time; 1000 us\nNumber of samples; 4000\nTrigger; off\n"
    )
    return head + "Position feedback [deg];Torque [Nm]\n" + table(np.degrees(m.q), m.u, sep=";")


def codesys(m: Motion) -> str:
    """A head of keys, and time in microseconds beside each variable."""
    us = (1e6 * m.t).round().astype(np.int64)
    head = "Trace; AxisTrace\nApplication; Device.Application\nTask; MotionTask\nVersion; 1.0\nCycle time; 1000 us\n\n"
    head += "Time [us];PLC_PRG.position_deg;Time [us];PLC_PRG.torque_Nm\n"
    return head + table(us, np.degrees(m.q), us, m.u, sep=";")


def odrive_script(m: Motion) -> str:
    """Ticks of 8 kHz, names in a comment, a semicolon after each line."""
    head = "% ODrive v3.6, axis0\n% t [ticks of 8 kHz], pos_estimate [turns], Iq_measured [A]\n"
    return head + table((8 * 1e3 * m.t).round().astype(int), m.q / TURN, m.u / 0.12, end=";\n")


def odrive_matrix(m: Motion) -> str:
    """A script for MATLAB: the matrix in brackets, the clock told in a comment."""
    head = "% control loop of 8 kHz; columns: ticks, position (turns), Iq (A)\ndata = [\n"
    return head + table((8 * 1e3 * m.t).round().astype(int), m.q / TURN, m.u / 0.12, sep=" ", end=";\n") + "];\n"


def arduino(m: Motion) -> str:
    """Labels and numbers in words, every other line, after a greeting."""
    rows = zip((2 * np.arange(2000) + 5001).tolist(), m.q[::2].tolist(), m.u[::2].tolist(), strict=True)
    return "Ready.\n" + "".join(f"Time: {t} Position_rad: {q:.8f} Torque_Nm: {u:.8f}\n" for t, q, u in rows)


def plotter(m: Motion) -> str:
    """As the Serial Plotter takes it, no time."""
    return "".join(f"Position_rad:{q:.8f},Torque_Nm:{u:.8f}\n" for q, u in zip(m.q.tolist(), m.u.tolist(), strict=True))


def motors(m: Motion) -> str:
    """Three motors in turns, distinguished by a column."""
    rows = [
        f"{t:.6f},{k},{(q if k == 2 else 0.1 * k):.8f},{(u if k == 2 else 0.0):.8f}\n"
        for t, q, u in zip(m.t.tolist(), m.q.tolist(), m.u.tolist(), strict=True)
        for k in (1, 2, 3)
    ]
    return "time_s,motor_id,position_rad,torque_nm\n" + "".join(rows)


def cut(m: Motion) -> str:
    """The last number is cut: 0.0 where 0.03456789 was."""
    return ("time_s,torque_nm,position_rad\n" + table(m.t, m.u, m.q))[:-7]


def dashes(m: Motion) -> str:
    """Names with the marks of a list before them."""
    return "- time_s,- joint_torque_Nm,- joint_position_rad\n" + table(m.t, m.u, m.q)


def effort(m: Motion) -> str:
    """An effort, which may be anything: its unit is given."""
    return "- timestamp,- joint_position,- joint_effort\n" + table(m.t, m.q, m.u)


def rostopic(m: Motion) -> str:
    """Stamps in ns since 1970, a comment's mark before the names."""
    ns = (1e9 * m.t).round().astype(np.int64) + 1_700_000_000_000_000_000
    seq = np.arange(m.t.size)
    return "%time,field.header.seq,field.position0,field.effort0\n" + table(ns, seq, m.q, m.u)


def plotjuggler(m: Motion) -> str:
    """Signals of two topics in one table, a row for each message: blanks where the other one spoke."""
    rows = zip((1.7e9 + m.t).tolist(), m.q.tolist(), m.u.tolist(), strict=True)
    return "__time,/imu/x,/joint/position [rad],/joint/torque [Nm]\n" + "".join(
        f"{t:.9f},,{q:.8f},{u:.8f}\n{t + 3e-4:.9f},0.5,,\n" for t, q, u in rows
    )


def lvm(m: Motion) -> str:
    """LabVIEW's measurement file."""
    head = "LabVIEW Measurement\t\nWriter_Version\t2\nSeparator\tTab\nDecimal_Separator\t.\nX_Columns\tOne\n"
    head += "***End_of_Header***\t\t\t\nChannels\t2\t\t\nSamples\t4000\t4000\t\nDate\t2026/03/25\t2026/03/25\t\n"
    head += "Y_Unit_Label\tmN·m\tdeg\t\nX_Dimension\tTime\tTime\t\nX0\t0.0\t0.0\t\nDelta_X\t0.001000\t0.001000\t\n"
    head += "***End_of_Header***\t\t\t\nX_Value\tTorque\tPosition\tComment\n"
    return head + table(m.t, 1e3 * m.u, np.degrees(m.q), np.full(m.t.size, ""), sep="\t")


def vesc(m: Motion) -> str:
    """VESC Tool: milliseconds of the day, semicolons."""
    ms = (1e3 * m.t).round().astype(int) + 45296000
    head = "ms_today;input_voltage;current_motor;current_in;encoder_position;erpm\n"
    one = np.ones(m.t.size)
    return head + table(ms, 24 * one, m.u / 0.12, one, np.degrees(m.q), one, sep=";")


def moteus(m: Motion) -> str:
    """A script's table of moteus: torque and revolutions, seconds since 1970."""
    stamps = np.array([f"{1.7e9 + t:.6f}" for t in m.t.tolist()])
    mode = np.full(m.t.size, 10)
    return "timestamp,mode,position,velocity,torque,q_current\n" + table(stamps, mode, m.q / TURN, m.q, m.u, m.u / 0.12)


def dynamixel(m: Motion) -> str:
    """Dynamixel Wizard: ms and mA in the names, counts of 1e6 a turn (4096 would hide an error of reading)."""
    return "Time [ms],Present Position,Present Current [mA]\n" + table(
        (1e3 * m.t).round().astype(int), (m.q / TURN * 1e6).round().astype(int), 1e3 * m.u / 0.12
    )


def feetech(m: Motion) -> str:
    """A script for a bus of servos: stamps of 10 ms on rows of 1 ms, millis in the name, words in every row."""
    ticks = (10 * np.floor(1e3 * m.t / 10)).astype(int)
    return "millis,mode,torque_mNm,pos_mrad\n" + table(ticks, np.full(m.t.size, "RUN"), 1e3 * m.u, 1e3 * m.q)


def epos(m: Motion) -> str:
    """EPOS Studio: names, units in the row below, decimal commas, tabs, UTF-16."""
    head = "Time\tPosition actual value\tTorque actual value\n[ms]\t[arcsec]\t[mN·m]\n"
    return head + table(1e3 * m.t, np.degrees(m.q) * 3600, 1e3 * m.u, sep="\t", comma=True)


def siemens(m: Motion) -> str:
    """A trace with a head of ``key:;value``, and statistics below."""
    head = "Trace:;Axis\nDate:;25.03.2026\nSampling:;1 ms\n\n"
    head += "Sample;Timestamp [ms];Axis_1.ActualPosition [°];Axis_1.ActualTorque [Nm]\n"
    n = m.t.size
    rows = table(np.arange(n), (1e3 * m.t).round().astype(int), np.degrees(m.q), m.u, sep=";")
    return head + rows + "\nStatistics\n" + "".join(f"{w};;{k}.5;0.1\n" for k, w in enumerate(("Min", "Max", "Mean")))


def german(m: Motion) -> str:
    """A spreadsheet's: date and time of the day in two columns, words for units."""
    day = [
        f"11:59:{58 + t:06.3f}".replace(".", ",") if t < 2 else f"12:00:{t - 2:06.3f}".replace(".", ",") for t in m.t
    ]
    head = "Datum;Uhrzeit;Drehmoment in Ncm;Gemessener Winkel in Grad\n"
    cells = table(1e2 * m.u, np.degrees(m.q), sep=";", comma=True).splitlines()
    return head + "".join(f"25.03.2026;{t};{c}\n" for t, c in zip(day, cells, strict=True))


def glued(m: Motion) -> str:
    """Units behind the numbers, a level of the logger before them."""
    rows = zip((1e3 * m.t).round().astype(int).tolist(), m.q.tolist(), m.u.tolist(), strict=True)
    return "".join(f"[INFO] t={t}ms pos={q:.8f}rad tau={u:.8f}Nm\n" for t, q, u in rows)


def gains_above(m: Motion) -> str:
    """A small table of gains above the log."""
    return "kp,ki,kd\n40,0.001,0.2\n\ntime_s,torque_nm,position_rad\n" + table(m.t, m.u, m.q)


def joints(m: Motion) -> str:
    """Two joints in turns, by their names."""
    rows = zip(m.t.tolist(), m.q.tolist(), m.u.tolist(), strict=True)
    return "time_s,joint,position_rad,torque_nm\n" + "".join(
        f"{t:.6f},shoulder,0.1,0\n{t:.6f},elbow,{q:.8f},{u:.8f}\n" for t, q, u in rows
    )


def imperial(m: Motion) -> str:
    """Time in minutes, torque in inch pounds, a rule below the names as Markdown has it."""
    body = table(
        np.array([f"{t / 60:.12f}" for t in m.t.tolist()]), m.u / 0.1129848290276167, np.degrees(m.q), sep=" | "
    )
    head = "| time [min] | torque [lbf·in] | angle [deg] |\n|---|---|---|\n"
    return head + "".join(f"| {row} |\n" for row in body.splitlines())


def hioki(m: Motion) -> str:
    """Rows of settings for each channel, blanks before the numbers, a number and a unit for a name."""
    rows = [["File name", "AUTO0001.CSV", "V 1.00a"], ["Title comment", ""]]
    rows += [["Start trigger time", "'24-12-16 13:52:32"], ["CH", "A 1- 1", "A 1- 2"], ["Mode", "Voltage", "Voltage"]]
    rows += [["Comment", "torque", "angle"], ["Ratio", " 1.00000E+00", " 1.00000E+00"], ["Time", "1-1[Nm]", "1-2[deg]"]]
    head = "".join(",".join(f'"{c}"' for c in row) + "\n" for row in rows)
    return head + "".join(f" {t:.9E}, {u:.10E}, {q:.10E}\n" for t, u, q in zip(m.t, m.u, np.degrees(m.q), strict=True))


def hioki_signals(m: Motion) -> str:
    """Labelled rows, one of which holds the names, and the word DATA below."""
    head = '"COMMENT","8807 MEM DATA"\n"DATE","01-01-1999"\n"NUM_SIGS",3\n"INTERVAL",1.000E-03\n"HORZ_UNITS","S"\n'
    head += '"VERT_UNITS","S","Nm","rad"\n"SIGNAL","TIME","Torque","Angle"\n"DATA"\n'
    return head + "".join(f"{t:+.9E}, {u:+.10E}, {q:+.10E}\n" for t, u, q in zip(*m, strict=True))


def yokogawa(m: Motion) -> str:
    """Labels in a column that is blank below; the rate of each channel, and its unit in another row."""
    n = m.t.size
    head = f"HeaderSize,10\nModel Name,DLM3054\nTraceName,Torque,Position\nBlockSize,{n},{n}\nVUnit,Nm,rad\n"
    head += "SampleRate,1000.0000,1000.0000\nHUnit,s,s\nDate,2024/05/01,2024/05/01\nTime,10:11:12.00,10:11:12.00\n\n"
    return head + "".join(f",{u:.10E},{q:.10E}\n" for u, q in zip(m.u, m.q, strict=True))


def rigol(m: Motion) -> str:
    """The head's first row goes on with the names of two numbers, which stand in its second row."""
    head = "X,CH1,CH2,Start,Increment,\nSequence,Volt,Volt,0.000000e+00,1.000000e-03,\n"
    return head + "".join(f"{k},{u:.10e},{q:.10e},\n" for k, (u, q) in enumerate(zip(m.u, m.q, strict=True)))


def tektronix(m: Motion) -> str:
    """The head stands beside the first rows of the data."""
    keys = [("Record Length", str(m.t.size)), ("Sample Interval", "1.0e-03"), ("Trigger Point", "0.0"), ("", "")]
    keys += [("Source", "CH1"), ("Vertical Units", "V"), ("Horizontal Units", "s"), ("Model Number", "TDS2024B")]
    keys += [("", "")] * (m.t.size - len(keys))
    rows = zip(keys, *m, strict=True)
    return "".join(f"{key},{value},,{t:.9f},{u:.10f},{q:.10f},\n" for (key, value), t, u, q in rows)


def rohde(m: Motion) -> str:
    """Values of two channels without names, the interval and its unit in two rows of the head."""
    head = "Acquisition Time Stamp,2024-05-01 10:11:12\nWaveform Type,ANALOG,ANALOG\nHorizontal Unit,s\n"
    head += f"Horizontal Scale,0.4\nSample Interval,0.001\nRecord Length,{m.t.size}\nVertical Unit,V,V\n"
    return head + table(m.u, m.q)


def panasonic(m: Motion) -> str:
    """Names in two rows, seconds as the finest stamp, an event amid the data."""
    head = (
        "DATE,TIME,INTERVAL[10us],1,2\n,,,torque,position\n,,,axis 1,axis 1\n,,,MOMENT,MOMENT\n,,,FLT,FLT\n,,,Nm,deg\n"
    )
    rows = [
        f"20/07/24,12:00:{k // 1000:02d},100,{u:.8f},{q:.8f}\n"
        for k, (u, q) in enumerate(zip(m.u, m.q * 360 / TURN, strict=True))
    ]
    return head + "".join([*rows[:3000], "20/07/24,12:00:02,40,STOP TRG,\n", *rows[3000:]])


def rexroth(m: Motion) -> str:
    """Sections with the period in one of them, and statistics below."""
    head = (
        "[Settings]\n[DATE]\n24.07.2020 12:00:00\n[RECTIME]\nRECTIME: 1 ms, AutoStop: 0, Poti: 100\n[RECSEPARATOR]\n;\n"
    )
    rows = table(m.u, m.q * 360 / TURN, sep=";")
    return f"{head}[Data]\nTorque [Nm];Position [deg]\n{rows}[Statistics]\nNmbOfSamples: {m.t.size}\n"


def influx(m: Motion) -> str:
    """Annotations, and one row per reading: first all of one signal, then all of the other."""
    head = "#group,false,false,false,false,true\n#datatype,string,long,dateTime:RFC3339,double,string\n"
    head += "#default,_result,,,,\n,result,table,_time,_value,_field\n"
    return head + "".join(
        f",,{j},2024-05-01T00:00:{t:06.3f}Z,{x:.8f},{name}\n"
        for j, (name, signal) in enumerate((("position_rad", m.q), ("torque_nm", m.u)))
        for t, x in zip(m.t, signal, strict=True)
    )


def readings(m: Motion) -> str:
    """A row for each reading, the signals in turns, with their units in a column."""
    rows = zip(*m, strict=True)
    return "time_s;tag;value;unit\n" + "".join(f"{t:.3f};M;{u:.8f};Nm\n{t:.3f};phi;{q:.8f};rad\n" for t, u, q in rows)


def chinese(m: Motion) -> str:
    """As a spreadsheet saves it there, with the separator in the first line."""
    return "sep=;\n时间(ms);转矩(N·m);位置(°)\n" + table(
        (1e3 * m.t).round().astype(int), m.u, m.q * 360 / TURN, sep=";", comma=True
    )


def japanese(m: Motion) -> str:
    """Names in Shift JIS."""
    return "時間[ms],トルク[Nm],位置フィードバック[deg]\n" + table(
        (1e3 * m.t).round().astype(int), m.u, m.q * 360 / TURN
    )


def simulink(folder: Path, m: Motion) -> Path:
    """To Workspace, "structure with time"."""
    from scipy.io import savemat

    signals = np.empty(2, dtype=object)
    signals[:] = {"values": m.u, "label": "torque"}, {"values": m.q, "label": "position"}
    savemat(folder / "a.mat", {"out": {"time": m.t, "signals": signals}})
    return folder / "a.mat"


def one_file_a_signal(folder: Path, m: Motion) -> Path:
    """A folder with a table for each signal, the torque at another rate and offset."""
    path = folder / "run 7"
    path.mkdir()
    (path / "position.csv").write_text("time_ms,value [rad]\n" + table(1e3 * m.t, m.q), encoding="utf-8")
    (path / "torque.csv").write_text("time_ms,value [Nm]\n" + table(1e3 * m.t[4::2], m.u[4::2]), encoding="utf-8")
    return path


def text(maker: Callable[[Motion], str], name: str, encoding: str = "utf-8") -> Callable[[Path, Motion], Path]:
    """A writer of one file."""

    def write(folder: Path, m: Motion) -> Path:
        (folder / name).write_text(maker(m), encoding=encoding)
        return folder / name

    return write


CONSTANT = ["--torque-constant", "0.12+-0.01"]
SI = ["--unit", "drive=Nm", "--unit", "position=rad"]
LOGS: dict[str, tuple[Callable[[Path, Motion], Path], list[str]]] = {
    "TwinCAT, a time column for each channel": (text(twincat_all, "a.csv"), []),
    "TwinCAT, channels of two rates, decimal commas": (text(twincat_rates, "a.csv"), []),
    "TwinCAT, full time stamps": (text(twincat_filetime, "a.csv"), []),
    "TwinCAT, no time columns": (text(twincat_none, "a.csv"), []),
    "TwinCAT 2": (text(twincat2, "a.csv"), []),
    "ctrlX, sampling time in the head": (text(ctrlx, "a.csv"), []),
    "CODESYS, time beside each variable": (text(codesys, "a.csv"), []),
    "ODrive script, ticks of 8 kHz": (text(odrive_script, "a.txt"), CONSTANT),
    "ODrive script for MATLAB": (
        text(odrive_matrix, "a.m"),
        ["--columns", "0,2,1", "--unit", "position=turns", "--unit", "drive=A", *CONSTANT],
    ),
    "Arduino, Time: 5001 Position: 595": (text(arduino, "a.txt"), []),
    "Arduino Serial Plotter": (text(plotter, "a.txt"), ["--rate", "1000"]),
    "a folder, one file a signal": (one_file_a_signal, []),
    "three motors in turns": (text(motors, "a.csv"), ["--position", "position_rad.2", "--drive", "torque_nm.2"]),
    "last row cut amid a number": (text(cut, "a.csv"), []),
    "names with dashes before them": (text(dashes, "a.csv"), []),
    "an effort with its unit given": (text(effort, "a.csv"), ["--drive", "joint_effort", "--unit", "drive=Nm"]),
    "PlotJuggler, signals with stamps of their own": (text(plotjuggler, "a.csv"), ["--time", "__time"]),
    "LabVIEW measurement file": (text(lvm, "a.lvm"), []),
    "VESC Tool": (text(vesc, "a.csv"), ["--drive", "current_motor", "--unit", "position=deg", *CONSTANT]),
    "moteus": (text(moteus, "a.csv"), ["--unit", "position=turns", "--unit", "drive=Nm"]),
    "Dynamixel Wizard": (text(dynamixel, "a.csv"), ["--unit", "position=ticks/1000000", *CONSTANT]),
    "Feetech script, stamps of 10 ms": (text(feetech, "a.csv"), []),
    "EPOS Studio": (text(epos, "a.txt", "utf-16"), []),
    "Siemens trace, statistics below": (text(siemens, "a.csv"), []),
    "date and time of the day, German": (text(german, "a.csv", "cp1252"), []),
    "numbers with units, levels of a logger": (text(glued, "a.log"), []),
    "gains above the log": (text(gains_above, "a.csv"), []),
    "two joints by their names": (
        text(joints, "a.csv"),
        ["--position", "position_rad.elbow", "--drive", "torque_nm.elbow"],
    ),
    "minutes and inch pounds in a Markdown table": (text(imperial, "a.md"), []),
    "Simulink, structure with time": (simulink, ["--unit", "drive=Nm"]),
    "Hioki LR8400": (text(hioki, "a.csv"), ["--drive", "1-1[Nm]", "--position", "1-2[deg]"]),
    "Hioki 8807": (text(hioki_signals, "a.txt"), []),
    "Yokogawa DLM": (text(yokogawa, "a.csv"), []),
    "Rigol": (text(rigol, "a.csv"), ["--drive", "CH1", "--position", "CH2", *SI]),
    "Tektronix, the head beside the data": (text(tektronix, "a.csv"), ["--columns", "3,4,5", *SI]),
    "Rohde & Schwarz RTH, values only": (text(rohde, "a.csv"), ["--columns", "0,1", *SI]),
    "Panasonic trace, an event amid the data": (text(panasonic, "a.csv"), []),
    "Rexroth MTX, sections": (text(rexroth, "a.csv"), []),
    "InfluxDB, annotated CSV": (text(influx, "a.csv"), []),
    "one row per reading": (text(readings, "a.csv"), ["--drive", "M", "--position", "phi"]),
    "Chinese, GB 18030": (text(chinese, "a.csv", "gb18030"), []),
    "Japanese, Shift JIS": (text(japanese, "a.csv", "cp932"), []),
    "rostopic echo -p": (text(rostopic, "a.csv"), ["--drive", "field.effort0", "--unit", "drive=Nm"]),
}


def wrong(name: str, folder: Path) -> str:
    """What `whsklearn gap` reads otherwise than it was written; nothing if all is right."""
    from whsklearn.cli.gap import main as gap
    from whsklearn.cli.gap import read_log
    from whsklearn.logs import LogError
    from whsklearn.logs.units import factor_of

    write, options = LOGS[name]
    m = motion()
    path = write(folder, m)
    with gap.make_context("gap", [str(path), *options]) as context, warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            log = read_log(context.params)
        except LogError as error:
            return str(error)
    every = round(RATE / log.sample_rate)
    start = 4 if name.startswith("a folder") else 0  # samples before the first that both signals have
    q = log.y * factor_of(log.units["position"])[0]
    u = log.X[:, 0] * factor_of(log.units["drive"])[0]
    known = Motion(*(x[start::every] for x in m))
    short = known.t.size - q.size
    told = []
    if abs(log.sample_rate * every / RATE - 1.0) > 1e-3 or not 0 <= short <= 2:
        told.append(f"{q.size} samples at {log.sample_rate:.6g} Hz for {known.t.size} at {RATE / every:g} Hz")
        return "; ".join(told)
    fine = 4e-6 if name.startswith("Dynamixel") else 2e-7  # half a count
    if not np.allclose(q, known.q[: q.size], atol=fine):
        told.append(f"position differs by up to {np.abs(q - known.q[: q.size]).max():.2g} rad")
    odd = slice(0, None, 2) if "two rates" in name or name.startswith("a folder") else slice(None)  # between: a line
    if not np.allclose(u[odd], known.u[: u.size][odd], atol=2e-7):
        told.append(f"drive differs by up to {np.abs(u[odd] - known.u[: u.size][odd]).max():.2g} Nm")
    if factor_of(log.units["drive"])[1] != "Nm":
        told.append(f"the drive is in {log.units['drive']}")
    return "; ".join(told)


def main() -> None:
    """Print a line for each dialect."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--keep", type=Path, help="write the files into this folder, one folder each")
    options = parser.parse_args()
    right = 0
    for i, name in enumerate(LOGS):
        with tempfile.TemporaryDirectory() as scratch:
            folder = Path(scratch)
            if options.keep is not None:
                folder = options.keep / f"{i + 1:02d}"
                folder.mkdir(parents=True)
            said = wrong(name, folder)
        right += not said
        print(f"{name}: {said or 'right'}")
    print(f"{right} of {len(LOGS)} are read right.")


if __name__ == "__main__":
    main()
