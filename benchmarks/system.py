"""Memory, identification, diagnosis, fleets."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.subjects import ROOT, record, table_1
from benchmarks.timing import Row

# of this program alone: what the process was before it is in getrusage as well
_PEAK = "print(next(int(l.split()[1]) for l in open('/proc/self/status') if l.startswith('VmHWM')) / 1024)"


def memory() -> list[Row]:
    """Peak memory of an hour in one batch, and of a day in chunks, each in a process of its own."""
    hour = (
        "from benchmarks.subjects import drive, table_1\n"
        "s, u = drive(3_600_000); x = table_1().simulate(s, u); assert x.size == 3_600_000\n" + _PEAK
    )
    day = (
        "import numpy as np; from benchmarks.subjects import drive, table_1\n"
        "from fomrc_core.model.streaming import Chunk, stream\n"
        "s, u = drive(200_000); n = 0\n"
        "for x in stream(table_1(), (Chunk(s, u) for _ in range({chunks}))): n += x.size\n"
        "assert n == {chunks} * 200_000\n" + _PEAK
    )
    scripts = {"hour": hour, "minutes": day.format(chunks=2), "day": day.format(chunks=432)}
    peak, seconds = {}, {}
    for name, script in scripts.items():
        start = time.perf_counter()
        done = subprocess.run([sys.executable, "-c", script], cwd=ROOT, capture_output=True, text=True, check=True)
        peak[name], seconds[name] = float(done.stdout.split()[-1]), time.perf_counter() - start
    return [
        Row(
            "an hour at 1 kHz in one batch, peak memory of the process",
            f"{peak['hour']:.0f} MB",
            "< 500 MB",
            peak["hour"] < 500.0,
        ),
        Row(
            "a day at 1 kHz in chunks, peak memory of the process",
            f"{peak['day']:.0f} MB in {seconds['day']:.1f} s; {peak['minutes']:.0f} MB for 400 s of it",
            "constant",
            peak["day"] <= 1.05 * peak["minutes"],
        ),
    ]


def identification() -> list[Row]:
    """Identify Table 1 from 60 000 samples with 1 nm of noise, in a process of its own."""
    script = "import json; from benchmarks.system import identify_once; print(json.dumps(identify_once()))"
    done = subprocess.run([sys.executable, "-c", script], cwd=ROOT, capture_output=True, text=True, check=True)
    seconds, ratio, off = json.loads(done.stdout)
    return [
        Row(
            "identify 22 parameters, 60 000 samples",
            f"{seconds:.2f} s CPU, rms {ratio:.4f} x noise, creep order {100 * off:.2f} % off",
            "<= 0.5 s; <= 1.01 x noise",
            seconds <= 0.5 and ratio <= 1.01,
        )
    ]


def identify_once(n: int = 60_000, noise_um: float = 1e-3) -> tuple[float, float, float]:
    """Return processor time [s] of an identification after a warm-up, rms over noise, relative error of the order."""
    from fomrc_core.identification.convex import identify

    measured = record(n, noise_um)
    identify(record(4000, noise_um), n_elements=10)
    best = float("inf")
    for _ in range(3):
        start = time.process_time()
        fit = identify(measured, n_elements=10)
        best = min(best, time.process_time() - start)
    return best, fit.rms_um / noise_um, abs(fit.model.creep_order / 0.015 - 1.0)


def diagnosis(n: int = 90_000) -> list[Row]:
    """Diagnose a record of 90 000 samples that hides an amplifier's bandwidth."""
    from concurrent.futures import ThreadPoolExecutor

    from fomrc_core.diagnosis.diagnosis import diagnose
    from fomrc_core.effects.amplifier_bandwidth import AmplifierBandwidth
    from fomrc_core.records.recording import Recording

    plain = record(n, 0.0)
    hidden = table_1().with_effects(AmplifierBandwidth(cutoff_hz=40.0))
    moved = hidden.simulate(plain.steps_s, plain.voltage_v)
    noisy = moved + 2e-3 * np.random.default_rng(3).standard_normal(n)
    measured = Recording(plain.time_s, plain.voltage_v, noisy)
    short = Recording(plain.time_s[:9000], plain.voltage_v[:9000], noisy[:9000])
    with ThreadPoolExecutor(2) as executor:
        diagnose(short, executor=executor)
        start, cpu = time.perf_counter(), time.process_time()
        found = diagnose(measured, executor=executor)
        seconds, cpu = time.perf_counter() - start, time.process_time() - cpu
    first = found.findings[0].cause if found.findings else "none"
    return [
        Row(
            f"diagnose {n} samples, all causes, 2 threads",
            f"{seconds:.1f} s ({cpu:.1f} s CPU), found {first}",
            "<= 15 s",
            seconds <= 15.0,
        )
    ]


def fleet(n_records: int = 64, n_samples: int = 60_000) -> list[Row]:
    """64 recordings on one and on two worker processes, kept alive, after a warm-up of each worker.

    Two workers need two free processors. Where others use them the time on the clock says little; the processor
    time of workers and of the process that hands out the work says what free processors would give.
    """
    from fomrc_core.storage import write_recording

    with tempfile.TemporaryDirectory() as folder:
        for index in range(n_records):
            write_recording(record(n_samples, 1e-3, seed=index), Path(folder) / f"unit_{index:02d}.csv")
        runs = {n: _fleet_run(Path(folder), n) for n in (1, 2)}
    clock = {n: run[0] for n, run in runs.items()}
    busy = {n: (run[1] / n + run[2]) for n, run in runs.items()}
    ratio, free = clock[1] / clock[2], busy[1] / busy[2]
    text = (
        f"{ratio:.2f} x on the clock ({clock[1]:.0f} s and {clock[2]:.0f} s, files read and written; load average "
        f"{os.getloadavg()[0]:.1f}); {free:.2f} x by processor time (workers {runs[1][1]:.1f} and {runs[2][1]:.1f} s, "
        f"handing out {runs[2][2]:.2f} s)"
    )
    return [
        Row(f"{n_records} recordings of {n_samples} samples on 2 workers against 1", text, ">= 1.8 x", ratio >= 1.8)
    ]


def _fleet_run(folder: Path, n_workers: int) -> tuple[float, float, float]:
    """Return time on the clock, processor time of the workers, and of the process that hands out the work [s]."""
    from concurrent.futures import ProcessPoolExecutor
    from multiprocessing import get_context

    from fomrc_core.identification.fleet import identify_fleet, records_in

    paths = records_in(folder)
    with ProcessPoolExecutor(n_workers, mp_context=get_context("spawn")) as pool:
        identify_fleet(paths[: 4 * n_workers], folder / f"warm_{n_workers}", executor=pool)
        before = _processor_time_of(pool)
        own, start = time.process_time(), time.perf_counter()
        done = identify_fleet(paths, folder / f"out_{n_workers}", executor=pool)
        clock, own = time.perf_counter() - start, time.process_time() - own
        workers = _processor_time_of(pool) - before
    assert all(r.is_done for r in done)
    return clock, workers, own


def _processor_time_of(pool: Any) -> float:
    ticks = 0
    for process in pool._processes:
        fields = Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()
        ticks += int(fields[11]) + int(fields[12])
    return ticks / os.sysconf("SC_CLK_TCK")
