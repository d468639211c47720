"""Exported C: how exactly it agrees with Python over a million samples, and what one fixed step costs."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from benchmarks import c_reference, exported
from benchmarks.subjects import ROOT, STEP_S, drive, table_1
from benchmarks.timing import Row, interleaved
from fomrc_core.export import ExportOptions, Precision
from fomrc_core.model.compensator import Compensator
from fomrc_core.model.piezo_model import PiezoModel
from fomrc_core.storage import read_model

BARS = {Precision.DOUBLE: 1e-12, Precision.FLOAT: 1e-5}
_LONGEST_STEP_NS = 60.0
EVERY_EFFECT = ROOT / "benchmarks" / "every_effect.yaml"


def errors_of(
    compiled: exported.Exported, model: PiezoModel, steps_s: np.ndarray | None, values: np.ndarray
) -> np.ndarray:
    """Return how far exported C is from the Python model, relative to the largest answer, shape (n_samples,).

    With the fixed step where no steps are given.
    """
    given = compiled.rounded(values)
    steps = np.full(values.size, compiled.options.sample_period_s) if steps_s is None else compiled.rounded(steps_s)
    beside = {name: compiled.rounded(signal) for name, signal in _signals_beside(steps).items()}
    run = Compensator(model).run if compiled.way == "inverse" else model.simulate
    wanted = run(steps, given, **beside)
    answers = compiled.run(None if steps_s is None else steps, given, **beside)
    return np.abs(answers - wanted) / np.max(np.abs(wanted))


def _signals_beside(steps_s: np.ndarray) -> dict[str, np.ndarray]:
    """A temperature that sways about 20 degC and a second axis that scans."""
    t = np.cumsum(steps_s)
    return {"temperature_c": 20.0 + np.sin(t / 47.0), "cross": np.sin(t / 3.0)}


def jumping_drive(n: int) -> tuple[np.ndarray, np.ndarray]:
    """Steps of one length [s], and sweeps with jumps and rests between them [V]: steps are divided, and not."""
    steps, voltage = drive(n)
    jumps = np.repeat(np.random.default_rng(3).uniform(-2.0, 2.0, n // 40 + 1), 40)[:n]
    return steps, np.where(np.arange(n) % 2000 < 1600, voltage, jumps)


def agreement(n: int = 1_000_000) -> list[Row]:
    """Exported C against Python, forward and inverse, steps of one length and of any."""
    if not exported.available():
        return []
    every = read_model(EVERY_EFFECT)
    plain = replace(table_1(), substeps=every.substeps)
    models = {"paper's model": table_1(), "with every effect": every}
    smooth = [effect for effect in every.effects if not effect.step_form(STEP_S).jumps]
    models["with every effect that does not jump"] = plain.with_effects(*smooth)
    models |= {f"with {effect.name}": plain.with_effects(effect) for effect in every.effects}
    steps, voltage = jumping_drive(n)
    desired = table_1().simulate(steps, voltage)
    jittered = STEP_S * np.random.default_rng(0).uniform(0.5, 2.0, n)
    rows = []
    for label, model in models.items():
        for precision, bar in BARS.items():
            errors = {}
            for way, values in (("forward", voltage), ("inverse", desired)):
                compiled = exported.Exported(model, options(precision), way)
                errors[f"{way}, fixed step"] = errors_of(compiled, model, None, values)
                errors[f"{way}, any step"] = errors_of(compiled, model, jittered, values)
            text = "; ".join(f"{what} {_told(error, bar)}" for what, error in errors.items())
            what = f"exported C, {precision.value}, against Python, {label}, {n} samples"
            is_met = max(float(np.max(error)) for error in errors.values()) <= bar
            rows.append(Row(what, text, f"<= {bar:g} relative", is_met))
    return rows


def _told(error: np.ndarray, bar: float) -> str:
    n_beyond = int(np.count_nonzero(error > bar))
    return f"{np.max(error):.1e}" + (
        f" ({n_beyond} samples beyond, the others {np.sort(error)[-n_beyond - 1]:.1e})" if n_beyond else ""
    )


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
            compiled = exported.Exported(model, options(precision), way)
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


def options(precision: Precision) -> ExportOptions:
    """Return how models are exported here."""
    return ExportOptions("exported", precision=precision, sample_period_s=STEP_S, is_dropping=True)
