"""Exported C: how exactly it agrees with Python over a million samples, and what one fixed step costs."""

from __future__ import annotations

import numpy as np

from benchmarks import c_reference, exported
from benchmarks.subjects import STEP_S, drive, table_1
from benchmarks.timing import Row, interleaved
from fomrc_core.export import ExportOptions, Precision
from fomrc_core.model.compensator import Compensator
from fomrc_core.model.piezo_model import PiezoModel

BARS = {Precision.DOUBLE: 1e-12, Precision.FLOAT: 1e-5}
_LONGEST_STEP_NS = 60.0


def largest_error(
    model: PiezoModel, precision: Precision, way: str, steps_s: np.ndarray, values: np.ndarray, is_fixed: bool
) -> float:
    """Return the largest difference between exported C and the Python model, relative to the largest answer."""
    compiled = exported.Exported(model, _options(precision, float(steps_s[0])), way)
    given = values.astype(compiled.dtype).astype(np.float64)
    steps = steps_s if is_fixed else steps_s.astype(compiled.dtype).astype(np.float64)
    wanted = Compensator(model).run(steps, given) if way == "inverse" else model.simulate(steps, given)
    answers = compiled.run(None if is_fixed else steps, given)
    return float(np.max(np.abs(answers - wanted)) / np.max(np.abs(wanted)))


def agreement(n: int = 1_000_000) -> list[Row]:
    """Exported C against Python, forward and inverse, steps of one length and of any."""
    if not exported.available():
        return []
    model = table_1()
    steps, voltage = drive(n)
    moved = model.simulate(steps, voltage)
    jittered = STEP_S * np.random.default_rng(0).uniform(0.2, 2.0, n)
    rows = []
    for precision, bar in BARS.items():
        errors = {
            f"{way}, {kind}": largest_error(model, precision, way, lengths, values, is_fixed=kind == "fixed step")
            for way, values in (("forward", voltage), ("inverse", moved))
            for kind, lengths in (("fixed step", steps), ("any step", jittered))
        }
        text = "; ".join(f"{what} {error:.1e}" for what, error in errors.items())
        what = f"exported C, {precision.value}, against Python, paper's model, {n} samples"
        rows.append(Row(what, text, f"<= {bar:g} relative", max(errors.values()) <= bar))
    return rows


def fixed_step(n: int = 200_000) -> list[Row]:
    """One call of ``step_fixed`` for each sample, beside the hand-written reference in the same turns."""
    if not exported.available():
        return []
    model = table_1()
    steps, voltage = drive(n)
    moved = model.simulate(steps, voltage)
    rows = []
    for way, values in (("forward", voltage), ("inverse", moved)):
        works, keep = {}, []
        for precision in Precision:
            compiled = exported.Exported(model, _options(precision, STEP_S), way)
            given, out = values.astype(compiled.dtype), np.empty(n, dtype=compiled.dtype)
            keep.append((compiled, given, out))
            works[precision.value] = lambda c=compiled, g=given, o=out: c.run_into(g, o)
        for label, flags in c_reference.FLAGS.items():
            reference, into = c_reference.CReference(model, STEP_S, flags), np.empty(n)
            works[label] = lambda r=reference, v=values, m=way, o=into: r.run(m, v, o)
        best = {name: 1e9 * seconds / n for name, seconds in interleaved(works, 15).items()}
        double = best[Precision.DOUBLE.value]
        others = "; ".join(f"{label} {best[label]:.1f}" for label in c_reference.FLAGS)
        figure = f"{double:.1f} ns double, {best[Precision.FLOAT.value]:.1f} ns float; reference: {others}"
        rows.append(
            Row(
                f"exported step_fixed, {way}, n = {model.n_elements}, {model.creep_modes.n_modes} modes, gcc -O2",
                figure,
                f"<= {_LONGEST_STEP_NS:g} ns double",
                double <= _LONGEST_STEP_NS,
            )
        )
    return rows


def _options(precision: Precision, sample_period_s: float) -> ExportOptions:
    return ExportOptions("exported", precision=precision, sample_period_s=sample_period_s)
