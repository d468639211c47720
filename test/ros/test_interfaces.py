"""Voltage and displacement in other message types, and what a driver is told when the compensator is gone."""

from __future__ import annotations

import re
import subprocess
import sys
import time

import numpy as np
import yaml
from harness import model_file
from node_server import REPOSITORY, die_with_the_parent
from rclpy.qos import qos_profile_sensor_data
from sensor_msgs.msg import JointState
from small_model import MODEL
from std_msgs.msg import Float64, Float64MultiArray

from fomrc_ros.conversions import INTERFACES, position_interface
from fomrc_ros.node.voltage_interface import voltage_interface

_HOW_TO = REPOSITORY / "docs" / "how-to"


def blocks(page: str, language: str) -> list[str]:
    return re.findall(rf"```{language}\n(.*?)```", (_HOW_TO / page).read_text(), re.DOTALL)


def test_every_type_carries_a_voltage_and_a_position_there_and_back(probe):
    stamp = probe.node.get_clock().now().to_msg()
    for name in INTERFACES:
        voltage = voltage_interface(name, "piezo")
        assert voltage.voltage_v(voltage.to_message(1.25, stamp)) == 1.25
        position = position_interface(name, "piezo")
        assert abs(position.to_um(position.to_message(1.25, stamp)) - 1.25) < 1e-12


def test_the_pages_parameters_connect_compensator_and_stage_to_controllers(tmp_path, probe, start):
    controllers, nodes = (yaml.safe_load(text) for text in blocks("ros2_control.md", "yaml")[-2:])
    assert controllers["voltage_controller"]["ros__parameters"]["interface_name"] == "effort"
    file = tmp_path / "nodes.yaml"
    given = nodes["/**"]["ros__parameters"]
    file.write_text(yaml.safe_dump({"/**": {"ros__parameters": given | {"model": MODEL}}}))
    to_controller = {"voltage": "voltage_controller/commands"}
    node = start("compensator", file, remaps=to_controller, rate_hz=200.0)
    start("simulated_pea", file, remaps=to_controller | {"displacement": "joint_states"}, plant="fomrc", rate_hz=200.0)
    commands = probe.record("voltage_controller/commands", Float64MultiArray)
    states: list = []
    probe.subscribe(JointState, "joint_states", lambda *seen: states.append(seen), qos_profile_sensor_data)
    probe.until(lambda: states, "the stage")
    publisher = probe.publisher("desired_position", JointState)
    probe.until_active(node)
    probe.drive_until(publisher, 0.8e-6, lambda: states[-1][1].position[0] > 0.7e-6, "the stage following")
    assert len(commands[-1][1].data) == 1
    assert states[-1][1].name == [given["joint_name"]]


def test_a_voltage_as_an_effort_has_a_stamp(tmp_path, probe, start):
    start("compensator", model_file(tmp_path / "model.yaml"), voltage_interface="joint_state", rate_hz=200.0)
    heard = probe.record("voltage", JointState)
    probe.drive_until(probe.publisher("desired_position"), 0.5e-6, lambda: len(heard) > 20, "voltages")
    stamps = np.array([m.header.stamp.sec + 1e-9 * m.header.stamp.nanosec for _, m in heard])
    assert np.all(np.diff(stamps) > 0.0)
    assert 0.0 < heard[-1][1].effort[0] < 2.5


def test_the_drivers_skeleton_goes_to_the_safe_voltage_when_the_compensator_is_killed(tmp_path, probe, start):
    (source,) = blocks("write-a-driver.md", "py")
    (tmp_path / "driver.py").write_text(source)
    said = tmp_path / "said.txt"

    def driven() -> list[str]:
        return [line for line in said.read_text().splitlines() if line.startswith("driving")]

    with said.open("wb") as output:
        command = [sys.executable, str(tmp_path / "driver.py")]
        driver = subprocess.Popen(command, stdout=output, stderr=output, preexec_fn=die_with_the_parent)
    try:
        given = {"rate_hz": 100.0, "stale_after_s": 0.0, "voltage_promises": True}
        compensator = start("compensator", model_file(tmp_path / "model.yaml"), **given)
        publisher = probe.publisher("desired_position", Float64)
        is_driving = lambda: re.search(r"driving 0\.[3-9]", said.read_text())  # noqa: E731
        probe.drive_until(publisher, 1e-6, is_driving, "the driver driving")
        compensator.process.kill()
        compensator.process.wait()
        killed_s = time.monotonic()
        probe.until(lambda: driven()[-1] == "driving 0.000 V", "the safe voltage")
        print(f"safe {time.monotonic() - killed_s:.1f} s after the compensator was killed")
        assert "Traceback" not in said.read_text()
    finally:
        driver.kill()
        driver.wait()
