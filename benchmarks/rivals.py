"""Libraries from the package index beside this one, on the same inputs, each in an environment of its own."""

from __future__ import annotations

import math
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

from benchmarks.subjects import ROOT, STEP_S, table_1
from benchmarks.timing import Row, best_of
from fomrc_core.operators.creep import creep_block, creep_modes
from fomrc_core.operators.creep_batch import integrate
from fomrc_core.operators.creep_full_memory import creep_full_memory
from fomrc_core.operators.hysteresis import hysteresis_block, move_stops_batch

_ENVIRONMENT = ROOT / ".venv" / "rivals"
_PACKAGES = ("pycaputo", "differint", "openseespy==3.7.1.2")
_ORDER = 0.015


def environment() -> Path | None:
    """Return the rivals' Python, made and filled where it is missing; None where that is not possible."""
    python = _ENVIRONMENT / "bin" / "python"
    if not python.exists():
        made = subprocess.run([sys.executable, "-m", "venv", str(_ENVIRONMENT)], capture_output=True, check=False)
        if made.returncode:
            return None
        for package in _PACKAGES:
            command = [str(python), "-m", "pip", "install", "-q", "--disable-pip-version-check", package]
            subprocess.run(command, capture_output=True, check=False)
    return python


def _run(python: Path, name: str, inputs: Path, folder: Path) -> tuple[float, np.ndarray, str] | None:
    outputs = folder / "outputs.npz"
    script = Path(__file__).with_name("rival_runs.py")
    done = subprocess.run([str(python), str(script), name, str(inputs), str(outputs)], capture_output=True, check=False)
    if done.returncode:
        return None
    found = np.load(outputs)
    return float(found["seconds"]), found["values"], str(found["version"])


def _exact_at(order: float, walk: np.ndarray, step_s: float, at: np.ndarray) -> np.ndarray:
    # The defining sum in extended precision at some samples: no code in common with anything measured here.
    changes = np.diff(walk.astype(np.longdouble), prepend=np.longdouble(0))
    power = np.longdouble(order) + 1
    scale = np.longdouble(step_s) ** np.longdouble(order) / np.longdouble(math.gamma(order + 2.0))
    exact = []
    for k in at:
        m = np.arange(k + 1, 0, -1, dtype=np.longdouble)
        exact.append(scale * np.sum(changes[: k + 1] * (m**power - (m - 1) ** power)))
    return np.array(exact, dtype=np.longdouble)


def creep_rows(n: int = 60_000) -> list[Row]:
    """Creep of a random walk beside fractional libraries: time and error."""
    walk = np.cumsum(np.random.default_rng(1).standard_normal(n))
    steps = np.full(n, STEP_S)
    at = np.unique(np.linspace(10, n - 1, 60).astype(int))
    exact = _exact_at(_ORDER, walk, STEP_S, at)

    def error(values: np.ndarray) -> float:
        known = at < values.size
        return float(np.max(np.abs(values[at[known]] - exact[known])) / np.max(np.abs(exact)))

    out = np.empty(n)
    rows, ours = [], {}
    for label, accuracy in (("modes, 1e-6", 1e-6), ("modes, 1e-10", 1e-10)):
        modes = creep_modes(_ORDER, accuracy, shortest_time_s=4.6e-4)
        seconds = best_of(lambda modes=modes: integrate(creep_block(modes), 0, walk, steps, out))
        ours[label] = (seconds, error(out))
    whole = creep_full_memory(_ORDER, walk, steps)
    ours["full memory"] = (best_of(lambda: creep_full_memory(_ORDER, walk, steps), 3), error(whole))
    for label, (seconds, off) in ours.items():
        rows.append(Row(f"creep, {n} samples, {label}", f"{1e3 * seconds:.2f} ms, error {off:.1e}"))
    python = environment()
    if python is None:
        return [*rows, Row("fractional libraries", "not installed: no environment for them")]
    with tempfile.TemporaryDirectory() as folder:
        inputs = Path(folder) / "inputs.npz"
        np.savez(inputs, walk=walk, step_s=STEP_S, order=_ORDER)
        for name in ("pycaputo", "differint GL"):
            found = _run(python, name, inputs, Path(folder))
            if found is None:
                rows.append(Row(f"creep, {name}", "does not install or does not run"))
                continue
            seconds, values, version = found
            off = error(values)
            text = f"{seconds:.2f} s, error {off:.1e}"
            as_good = [(s, label) for label, (s, e) in ours.items() if e <= off]
            is_exact = name == "pycaputo"
            ratio = seconds / min(as_good)[0] if as_good else float("nan")
            if as_good:
                text += f"; {ratio:.0f} x slower than {min(as_good)[1]}, which is no less exact"
            rows.append(
                Row(
                    f"creep, {name} {version}",
                    text,
                    ">= 1000 x" if is_exact else "",
                    ratio >= 1000.0 if is_exact else None,
                )
            )
    return rows


def hysteresis_rows(n: int = 200_000) -> list[Row]:
    """Hysteresis alone, displacement to voltage, beside a chain of springs and sliders."""
    stop = table_1().stop_form
    displacement = 3.0 * np.sin(np.arange(n) * 0.01) * np.linspace(1.0, 0.2, n)
    out = np.empty(n)
    seconds = best_of(lambda: move_stops_batch(hysteresis_block(stop), 0, displacement, out))
    python = environment()
    if python is None:
        return [Row("spring-slider chain", "not installed: no environment for it")]
    with tempfile.TemporaryDirectory() as folder:
        inputs = Path(folder) / "inputs.npz"
        np.savez(inputs, thresholds=stop.thresholds, weights=stop.weights, slope=stop.slope, displacement=displacement)
        found = _run(python, "openseespy", inputs, Path(folder))
    if found is None:
        return [Row("spring-slider chain, openseespy", "does not install or does not run")]
    theirs, values, version = found
    difference = float(np.max(np.abs(values - out)) / np.max(np.abs(out)))
    text = (
        f"{1e9 * seconds / n:.1f} ns/sample against {1e9 * theirs / n:.0f}: {theirs / seconds:.0f} x "
        f"(the two differ by {difference:.0e})"
    )
    return [
        Row(
            f"hysteresis alone against the chain of openseespy {version}, 11 elements",
            text,
            ">= 50 x",
            theirs >= 50.0 * seconds,
        )
    ]
