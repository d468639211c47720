"""Work that takes a while: a job number at once, and how it goes and what came of it on ``~/status``."""

from __future__ import annotations

import json
import time

from harness import model_file
from rclpy.qos import DurabilityPolicy, QoSProfile
from std_msgs.msg import String

LATCHED = QoSProfile(depth=20, durability=DurabilityPolicy.TRANSIENT_LOCAL)


def statuses(probe, node) -> list[dict]:
    heard: list[dict] = []
    probe.subscribe(String, f"{node.name}/status", lambda _, m: heard.append(json.loads(m.data)), LATCHED)
    return heard


def test_a_relaxation_is_begun_at_once_and_told_of(tmp_path, probe, start):
    file = model_file(tmp_path / "model.yaml", relax_duration_s=2.0, relax_amplitude_v=1.0)
    node = start("compensator", file, rate_hz=200.0)
    heard = statuses(probe, node)
    probe.until(lambda: heard, "the latched status")
    assert (heard[-1]["job"], heard[-1]["state"]) == (0, "idle")
    probe.until(lambda: node.name in probe.messages, "the node running")
    began_s = time.monotonic()
    answer = probe.trigger(f"{node.name}/start_relax")
    assert (answer.success, answer.message) == (True, "job 1")
    assert heard[-1]["state"] != "succeeded"
    assert "busy: relax runs" in probe.trigger(f"{node.name}/relax").message
    probe.until(lambda: heard[-1]["state"] == "succeeded", "the end of the relaxation")
    assert time.monotonic() - began_s > 2.0
    percents = [status["percent"] for status in heard if status["state"] == "running"]
    assert percents == sorted(percents)
    assert percents[-1] > 50.0
    assert heard[-1] == {"job": 1, "activity": "relax", "state": "succeeded", "percent": 100.0, "text": "relaxed"}
    late = statuses(probe, node)
    probe.until(lambda: late, "the status for who comes late")
    assert late == [heard[-1]]


def test_what_fails_is_told_with_its_reason(probe, start):
    node = start("identification")
    heard = statuses(probe, node)
    assert probe.trigger(f"{node.name}/start_identify").message == "job 1"
    probe.until(lambda: heard and heard[-1]["state"] == "failed", "the failure")
    assert heard[-1]["activity"] == "identify"
    assert "no recording named" in heard[-1]["text"]
    assert not probe.trigger(f"{node.name}/identify").success
    probe.until(lambda: heard[-1]["job"] == 2, "the next job")
