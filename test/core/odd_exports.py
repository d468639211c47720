"""What programs and instruments write, beyond a table with a header: whole files, and what has to come of each."""

from __future__ import annotations

from collections.abc import Callable
from datetime import datetime, timedelta
from pathlib import Path

import numpy as np
from odd_recordings import Odd, truth

_RIGOL = "X,CH1,CH2,Start,Increment,\nSequence,Volt,um,0.000000e+00,1.000000e-03,\n"
_LECROY = "LECROYHDO4024,13127,Waveform\nSegments,1,SegmentSize,1200\nSegment,TrigTime,TimeSinceSegment1\n"
_LECROY += "#1,22-Nov-2026 10:14:55,0\n"
_SIGLENT = (
    "Record Length,Analog:1200\nSample Interval,Analog:0.001\nVertical Units,CH1:V CH2:um\nVertical Scale,CH1:20.00\n"
)
_PICO = "Time,Channel A,Channel B\n(ms),(V),(um)\n\n"
_LVM = "LabVIEW Measurement\t\nWriter_Version\t2\nSeparator\tTab\nDecimal_Separator\t.\n***End_of_Header***\t\n\t\n"
_LVM += "Channels\t2\t\t\nSamples\t1200\t1200\t\nDate\t2026/11/22\t2026/11/22\t\nY_Unit_Label\tV\tum\t\n"
_LVM += "***End_of_Header***\t\t\t\n"
_DEWE = "Data acquisition 7\nStart time: 22.11.2026 10:14\nNumber of channels: 2\n\n"
_HEADER = "time_s,voltage_v,displacement_um"
_IN_SECONDS = "Time (s),Voltage (V),Position (um)"


def _rows(separator: str = ",", form: str = ".9g", times: list[str] | None = None) -> list[str]:
    t, v, x = truth()
    stamps = times or [f"{at:{form}}" for at in t]
    return [f"{at}{separator}{a:{form}}{separator}{b:{form}}" for at, a, b in zip(stamps, v, x, strict=True)]


def _file(above: str, rows: list[str], below: str = "", encoding: str = "utf-8") -> Callable[[Path], None]:
    def write(path: Path) -> None:
        path.write_bytes((above + "\n".join(rows) + "\n" + below).encode(encoding))

    return write


def _dates() -> list[str]:
    start = datetime(2026, 11, 22, 10, 14, 55)
    return [
        str(start + timedelta(milliseconds=k)) if k % 1000 else f"{start + timedelta(milliseconds=k)}.000"
        for k in range(1200)
    ]


def _clock() -> list[str]:
    return [f"10:14:{55 + k / 1e3:06.3f}" for k in range(1200)]


def _npy(path: Path) -> None:
    np.save(path, np.stack(truth(), axis=1))


def _mat_of_structs(path: Path) -> None:
    from scipy.io import savemat

    t, v, x = truth()
    savemat(path, {"run": {"time_s": t, "voltage_V": v, "position_nm": 1e3 * x, "note": "third"}})


def _two_groups(path: Path) -> None:
    import h5py

    with h5py.File(path, "w") as held:
        for name, unit, values in zip(("t", "u", "x"), ("ms", "V", "nm"), truth(), strict=True):
            scale = {"ms": 1e3, "V": 1.0, "nm": 1e3}[unit]
            held.create_dataset(f"raw/{name}", data=scale * values).attrs["units"] = unit
        held.create_dataset("settings/gains", data=np.arange(7.0))


_COLUMNS = ("--columns", "time=0,voltage=1,displacement=2")


def _columns(form: str = ".9g", **scales: float) -> list[str]:
    """Return the rows in other units: factors of time, voltage and displacement by t, v and x."""
    factors = [scales.get(name, 1.0) for name in "tvx"]
    return [
        ",".join(f"{k * value:{form}}" for k, value in zip(factors, row, strict=True))
        for row in zip(*truth(), strict=True)
    ]


def _without_x(cell: str) -> list[str]:
    return [f"{row.rpartition(',')[0]},{cell}" for row in _rows()]


EXPORTS_UNDERSTOOD: tuple[Odd, ...] = (
    Odd("utf16.csv", _file(_IN_SECONDS + "\n", _rows(), encoding="utf-16")),
    Odd("utf16_tabs.txt", _file(_IN_SECONDS.replace(",", "\t") + "\n", _rows("\t"), encoding="utf-16")),
    Odd("windows_1252.csv", _file("Zeit (s),Spannung (V),Weg (\u00b5m)\n", _rows(), encoding="cp1252")),
    Odd("excel_sep.csv", _file("sep=;\n" + _HEADER.replace(",", ";") + "\n", _rows(";"))),
    Odd(
        "lecroy.csv",
        _file(_LECROY + "Time,Ampl,Ampl\n", _rows()),
        (*_COLUMNS, "--units", "time=s,voltage=V,displacement=um"),
    ),
    Odd("siglent.csv", _file(_SIGLENT + "Second,Volt,um\n", _rows())),
    Odd("picoscope.csv", _file(_PICO, _columns(t=1e3))),
    Odd(
        "labview.lvm",
        _file(_LVM + "X_Value\tVoltage (V)\tPosition (um)\tComment\n", _rows("\t")),
        ("--units", "time=s"),
    ),
    Odd("dewesoft.txt", _file(_DEWE + "Time (s)\tVoltage (V)\tPosition (um)\n", _rows("\t"))),
    Odd("array.npy", _npy, (*_COLUMNS, "--units", "time=s,voltage=V,displacement=um")),
    Odd("struct.mat", _mat_of_structs),
    Odd("groups.h5", _two_groups),
    Odd("remark_below.csv", _file(_HEADER + "\n", _rows(), "# end of measurement\n")),
    Odd("greek.csv", _file("t / s;U / V;x / \u03bcm\n", _rows(";"))),
    Odd("row_numbers.csv", _file(f",{_HEADER}\n", [f"{k},{row}" for k, row in enumerate(_rows())])),
    Odd("sample_in_ms.csv", _file("t (ms),U (V),x (um)\n", _rows(times=[str(k) for k in range(1200)]))),
    Odd("picometres.csv", _file("Time (ns),V (V),D (pm)\n", _columns(t=1e9, x=1e6))),
    Odd("x_is_time.csv", _file("X (s),Y1 (V),Y2 (um)\n", _rows())),
    Odd(
        "repeated_header_dropped.csv",
        _file(_IN_SECONDS + "\n", [*_rows()[:600], _IN_SECONDS, *_rows()[600:]]),
        ("--drop-nan",),
    ),
    Odd(
        "voltage_read_back.csv",
        _file("t (s),set (V),read (V),x (um)\n", [row.replace(",", ",1,", 1) for row in _rows()]),
        ("--columns", "time=0,voltage=2,displacement=3", "--units", "time=s,voltage=V,displacement=um"),
    ),
)

EXPORTS_REFUSED: tuple[Odd, ...] = (
    Odd(
        "rigol.csv",
        _file(_RIGOL, [f"{k},{','.join(row.split(',')[1:])},," for k, row in enumerate(_rows())]),
        refused="no column is time",
    ),
    Odd(
        "dates.csv",
        _file(_IN_SECONDS + "\n", _rows(times=_dates())),
        refused="1200 of 1200 rows hold no number in time_s",
    ),
    Odd(
        "clock.csv",
        _file(_IN_SECONDS + "\n", _rows(times=_clock())),
        refused="1200 of 1200 rows hold no number in time_s",
    ),
    Odd(
        "fortran.dat",
        _file(_HEADER.replace(",", " ") + "\n", [row.replace("e", "D") for row in _rows(" ", ".9e")]),
        refused="not a number",
    ),
    Odd(
        "sentence_below.csv",
        _file(_IN_SECONDS + "\n", _rows(), "end of measurement\n"),
        refused="line 1202: row has another number of cells",
    ),
    Odd(
        "half_row.csv",
        _file(_HEADER + "\n", [*_rows()[:-1], "1.19"]),
        refused="line 1201: row has another number of cells",
    ),
    Odd(
        "repeated_header.csv",
        _file(_IN_SECONDS + "\n", [*_rows()[:600], _IN_SECONDS, *_rows()[600:]]),
        refused="1 of 1201 rows hold no number",
    ),
    Odd(
        "minus_sign.csv",
        _file(_IN_SECONDS + "\n", [row.replace("-", "\u2212") for row in _rows()]),
        refused="rows hold no number in displacement_um",
    ),
    Odd(
        "thousands.csv",
        _file(_HEADER + "\n", [f'{row.split(",")[0]},"1,{row.split(",")[1]}",2.5' for row in _rows()]),
        refused="another number of cells",
    ),
    Odd(
        "units_in_cells.csv",
        _file("time,voltage,position\n", [" s,".join(row.split(",", 1)) + " um" for row in _rows()]),
        refused="another unit, or none",
    ),
    Odd("megavolts.csv", _file("t (s),U (MV),x (um)\n", _rows()), refused="does not say the unit of voltage"),
    Odd("percent.csv", _file("Time (s),Drive (%),Sensor (um)\n", _rows()), refused="does not say the unit of voltage"),
    Odd(
        "two_sensors.csv",
        _file(_IN_SECONDS + ",Sensor 2 (um)\n", [f"{row},1.0" for row in _rows()]),
        refused="two columns are displacement",
    ),
    Odd("tilt.csv", _file("Time (s),Voltage (V),Tilt (urad)\n", _rows()), refused="no displacement"),
    Odd("target_only.csv", _file("time_s,voltage_v,desired_um\n", _rows()), refused="no displacement"),
    Odd(
        "rounded_stamps.csv",
        _file(_IN_SECONDS + "\n", _rows(times=[f"{k / 1e3:.2f}" for k in range(1200)])),
        refused="time_s does not increase",
    ),
    Odd(
        "unix_rounded.csv", _file(_IN_SECONDS + "\n", _rows(times=["1.7e9"] * 1200)), refused="time_s does not increase"
    ),
    Odd("rests.csv", _file(_HEADER + "\n", _without_x("3.0")), refused="displacement is constant"),
    Odd(
        "zero_bytes.csv",
        lambda path: path.write_bytes(b"time_s,voltage_v\n0,1\n" + bytes(400)) and None,
        refused="not a text file",
    ),
    Odd("json.csv", lambda path: path.write_text('{"time_s": [0, 1]}') and None, refused="no column voltage_v"),
    Odd(
        "html.csv",
        lambda path: path.write_text("<html><td>1</td><td>2</td></html>") and None,
        refused="no column voltage_v",
    ),
    Odd("column_without_name.npy", _npy, refused="no column is time"),
)
