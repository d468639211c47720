"""The voltage on its way out: within its limits whatever asks for it, and where it may stay at every stop."""

from __future__ import annotations

import json
import os
import signal
import time
import zlib
from pathlib import Path

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticStatus
from harness import clean, model_file
from lifecycle_msgs.srv import ChangeState
from sensor_msgs.msg import JointState
from std_srvs.srv import Trigger

OPTIONS = {"rate_hz": 200.0, "slew_limit_v_per_s": 500.0}


def volts(heard) -> np.ndarray:
    return np.array([message.data for _, message in heard])


def held_at(probe, node, heard, publisher, target_m: float) -> float:
    """Follow a target until the voltage has come to it; return that voltage."""
    probe.drive_until(publisher, target_m, lambda: heard, "a voltage")
    probe.drive(publisher, lambda t: target_m, 0.3)
    probe.until(lambda: len(heard) > 20 and np.ptp(volts(heard[-10:])) < 1e-3, "the voltage at rest")
    return heard[-1][1].data


def test_row_07_limits_narrowed_live_are_kept_from_the_next_message_on(tmp_path, probe, start):
    node = start("compensator", model_file(tmp_path / "model.yaml"), **OPTIONS)
    heard = probe.record("voltage")
    publisher = probe.publisher("desired_position")
    assert held_at(probe, node, heard, publisher, 1.8e-6) > 0.8
    # While the target is followed, while it rests, and while there is none: after the answer nothing beyond.
    assert probe.set_one(node.name, "maximum_voltage_v", 0.3).successful
    answered_s = probe.now_s()
    probe.drive(publisher, lambda t: 1.8e-6, 0.5)
    assert volts(probe.sent_since(heard, answered_s)).max() == 0.3
    assert probe.set_all(node.name, minimum_voltage_v=-0.1, maximum_voltage_v=0.1).successful
    answered_s = probe.now_s()
    probe.until(lambda: len(probe.sent_since(heard, answered_s)) > 40, "voltage at rest")
    assert np.abs(volts(probe.sent_since(heard, answered_s))).max() <= 0.1


@pytest.mark.parametrize("source", ["narrower limits", "hand-edited"])
def test_row_07_a_checkpoint_beyond_the_limits_is_refused(tmp_path, probe, start, source):
    file, checkpoint = model_file(tmp_path / "model.yaml", stop_policy="hold"), tmp_path / "memory"
    node = start("compensator", file, checkpoint_file=checkpoint, **OPTIONS)
    heard = probe.record("voltage")
    publisher = probe.publisher("desired_position")
    assert held_at(probe, node, heard, publisher, 1.8e-6) > 0.8
    assert node.stop() == 0
    limits = {}
    if source == "hand-edited":
        content = json.loads(checkpoint.read_bytes().partition(b"\n")[2]) | {"voltage_v": 1e9}
        body = json.dumps(content).encode()
        checkpoint.write_bytes(f"{zlib.crc32(body):08x}\n".encode() + body)
        for journal in tmp_path.glob("memory.journal.*"):
            journal.unlink()
    else:
        limits = {"maximum_voltage_v": 0.3}
    probe.spin_for(0.5)
    heard.clear()  # nothing of the first one is on its way any more
    node = start("compensator", file, checkpoint_file=checkpoint, **OPTIONS, **limits)
    probe.until(lambda: "beyond the limits" in probe.messages.get(node.name, ""), "the refusal in diagnostics")
    assert "~/relax" in probe.messages[node.name]
    assert (tmp_path / "memory.damaged").exists()
    probe.drive_until(probe.publisher("desired_position"), 1.8e-6, lambda: len(heard) > 100, "voltage")
    assert np.abs(volts(heard)).max() <= limits.get("maximum_voltage_v", 2.5)


@pytest.mark.parametrize("way", ["SIGINT", "deactivate", "shutdown"])
def test_row_08_a_stop_during_a_relaxation_before_any_target_ramps_to_the_safe_voltage(tmp_path, probe, start, way):
    file = model_file(tmp_path / "model.yaml", relax_amplitude_v=2.0, relax_duration_s=30.0, relax_frequency_hz=0.5)
    node = start("compensator", file, safe_ramp_v_per_s=20.0, **OPTIONS)
    heard = probe.record("voltage")
    probe.until(lambda: probe.messages.get(node.name) == "waiting for a target", "the active node")
    relaxing = probe.ask(Trigger, f"{node.name}/relax", Trigger.Request())
    probe.until(lambda: heard and heard[-1][1].data < -1.0, "the relaxation under way")
    if way == "SIGINT":
        node.process.send_signal(signal.SIGINT)
        probe.until(lambda: node.process.poll() is not None, "the end")
    else:
        assert probe.transition(node.name, way)
        probe.until(relaxing.done, "the answer to who waited for the relaxation")
        assert not relaxing.result().success
    probe.until(lambda: heard[-1][1].data == 0.0, "the safe voltage")
    ramp = volts(heard)[-25:]
    # two periods' reach at most, also where a tick came late
    assert np.all(np.abs(np.diff(ramp)) <= 2 * 20.0 / 200.0 + 1e-12), "and not in one jump"


def test_row_09_a_slow_ramp_leaves_the_node_free_to_answer(tmp_path, probe, start):
    node = start("compensator", model_file(tmp_path / "model.yaml"), safe_ramp_v_per_s=0.2, **OPTIONS)
    heard = probe.record("voltage")
    publisher = probe.publisher("desired_position")
    held_v = held_at(probe, node, heard, publisher, 1.8e-6)
    request = ChangeState.Request()
    request.transition.label = "deactivate"
    began_s = time.monotonic()
    deactivated = probe.ask(ChangeState, f"{node.name}/change_state", request)
    n_answers = 0
    while not deactivated.done():
        assert probe.get(node.name, "safe_ramp_v_per_s") == 0.2
        n_answers += 1
        # Another transition meanwhile is refused, and a target is not followed.
        if n_answers == 3:
            assert not probe.transition(node.name, "deactivate")
        publisher.publish(type(heard[0][1])(data=1.8e-6))
    assert deactivated.result().success
    ramp_s = time.monotonic() - began_s
    assert ramp_s > 0.8 * held_v / 0.2, "it was a slow ramp"
    assert n_answers > 10 * ramp_s, "answers came all the while"
    assert heard[-1][1].data == 0.0
    assert np.all(np.diff(volts(heard)[-100:]) <= 1e-12)


def test_row_09_it_ends_with_little_work_of_its_own(tmp_path, probe, start):
    node = start("compensator", model_file(tmp_path / "model.yaml"), **OPTIONS)
    heard = probe.record("voltage")
    publisher = probe.publisher("desired_position")
    held_at(probe, node, heard, publisher, 1e-6)

    def cpu_s() -> float:
        fields = Path(f"/proc/{node.process.pid}/stat").read_text().rpartition(")")[2].split()
        return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")

    before_s = last_s = cpu_s()
    node.process.send_signal(signal.SIGINT)
    while node.process.poll() is None:
        try:
            last_s = cpu_s()
        except (OSError, IndexError, ProcessLookupError):
            break
        probe.spin_for(0.002)
    assert node.wait_for_exit() == 0
    assert clean(node.output()) == []
    print(f"{last_s - before_s:.2f} s of processor time from SIGINT to the end")
    assert last_s - before_s < 1.0


def test_row_10_a_target_out_of_reach_is_said_and_by_how_much(tmp_path, probe, start):
    node = start(
        "compensator", model_file(tmp_path / "model.yaml"), stale_after_s=0.0, maximum_voltage_v=0.5, **OPTIONS
    )
    publisher = probe.publisher("desired_position")
    said = lambda: probe.messages.get(node.name, "")  # noqa: E731
    probe.drive_until(publisher, 2e-6, lambda: "saturated: target out of reach by" in said(), "the warning")
    assert probe.levels[node.name] == DiagnosticStatus.WARN
    assert 0.5 < float(probe.diagnostics[node.name]["shortfall_um"]) < 2.0
    probe.drive_until(publisher, 0.2e-6, lambda: said() == "tracking", "the end of the warning")


def test_row_10_the_gap_nodes_say_so_too(tmp_path, probe, start):
    file = model_file(tmp_path / "model.yaml")
    for axis in ("axis1", "axis2", "axis3"):
        start("compensator", file, namespace=f"/{axis}", stale_after_s=0.0, maximum_voltage_v=0.5, **OPTIONS)
    gap_nodes = [start(kind) for kind in ("gap_command", "gap_monitor")]
    publisher = probe.publisher("desired_gap", JointState)
    for axis in ("axis1", "axis2", "axis3"):
        probe.until(lambda axis=axis: probe.node.count_subscribers(f"/{axis}/desired_position"), "axes")
    gap = JointState(name=["piston", "tip", "tilt"], position=[0.0, 500e-6, 0.0])

    def is_said() -> bool:
        publisher.publish(gap)
        return all("axis2: saturated" in probe.messages.get(node.name, "") for node in gap_nodes)

    probe.until(is_said, "the warning of both gap nodes")
    assert all(probe.levels[node.name] == DiagnosticStatus.WARN for node in gap_nodes)


def test_row_11_a_clock_that_does_not_come_is_said(tmp_path, probe, start):
    file = model_file(tmp_path / "model.yaml", use_sim_time=True)
    nodes = [start(kind, file, rate_hz=200.0) for kind in ("compensator", "simulated_pea", "identification")]
    for node in nodes:
        probe.until(lambda node=node: "no /clock" in probe.messages.get(node.name, ""), f"the warning of {node.name}")
        assert probe.levels[node.name] == DiagnosticStatus.WARN
