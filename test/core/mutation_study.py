"""Every command with spoilt inputs and options, each in a process of its own: no traceback, no hang, no leftover.

    python test/core/mutation_study.py                       # 300 of seed 0
    python test/core/mutation_study.py --seed 7 --count 50

A third are interrupted (SIGINT) at a random moment. Prints a line for each that fails, and the counts at the end.
"""

from __future__ import annotations

import argparse
import os
import resource
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path

import numpy as np
from mutated_commands import Mutated, mutations

_LONGEST_S = 120.0
_MEMORY_BYTES = 6 * 2**30
_STATUSES = (0, 1, 2)
_INTERRUPTED = (130, -signal.SIGINT)
_LAST_S = 10.0  # after SIGINT


def _bounded() -> None:
    resource.setrlimit(resource.RLIMIT_AS, (_MEMORY_BYTES, _MEMORY_BYTES))


def left_running(group: int) -> list[str]:
    """Return the processes of a group that still run, by command line."""
    found = []
    for entry in Path("/proc").iterdir():
        if entry.name.isdecimal():
            try:
                state, _, its_group = (entry / "stat").read_text().rpartition(")")[2].split()[:3]
                if int(its_group) == group and state != "Z":
                    found.append((entry / "cmdline").read_bytes().replace(b"\0", b" ").decode(errors="replace"))
            except (OSError, ValueError):
                continue
    return found


def run_one(mutated: Mutated, folder: Path, stop_after_s: float | None) -> list[str]:
    """Return what is wrong with how a command ends; empty where nothing is.

    Args:
        mutated: the command.
        folder: to run it in.
        stop_after_s: when it is interrupted [s]; None to let it end.
    """
    before = {path.relative_to(folder) for path in folder.rglob("*")}
    said = tempfile.TemporaryFile()  # noqa: SIM115  closed with the process it belongs to
    process = subprocess.Popen(
        [sys.executable, "-m", "fomrc_core.cli", *mutated.arguments],
        cwd=folder,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
        stderr=said,
        start_new_session=True,
        preexec_fn=_bounded,
        env={**os.environ, "MPLBACKEND": "agg", "BROWSER": "true", "ROS_LOG_DIR": str(folder)},
    )
    wrong, is_stopped = [], False
    try:
        process.wait(_LONGEST_S if stop_after_s is None else stop_after_s)
    except subprocess.TimeoutExpired:
        is_stopped = True
        if stop_after_s is None:
            wrong.append(f"still running after {_LONGEST_S:g} s")
        os.killpg(process.pid, signal.SIGINT)
        try:
            process.wait(_LAST_S)
        except subprocess.TimeoutExpired:
            wrong.append(f"still running {_LAST_S:g} s after SIGINT")
            os.killpg(process.pid, signal.SIGKILL)
            process.wait()
    left = left_running(process.pid)
    if left:
        wrong.append(f"left running: {left[0][:80]}")
        os.killpg(process.pid, signal.SIGKILL)
    said.seek(0)
    text = said.read().decode(errors="replace")
    if "Traceback" in text:
        wrong.append(f"traceback: {text.strip().splitlines()[-1][:200]}")
    if process.returncode not in (*_STATUSES, *(_INTERRUPTED if is_stopped else ())):
        wrong.append(f"exit {process.returncode}: {text.strip().splitlines()[-1:]}")
    if process.returncode == 2 and not text.strip():
        wrong.append("refused without a word")
    partial = [
        str(path)
        for path in {path.relative_to(folder) for path in folder.rglob("*")} - before
        if path.name.startswith(".") or path.name.endswith((".tmp", ".part", "~"))
    ]
    if partial:
        wrong.append(f"half-written: {partial[0]}")
    return wrong


def main() -> None:
    """Run them, and exit with 1 where one fails."""
    parser = argparse.ArgumentParser(description="Spoilt inputs and options over all commands.")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--count", type=int, default=300)
    parser.add_argument("--first", type=int, default=0, help="leave out those before")
    options = parser.parse_args()
    rng = np.random.default_rng(options.seed + 1)
    counts: Counter[str] = Counter()
    begin = time.monotonic()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for k, mutated in enumerate(mutations(options.seed, folder, options.count)):
            stop_after_s = float(rng.uniform(0.2, 6.0)) if k % 3 == 2 else None
            if k < options.first:
                continue
            counts["run"] += 1
            for wrong in run_one(mutated, folder, stop_after_s):
                counts[wrong.partition(":")[0].split(" of ")[0]] += 1
                print(f"{k}: fomrc {' '.join(mutated.arguments)[:200]!r} ({mutated.how[:200]}): {wrong}", flush=True)
    counts["failed"] = sum(count for what, count in counts.items() if what != "run")
    print(f"{time.monotonic() - begin:.0f} s, seed {options.seed}: " + ", ".join(f"{n} {w}" for w, n in counts.items()))
    sys.exit(1 if counts["failed"] else 0)


if __name__ == "__main__":
    main()
