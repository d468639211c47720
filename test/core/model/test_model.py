"""The model of the chain: exactness, states, plain Python beside compiled kernels, bad input."""

from __future__ import annotations

import json
import os
import pickle
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st
from random_models import elements, relative, signals, steps

from fomrc_core.effects.amplifier_bandwidth import AmplifierBandwidth
from fomrc_core.effects.thermal_drift import ThermalDrift
from fomrc_core.errors import InputError
from fomrc_core.model.compensator import Compensator
from fomrc_core.model.piezo_model import PiezoModel
from fomrc_core.model.prehistory import Prehistory
from fomrc_core.model.state import ModelState
from fomrc_core.operators.creep_full_memory import creep_full_memory
from fomrc_core.operators.hysteresis import hysteresis_block, move_plays_batch

ROOT = Path(__file__).parents[3]
ORDERS = st.one_of(st.sampled_from([0.0, 1e-6, 0.015, 0.2]), st.floats(0.0, 0.2))


def table_1() -> PiezoModel:
    content = yaml.safe_load((ROOT / "config" / "pi_p753_table1.yaml").read_text())
    return PiezoModel.from_mapping(content["/**"]["ros__parameters"]["model"])


@settings(deadline=None, max_examples=80)
@given(st.data(), elements(), ORDERS)
def test_batch_equals_stepwise_and_any_chunks(data, sets, order):
    model = PiezoModel(*sets, order)
    voltage_v = data.draw(signals())
    steps_s = data.draw(steps(voltage_v.size))
    whole = model.simulate(steps_s, voltage_v)
    state = model.initial_state()
    single = np.array([model.advance(state, u, dt) for u, dt in zip(voltage_v.tolist(), steps_s.tolist(), strict=True)])
    assert relative(whole, single) <= 1e-12
    cut = data.draw(st.integers(1, voltage_v.size - 1))
    state = model.initial_state()
    parts = [model.simulate(steps_s[p], voltage_v[p], state) for p in (slice(0, cut), slice(cut, None))]
    assert relative(np.concatenate(parts), single) <= 1e-12


@settings(deadline=None, max_examples=40)
@given(st.data(), elements(), ORDERS)
def test_saved_state_goes_on_as_if_nothing_had_been(data, sets, order):
    model = PiezoModel(*sets, order)
    voltage_v = data.draw(signals())
    steps_s = data.draw(steps(voltage_v.size))
    half = voltage_v.size // 2
    state = model.initial_state()
    model.simulate(steps_s[:half], voltage_v[:half], state)
    restored = ModelState.from_mapping(json.loads(json.dumps(state.to_mapping())))
    copied = state.copy()
    onward = model.simulate(steps_s[half:], voltage_v[half:], state)
    assert np.array_equal(model.simulate(steps_s[half:], voltage_v[half:], restored), onward)
    assert np.array_equal(model.simulate(steps_s[half:], voltage_v[half:], copied), onward)


@pytest.mark.parametrize("order", [0.0, 0.015, 0.1])
def test_model_is_plays_then_the_whole_past(order):
    # the elements by their law, the creep from its exact full-memory form: no kernel in common but the plays
    table = table_1()
    model = PiezoModel(table.kappa_um_per_v, table.saturation_v, order)
    rng = np.random.default_rng(5)
    voltage_v = np.clip(np.cumsum(0.05 * rng.standard_normal(5000)), -2.5, 2.5)
    steps_s = np.full(5000, 1e-3)
    moved = np.empty(5000)
    move_plays_batch(hysteresis_block(model.play_form), 0, voltage_v, moved)
    assert relative(model.simulate(steps_s, voltage_v), creep_full_memory(order, moved, steps_s)) <= 1e-5


def test_table_1_small_signal_gain_and_range():
    # sum of 1/kappa of Table 1 is 1.255 V/um; far out only the last element is left: 1.2808 um/V
    table = table_1()
    assert table.n_elements == 10
    without_creep = PiezoModel(table.kappa_um_per_v, table.saturation_v, 0.0)
    x = without_creep.simulate(np.full(3, 1e-3), np.array([1e-6, 50.0, 51.0]))
    assert x[0] / 1e-6 == pytest.approx(1.0 / 1.255, rel=1e-3)
    assert x[2] - x[1] == pytest.approx(1.2808, rel=1e-12)


def test_creep_of_a_held_step_grows_with_the_power_of_time():
    model = table_1()
    steps_s = np.full(61_000, 1e-3)
    x = model.simulate(steps_s, np.full(61_000, 1.0))
    # 10^0.015 per decade of time, from 6 ms to 60 s
    assert x[60_000] / x[600] == pytest.approx((60.001 / 0.601) ** 0.015, rel=1e-4)


@settings(deadline=None, max_examples=30)
@given(elements(), ORDERS)
def test_mapping_round_trip(sets, order):
    model = PiezoModel(*sets, order).with_effects(AmplifierBandwidth(cutoff_hz=11.3), ThermalDrift(um_per_c=0.01))
    text = yaml.safe_dump(model.to_mapping())
    back = PiezoModel.from_mapping(yaml.safe_load(text))
    assert np.array_equal(back.kappa_um_per_v, model.kappa_um_per_v)
    assert np.array_equal(back.saturation_v, model.saturation_v)
    assert back.creep_order == model.creep_order
    assert back.effects == model.effects
    assert yaml.safe_dump(back.to_mapping()) == text


def test_model_is_frozen_and_pickles():
    model = table_1()
    with pytest.raises(ValueError, match="read-only"):
        model.kappa_um_per_v[0] = 1.0
    with pytest.raises(AttributeError):
        model.creep_order = 0.5  # type: ignore[misc]
    back = pickle.loads(pickle.dumps(model))
    u, dt = np.linspace(0.0, 1.0, 50), np.full(50, 1e-3)
    assert np.array_equal(back.simulate(dt, u), model.simulate(dt, u))


def test_a_model_does_not_share_state_between_runs():
    model = table_1()
    u, dt = np.sin(np.arange(300) / 20.0), np.full(300, 1e-3)
    first = model.simulate(dt, u)
    assert np.array_equal(model.simulate(dt, u), first)


PLAIN = """
import sys
sys.modules["numba"] = None
import json
import numpy as np
from fomrc_core.compute.compiled import IS_COMPILED
from fomrc_core.model.compensator import Compensator
from fomrc_core.model.piezo_model import PiezoModel
assert not IS_COMPILED
work = json.load(sys.stdin)
model = PiezoModel.from_mapping(work["model"])
u, dt = np.array(work["voltage_v"]), np.array(work["steps_s"])
x = model.simulate(dt, u)
state = model.initial_state()
steps = [model.advance(state, a, b) for a, b in zip(u.tolist(), dt.tolist())]
compensator = Compensator(model)
back_state = compensator.initial_state()
back_steps = [compensator.advance(back_state, a, b) for a, b in zip(x.tolist(), dt.tolist())]
v = compensator.run(dt, x)
json.dump({"x": x.tolist(), "steps": steps, "v": v.tolist(), "back_steps": back_steps,
           "state": state.to_mapping(), "back_state": back_state.to_mapping()}, sys.stdout)
"""


@pytest.mark.parametrize("order", [0.0, 0.015, 0.3])
@pytest.mark.parametrize("jitter", [0.0, 0.3])
@pytest.mark.parametrize("with_effects", [False, True])
def test_plain_python_equals_compiled(order, jitter, with_effects):
    rng = np.random.default_rng(21)
    table = table_1()
    model = PiezoModel(table.kappa_um_per_v, table.saturation_v, order)
    if with_effects:
        model = model.with_effects(AmplifierBandwidth(cutoff_hz=30.0)).with_start(Prehistory(1.0, 0.2, 2.0, 3.0))
    u = np.round(np.cumsum(0.1 * rng.standard_normal(80)), 2)
    dt = 1e-3 * (1.0 + jitter * rng.uniform(-1.0, 1.0, u.size))
    work = {"model": model.to_mapping(), "voltage_v": u.tolist(), "steps_s": dt.tolist()}
    done = subprocess.run(
        [sys.executable, "-c", PLAIN],
        input=json.dumps(work),
        capture_output=True,
        text=True,
        cwd=ROOT,
        timeout=300,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    plain = {
        key: np.array(value) if isinstance(value, list) else value for key, value in json.loads(done.stdout).items()
    }
    x = model.simulate(dt, u)
    v = Compensator(model).run(dt, x)
    assert relative(plain["x"], x) <= 1e-12
    assert relative(plain["steps"], x) <= 1e-12
    assert relative(plain["v"], v) <= 1e-12
    assert relative(plain["back_steps"], v) <= 1e-12
    # states are the same numbers in either form: one saved without numba is restored with it
    state = ModelState.from_mapping(plain["state"])
    fresh = model.initial_state()
    model.simulate(dt, u, fresh)
    assert relative(model.simulate(dt, u[::-1].copy(), state), model.simulate(dt, u[::-1].copy(), fresh)) <= 1e-12


def test_import_compiles_nothing():
    script = (
        "import gc, fomrc_core.model.piezo_model, fomrc_core.model.compensator, fomrc_core.effects as e;"
        "import numba.core.dispatcher as d;"
        "e.effect_classes();"
        "print(sum(len(o.signatures) for o in gc.get_objects() if isinstance(o, d.Dispatcher)))"
    )
    done = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, cwd=ROOT, timeout=120, check=True
    )
    assert int(done.stdout) == 0


def test_kernels_work_where_no_cache_can_be_written():
    # a cache folder below a file cannot be made, and neither can one beside the package
    pytest.importorskip("numba")
    script = (
        "import numpy as np; from fomrc_core.model.piezo_model import PiezoModel;"
        "print(PiezoModel([2.0, 1.0], [0.1], 0.01).simulate(np.full(3, 1e-3), np.ones(3))[-1] > 0)"
    )
    environment = {**os.environ, "NUMBA_CACHE_DIR": "/dev/null/nowhere"}
    done = subprocess.run(
        [sys.executable, "-c", script],
        capture_output=True,
        text=True,
        cwd=ROOT,
        env=environment,
        timeout=120,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.strip() == "True"


def test_a_changed_kernel_is_compiled_anew_in_those_that_use_it(tmp_path):
    # numba looks at the file of the calling kernel alone; here one of another file changes
    pytest.importorskip("numba")
    shutil.copytree(ROOT / "fomrc_core", tmp_path / "fomrc_core")
    script = (
        "import numpy as np; from fomrc_core.model.piezo_model import PiezoModel;"
        "print(PiezoModel([2.0, 1.0], [0.1], 0.0).simulate(np.full(9, 1e-3), np.ones(9))[-1])"
    )

    def run() -> float:
        done = subprocess.run(
            [sys.executable, "-c", script], capture_output=True, text=True, cwd=tmp_path, timeout=120, check=True
        )
        return float(done.stdout)

    before = run()
    source = tmp_path / "fomrc_core" / "operators" / "hysteresis.py"
    text = source.read_text()
    changed = text.replace("out[k] = slope * value + total", "out[k] = slope * value + total + 100.0")
    assert changed != text
    source.write_text(changed)
    assert run() == pytest.approx(before + 100.0)


GOOD = {"kappa_um_per_v": [2.0, 1.0], "saturation_v": [0.1], "creep_order": 0.01}


@pytest.mark.parametrize(
    ("mapping", "named"),
    [
        (None, "model"),
        ([1.0], "model"),
        ({}, "kappa_um_per_v"),
        ({**GOOD, "creep_order": 1.2}, "model.creep_order"),
        ({**GOOD, "creep_order": "a"}, "model.creep_order"),
        ({**GOOD, "creep_order": None}, "model.creep_order"),
        ({**GOOD, "saturation_v": [0.1, 0.2]}, "saturation_v"),
        ({**GOOD, "saturation_v": [-0.1]}, "model.saturation_v"),
        ({**GOOD, "saturation_v": "0.1"}, "model.saturation_v"),
        ({**GOOD, "saturation_v": ["0.1"]}, "model.saturation_v"),
        ({**GOOD, "saturation_v": [True]}, "model.saturation_v"),
        ({**GOOD, "saturation_v": 0.1}, "model.saturation_v"),
        ({**GOOD, "saturation_v": {"a": 1}}, "model.saturation_v"),
        ({**GOOD, "kappa_um_per_v": [2.0, float("nan")]}, "model.kappa_um_per_v"),
        ({**GOOD, "alpha": 1.0}, "alpha"),
        ({**GOOD, "effects": "amplifier_bandwidth"}, "model.effects"),
        ({**GOOD, "effects": ["nonsense"]}, "nonsense"),
        ({**GOOD, "effects": [3]}, "model.effects"),
        ({**GOOD, "effects": ["amplifier_bandwidth"]}, "amplifier_bandwidth"),
        ({**GOOD, "effects": ["amplifier_bandwidth"], "amplifier_bandwidth": 3}, "model.amplifier_bandwidth"),
        ({**GOOD, "effects": ["amplifier_bandwidth"], "amplifier_bandwidth": {}}, "cutoff_hz"),
        (
            {**GOOD, "effects": ["amplifier_bandwidth"], "amplifier_bandwidth": {"cutoff_hz": -1.0}},
            "cutoff_hz",
        ),
        ({**GOOD, "effects": ["amplifier_bandwidth"], "amplifier_bandwidth": {"cutoff": 1.0}}, "cutoff"),
        ({**GOOD, "effects": ["gain_drift", "gain_drift"], "gain_drift": {"per_s": 0.1}}, "gain_drift"),
    ],
)
def test_bad_model_block_is_named(mapping, named):
    with pytest.raises(InputError) as caught:
        PiezoModel.from_mapping(mapping)
    assert named in str(caught.value)
    assert "allowed" in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    "mapping",
    [
        None,
        {},
        {"packed": "a"},
        {"packed": [1.0], "effects": [], "last_input": 0.0, "bend": 0.0},
        {"packed": [float("nan")], "effects": {}, "last_input": 0.0, "bend": 0.0},
        {"packed": [1.0], "effects": {}, "last_input": "b", "bend": 0.0},
        {"packed": [1.0], "effects": {}, "last_input": 0.0},
    ],
)
def test_bad_state_is_named(mapping):
    with pytest.raises(InputError, match="state"):
        ModelState.from_mapping(mapping)


def test_bad_signals_are_named():
    model = table_1()
    for u, dt, named in (
        (np.ones(3), np.ones(2), "voltage_v"),
        (np.ones((2, 2)), np.ones((2, 2)), "voltage_v"),
        (np.empty(0), np.empty(0), "voltage_v"),
        (np.array([1.0, np.nan]), np.ones(2), "voltage_v"),
        (np.ones(2), np.array([1.0, 0.0]), "steps_s"),
        (np.ones(2), np.array([1.0, -1.0]), "steps_s"),
        (np.ones(2), np.array([1.0, np.nan]), "steps_s"),
        (np.ones(2), np.array([1.0, np.inf]), "steps_s"),
    ):
        state = model.initial_state()
        before = state.copy()
        with pytest.raises(InputError, match=named):
            model.simulate(dt, u, state)
        assert np.array_equal(state.packed, before.packed)


@pytest.mark.parametrize(
    ("voltage_v", "step_s"),
    [(np.nan, 1e-3), (np.inf, 1e-3), (1.0, 0.0), (1.0, -1e-3), (1.0, np.nan), (1.0, np.inf)],
)
@pytest.mark.parametrize("with_effects", [False, True])
def test_a_bad_step_is_refused_and_leaves_the_state(voltage_v, step_s, with_effects):
    model = table_1()
    if with_effects:
        model = model.with_effects(AmplifierBandwidth(cutoff_hz=30.0))
    for runner in (model, Compensator(model)):
        state = runner.initial_state()
        before = state.copy()
        with pytest.raises(InputError):
            runner.advance(state, voltage_v, step_s)
        assert np.array_equal(state.packed, before.packed)
        assert state.last_input == before.last_input
