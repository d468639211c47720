"""A thousand actuators stepped together, beside as many compensators of their own."""

from __future__ import annotations

import numpy as np

from benchmarks import c_reference
from benchmarks.subjects import STEP_S, table_1
from benchmarks.timing import Row, interleaved
from fomrc_core.model.actuator_array import ActuatorArray
from fomrc_core.model.compensator import Compensator
from fomrc_core.model.piezo_model import PiezoModel

_LONGEST_NS = 25.0


def thousand_actuators(n_actuators: int = 1000) -> list[Row]:
    """One step of all, each with parameters of its own, in one thread; the state goes on from step to step."""
    rng = np.random.default_rng(1)
    first = table_1()
    models = [
        PiezoModel(first.kappa_um_per_v * rng.uniform(0.9, 1.1), first.saturation_v * rng.uniform(0.9, 1.1), order)
        for order in first.creep_order * rng.uniform(0.9, 1.1, n_actuators)
    ]
    array = ActuatorArray(models)
    n_steps = 200
    steps = np.full(n_steps, STEP_S)
    phases = rng.uniform(0.0, 6.0, n_actuators)
    voltage = 2.0 * np.sin(np.arange(n_steps)[:, None] / 30.0 + phases)
    forward, inverse = array.initial_state(), array.initial_state(is_inverse=True)
    desired = array.simulate(steps, voltage, forward.copy())
    singles = [Compensator(model) for model in models]
    states = [single.initial_state() for single in singles]
    row_um = desired[50].tolist()

    def separate() -> None:
        for single, state, target in zip(singles, states, row_um, strict=True):
            single.advance(state, target, STEP_S)

    def one_by_one() -> None:
        for row in desired:
            array.advance(inverse, row, STEP_S)

    works = {
        "forward": lambda: array.simulate(steps, voltage, forward),
        "inverse": lambda: array.compensate(steps, desired, inverse),
        "inverse, step by step": one_by_one,
        "separate compensators": separate,
    }
    if c_reference.available():
        flags = c_reference.FLAGS["gcc -O3 -march=native -ffast-math"]
        reference = c_reference.CReference(first, STEP_S, flags)
        one, out = np.ascontiguousarray(np.tile(desired[:, 0], 1000)), np.empty(1000 * n_steps)
        works["C reference, one actuator"] = lambda: reference.run("inverse", one, out)
    best = interleaved(works, 15)
    each = {
        "forward": 1e9 * best["forward"] / (n_steps * n_actuators),
        "inverse": 1e9 * best["inverse"] / (n_steps * n_actuators),
        "inverse, step by step": 1e9 * best["inverse, step by step"] / (n_steps * n_actuators),
        "separate compensators": 1e9 * best["separate compensators"] / n_actuators,
    }
    if "C reference, one actuator" in best:
        each["C reference, one actuator again and again"] = 1e9 * best["C reference, one actuator"] / (1000 * n_steps)
    figure = "; ".join(f"{name} {cost:.1f} ns" for name, cost in each.items())
    is_met = max(each["forward"], each["inverse"], each["inverse, step by step"]) <= _LONGEST_NS
    return [Row(f"{n_actuators} actuators, one step of all, for each", figure, f"<= {_LONGEST_NS:g} ns", is_met)]
