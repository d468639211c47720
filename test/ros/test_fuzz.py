"""Nonsense at every parameter, service and message field: the loop lives on."""

from __future__ import annotations

import math
import random

from harness import model_file
from rcl_interfaces.msg import Parameter as ParameterMessage
from rcl_interfaces.msg import ParameterType, ParameterValue
from rcl_interfaces.srv import ListParameters, SetParameters, SetParametersAtomically
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64

NUMBERS = (0.0, -0.0, 1.0, -1.0, 1e-308, 1e308, math.nan, math.inf, -math.inf, 5e-324, 2.0**63)
STRINGS = ("", "x" * 5000, "/etc/passwd", "../..", "\n", "hold", "é", "%s%n", "model", "a\x01b")


def any_value(generator: random.Random) -> ParameterValue:
    kind = generator.choice(range(10))
    value = ParameterValue(type=kind)
    length = generator.choice((0, 1, 3, 11, 5000))
    if kind == ParameterType.PARAMETER_BOOL:
        value.bool_value = generator.random() < 0.5
    elif kind == ParameterType.PARAMETER_INTEGER:
        value.integer_value = generator.choice((0, 1, -1, 2**63 - 1, -(2**63)))
    elif kind == ParameterType.PARAMETER_DOUBLE:
        value.double_value = generator.choice(NUMBERS)
    elif kind == ParameterType.PARAMETER_STRING:
        value.string_value = generator.choice(STRINGS)
    elif kind == ParameterType.PARAMETER_BYTE_ARRAY:
        value.byte_array_value = [b"\xff"] * length
    elif kind == ParameterType.PARAMETER_BOOL_ARRAY:
        value.bool_array_value = [True] * length
    elif kind == ParameterType.PARAMETER_INTEGER_ARRAY:
        value.integer_array_value = [generator.choice((0, 1, -5, 2**40)) for _ in range(length)]
    elif kind == ParameterType.PARAMETER_DOUBLE_ARRAY:
        value.double_array_value = [generator.choice(NUMBERS) for _ in range(length)]
    elif kind == ParameterType.PARAMETER_STRING_ARRAY:
        value.string_array_value = [generator.choice(STRINGS) for _ in range(min(length, 11))]
    return value


def test_nothing_that_can_be_sent_takes_a_node_down(tmp_path, probe, start):
    generator = random.Random(7)
    file = model_file(tmp_path / "model.yaml", interface="joint_state")
    nodes = [start(kind, file, rate_hz=200.0) for kind in ("compensator", "simulated_pea", "identification")]
    heard = probe.record("voltage")
    targets = probe.publisher("desired_position", JointState)
    cross = probe.publisher("cross_position", JointState)
    voltages = probe.publisher("voltage")
    for node in nodes:
        names = probe.call(ListParameters, f"{node.name}/list_parameters", ListParameters.Request()).result.names
        names = [name for name in names if name != "use_sim_time"]
        assert len(names) > 8
        names += ["", "model", "model.effects.x", "model.mechanical_resonance.frequency_hz", "é", "x" * 300]
        for _ in range(25):
            chosen = generator.sample(names, generator.choice((1, 1, 5)))
            messages = [ParameterMessage(name=name, value=any_value(generator)) for name in chosen]
            if generator.random() < 0.5:
                probe.call(SetParameters, f"{node.name}/set_parameters", SetParameters.Request(parameters=messages))
            else:
                request = SetParametersAtomically.Request(parameters=messages)
                probe.call(SetParametersAtomically, f"{node.name}/set_parameters_atomically", request)
    for _ in range(200):
        n = generator.choice((0, 1, 2, 50))
        message = JointState(
            name=[generator.choice(("piezo", "", "other")) for _ in range(generator.choice((0, 1, n)))],
            position=[generator.choice(NUMBERS) for _ in range(n)],
            velocity=[generator.choice(NUMBERS) for _ in range(generator.choice((0, 3)))],
        )
        message.header.stamp.sec = generator.choice((0, 2**31 - 1, -1))
        generator.choice((targets, cross)).publish(message)
        voltages.publish(Float64(data=generator.choice(NUMBERS)))
        probe.spin_for(0.003)
    for service in ("relax", "assume_relaxed", "reload_parameters"):
        if service != "relax":
            probe.trigger(f"{nodes[0].name}/{service}")
    for service in ("identify", "diagnose", "cancel"):
        assert not probe.trigger(f"{nodes[2].name}/{service}").success
    for node in nodes:
        assert node.process.poll() is None, node.output()
    good = [("minimum_voltage_v", -2.5), ("maximum_voltage_v", 2.5), ("safe_voltage_v", 0.0)]
    for name, value in good * 2:
        probe.set_one(nodes[0].name, name, value)
    heard.clear()
    probe.drive_until(targets, 0.3e-6, lambda: len(heard) > 20, "voltage after all that")
    assert all(math.isfinite(message.data) for _, message in heard[-10:])
    for node in nodes:
        assert node.stop() == 0
        assert "Traceback" not in node.output()
