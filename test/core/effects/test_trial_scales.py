"""Trial instances of every cause at any scale: within bounds, finite, never an exception."""

from __future__ import annotations

import numpy as np
import pytest

from fomrc_core.effects import Covariates, effect_classes
from fomrc_core.effects.base.evidence import Evidence, RecordEvidence
from fomrc_core.model.causes import cause_classes
from fomrc_core.model.piezo_model import PiezoModel
from test.hidden.all_cases import some_of

N_SCALES = len(some_of(range(300), 5))


def drive(rng: np.random.Generator, n: int) -> np.ndarray:
    """Return a drive between zero and one: sweeps, a sine, steps or noise, a stretch of it constant."""
    k = np.arange(n)
    kind = rng.integers(4)
    if kind == 0:
        shape = np.abs((k * rng.uniform(1.0, 20.0) / n) % 2.0 - 1.0)
    elif kind == 1:
        shape = 0.5 - 0.5 * np.cos(2.0 * np.pi * k * rng.uniform(1.0, 0.2 * n) / n)
    elif kind == 2:
        shape = np.repeat(rng.random(n // 20 + 1), 20)[:n]
    else:
        walk = np.cumsum(rng.standard_normal(n))
        shape = (walk - walk.min()) / np.ptp(walk)
    start = rng.integers(0, n // 2)
    shape[start : start + n // 5] = shape[start]
    return shape


def random_evidence(seed: int) -> Evidence:
    """Return evidence of one or two records at a random scale: rate, length, stroke, range, a spike in it."""
    rng = np.random.default_rng(seed)
    rate_hz, stroke_um = 10.0 ** rng.uniform(-1.0, np.log10(2e6)), 10.0 ** rng.uniform(-2.0, np.log10(2e4))
    span_v, lowest = 10.0 ** rng.uniform(0.0, 4.0), rng.choice([0.0, -0.5, -1.0])
    records = []
    for _ in range(rng.integers(1, 3)):
        n = int(10.0 ** rng.uniform(np.log10(200.0), np.log10(20_000.0)))
        steps_s = (1.0 + rng.choice([0.0, 0.3]) * rng.uniform(-1.0, 1.0, n)) / rate_hz
        time_s = np.cumsum(steps_s) - steps_s[0]
        shape = drive(rng, n)
        residual_um = 1e-3 * stroke_um * rng.standard_normal(n)
        if rng.random() < 0.5:
            residual_um[rng.integers(n)] += 0.5 * stroke_um
        if rng.random() < 0.5:  # a tone, anywhere up to half the sample rate
            residual_um += 3e-3 * stroke_um * np.sin(np.pi * rng.uniform(20.0 / n, 1.0) * np.arange(n))
        covariates = Covariates(
            temperature_c=20.0 + rng.random(n) if rng.random() < 0.5 else None,
            cross=stroke_um * rng.random(n) if rng.random() < 0.5 else None,
        )
        records.append(
            RecordEvidence(
                time_s,
                steps_s,
                span_v * (shape + lowest),
                stroke_um * shape,
                residual_um - residual_um.mean(),
                covariates,
            )
        )
    return Evidence(tuple(records), 1e-4 * stroke_um)


def test_trial_instances_of_every_cause_are_within_bounds_at_any_scale() -> None:
    n_trials = dict.fromkeys(cause_classes(), 0)
    for seed in range(N_SCALES):
        evidence = random_evidence(seed)
        for name, kind in cause_classes().items():
            trials = kind.screening(evidence)
            n_trials[name] += len(trials)
            for trial in trials:
                for spec in trial.parameters:
                    values = getattr(trial, spec.name)
                    for value in values if spec.is_list else (values,):
                        assert spec.lower <= value <= spec.upper, (seed, trial)
    sought = [n for n, kind in cause_classes().items() if kind.is_named and not kind.adds_elements]
    assert [n for n in sought if n_trials[n] < N_SCALES // 10] == []


def test_trial_instances_of_every_effect_simulate_to_finite_values_at_any_scale() -> None:
    for seed in range(0, N_SCALES, 6):
        evidence = random_evidence(seed)
        record = evidence.records[0]
        largest_v = float(np.max(np.abs(record.voltage_v)))
        gain = evidence.stroke_um / largest_v
        model = PiezoModel([0.1 * gain, gain], [0.1 * largest_v], 0.02)
        n = min(record.time_s.size, 1000)
        outside = record.covariates.part(slice(0, n))
        for kind in effect_classes().values():
            for trial in kind.screening(evidence):
                found = model.with_effects(trial).simulate(
                    record.steps_s[:n],
                    record.voltage_v[:n],
                    temperature_c=outside.temperature_c,
                    cross=outside.cross,
                )
                assert np.all(np.isfinite(found)), (seed, trial)


@pytest.mark.parametrize("name", list(cause_classes()))
def test_nothing_to_see_is_no_exception(name: str) -> None:
    n = 200
    time_s, nothing = np.arange(n) * 0.01, np.zeros(n)
    for voltage_v in (nothing, np.linspace(0.0, 1.0, n)):
        record = RecordEvidence(time_s, np.full(n, 0.01), voltage_v, nothing, nothing)
        cause_classes()[name].screening(Evidence((record,), 0.0))
