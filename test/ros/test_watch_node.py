"""The watch as a process: silent while the stage is its model, and then says what has changed."""

from __future__ import annotations

import json
import math

import numpy as np
import pytest
import yaml
from diagnostic_msgs.msg import DiagnosticStatus
from harness import clean, model_file
from node_under_test import PATIENCE_S
from rcl_interfaces.srv import GetParameters, ListParameters
from rclpy.parameter import Parameter
from rclpy.qos import DurabilityPolicy, QoSProfile
from sensor_msgs.msg import JointState
from small_model import MODEL
from std_msgs.msg import Float64, String

from fomrc_core.storage import read_model

RATE_HZ = 250.0
LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
NAME = "/watch"
_ATTEMPTS, _HELD_UP_S = 4, 0.05
QUICK = {"learn_s": 10.0, "follow_s": 6.0, "memory_s": 60.0}


def swing_m(t: float) -> float:
    return 1e-6 * (0.8 * math.sin(2.0 * t) + 0.4 * math.sin(5.3 * t) + 0.3 * math.sin(0.7 * t))


def test_a_stage_that_moves_less_is_noticed_and_named(tmp_path, probe, start, spoilt):
    file = model_file(tmp_path / "model.yaml", stale_after_s=0.0)
    start("compensator", file, rate_hz=RATE_HZ)
    spoilt("sound", "--stamped")
    heard, moved = probe.record("voltage"), probe.record("displacement", JointState)
    told: list[dict] = []
    scale = probe.publisher("sensor_scale")
    targets = probe.publisher("desired_position")
    driven = {"s": 0.0}

    def drive_until(condition, what: str) -> None:
        deadline_s = driven["s"] + PATIENCE_S
        while not condition():
            assert driven["s"] < deadline_s, f"{what}: {probe.messages.get(NAME)}"
            probe.drive(targets, lambda t: swing_m(t + driven["s"]), 1.0)
            driven["s"] += 1.0

    def drive_for(duration_s: float) -> None:
        until_s = driven["s"] + duration_s
        drive_until(lambda: driven["s"] >= until_s, "normal work")

    def is_watching() -> bool:
        return probe.diagnostics.get(NAME, {}).get("state") == "watching"

    # What is normal is learnt within seconds here. Where a busy machine held a process up meanwhile that is normal,
    # too, and it is learnt once more, a few times.
    for attempt in range(_ATTEMPTS):
        folder = tmp_path / f"seen{attempt}"
        heard.clear()
        moved.clear()
        watch = start("watch", file, auto_apply=True, interface="joint_state", output_folder=folder.name, **QUICK)
        probe.diagnostics.pop(NAME, None)
        drive_until(is_watching, "learning what is normal")
        drive_for(5.0)
        longest_s = max(float(np.max(np.diff([sent_s for sent_s, _ in entries]))) for entries in (heard, moved))
        if longest_s < _HELD_UP_S or attempt == _ATTEMPTS - 1:
            break
        assert watch.stop() == 0
        drive_for(1.0)  # what it said last is heard before the next one is waited for
    probe.subscribe(String, f"{watch.name}/changes", lambda _, m: told.append(json.loads(m.data)), LATCHED)
    probe.until(lambda: told, "what has changed so far")
    assert probe.levels[watch.name] == DiagnosticStatus.OK, probe.messages[watch.name]
    assert told[-1] == {"changes": []}
    before_s = driven["s"]
    scale.publish(Float64(data=0.8))
    drive_until(lambda: told and told[-1]["changes"], "the change")
    change = told[-1]["changes"][0]
    print(f"seen after {driven['s'] - before_s:.0f} s: {change['cause']}, {change['causes'][0]}")
    assert change["cause"] == "sensor_scale"
    assert change["causes"][0]["parameters"]["relative_change"] == pytest.approx(-0.2, abs=0.02)
    assert change["data_after"]["is_better"]
    assert probe.levels[watch.name] == DiagnosticStatus.WARN
    assert "sensor_scale" in (folder / "watch.log").read_text()
    assert len((folder / "watch.log").read_text().splitlines()) == 1
    assert "sensor_scale" in (folder / "change_1" / "change.html").read_text()
    extended = read_model(folder / "change_1" / "extended_model.yaml")
    assert extended.kappa_um_per_v[0] == pytest.approx(0.8 * MODEL["kappa_um_per_v"][0], rel=0.02)
    in_force = list(probe.get("/compensator", "model.kappa_um_per_v"))
    assert change["applied"].startswith("applied"), change["applied"]
    assert in_force == pytest.approx(extended.kappa_um_per_v)
    assert probe.trigger(f"{watch.name}/acknowledge").success
    probe.until(lambda: probe.levels[watch.name] == DiagnosticStatus.OK, "the warning taken back")
    assert watch.stop() == 0
    assert [line for line in clean(watch.output()) if "[WARN]" not in line] == []


def test_without_a_model_or_a_compensator_it_says_so(tmp_path, probe, start):
    alone = start("watch", is_fresh=True, compensator="")
    probe.until(lambda: "no model" in probe.messages.get(alone.name, ""), "the warning")
    assert probe.levels[alone.name] == DiagnosticStatus.WARN
    values = {f"model__{name}": value for name, value in MODEL.items()}
    assert probe.set_all(alone.name, **values).successful
    probe.until(lambda: probe.levels[alone.name] == DiagnosticStatus.OK, "the model in force")
    assert alone.stop() == 0
    asking = start("watch", service_timeout_s=0.5)
    probe.until(lambda: "does the compensator run?" in probe.messages.get(asking.name, ""), "the warning")
    assert asking.stop() == 0
    shown = yaml.safe_load(yaml.safe_dump(probe.messages[asking.name]))
    assert "list_parameters" in shown


def test_an_answer_that_was_dropped_is_asked_for_again(probe, start):
    """What the middleware does on a busy machine that has not matched the endpoints yet: a request, and no answer."""
    deaf = [
        probe.node.create_service(ListParameters, "/deaf/list_parameters", lambda request, response: response),
        probe.node.create_service(GetParameters, "/deaf/get_parameters", lambda request, response: response),
    ]
    values = {f"model.{name}": value for name, value in MODEL.items()}
    asking = start("watch", compensator="/deaf", service_timeout_s=6.0)
    said: list[str] = []
    n_asked = [0, 0]

    def answer() -> bool:
        said.append(probe.messages.get(asking.name, ""))
        for k, service in enumerate(deaf):
            request, header = service.handle.service_take_request(service.srv_type.Request)
            if header is None:
                continue
            n_asked[k] += 1
            response = service.srv_type.Response()
            if k == 0:
                response.result.names = list(values)
            else:
                response.values = [Parameter(name, value=values[name]).get_parameter_value() for name in request.names]
            if n_asked[k] > 1:
                service.handle.service_send_response(response, header.request_id)
        return probe.levels.get(asking.name) == DiagnosticStatus.OK

    probe.until(answer, "the model in force")
    assert not [line for line in said if "no answer" in line]
    assert asking.stop() == 0
