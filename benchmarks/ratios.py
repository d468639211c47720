"""Print every figure beside its bar, measured in one run: ``python -m benchmarks.ratios [PART ...] [--write]``.

Parts: kernels, rivals, system, fleet, export, array. ``--write`` puts the table with versions and machine into
docs/benchmarks.md.
"""

from __future__ import annotations

import importlib.metadata
import os
import platform
import re
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

from benchmarks import array_rows, controllers, export_rows, kernels, rivals, system
from benchmarks.subjects import ROOT
from benchmarks.timing import Row

PARTS: dict[str, tuple[Callable[[], list[Row]], ...]] = {
    "kernels": (kernels.against_c, kernels.one_step, kernels.flatness, kernels.jittered, kernels.starting),
    "rivals": (rivals.hysteresis_rows, rivals.creep_rows),
    "system": (system.memory, system.identification, system.diagnosis),
    "fleet": (system.fleet,),
    "export": (export_rows.fixed_step, controllers.cortex_m7, controllers.loop_at_20_khz, export_rows.agreement),
    "array": (array_rows.thousand_actuators,),
}
_PAGE = ROOT / "docs" / "benchmarks.md"
_MARK = {True: "met", False: "NOT MET", None: ""}


def machine() -> list[str]:
    """Return lines on machine and versions."""
    cpu = Path("/proc/cpuinfo").read_text() if Path("/proc/cpuinfo").exists() else ""
    model = re.search(r"model name\s*:\s*(.*)", cpu)
    mhz = re.search(r"cpu MHz\s*:\s*([\d.]+)", cpu)
    gcc = subprocess.run(["gcc", "--version"], capture_output=True, text=True, check=False).stdout.splitlines()
    versions = ", ".join(f"{name} {importlib.metadata.version(name)}" for name in ("numpy", "scipy", "numba"))
    return [
        f"Machine: {os.cpu_count()} x {model.group(1) if model else platform.processor()}"
        + (f" at {float(mhz.group(1)) / 1000.0:.1f} GHz" if mhz else "")
        + f", {platform.system()}.",
        f"Versions: Python {platform.python_version()}, {versions}, {gcc[0] if gcc else 'no gcc'}.",
    ]


def table(rows: list[Row]) -> str:
    """Return the rows as a Markdown table."""
    lines = ["| what | figure | bar | |", "|---|---|---|---|"]
    return "\n".join([*lines, *(f"| {r.what} | {r.figure} | {r.bar} | {_MARK[r.is_met]} |" for r in rows)])


def main(arguments: list[str]) -> int:
    """Measure the parts asked for and print one line each as it comes."""
    wanted = [name for name in arguments if name != "--write"] or list(PARTS)
    unknown = [name for name in wanted if name not in PARTS]
    if unknown:
        print(f"unknown part {unknown[0]} (allowed: {', '.join(PARTS)})", file=sys.stderr)
        return 2
    print("\n".join(machine()), flush=True)
    sections = []
    for name in wanted:
        rows: list[Row] = []
        for measure in PARTS[name]:
            for row in measure():
                print(
                    f"{row.what}: {row.figure}" + (f"   [{row.bar}: {_MARK[row.is_met]}]" if row.bar else ""),
                    flush=True,
                )
                rows.append(row)
        sections.append(f"## {name.capitalize()}\n\n{table(rows)}\n")
    if "--write" in arguments:
        _PAGE.parent.mkdir(exist_ok=True)
        _PAGE.write_text(_HEAD + "\n".join(f"- {line}" for line in machine()) + "\n\n" + "\n".join(sections))
    return 0


_HEAD = """# Benchmarks

Written by `python -m benchmarks.ratios --write` (`make bench` prints the same): everything measured in one run, so
that ratios hold on a busy machine too. Kernels are timed by the processor time of their thread, the least of several
rounds taken in turns.

- The C reference (`benchmarks/reference.c`) is the same algorithm as one would write it first, one sample after the
  other with strict sums; outputs agree to 1e-12. Ratios below 1 mean that this package is the faster one: its batch
  kernels take four samples of creep at once, or two operations a mode (see `fomrc_core/operators/creep_batch.py`), and
  sums in any order.
- Rivals run in an environment of their own with the versions named, on the same inputs. Errors are relative to
  the largest value, against the defining sum in extended precision.
"""

if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
