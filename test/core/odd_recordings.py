"""Recordings as laboratories have them: what is written, how it is read, and what has to come of it.

The truth is one loop with creep by a crude model of its own; each case writes it in its own odd way.
"""

from __future__ import annotations

import gzip
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

_N = 1200
Arrays = tuple[np.ndarray, np.ndarray, np.ndarray]


def truth(
    n: int = _N, step_s: float = 1e-3, volts: float = 100.0, microns: float = 20.0, noise: float = 1e-4
) -> Arrays:
    """Return time [s], voltage [V] and displacement [um] of decreasing triangles, shape (n,) each."""
    k = np.arange(n)
    unit = np.abs((k / (n / 9.5) + 1.0) % 2.0 - 1.0) * (1.0 - 0.35 * k / n)
    at, creep, moved = 0.0, 0.0, np.empty(n)
    for i, u in enumerate(unit):
        at = min(max(at, u - 0.12), u + 0.12)
        creep += 0.01 * (u - creep)
        moved[i] = 0.55 * u + 0.4 * at + 0.05 * creep
    rng = np.random.default_rng(1)
    return k * step_s, volts * unit, microns * (moved + noise * rng.standard_normal(n)) - 3.0


@dataclass(frozen=True)
class Odd:
    """One case.

    Attributes:
        name: of the case and of the file, with its suffix.
        write: writes the file.
        options: of the command that reads it.
        refused: part of the one line that refuses it; None where it is understood.
        scales: what is read over the truth, time, voltage and displacement, where it is understood.
        said: part of what is told of it.
        rows: rows of the truth that are read, where not all.
    """

    name: str
    write: Callable[[Path], None]
    options: tuple[str, ...] = ()
    refused: str | None = None
    scales: tuple[float, float, float] = (1.0, 1.0, 1.0)
    said: str = ""
    rows: slice | np.ndarray = field(default_factory=lambda: slice(None))
    shape: dict[str, float] = field(default_factory=dict)


def _text(
    header: str,
    separator: str = ",",
    decimal: str = ".",
    units: Arrays | tuple[float, float, float] = (1.0, 1.0, 1.0),
    **more: str,
) -> Callable[[Path], None]:
    def write(path: Path) -> None:
        columns = [unit * values for unit, values in zip(units, truth(), strict=True)]
        rows = [separator.join(f"{v:.9g}" for v in row).replace(".", decimal) for row in zip(*columns, strict=True)]
        end = more.get("end", "\n")
        body = end.join([*([header] if header else []), *(r + more.get("tail", "") for r in rows)])
        path.write_bytes((more.get("above", "") + body + end).encode(more.get("encoding", "utf-8")))

    return write


def _changed(change: Callable[[Arrays], Arrays], **shape: float) -> Callable[[Path], None]:
    def write(path: Path) -> None:
        columns = change(truth(**shape))  # type: ignore[arg-type]
        rows = [",".join("" if np.isnan(v) else f"{v:.9g}" for v in row) for row in zip(*columns, strict=True)]
        path.write_text("\n".join(["time_s,voltage_v,displacement_um", *rows, ""]))

    return write


def _replaced(index: int, at: object, value: float | np.ndarray) -> Callable[[Arrays], Arrays]:
    def change(columns: Arrays) -> Arrays:
        columns[index][at] = value  # type: ignore[index]
        return columns

    return change


def _npz(path: Path) -> None:
    t, v, x = truth()
    np.savez(path, time_s=t, voltage_mV=1e3 * v, displacement_nm=1e3 * x)


def _mat(path: Path) -> None:
    from scipy.io import savemat

    t, v, x = truth()
    savemat(path, {"Time_ms": 1e3 * t, "V_out_V": v, "pos_um": x, "comment": "third run"})


def _gzip(path: Path) -> None:
    t, v, x = truth()
    rows = "\n".join(f"{a:.9g},{b:.9g},{c:.9g}" for a, b, c in zip(t, v, x, strict=True))
    path.write_bytes(gzip.compress(("time_s,voltage_v,displacement_um\n" + rows).encode()))


def _frame(kind: str) -> Callable[[Path], None]:
    def write(path: Path) -> None:
        import pandas

        t, v, x = truth()
        frame = pandas.DataFrame({"Time (ms)": 1e3 * t, "Voltage [V]": v, "Position [nm]": 1e3 * x})
        frame.to_parquet(path) if kind == "parquet" else frame.to_excel(path, index=False)

    return write


def _hdf5(path: Path) -> None:
    import h5py

    with h5py.File(path, "w") as held:
        for name, unit, values in zip(("time", "drive", "position"), ("s", "V", "um"), truth(), strict=True):
            held.create_dataset(f"run/{name}", data=values).attrs["unit"] = unit


def _tdms(path: Path) -> None:
    from nptdms import ChannelObject, TdmsWriter

    t, v, x = truth()
    with TdmsWriter(path) as writer:
        step = {"wf_increment": float(t[1])}
        writer.write_segment([ChannelObject("run", "voltage", v, {"unit_string": "V", **step})])
        writer.write_segment([ChannelObject("run", "position", x, {"unit_string": "um"})])


_TEK = "Model,MSO2024\nFirmware Version,1.56\n\nPoint Format,Y,,\nSample Interval,1.0e-3,s\n\n"
_KEYSIGHT = "x-axis,1,2\nsecond,Volt,micron\n"
_LATIN = "latin-1"
_TO_NM, _IN_MS, _IN_MV = (1.0, 1.0, 1e3), (1e3, 1.0, 1.0), (1.0, 1e3, 1.0)
_SWAPPED = "swapped"
_SPIKES = "spikes: 5 samples"

UNDERSTOOD: tuple[Odd, ...] = (
    Odd("plain.csv", _text("time_s,voltage_v,displacement_um")),
    Odd("capitals.csv", _text("TIME_S, Voltage_V ,Displacement_UM")),
    Odd("packed.csv.gz", _gzip),
    Odd("semicolons.csv", _text("time_s;voltage_v;displacement_um", ";")),
    Odd("decimal_commas.csv", _text("time_s;voltage_v;displacement_um", ";", ",")),
    Odd("german.csv", _text("Zeit (ms);Spannung (V);Weg (µm)", ";", ",", _IN_MS)),
    Odd("tabs.txt", _text("time_s\tvoltage_v\tdisplacement_um", "\t")),
    Odd("tabs_and_commas.txt", _text("t [s]\tU [V]\tx [um]", "\t", ",")),
    Odd("spaces.dat", _text("time_s voltage_v displacement_um", "  ")),
    Odd("quoted.csv", _text('"Time (s)","Voltage (V)","Position (um)"')),
    Odd("windows.csv", _text("Time (s),Voltage (V),Position (um)", end="\r\n")),
    Odd("trailing.csv", _text("Time (s),Voltage (V),Position (um),", tail=",")),
    Odd("byte_mark.csv", _text("Time (s),Voltage (V),Position (um)", above="\ufeff")),
    Odd("ms.csv", _text("Time (ms),V_out [V],pos/um", units=_IN_MS)),
    Odd("mv.csv", _text("t/s,V_out [mV],pos/um", units=_IN_MV)),
    Odd("nm.csv", _text("time_s,voltage_v,displacement_nm", units=_TO_NM)),
    Odd("us.csv", _text("Time (us),Drive (V),Sensor (um)", units=(1e6, 1.0, 1.0))),
    Odd("kv.csv", _text("time_s,Voltage [kV],displacement_um", units=(1.0, 1e-3, 1.0))),
    Odd("mm.csv", _text("time in s,voltage in V,displacement in mm", units=(1.0, 1.0, 1e-3))),
    Odd("metres.csv", _text("time (s),voltage (V),position (m)", units=(1.0, 1.0, 1e-6))),
    Odd("tektronix.csv", _text("TIME (s),CH1 (V),CH2 (um)", above=_TEK)),
    Odd("keysight.csv", _text("", above=_KEYSIGHT)),
    Odd("commented.csv", _text("Time (s),Voltage (V),Position (um)", above="# stage 7\n% run 3\n\n")),
    Odd("marked_header.dat", _text("# time_s voltage_v displacement_um", " ")),
    Odd("named_units.csv", _text("a,b,c"), ("--columns", "time=0,voltage=1,displacement=2")),
    Odd(
        "counts.csv",
        _text("Time (s),Drive,Sensor", units=(1.0, 1 / 15.0, 0.1)),
        ("--units", "voltage=15V,displacement=10um"),
    ),
    Odd("told.csv", _text("Time,Voltage,Position", units=_IN_MS), ("--units", "time=ms,voltage=V,displacement=um")),
    Odd("no_header.dat", _text(""), ("--columns", "time=0,voltage=1,displacement=2")),
    Odd("arrays.npz", _npz),
    Odd("matlab.mat", _mat),
    Odd("table.parquet", _frame("parquet")),
    Odd("table.xlsx", _frame("xlsx")),
    Odd("table.h5", _hdf5),
    Odd("table.tdms", _tdms),
    Odd(
        "spikes.csv",
        _changed(_replaced(2, [100, 300, 500, 700, 900], np.array([90.0, -70.0, 80.0, 60.0, -40.0]))),
        said=_SPIKES,
        rows=slice(0, 100),
    ),
    Odd("dropouts.csv", _changed(_replaced(2, slice(55, 1100, 55), -50.0)), said="dropouts: 19", rows=slice(0, 55)),
    Odd("slow.csv", _changed(lambda c: c, step_s=10.0, n=200), shape={"step_s": 10.0, "n": 200}),
    Odd("fast.csv", _changed(lambda c: c, step_s=1e-6), shape={"step_s": 1e-6}),
    Odd(
        "nan_dropped.csv",
        _changed(_replaced(2, [50, 60], np.nan)),
        ("--drop-nan",),
        said="2 of 1200",
        rows=slice(0, 50),
    ),
    Odd(
        "resampled.csv", _text("time_s,voltage_v,displacement_um"), ("--resample", "1000"), said="1200 rows at 1000 Hz"
    ),
    Odd(
        "mixed_up.csv",
        _changed(lambda c: tuple(np.concatenate((a[600:], a[:600], a[5:6])) for a in c)),  # type: ignore[arg-type,return-value]
        ("--sort",),
        said="1 rows of a time left out",
    ),
    Odd(
        "despiked.csv",
        _changed(_replaced(2, [100, 300], 90.0)),
        ("--despike",),
        said="despiked: 2 readings",
        rows=slice(0, 100),
    ),
    Odd("reversed_and_told.csv", _changed(lambda c: (c[0], c[1], -c[2])), ("--units", "displacement=-1um")),
)

REFUSED: tuple[Odd, ...] = (
    Odd(
        "no_units.csv",
        _text("Time,Voltage,Position"),
        refused="does not say the unit of time and voltage and displacement",
    ),
    Odd("two_voltages.csv", _text("Time (s),CH1 (V),CH2 (V)"), refused="two columns are voltage"),
    Odd(
        "no_voltage.csv",
        _text("time_s,current_a,displacement_um"),
        refused="no column voltage_v, got 'time_s,current_a",
    ),
    Odd("no_time.csv", _text("index,voltage_v,displacement_um"), refused="no column time_s and no rate"),
    Odd("headless.csv", _text(""), refused="no header line naming the columns"),
    Odd("reversed.csv", _changed(lambda c: (c[0], c[1], -c[2])), refused="sign of one reversed"),
    # it can be imported so; but no model of a stage falls with its voltage
    Odd(
        "reversed_accepted.csv",
        _changed(lambda c: (c[0], c[1], -c[2])),
        ("--accept",),
        refused="the sign of one is reversed",
    ),
    Odd("swapped.csv", _changed(lambda c: (c[0], c[2], c[1]), microns=90.0), refused="columns swapped"),
    Odd(
        "unrelated.csv",
        _changed(lambda c: (c[0], c[1], np.random.default_rng(3).normal(size=_N))),
        refused="nothing to do",
    ),
    Odd("twice.csv", _changed(lambda c: (c[0], c[1], c[1])), refused="is it the same column"),
    Odd(
        "ms_as_s.csv",
        _changed(lambda c: (1e3 * c[0], c[1], c[2]), n=6000, step_s=1e-3 * 0.2),
        refused="ms or us read as s",
    ),
    Odd("nm_as_um.csv", _changed(lambda c: (c[0], c[1], 1e3 * c[2])), refused="nm read as um"),
    Odd("mv_as_v.csv", _changed(lambda c: (c[0], 1e3 * c[1], c[2])), refused="mV read as V"),
    Odd(
        "nan_rows.csv",
        _changed(_replaced(2, [50, 60], np.nan)),
        refused="line 52, column displacement_um: not a number",
    ),
    Odd("same_stamp.csv", _changed(_replaced(0, 70, 0.069)), refused="line 72, column time_s: time does not increase"),
    Odd("back_in_time.csv", _changed(_replaced(0, 70, 0.01)), refused="time does not increase"),
    Odd(
        "gap.csv", _changed(lambda c: (c[0] + (np.arange(_N) > 600) * 0.5, c[1], c[2])), refused="gap after sample 600"
    ),
    Odd("clipped.csv", _changed(lambda c: (c[0], c[1], np.minimum(c[2], 8.0))), refused="sensor is clipped"),
    Odd(
        "clipped_noisy.csv",
        _changed(
            lambda c: (c[0], c[1], np.minimum(c[2], 8.0) + 2e-3 * np.random.default_rng(0).normal(size=c[0].size)),
            n=4000,
        ),
        refused="flat at the highest reading but for noise",
    ),
    Odd("half_wrong.csv", _changed(_replaced(2, slice(3, None, 8), -90.0)), refused="readings are wrong"),
    Odd("short.csv", _changed(lambda c: c, n=50), refused="record is too short, got 50"),
    Odd("still.csv", _changed(lambda c: (c[0], 0.0 * c[1] + 5.0, c[2])), refused="voltage is constant"),
    Odd("words.csv", lambda path: path.write_text("to be done\n") and None, refused="no column voltage_v"),
    Odd("empty.csv", lambda path: path.write_text("") and None, refused="empty file"),
    Odd("broken.npz", lambda path: path.write_bytes(b"PK no zip") and None, refused="cannot be read as .npz"),
    Odd(
        "ragged.csv", lambda path: path.write_text("time_s,voltage_v\n0,1\n1\n2,3\n") and None, refused="another number"
    ),
)
