"""Kernels against plain C, and the cost of one sample as the past grows."""

from __future__ import annotations

import json
import subprocess
import sys

import numpy as np

from benchmarks import c_reference
from benchmarks.subjects import ROOT, STEP_S, drive, table_1
from benchmarks.timing import Row, best_of, interleaved
from fomrc_core.model.compensator import Compensator
from fomrc_core.model.kernels import forward, inverse
from fomrc_core.operators.creep import creep_block
from fomrc_core.operators.hysteresis import hysteresis_block, move_stops_batch


def against_c(n: int = 1_000_000) -> list[Row]:
    """Forward, inverse and hysteresis alone beside the C reference, the same numbers in and out."""
    model = table_1()
    compensator = Compensator(model)
    steps, voltage = drive(n)
    moved = model.simulate(steps, voltage)
    ours, theirs = np.empty(n), np.empty(n)
    back = creep_block(model.creep_modes)
    plays, stops = hysteresis_block(model.play_form), hysteresis_block(model.stop_form)
    works = {
        "forward": lambda: forward(np.concatenate((plays, back)), model.at_creep, voltage, steps, ours),
        "inverse": lambda: inverse(np.concatenate((stops, back)), compensator.at_creep, moved, steps, ours),
        "stops": lambda: move_stops_batch(stops.copy(), 0, moved, ours),
    }
    rows = []
    for name, work in works.items():
        values = voltage if name == "forward" else moved
        timed = {"ours": work}
        if c_reference.available():
            for label, flags in c_reference.FLAGS.items():
                reference = c_reference.CReference(model, STEP_S, flags)
                timed[label] = lambda r=reference, v=values, m=name: r.run(m, v, theirs)
        best = interleaved(timed)
        work()
        if c_reference.available():
            difference = float(np.max(np.abs(ours - theirs)) / np.max(np.abs(theirs)))
            assert difference < 1e-12, f"{name} and the C reference differ by {difference}"
        own = best.pop("ours")
        what = {"forward": "full model forward", "inverse": "full model inverse", "stops": "hysteresis alone"}[name]
        figure = f"{1e9 * own / n:.1f} ns/sample"
        for label, seconds in best.items():
            figure += f"; {own / seconds:.2f} x {label} ({1e9 * seconds / n:.1f})"
        plain = best.get("gcc -O3")
        bar = "" if name == "stops" else "<= 1.5 x C -O3"
        rows.append(
            Row(
                f"{what}, n = 10, {model.creep_modes.n_modes} modes, 1M samples",
                figure,
                bar,
                None if not bar or plain is None else own <= 1.5 * plain,
            )
        )
    return rows


def one_step(n: int = 100_000) -> list[Row]:
    """One step from Python, state in and state out, with numba and without."""
    compiled = _step_costs(n)
    script = (
        "import sys; sys.modules['numba'] = None; import json\n"
        "from benchmarks.kernels import _step_costs; print(json.dumps(_step_costs(20_000)))"
    )
    done = subprocess.run([sys.executable, "-c", script], cwd=ROOT, capture_output=True, text=True, check=True)
    plain = json.loads(done.stdout)
    return [
        Row(
            "one step with numba",
            f"forward {compiled[0]:.2f} us, inverse {compiled[1]:.2f} us",
            "<= 0.5 us",
            max(compiled) <= 0.5,
        ),
        Row(
            "one step in plain Python",
            f"forward {plain[0]:.2f} us, inverse {plain[1]:.2f} us",
            "<= 4 us",
            max(plain) <= 4.0,
        ),
    ]


def _step_costs(n: int) -> tuple[float, float]:
    model = table_1()
    costs = []
    for runner in (model, Compensator(model)):
        state, values = runner.initial_state(), drive(n)[1].tolist()
        advance = runner.advance

        def work(advance=advance, state=state, values=values):
            for value in values:
                advance(state, value, STEP_S)

        costs.append(1e6 * best_of(work, 7) / n)
    return costs[0], costs[1]


def flatness(longest: int = 100_000_000) -> list[Row]:
    """The cost of 10 000 samples at sample 1e4 and later, in one stream."""
    model = table_1()
    n_part = 10_000
    steps, voltage = drive(n_part)
    out = np.empty(n_part)
    state = model.initial_state()
    marks = [10**k for k in range(4, 10) if 10**k <= longest]
    costs: dict[int, float] = {}
    at = 0
    long_steps, long_voltage = drive(1_000_000)
    long_out = np.empty(1_000_000)
    for mark in marks:
        while at < mark:
            n = min(1_000_000, mark - at)
            forward(state.packed, model.at_creep, long_voltage[:n], long_steps[:n], long_out[:n])
            at += n
        # here, on copies of the state: the same samples again and again, as often as the best needs
        costs[mark] = (
            1e9 / n_part * best_of(lambda: forward(state.packed.copy(), model.at_creep, voltage, steps, out), 200)
        )
    ratio = costs[10**7] / costs[10**4] if 10**7 in costs else float("nan")
    spread = max(costs.values()) / min(costs.values())
    text = ", ".join(f"{value:.1f} at 1e{len(str(mark)) - 1}" for mark, value in costs.items())
    return [
        Row("cost per sample as the past grows [ns]", text, "flat within 10 %", spread <= 1.1),
        Row("cost at sample 1e7 over that at 1e4", f"{ratio:.3f}", "<= 1.1", ratio <= 1.1),
    ]


def jittered(n: int = 100_000) -> list[Row]:
    """Every step of another length: coefficients anew at each sample."""
    model = table_1()
    _, voltage = drive(n)
    steps = STEP_S * np.random.default_rng(0).uniform(0.9, 1.1, n)
    model.simulate(steps[:10], voltage[:10])
    return [
        Row(
            "forward, every step of another length",
            f"{1e9 * best_of(lambda: model.simulate(steps, voltage)) / n:.0f} ns/sample",
        )
    ]


def starting() -> list[Row]:
    """Import, first use and loading a model, each in a process of its own."""
    script = (
        "import time; t = [time.process_time()]\n"
        "import numpy; t.append(time.process_time())\n"
        "import fomrc_core.model.piezo_model, fomrc_core.model.compensator; t.append(time.process_time())\n"
        "from fomrc_core.storage import read_model\n"
        "m = read_model('config/pi_p753_table1.yaml'); t.append(time.process_time())\n"
        "s = m.initial_state(); m.advance(s, 0.1, 1e-3); t.append(time.process_time())\n"
        "m = read_model('config/pi_p753_table1.yaml'); t.append(time.process_time())\n"
        "print(*[b - a for a, b in zip(t, t[1:])])"
    )
    best = [float("inf")] * 5
    for _ in range(3):
        done = subprocess.run([sys.executable, "-c", script], cwd=ROOT, capture_output=True, text=True, check=True)
        best = [min(a, float(b)) for a, b in zip(best, done.stdout.split(), strict=True)]
    fresh = subprocess.run(
        [sys.executable, "-c", script],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=True,
        env=_environment_without_cache(),
    )
    compile_s = float(fresh.stdout.split()[3])
    return [
        Row("import of model and inverse, beside numpy", f"{best[1]:.2f} s CPU (numpy {best[0]:.2f} s)"),
        Row("first step with kernels from the disk cache", f"{best[3]:.2f} s CPU"),
        Row("first step where nothing is cached", f"{compile_s:.1f} s CPU, once"),
        Row("model load", f"{1e3 * best[4]:.1f} ms"),
    ]


def _environment_without_cache() -> dict[str, str]:
    import os
    import tempfile

    return {**os.environ, "NUMBA_CACHE_DIR": tempfile.mkdtemp(prefix="fomrc-bench-")}
