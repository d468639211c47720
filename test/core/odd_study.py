"""Odd recordings through the commands: each understood as it was meant, or refused in one line.

    python test/core/odd_study.py             # the table: import, check and identify of each
    python test/core/odd_study.py --large     # 10^6 rows at 1 MHz as text, 10^7 rows as arrays
    python test/core/odd_study.py --mistakes  # mistakes on stages drawn at random: how many are seen

A line for each case that is not as expected, and the counts at the end.
"""

from __future__ import annotations

import argparse
import contextlib
import io
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path

import numpy as np
from odd_exports import EXPORTS_REFUSED, EXPORTS_UNDERSTOOD
from odd_recordings import REFUSED, UNDERSTOOD, Odd, truth
from stage_records import N, drives, loop

from fomrc_core import Recording
from fomrc_core.cli.application import run
from fomrc_core.errors import FomrcError
from fomrc_core.records.plausibility import suspicions
from fomrc_core.records.quality import examine
from fomrc_core.records.usability import check_usable
from fomrc_core.storage import read_recording


def told(arguments: list[str]) -> tuple[int, list[str]]:
    """Return exit status and lines on standard error of a command."""
    errors = io.StringIO()
    with contextlib.redirect_stderr(errors), contextlib.redirect_stdout(io.StringIO()):
        status = run(arguments)
    return status, errors.getvalue().splitlines()


def as_understood(odd: Odd, path: Path, folder: Path) -> str:
    """Return what is wrong with how a file is understood by import, check and identify; empty where nothing is."""
    ours, model = folder / "ours.csv", folder / "model.yaml"
    status, lines = told(["import", str(path), "--output", str(ours), *odd.options])
    if status != 0:
        return f"import: {lines[-1]}"
    read = read_recording(ours)
    expected = truth(**odd.shape)  # type: ignore[arg-type]
    for values, meant, scale in zip((read.time_s, read.voltage_v, read.measured_um), expected, odd.scales, strict=True):
        if not np.allclose(values[odd.rows], scale * meant[odd.rows], rtol=1e-6, atol=1e-6 * float(np.ptp(meant))):
            return "import: silently wrong"
    for command in (["check"], ["identify", "--output", str(model)]):
        status, lines = told([*command, str(path), "--elements", "4", *odd.options])
        if status != 0:
            return f"{command[0]}: {lines[-1]}"
    return ""


def as_refused(odd: Odd, path: Path, folder: Path) -> str:
    """Return what is wrong with how a file is refused by check, identify and diagnose; empty where nothing is."""
    for command in (["check"], ["identify", "-o", str(folder / "no.yaml")], ["diagnose", "-o", str(folder / "no")]):
        status, lines = told([*command, str(path), *odd.options])
        if status != 2 or not lines or not lines[-1].startswith("fomrc: "):
            return f"{command[0]}: exit {status}, {lines[-1:]}"
        if odd.refused not in lines[-1]:
            return f"{command[0]}: refused for another reason: {lines[-1]}"
        if (folder / "no.yaml").exists() or (folder / "no" / "model.yaml").exists():
            return f"{command[0]}: something written"
    return ""


def table(folder: Path) -> bool:
    """Run every case, print what is not as expected and the counts; return whether all are."""
    counts: Counter[str] = Counter()
    for judge, cases in (
        (as_understood, (*UNDERSTOOD, *EXPORTS_UNDERSTOOD)),
        (as_refused, (*REFUSED, *EXPORTS_REFUSED)),
    ):
        for odd in cases:
            path = folder / odd.name
            odd.write(path)
            wrong = judge(odd, path, folder)
            counts[f"{judge.__name__}{': not' if wrong else ''}"] += 1
            if wrong:
                print(f"{odd.name}: {wrong}", flush=True)
    print(", ".join(f"{name.replace('_', ' ')} {count}" for name, count in counts.items()))
    return not any(name.endswith("not") for name in counts)


def large(folder: Path) -> None:
    """Read recordings of 10^6 rows of text at 1 MHz and of 10^7 rows of arrays; print what was said and the time."""
    for n, step_s, name in ((1_000_000, 1e-6, "fast.csv"), (10_000_000, 1e-5, "long.npz")):
        path = folder / name
        t = step_s * np.arange(n)
        v = 50.0 - 50.0 * np.cos(2.0 * np.pi * 10.0 / (n * step_s) * t)
        x = 0.2 * (v + 8.0 * np.sin(2.0 * np.pi * 10.0 / (n * step_s) * t)) + 1e-3 * np.random.default_rng(0).normal(
            size=n
        )
        if name.endswith("npz"):
            np.savez(path, time_s=t, voltage_V=v, position_um=-x)
        else:
            np.savetxt(path, np.stack((t, v, -x), axis=1), "%.9g", ",", header="t (s),U (V),x (um)", comments="")
        begin = time.process_time()
        status, lines = told(["import", str(path), "--output", str(folder / "ours.csv")])
        print(f"{name}, {n} rows, sign reversed: exit {status} after {time.process_time() - begin:.0f} s: {lines[-1]}")


def _verdict(time_s: np.ndarray, voltage_v: np.ndarray, displacement_um: np.ndarray) -> bool:
    """Return whether a recording is refused."""
    try:
        record = Recording(time_s, voltage_v, displacement_um)
        if suspicions(record):
            return True
        check_usable([record])
        examine(record)
    except FomrcError:
        return True
    return False


def mistakes() -> None:
    """Print for each mistake how many recordings of stages drawn at random are refused."""
    refused: Counter[str] = Counter()
    n_stages = 0
    for seed in range(8):
        rng = np.random.default_rng(seed + 100)
        for drive in drives(rng).values():
            n_stages += 1
            unit = (drive - np.min(drive)) / float(np.ptp(drive))
            volts, gain = 10.0 ** rng.uniform(0.7, 2.7), 10.0 ** rng.uniform(-2.0, 0.5)
            step_s, noise = 10.0 ** rng.uniform(-5.0, -1.0), 10.0 ** rng.uniform(-4.5, -2.5)
            t, v, moved = step_s * np.arange(N), volts * unit, loop(unit)
            x = gain * volts * (moved / float(np.ptp(moved)) + noise * rng.standard_normal(N))
            other = list(drives(rng).values())[int(rng.integers(10))]
            for name, columns in {
                "sound": (t, v, x),
                "sign reversed": (t, v, -x),
                "columns swapped, clean drive": (t, x, v),
                "columns swapped, drive read back with noise": (t, x, v + 1e-4 * volts * rng.standard_normal(N)),
                "same column twice": (t, v, v),
                "monitor of the amplifier": (t, v, gain * (v + 1e-5 * volts * rng.standard_normal(N))),
                "noise for displacement": (t, v, gain * rng.standard_normal(N)),
                "drift for displacement": (t, v, gain * np.cumsum(rng.standard_normal(N))),
                "displacement of another run": (t, v, gain * volts * loop(other)),
                "nm read as um": (t, v, 1e3 * x),
                "mV read as V": (t, 1e3 * v, x),
                "ms read as s": (1e3 * t, v, x),
                "nothing measured": (t, v, 0.0 * x + 1.0),
            }.items():
                refused[name] += _verdict(*columns)
    for name, count in refused.items():
        print(f"{name}: {count} of {n_stages} refused")


def main() -> None:
    """Run what is asked for."""
    parser = argparse.ArgumentParser(description="Odd recordings through the commands.")
    parser.add_argument("--large", action="store_true", help="10^6 and 10^7 rows")
    parser.add_argument("--mistakes", action="store_true", help="mistakes on stages drawn at random")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        if options.large:
            large(Path(folder))
        elif options.mistakes:
            mistakes()
        elif not table(Path(folder)):
            sys.exit(1)


if __name__ == "__main__":
    main()
