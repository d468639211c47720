"""How long commands are silent: python -m benchmarks.longest_silence [--data DIR] [--large] [--only WORD].

Runs long commands on recordings it makes (of the electromechanical plant's kin, see large_recordings; a mirror of
three axes), each a process of its own with a pipe for its standard error, and prints the longest time in which it
wrote nothing, when that was and what it said before. With ``--data`` also on the measured records: a folder with
pea_1hz/ and fsm/, as ``fomrc data`` finds them. With ``--large`` on 10 000 000 samples, which takes a quarter of an
hour. The kernels come from an empty cache for the first command, which is when they are compiled.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from benchmarks.large_recordings import measured

_BAR_S = 5.0
_PEA = ("--columns", "time=none,voltage=0,displacement=4", "--rate", "200")


@dataclass(frozen=True)
class Silence:
    """The longest time in which a command wrote nothing.

    Attributes:
        status: exit status of the command.
        whole_s: how long it took [s].
        longest_s: the longest silence [s].
        begun_s: when that began, from the start of the command [s].
        after: the last line before it.
    """

    status: int
    whole_s: float
    longest_s: float
    begun_s: float
    after: str


def silence_of(arguments: list[str], folder: Path, cache: Path) -> Silence:
    """Run a command and return its longest silence."""
    environment = {**os.environ, "PYTHONUNBUFFERED": "1", "NUMBA_CACHE_DIR": str(cache)}
    process = subprocess.Popen(
        [sys.executable, "-m", "fomrc_core.cli", *arguments],
        cwd=folder,
        env=environment,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
    )
    assert process.stdout is not None
    begun_s = last_s = time.perf_counter()
    longest_s, at_s, after, line = 0.0, 0.0, "", "(start)"
    while True:
        said = os.read(process.stdout.fileno(), 1 << 16)
        now_s = time.perf_counter()
        if now_s - last_s > longest_s:
            longest_s, at_s, after = now_s - last_s, last_s - begun_s, line
        last_s = now_s
        if not said:
            return Silence(process.wait(), now_s - begun_s, longest_s, at_s, after)
        line = (said.decode(errors="replace").strip().splitlines() or [line])[-1]


def _write_records(folder: Path, *, is_large: bool) -> None:
    """Write short.csv, test.csv, long.csv, noisy.csv, fleet/ and, where asked for, large.npz and large.csv."""

    def write(name: str, columns: dict[str, np.ndarray]) -> None:
        if name.endswith(".npz"):
            np.savez(folder / name, **columns)
            return
        rows = np.column_stack(list(columns.values()))
        np.savetxt(folder / name, rows, fmt="%.9g", delimiter=",", header=",".join(columns), comments="")

    (folder / "fleet").mkdir()
    write("short.csv", measured("amplifier_bandwidth", 60_000, 3))
    write("test.csv", measured("amplifier_bandwidth", 40_000, 4))
    write("long.csv", measured("load", 600_000, 3))
    for seed in (5, 6):
        write(f"fleet/{seed}.csv", measured("load", 40_000, seed))
    if is_large:
        write("large.npz", measured("load", 10_000_000, 3))
        write("large.csv", measured("load", 10_000_000, 3))


def _commands(data: Path | None, *, is_large: bool) -> list[list[str]]:
    """Return the commands, that of the compiled kernels first."""
    found = [
        ["diagnose", "short.csv", "--test", "test.csv", "-o", "first"],
        ["identify", "short.csv", "--test", "test.csv", "--elements", "auto", "--uncertainty", "-o", "m.yaml"],
        ["identify", "short.csv", "--method", "paper", "--elements", "6", "-o", "paper.yaml"],
        ["check", "short.csv"],
        ["diagnose", "short.csv", "--model", "m.yaml", "-o", "based"],
        ["identify", "long.csv", "-o", "long.yaml"],
        ["check", "long.csv"],
        ["diagnose", "long.csv", "-o", "long"],
        ["import", "long.csv", "-o", "ours.csv"],
        ["view", "long.csv", "-o", "view.html", "--no-open"],
        ["identify-fleet", "fleet", "-o", "models"],
        ["diagnose-fleet", "fleet", "-o", "reports"],
        ["compare", "short.csv", "--test", "test.csv", "-o", "compared"],
        ["reproduce", "-o", "paper"],
    ]
    if is_large:
        for name in ("large.npz", "large.csv"):
            found += [["identify", name, "-o", "large.yaml"], ["diagnose", name, "-o", "large"]]
        found.append(["import", "large.csv", "-o", "again.csv"])
    if data is not None:
        train, test = (str(data / "pea_1hz" / name) for name in ("model.dat", "test_first_25s.dat"))
        found.append(["diagnose", train, "--test", test, *_PEA, "-o", "pea"])
        found.append(["compare", train, "--test", test, *_PEA, "-o", "pea_compared"])
        found.append(["benchmark", "fsm", "--train", str(data / "fsm"), "-o", "fsm"])
    return found


def main() -> int:
    """Run and print a table; the exit status says whether every silence is within the bar."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--data", type=Path, help="folder with pea_1hz/ and fsm/")
    parser.add_argument("--large", action="store_true", help="also 10 000 000 samples")
    parser.add_argument("--only", default="", help="commands with this word only")
    asked = parser.parse_args()
    data = None if asked.data is None else asked.data.resolve()
    n_over = 0
    print("| command | exit | whole [s] | longest silence [s] | at [s] | after |\n|---|---:|---:|---:|---:|---|")
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        _write_records(folder, is_large=asked.large)
        for arguments in _commands(data, is_large=asked.large):
            shown = " ".join(Path(word).name if "/" in word else word for word in arguments)
            if asked.only not in shown:
                continue
            found = silence_of(arguments, folder, folder / "cache")
            n_over += found.longest_s > _BAR_S
            print(
                f"| {shown} | {found.status} | {found.whole_s:.1f} | {found.longest_s:.1f} | {found.begun_s:.1f} "
                f"| {found.after[:100]} |",
                flush=True,
            )
    print(f"silent for more than {_BAR_S:g} s: {n_over}")
    return 1 if n_over else 0


if __name__ == "__main__":
    raise SystemExit(main())
