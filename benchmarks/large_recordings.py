"""Identify and diagnose long recordings: python -m benchmarks.large_recordings [--samples N] [--causes none,load,...].

Makes a recording of the electromechanical plant's kin at 10 kHz (hysteresis, creep, noise of 1 nm, and one hidden
cause), writes it as .npz, runs ``fomrc identify`` and ``fomrc diagnose`` on it, each a process of its own, and prints
wall time, processor time and the largest memory of each, and what was named.
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
from scipy.signal import cont2discrete, lfilter

from benchmarks.subjects import table_1
from fomrc_core.model.streaming import in_chunks, stream

RATE_HZ = 1e4
NOISE_UM = 1e-3
CAUSES = ("none", "coloured", "load", "amplifier_bandwidth", "resonance", "hum")
_TOP_V = 5.0


def drive(duration_s: float, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Return times [s] and voltages [V]: loops of many sizes, jumps with rests, and sines, in turns."""
    rng = np.random.default_rng(seed)
    at_s, level_v = [0.0], [0.0]
    while at_s[-1] < duration_s:
        kind = rng.integers(3)
        if kind == 0:
            slope = 10.0 ** rng.uniform(0.3, 1.3)
            for _ in range(rng.integers(4, 9)):
                v = rng.uniform(0.0, _TOP_V)
                at_s.append(at_s[-1] + max(abs(v - level_v[-1]) / slope, 0.02))
                level_v.append(v)
        elif kind == 1:
            for _ in range(rng.integers(2, 5)):
                v = rng.uniform(0.0, _TOP_V)
                at_s += [at_s[-1] + 1.0 / RATE_HZ, at_s[-1] + rng.uniform(0.3, 1.0)]
                level_v += [v, v]
        else:
            frequency_hz, size_v = rng.uniform(1.0, 8.0), rng.uniform(0.3, 1.5)
            middle_v = float(np.clip(level_v[-1], size_v, _TOP_V - size_v))
            t = np.arange(1, 1536) / 512.0
            at_s.append(at_s[-1] + 0.2)
            level_v.append(middle_v)
            swell = np.minimum(1.0, 3.0 * (3.0 - t))
            level_v += list(middle_v + size_v * np.sin(2.0 * np.pi * frequency_hz * t) * swell)
            at_s += list(at_s[-1] + t)
    time_s = np.arange(round(duration_s * RATE_HZ)) / RATE_HZ
    return time_s, np.interp(time_s, at_s, level_v)


def measured(cause: str, n_samples: int, seed: int) -> dict[str, np.ndarray]:
    """Return time, voltage and displacement of a stage with one hidden cause."""
    rng = np.random.default_rng(1000 + seed)
    time_s, voltage_v = drive(n_samples / RATE_HZ, seed)
    reached_v = voltage_v
    if cause == "amplifier_bandwidth":
        keep = float(np.exp(-2.0 * np.pi * 60.0 / RATE_HZ))
        reached_v = lfilter([1.0 - keep], [1.0, -keep], voltage_v)
    model = table_1()
    chunks = in_chunks(np.full(time_s.size, 1.0 / RATE_HZ), reached_v)
    moved_um = np.concatenate(list(stream(model, chunks)))
    if cause == "load":
        moved_um += 0.03 * ((time_s > 0.41 * time_s[-1]) & (time_s < 0.63 * time_s[-1]))
    if cause == "hum":
        moved_um += 2e-3 * np.sin(2.0 * np.pi * 50.0 * time_s + 0.3)
    if cause == "resonance":
        w = 2.0 * np.pi * 300.0
        above, below, _ = cont2discrete(([w * w], [1.0, 0.06 * w, w * w]), 1.0 / RATE_HZ, method="foh")
        moved_um = lfilter(np.ravel(above), below, moved_um)
    noise_um = rng.normal(0.0, NOISE_UM, time_s.size)
    if cause == "coloured":  # half its power white, half a first-order process of 20 ms
        keep = float(np.exp(-1.0 / (0.02 * RATE_HZ)))
        slow = lfilter([np.sqrt(1.0 - keep**2)], [1.0, -keep], rng.normal(0.0, NOISE_UM, time_s.size))
        noise_um = np.sqrt(0.5) * (noise_um + slow)
    return {"time_s": time_s, "voltage_v": voltage_v, "displacement_um": moved_um + noise_um}


def timed(arguments: list[str]) -> tuple[float, float, float]:
    """Return wall time [s], processor time [s] and largest memory [GB] of a command.

    From a process that does nothing else: the largest memory is that of all its children.
    """
    code = f"from benchmarks.large_recordings import run; run({arguments!r})"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    if done.returncode != 0:
        raise SystemExit(done.stderr[-2000:])
    wall_s, cpu_s, memory_gb = json.loads(done.stdout.splitlines()[-1])
    return wall_s, cpu_s, memory_gb


def run(arguments: list[str]) -> None:
    """Run a command and print wall time [s], processor time [s] and largest memory [GB] as JSON."""
    begun = time.perf_counter()
    command = [sys.executable, "-m", "fomrc_core.cli", *arguments]
    subprocess.run(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, check=True)
    wall_s = time.perf_counter() - begun
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    print(json.dumps([wall_s, used.ru_utime + used.ru_stime, used.ru_maxrss * 1024 / 1e9]))


def main() -> None:
    """Run and print a table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--samples", type=int, default=600_000)
    parser.add_argument("--causes", default=",".join(CAUSES))
    parser.add_argument("--seeds", default="3")
    parser.add_argument("--max-memory", default="2.0")
    parser.add_argument("--commands", default="identify,diagnose")
    parser.add_argument("--format", default="npz", choices=("npz", "csv", "parquet"))
    options = parser.parse_args()
    print("| cause | seed | command | wall [s] | CPU [s] | memory [GB] | outcome |\n|---|---|---|---:|---:|---:|---|")
    for cause in options.causes.split(","):
        for seed in map(int, options.seeds.split(",")):
            with tempfile.TemporaryDirectory() as folder:
                record = Path(folder) / f"record.{options.format}"
                columns = measured(cause, options.samples, seed)
                if options.format == "npz":
                    np.savez(record, **columns)
                elif options.format == "parquet":
                    import pandas

                    pandas.DataFrame(columns).to_parquet(record)
                else:
                    rows = np.column_stack(list(columns.values()))
                    np.savetxt(record, rows, fmt="%.9g", delimiter=",", header=",".join(columns), comments="")
                for command in options.commands.split(","):
                    print(_row(command, record, cause, seed, options.max_memory), flush=True)


def _row(command: str, record: Path, cause: str, seed: int, max_memory: str) -> str:
    folder = record.parent
    bound = ["--max-memory", max_memory]
    if command == "identify":
        figures = timed(
            ["identify", str(record), "-o", str(folder / "m.yaml"), "--json", str(folder / "f.json"), *bound]
        )
        found = json.loads((folder / "f.json").read_text())
        outcome = f"{found['outcome']}, {1e3 * found['rms_um']:.3g} nm rms, noise {1e3 * found['noise_um']:.3g} nm"
    else:
        figures = timed(["diagnose", str(record), "-o", str(folder / "d"), *bound])
        found = json.loads((folder / "d" / "diagnosis.json").read_text())
        names = [f"{f['cause']} ({100 * f['probability']:.0f} %)" for f in found["findings"]]
        outcome = f"{found['status']}: {', '.join(names) or 'nothing'}"
        if found["ambiguous_with"]:
            outcome += f", or {', '.join(found['ambiguous_with'])}"
    wall_s, cpu_s, memory_gb = figures
    return f"| {cause} | {seed} | {command} | {wall_s:.1f} | {cpu_s:.1f} | {memory_gb:.2f} | {outcome} |"


if __name__ == "__main__":
    os.environ.pop("_ROS_WHEELS_BOOTSTRAP_COMPLETE", None)
    main()
