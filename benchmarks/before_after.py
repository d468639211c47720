"""Time this checkout beside another one, in turns: python -m benchmarks.before_after OTHER [--python P] [--rounds N].

OTHER is a folder with another state of this project, P the Python of its environment. Every figure is the least
processor time of several rounds, each a process of its own, the two checkouts one after the other: what else the
machine does slows both. A ratio above 1 means that this checkout is the slower one.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
from pathlib import Path

from benchmarks.subjects import ROOT

# Only what the benchmarks of either state have: where its modules are is their own matter.
_TIMED = """
import json, sys
from benchmarks.kernels import Compensator, _step_costs
from benchmarks.subjects import drive, record, table_1
from benchmarks.system import identify_once
from benchmarks.timing import best_of

n = 300_000
model = table_1()
compensator = Compensator(model)
steps_s, voltage_v = drive(n)
moved_um = model.simulate(steps_s, voltage_v)
compensator.run(steps_s, moved_um)
forward_us, inverse_us = (min(costs) for costs in zip(*(_step_costs(20_000) for _ in range(5))))
print(json.dumps({
    "forward [ns/sample]": 1e9 * best_of(lambda: model.simulate(steps_s, voltage_v)) / n,
    "inverse [ns/sample]": 1e9 * best_of(lambda: compensator.run(steps_s, moved_um)) / n,
    "one step forward [us]": forward_us,
    "one step inverse [us]": inverse_us,
    "identify 60 000 samples [s]": identify_once()[0],
    "modules": [type(model).__module__, Compensator.__module__],
}))
"""
_IMPORTED = """
import json, time
import numpy
begun = time.process_time()
import {modules}
print(json.dumps({{"import of model and inverse, beside numpy [s]": time.process_time() - begun}}))
"""


def main() -> None:
    """Time both and print a table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("other", type=Path)
    parser.add_argument("--python", default=sys.executable, help="Python of the other checkout")
    parser.add_argument("--rounds", type=int, default=5)
    options = parser.parse_args()
    places = {"before": (options.other.resolve(), options.python), "after": (ROOT, sys.executable)}
    best: dict[str, dict[str, float]] = {name: {} for name in places}
    for number in range(options.rounds):
        print(f"round {number + 1} of {options.rounds}", file=sys.stderr)
        for name, (folder, python) in places.items():
            figures = _printed(python, folder, _TIMED)
            figures |= _printed(python, folder, _IMPORTED.format(modules=", ".join(figures.pop("modules"))))
            for what, value in figures.items():
                best[name][what] = min(best[name].get(what, float("inf")), value)
    print("| what | before | after | after / before |\n|---|---:|---:|---:|")
    for what, after in best["after"].items():
        before = best["before"][what]
        print(f"| {what} | {before:.3g} | {after:.3g} | {after / before:.2f} |")


def _printed(python: str, folder: Path, script: str) -> dict:
    environment = {k: v for k, v in os.environ.items() if k != "_ROS_WHEELS_BOOTSTRAP_COMPLETE"}
    environment["PYTHONPATH"] = str(folder)
    done = subprocess.run(
        [python, "-c", script], cwd=folder, env=environment, capture_output=True, text=True, check=True
    )
    return json.loads(done.stdout.splitlines()[-1])


if __name__ == "__main__":
    main()
