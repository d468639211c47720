"""A sensor takes what the model lacks; one that fails leaves the loop as it was, without a jump."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
import pytest
from small_model import MODEL

from benchmarks import fast_sensor
from fomrc_core.control.checkpoint import CheckpointWriter, read_checkpoint
from fomrc_core.control.compensation_loop import CompensationLoop, LoopSettings
from fomrc_core.control.feedback import Feedback
from fomrc_core.control.gain_margin import largest_bandwidth_hz
from fomrc_core.control.stage_motion import StageMotion
from fomrc_core.control.voltage_limits import VoltageLimits
from fomrc_core.effects.mechanical_resonance import MechanicalResonance
from fomrc_core.effects.transport_delay import TransportDelay
from fomrc_core.model.loop_filters import joint_response
from fomrc_core.model.piezo_model import PiezoModel
from fomrc_core.model.preview_inverse import PreviewInverse

PERIOD_S = 1e-3
NOISE_UM = 1e-3
SLEW_V_PER_S = 100.0
BANDWIDTH_HZ = 20.0
DYNAMICS = {
    "amplifier_bandwidth": {"cutoff_hz": 500.0},
    "mechanical_resonance": {"frequency_hz": 900.0, "damping_ratio": 0.2},
}


def model_of(gain: float = 1.0, **changed) -> PiezoModel:
    """The small model, its displacement scaled: every element by the same gain."""
    kappa = [gain * value for value in MODEL["kappa_um_per_v"]]
    return PiezoModel.from_mapping(MODEL | {"kappa_um_per_v": kappa, "effects": list(DYNAMICS)} | DYNAMICS | changed)


@dataclass
class Bench:
    """A loop with a sensor on a stage 5 % off the model.

    Attributes:
        sensor: what the sensor says [um or None] at a tick, of what is so [um].
        load_um: what pushes the stage at a tick [um].
    """

    sensor: Callable[[int, float], float | None] = lambda k, true_um: true_um
    load_um: Callable[[int], float] = lambda k: 0.0
    bandwidth_hz: float = BANDWIDTH_HZ
    limit_v: float = 5.0
    gain: float = 1.05
    feedback: Feedback = field(init=False)
    loop: CompensationLoop = field(init=False)

    def run(self, target_um: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return voltages [V] and true displacements [um]."""
        preview = PreviewInverse.of(model_of(), PERIOD_S, 0.01)
        limits = VoltageLimits(-self.limit_v, self.limit_v, SLEW_V_PER_S, 0.0, 10.0, 2.0 * PERIOD_S)
        self.loop = CompensationLoop(preview.core, LoopSettings(limits, 0.0, False, PERIOD_S, 60.0), preview=preview)
        self.feedback = Feedback(self.bandwidth_hz, PERIOD_S)
        motion = StageMotion(None, self.feedback)
        plant, noise = model_of(self.gain), np.random.default_rng(1).normal(0.0, NOISE_UM, target_um.size)
        state = plant.initial_state()
        voltages, moved = [], []
        self.closed = []
        for k, wanted in enumerate(target_um):
            now_s = k * PERIOD_S
            self.loop.set_target(float(wanted))
            motion.before_tick(self.loop, now_s)
            voltages.append(self.loop.tick(PERIOD_S))
            motion.after_tick(self.loop, now_s)
            moved.append(plant.advance(state, voltages[-1], PERIOD_S) + self.load_um(k))
            said = self.sensor(k, moved[-1] + noise[k])
            if said is not None:
                self.feedback.take(now_s + 0.5 * PERIOD_S, said)
            self.closed.append(self.feedback.is_closed)
        return np.array(voltages), np.array(moved)


STEP_UM = np.concatenate((np.zeros(50), np.full(950, 2.0)))


def test_the_sensor_takes_what_the_model_lacks_and_a_load():
    bench = Bench(load_um=lambda k: 0.05 if k >= 600 else 0.0)
    voltages, moved_um = bench.run(STEP_UM)
    off_um = moved_um - 2.0
    print("after 50 ms of the load", np.sqrt(np.mean(off_um[650:700] ** 2)), "at it", off_um[600])
    assert off_um[600] > 0.04
    assert np.sqrt(np.mean(off_um[500:600] ** 2)) < 1.5 * NOISE_UM
    assert np.sqrt(np.mean(off_um[650:700] ** 2)) < 3.0 * NOISE_UM
    assert np.max(np.abs(np.diff(voltages))) <= SLEW_V_PER_S * PERIOD_S + 1e-12
    assert bench.feedback.n_opened == 0


def test_what_was_added_is_the_models_error_in_its_units():
    time_s = PERIOD_S * np.arange(20000)
    bench = Bench(bandwidth_hz=10.0)
    bench.run(1.0 - np.cos(2.0 * np.pi * 0.2 * time_s))
    # The stage goes 5 % too far: all of the correction that is needed is 1 - 1 / 1.05 of where it is to be.
    print(bench.feedback.error.slope, bench.feedback.error.rms_um)
    assert bench.feedback.error.slope == pytest.approx(1.0 / 1.05 - 1.0, rel=0.1)
    assert bench.feedback.error.rms_um == pytest.approx((1.0 - 1.0 / 1.05) * math.sqrt(1.5), rel=0.1)


@pytest.mark.parametrize(
    ("fails", "says"),
    [
        (lambda k, true_um: None, "no measurement"),
        (lambda k, true_um: math.nan, "nan"),
        (lambda k, true_um: 2.0, "stuck"),
        (lambda k, true_um: true_um + (1.0 if k % 2 else -1.0), "from those before"),
    ],
    ids=["cut", "not a number", "stuck", "spikes"],
)
def test_a_sensor_that_fails_leaves_the_correction_as_it_is(fails, says):
    first, last = 500, 700
    course_um = 2.0 + 0.3 * np.sin(2.0 * np.pi * 5.0 * PERIOD_S * np.arange(1000))
    bench = Bench(sensor=lambda k, true_um: fails(k, true_um) if first <= k < last else true_um)
    problems = []
    original = bench.sensor

    def told(k: int, true_um: float) -> float | None:
        problems.append(bench.feedback.guard.problem)
        return original(k, true_um)

    bench.sensor = told
    voltages, moved_um = bench.run(np.concatenate((np.zeros(20), course_um[20:])))
    whole = Bench()
    _, unspoilt_um = whole.run(np.concatenate((np.zeros(20), course_um[20:])))
    assert np.max(np.abs(np.diff(voltages))) <= SLEW_V_PER_S * PERIOD_S + 1e-12
    assert not any(bench.closed[first + 30 : last])
    assert any(says in problem for problem in problems[first:last])
    assert all(bench.closed[last + 10 :])
    # In open loop it drifts by no more than a 5 % model error of the motion, and comes back.
    apart_um = np.abs(moved_um - unspoilt_um)
    print(says, np.max(apart_um[first:last]), np.max(apart_um[-100:]))
    assert np.max(apart_um[first:last]) < 0.05
    assert np.max(apart_um[-100:]) < 2.0 * NOISE_UM


def test_a_single_spike_is_not_heard():
    spoilt = Bench(sensor=lambda k, true_um: true_um + (1.0 if k == 500 else 0.0))
    voltages, _ = spoilt.run(STEP_UM)
    unspoilt, _ = Bench().run(STEP_UM)
    # One measurement is missing: what is integrated less is a sample of noise.
    assert np.max(np.abs(voltages - unspoilt)[500:520]) < 1e-3
    assert all(spoilt.closed[100:])


def test_a_limit_winds_nothing_up():
    bench = Bench(limit_v=1.5)
    target_um = np.concatenate((np.zeros(50), np.full(600, 4.0), np.full(400, 1.0)))
    _, moved_um = bench.run(target_um)
    assert bench.loop.counts.n_clamped > 300
    assert abs(bench.feedback.correction_um) < 0.3
    assert np.abs(moved_um[-50:] - 1.0).max() < 5.0 * NOISE_UM


@pytest.mark.parametrize(
    "effects",
    [
        (),
        (TransportDelay(delay_s=0.01),),
        (MechanicalResonance(frequency_hz=300.0, damping_ratio=0.02),),
        (MechanicalResonance(frequency_hz=120.0, damping_ratio=0.3), TransportDelay(delay_s=2e-3)),
    ],
    ids=["nothing", "delay", "light resonance", "resonance and delay"],
)
def test_the_largest_bandwidth_has_a_gain_margin_of_six_decibels(effects):
    """Nyquist's crossings of the negative real axis, counted on a grid of their own."""
    bandwidth_hz = largest_bandwidth_hz(effects, PERIOD_S)
    frequency_hz = np.linspace(0.05, 2500.0, 2_000_001)
    loop = bandwidth_hz / (1j * frequency_hz) * joint_response(effects, frequency_hz)
    margins = []
    # Late by two periods, or by less: the phase of what rings is not known so well.
    for late_s in PERIOD_S * np.linspace(0.25, 2.0, 8):
        late = loop * np.exp(-2j * np.pi * frequency_hz * late_s)
        crosses = (np.diff(np.sign(late.imag)) != 0) & (late.real[1:] < 0.0)
        margins.append(1.0 / np.max(-late.real[1:][crosses]))
    print([str(effect) for effect in effects], bandwidth_hz, margins)
    assert min(margins) * 1.001 >= 2.0
    assert min(margins) < 3.0, "and not much more than that"


def test_a_restart_goes_on_with_what_was_added(tmp_path):
    bench = Bench()
    bench.run(STEP_UM)
    loop, file = bench.loop, tmp_path / "memory"
    writer = CheckpointWriter(file, 3600.0)
    writer.note(
        loop.compensator,
        loop.memory,
        loop.moves,
        loop.followed_um,
        loop.voltage_v,
        correction_um=loop.correction_um,
        is_discontinuous=True,
    )
    writer.close()
    resumed = read_checkpoint(file, loop.compensator, PERIOD_S)
    assert resumed is not None
    assert resumed.is_exact
    assert resumed.correction_um == loop.correction_um
    assert abs(resumed.correction_um + 2.0 * 0.05 / 1.05) < 3.0 * NOISE_UM
    again = CompensationLoop(
        loop.compensator,
        loop.settings,
        resumed.memory,
        resumed.voltage_v,
        resumed.target_um - resumed.correction_um,
        preview=loop.preview,
    )
    again.correction_um = resumed.correction_um
    # Held where it was, creep going on for as long as it was down (on a busy machine some tenths of a second):
    # as the loop would have gone on that never was.
    for _ in range(round(resumed.down_time_s / PERIOD_S)):
        loop.tick(PERIOD_S)
    held_v, resumed_v = loop.tick(PERIOD_S), again.tick(PERIOD_S)
    print("held", held_v, "resumed", resumed_v, "after", resumed.down_time_s, "s")
    assert abs(resumed_v - held_v) < 5e-5, "half a period of creep, and rest"
    assert abs(again.target_um - 2.0) < 3.0 * NOISE_UM


def test_what_was_added_since_the_snapshot_is_in_the_journal(tmp_path):
    bench = Bench(bandwidth_hz=1.0)
    bench.run(STEP_UM[:100])
    loop, file = bench.loop, tmp_path / "memory"
    writer = CheckpointWriter(file, 3600.0)

    def note(is_discontinuous: bool) -> None:
        done = (loop.compensator, loop.memory, loop.moves, loop.followed_um, loop.voltage_v)
        writer.note(*done, correction_um=loop.correction_um, is_discontinuous=is_discontinuous)

    note(True)
    for added_um in (-0.03, -0.04, -0.05):
        loop.correction_um = added_um
        loop.tick(PERIOD_S)
        note(False)
    writer.close()
    resumed = read_checkpoint(file, loop.compensator, PERIOD_S)
    assert resumed is not None
    assert resumed.correction_um == -0.05
    assert resumed.voltage_v == loop.voltage_v
    assert abs(resumed.target_um - loop.followed_um) < 1e-12


@pytest.mark.parametrize("name", fast_sensor.FAILURES)
def test_whatever_fails_no_step_is_beyond_the_slew_limit_and_a_cut_opens_within_two_periods(name):
    failed = fast_sensor.driven(fast_sensor.swinging_um(), fast_sensor.FAILURES[name])
    print(name, failed.largest_step_v, failed.opened_after)
    assert np.max(np.abs(np.diff(failed.voltage_v))) <= SLEW_V_PER_S * PERIOD_S + 1e-12
    assert failed.opened_after <= {"cut": 2, "not a number": 2}.get(name, 10)
    assert all(failed.is_closed[fast_sensor.FAILS_TO + 10 :])
