"""Live calibration: from a stage nobody knows to one that follows, and back to the old model where it fails."""

from __future__ import annotations

import math
import subprocess
import sys
import time

import numpy as np
import yaml
from harness import model_file
from node_under_test import PATIENCE_S
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState
from small_model import MODEL
from std_msgs.msg import Float64
from std_srvs.srv import Trigger

COMMON = {"lease_s": 20.0, "calibrate_step_v": 0.5, "safe_ramp_v_per_s": 20.0, "slew_limit_v_per_s": 2000.0}
CAREFUL = COMMON | {
    "relax_duration_s": 2.0,
    "relax_frequency_hz": 25.0,
    "calibrate_slope_v_per_s": 6.0,
    "calibrate_dwell_s": 0.15,
}
PERIOD_S = 0.002
HASTY = COMMON | {
    "relax_duration_s": 0.5,
    "relax_frequency_hz": 40.0,
    "calibrate_slope_v_per_s": 20.0,
    "calibrate_dwell_s": 0.03,
}


def nodes(tmp_path, start, rate_hz=1.0 / PERIOD_S, plant="electromechanical", **options):
    file = model_file(tmp_path / "wrong.yaml", **options)
    return (
        start("compensator", file, rate_hz=rate_hz),
        start("simulated_pea", file, plant=plant, rate_hz=rate_hz),
        start("identification", file, rate_hz=rate_hz),
    )


class Lockstep:
    """A clock that goes on when the stage and the compensator have done their step, however busy the machine is.

    So what is measured is the model and the loop, not who got the processor first.
    """

    def __init__(self, probe, moved: list, heard: list) -> None:
        self._probe, self._moved, self._heard = probe, moved, heard
        self._clock = probe.publisher("/clock", Clock)
        self._is_driving = False
        self.time_s = 0.0
        self._k = 0

    def step(self) -> None:
        self._k += 1
        message = Clock()
        message.clock.sec, message.clock.nanosec = divmod(round(self._k * PERIOD_S * 1e9), 10**9)
        self.time_s = self._k * PERIOD_S
        n_moved, n_heard = len(self._moved), len(self._heard)
        self._clock.publish(message)
        self._wait(lambda: len(self._moved) > n_moved, 1.0)
        # Where the compensator drives nothing there is nothing to wait for; whether it does is found now and then.
        if self._is_driving or self._k % 50 == 0:
            self._is_driving = self._wait(lambda: len(self._heard) > n_heard, 0.5)

    def _wait(self, condition, timeout_s: float) -> bool:
        deadline = time.monotonic() + timeout_s
        self._probe.take()
        while not condition():
            if time.monotonic() > deadline:
                return False
            time.sleep(0.0005)
            self._probe.take()
        return True

    def until(self, condition, what: str) -> None:
        deadline = time.monotonic() + 3.0 * PATIENCE_S
        while not condition():
            assert time.monotonic() < deadline, what
            self.step()


def test_calibrated_stage_follows(tmp_path, probe, start):
    # stamped both: under a simulated clock the stamp is the only time a message has
    stamped = {"interface": "joint_state", "voltage_interface": "joint_state", "use_sim_time": True}
    compensator, _, identification = nodes(tmp_path, start, **CAREFUL, **stamped)
    heard, moved = probe.record("voltage", JointState), probe.record("displacement", JointState)
    publisher = probe.publisher("desired_position", JointState)
    for name in (compensator.name, identification.name):
        probe.until(lambda name=name: name in probe.messages, f"{name} running")
    clock = Lockstep(probe, moved, heard)
    clock.until(lambda: moved, "the stage")
    calibrated = probe.ask(Trigger, f"{identification.name}/calibrate", Trigger.Request())
    clock.until(calibrated.done, "the end of the calibration")
    answer = calibrated.result()
    assert answer.success, answer.message
    assert probe.state(compensator.name) == "active"
    model = yaml.safe_load((tmp_path / "identified_model.yaml").read_text())["/**"]["ros__parameters"]["model"]
    assert list(probe.get(compensator.name, "model.saturation_v")) == model["saturation_v"] != MODEL["saturation_v"]
    voltages = np.array([message.effort[0] for _, message in heard])
    assert np.max(np.abs(voltages)) <= 2.5
    nrmse_percent = tracked(clock, publisher, moved)
    print(f"{answer.message}; {clock.time_s:.0f} s of the stage's time; tracking NRMSE {nrmse_percent:.3f} %")
    assert nrmse_percent <= 0.36


def tracked(clock: Lockstep, publisher, moved: list) -> float:
    """Return NRMSE [%] of following a swing, by the stamps of the stage."""
    sent: list[tuple[float, float]] = []

    def follow(target_m, duration_s: float) -> None:
        began_s = clock.time_s
        while clock.time_s < began_s + duration_s:
            sent.append((clock.time_s, target_m(clock.time_s - began_s)))
            publisher.publish(JointState(name=["piezo"], position=[sent[-1][1]]))
            clock.step()

    follow(lambda t: 0.0, 0.3)
    moved.clear()
    sent.clear()
    follow(lambda t: 1e-6 * (1.5 * math.sin(1.0 * t) + 0.5 * math.sin(2.1 * t)), 6.0)
    targets = np.array(sent)
    times = np.array([m.header.stamp.sec + 1e-9 * m.header.stamp.nanosec for _, m in moved])
    values = np.array([m.position[0] for _, m in moved])
    inside = (times > targets[0, 0]) & (times < targets[-1, 0])
    error = values[inside] - np.interp(times[inside], targets[:, 0], targets[:, 1])
    return 100.0 * float(np.sqrt(np.mean(error**2)) / np.ptp(values[inside]))


def test_whatever_fails_the_old_model_goes_on_and_the_voltage_is_safe(tmp_path, probe, start):
    # In real time, and so little work that a busy machine keeps up: a stage that misses half its steps, as that of
    # circuit and mechanics does on a third of a processor, is no calibration.
    options = HASTY | {"relax_frequency_hz": 20.0, "displacement_timeout_s": 2.0}
    compensator, stage, identification = nodes(tmp_path, start, 200.0, "fomrc", **options)
    heard, moved = probe.record("voltage"), probe.record("displacement")
    publisher = probe.publisher("desired_position")
    client = probe.client(Trigger, f"{identification.name}/calibrate")
    probe.until(lambda: client.service_is_ready() and moved, "nodes")
    probe.drive_until(publisher, 0.5e-6, lambda: heard, "a voltage")

    def check(future, named: str) -> None:
        probe.until(lambda: future.done(), f"end of calibration: {named}")
        assert not future.result().success, named
        assert named in future.result().message, future.result().message
        assert probe.state(compensator.name) == "active", named
        assert probe.get(compensator.name, "model.saturation_v") == MODEL["saturation_v"], named
        assert abs(heard[-1][1].data) < 1.0, named
        heard.clear()
        probe.drive(publisher, lambda t: 0.2e-6, 0.3)
        probe.until(lambda: len(heard) > 20, f"the old model driving on: {named}")

    def doing(text: str) -> bool:
        return text in probe.diagnostics.get(identification.name, {}).get("doing", "")

    for stage_of_work in ("relaxing", "driving", "fitting"):
        if stage_of_work == "fitting":  # long enough to be cancelled in
            assert probe.set_one(identification.name, "n_elements", 0).successful
        future = client.call_async(Trigger.Request())
        probe.until(lambda s=stage_of_work, f=future: doing(s) or f.done(), stage_of_work)
        assert not future.done(), future.result()
        assert probe.trigger(f"{identification.name}/cancel").success
        check(future, "cancelled")
        probe.diagnostics.clear()
    assert probe.set_one(identification.name, "n_elements", 5).successful
    # The file cannot be written.
    assert probe.set_one(identification.name, "output_file", "no_such_folder/model.yaml").successful
    check(client.call_async(Trigger.Request()), "no_such_folder")
    assert probe.set_one(identification.name, "output_file", "model.yaml").successful
    # The stage dies in the middle.
    future = client.call_async(Trigger.Request())
    probe.diagnostics.clear()
    probe.until(lambda: doing("driving"), "driving")
    stage.process.kill()
    check(future, "no displacement")
    # The compensator dies: nothing to bring back, and the node says so.
    assert probe.set_one(identification.name, "service_timeout_s", 1.0).successful
    compensator.process.kill()
    compensator.process.wait()
    future = client.call_async(Trigger.Request())
    probe.until(future.done, "refusal")
    assert not future.result().success
    assert isinstance(heard[-1][1], Float64)


# Where messages of a stage faster than real time are late on a busy machine its record is refused, as it should be.
_ATTEMPTS = 3

CLOCK = """
import rclpy, signal, time
from rosgraph_msgs.msg import Clock
from rclpy.signals import SignalHandlerOptions
rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
node = rclpy.create_node("clock")
publisher = node.create_publisher(Clock, "/clock", 1)
message, k = Clock(), 0
while True:
    k += 1
    message.clock.sec, message.clock.nanosec = divmod(k * 5_000_000, 10**9)
    publisher.publish(message)
    time.sleep(0.002)
"""


def test_joint_states_and_simulated_time_faster_than_real(tmp_path, probe, start):
    options = HASTY | {
        "interface": "joint_state",
        "voltage_interface": "joint_state",
        "use_sim_time": True,
        "relax_duration_s": 3.0,
    }
    file = model_file(tmp_path / "wrong.yaml", **options)
    compensator = start("compensator", file, rate_hz=50.0)
    # The stage is another one than the compensator believes.
    stage = MODEL | {"kappa_um_per_v": [1.2 * kappa for kappa in MODEL["kappa_um_per_v"]]}
    start("simulated_pea", model_file(tmp_path / "stage.yaml", stage, **options), plant="fomrc", rate_hz=50.0)
    identification = start(
        "identification",
        file,
        rate_hz=50.0,
        relax_frequency_hz=5.0,
        calibrate_slope_v_per_s=4.0,
        calibrate_dwell_s=0.3,
        n_elements=3,
    )
    clock = subprocess.Popen([sys.executable, "-c", CLOCK])
    try:
        moved = probe.record("displacement", JointState)
        probe.until(lambda: moved, "displacement", 30.0)
        begun_s, begun_sim_s = time.monotonic(), moved[-1][1].header.stamp.sec
        for _ in range(_ATTEMPTS):
            answer = probe.trigger(f"{identification.name}/calibrate")
            if answer.success:
                break
            print(answer.message)
        assert answer.success, answer.message
        elapsed_s, elapsed_sim_s = time.monotonic() - begun_s, moved[-1][1].header.stamp.sec - begun_sim_s
        print(f"{elapsed_sim_s} simulated seconds in {elapsed_s:.1f}: {answer.message}")
        found = probe.get(compensator.name, "model.kappa_um_per_v")
        # Late messages cost some percent of it; the model that was in force is off by a sixth.
        assert abs(found[-1] - stage["kappa_um_per_v"][-1]) < 0.5 * abs(MODEL["kappa_um_per_v"][-1] - found[-1]), found
        assert elapsed_sim_s > 20
        assert elapsed_sim_s > 1.2 * elapsed_s
    finally:
        clock.kill()
        clock.wait()
