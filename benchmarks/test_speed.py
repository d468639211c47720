"""pytest-benchmark suites: ``python -m pytest benchmarks --benchmark-only``; no bar is asserted here."""

from __future__ import annotations

import functools
import json
import subprocess
import sys

import numpy as np
import pytest
import scipy.signal

from benchmarks.subjects import MODEL_FILE, ROOT, STEP_S, drive, record, table_1
from fomrc_core.effects import Effect
from fomrc_core.effects.amplifier_bandwidth import AmplifierBandwidth
from fomrc_core.effects.base.kernels import knee_block, run_knees
from fomrc_core.effects.base.linear_modes import logarithmic_modes, modes_at_rest, run_modes
from fomrc_core.effects.clock_skew import ClockSkew
from fomrc_core.effects.sensor_bandwidth import SensorBandwidth
from fomrc_core.effects.transport_delay import TransportDelay
from fomrc_core.model.compensator import Compensator
from fomrc_core.model.simulation import relaxed_state, run_chain
from fomrc_core.model.substeps import Substeps
from fomrc_core.operators.creep import creep_block
from fomrc_core.operators.creep_batch import integrate
from fomrc_core.operators.hysteresis import hysteresis_block, move_plays_batch, move_stops_batch

N = 100_000


@pytest.fixture(scope="module")
def model():
    return table_1()


def test_forward_batch(benchmark, model):
    steps, voltage = drive(N)
    benchmark(model.simulate, steps, voltage)


def test_forward_batch_jittered(benchmark, model):
    _, voltage = drive(N)
    steps = STEP_S * np.random.default_rng(0).uniform(0.9, 1.1, N)
    benchmark(model.simulate, steps, voltage)


def test_forward_batch_with_effects(benchmark, model):
    steps, voltage = drive(N)
    benchmark(model.with_effects(AmplifierBandwidth(50.0), TransportDelay(0.003)).simulate, steps, voltage)


def test_inverse_batch(benchmark, model):
    steps, voltage = drive(N)
    benchmark(Compensator(model).run, steps, model.simulate(steps, voltage))


@pytest.mark.parametrize("form", ["plays", "stops"])
def test_hysteresis_alone(benchmark, model, form):
    _, voltage = drive(N)
    block = hysteresis_block(model.play_form if form == "plays" else model.stop_form)
    benchmark(move_plays_batch if form == "plays" else move_stops_batch, block, 0, voltage, np.empty(N))


def test_creep_alone(benchmark, model):
    steps, values = drive(N)
    benchmark(integrate, creep_block(model.creep_modes), 0, values, steps, np.empty(N))


@pytest.mark.parametrize("way", ["side by side", "one by one"])
@pytest.mark.parametrize("effect", [SensorBandwidth(100.0, 2.0), ClockSkew(300.0)], ids=lambda effect: effect.name)
def test_columns_of_a_fit(benchmark, effect, way):
    columns = np.random.default_rng(0).standard_normal((N // 10, 60)).cumsum(axis=0)
    linearized = effect.linearized if way == "side by side" else functools.partial(Effect.linearized, effect)
    benchmark(linearized, columns, np.full(N // 10, STEP_S))


@pytest.mark.parametrize("knee_v", [-np.inf, 5.0], ids=["plain", "kneed"])
def test_plays_of_an_effect(benchmark, model, knee_v):
    form = model.play_form
    block = knee_block(form.thresholds, np.full(form.thresholds.size, knee_v), form.weights)
    benchmark(run_knees, block, drive(N)[1], np.empty(N))


def test_real_modes_of_an_effect(benchmark):
    rates_per_s, gains = logarithmic_modes(STEP_S)
    steps, values = drive(N)
    benchmark(run_modes, modes_at_rest(rates_per_s.size), rates_per_s, gains, 1.0, values, steps, np.empty(N))


@pytest.mark.parametrize("substeps", [Substeps.BENDS, Substeps.FIT], ids=lambda substeps: substeps.value)
def test_a_run_of_a_fit(benchmark, model, substeps):
    # triangles of some 0.4 % of the largest threshold a step: as a model divides their steps, and as a fit does
    steps, voltage = np.full(N // 10, STEP_S), scipy.signal.sawtooth(2.0 * np.pi * np.arange(N // 10) / 500.0, 0.5)

    def run():
        state, at_creep = relaxed_state(model.play_form, model.creep_modes, ())
        return run_chain(state, at_creep, (), steps, model.play_form.thresholds[-1] * voltage, substeps=substeps)

    benchmark(run)


@pytest.mark.parametrize("direction", ["forward", "inverse"])
def test_one_step(benchmark, model, direction):
    runner = model if direction == "forward" else Compensator(model)
    benchmark(runner.advance, runner.initial_state(), 0.5, STEP_S)


@pytest.mark.parametrize("direction", ["forward", "inverse"])
def test_one_step_without_numba(benchmark, model, direction):
    from fomrc_core.model.plain_kernels import PlainKernels

    runner = model if direction == "forward" else Compensator(model)
    state = runner.initial_state()
    step = getattr(PlainKernels(state.packed, runner.at_creep), direction)
    benchmark(step, 0.5, STEP_S)


def test_model_load(benchmark):
    from fomrc_core.storage import read_model

    benchmark(read_model, MODEL_FILE)


def test_import(benchmark):
    script = "import time, json, numpy; t = time.process_time(); import fomrc_core.model.piezo_model\n"
    script += "import fomrc_core.model.compensator\n"
    script += "print(json.dumps(time.process_time() - t))"

    def start():
        done = subprocess.run([sys.executable, "-c", script], cwd=ROOT, capture_output=True, text=True, check=True)
        return json.loads(done.stdout)

    benchmark.extra_info["import_s"] = benchmark.pedantic(start, rounds=3)


def test_identification(benchmark):
    from fomrc_core.identification.convex import identify

    benchmark.pedantic(identify, args=(record(60_000, 1e-3),), rounds=3, warmup_rounds=1)


def test_diagnosis(benchmark):
    from fomrc_core.diagnosis.diagnosis import diagnose

    benchmark.pedantic(diagnose, args=(record(20_000, 1e-3),), rounds=1, warmup_rounds=1)
