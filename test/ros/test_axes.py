"""Several axes from one file: the gap of a tunable filter; a second axis that leaks into this one."""

from __future__ import annotations

import os

import numpy as np
from harness import model_file
from node_server import REPOSITORY
from sensor_msgs.msg import JointState
from small_model import MODEL

from benchmarks.gap_coupling import measured_errors_um
from fomrc_core.model.axes import AxesModel
from fomrc_core.model.piezo_model import PiezoModel
from fomrc_core.storage.axes_files import write_axes_model

MOTIONS = ["piston", "tip", "tilt"]


def test_three_axes_set_a_gap(probe, start):
    file = REPOSITORY / "config" / "tunable_filter.yaml"
    axes = ("/axis1", "/axis2", "/axis3")
    for axis in axes:
        start("compensator", file, namespace=axis)
        start("simulated_pea", file, namespace=axis)
    start("gap_command", file)
    start("gap_monitor", file)
    gaps = probe.record("gap", JointState)
    publisher = probe.publisher("desired_gap", JointState)
    probe.until(lambda: gaps, "the gap", 40.0)
    for axis in axes:
        probe.until(lambda axis=axis: probe.node.count_subscribers(f"{axis}/desired_position"), "axes", 40.0)
    orders = [probe.get(f"{axis}/compensator", "model.creep_order") for axis in axes]
    assert orders == [0.015, 0.016, 0.014]

    def reached(wanted: np.ndarray) -> bool:
        publisher.publish(JointState(name=MOTIONS, position=wanted.tolist()))
        found = np.array(gaps[-1][1].position)
        return bool(np.all(np.abs(found - wanted) < [5e-9, 2e-6, 2e-6]))

    for wanted in (np.array([0.5e-6, 0.0, 0.0]), np.array([-0.3e-6, 30e-6, -20e-6]), np.zeros(3)):
        probe.until(lambda wanted=wanted: reached(wanted), f"gap {wanted}")
    # What cannot be is refused, and the gap stays.
    probe.publisher("desired_gap", JointState).publish(JointState(name=["piston"], position=[1e-6]))
    assert not probe.set_one("/gap_command", "geometry", [1.0] * 9).successful
    assert not probe.set_one("/gap_command", "geometry", [1.0] * 8).successful
    probe.until(lambda: probe.diagnostics.get("/gap_command", {}).get("refused_messages") == "1", "refusal")
    assert reached(np.zeros(3))


def test_what_axes_of_one_body_move_of_each_other_is_undone_where_their_model_is_given(tmp_path):
    found = measured_errors_um(tmp_path, int(os.environ["ROS_DOMAIN_ID"]), n_targets=2)
    together, apart = (float(np.sqrt(np.mean(errors**2))) for errors in found.values())
    assert apart > 0.02  # 5 % of some 1 um
    assert apart > 10.0 * together


def test_a_model_of_other_axes_is_refused_in_a_line(tmp_path, start):
    one = AxesModel((PiezoModel.from_mapping(MODEL),))
    write_axes_model(one, tmp_path / "one.yaml")
    node = start("gap_command", axes_model=tmp_path / "one.yaml")
    assert node.wait_for_exit() == 2
    assert "axes_model: not a model of three axes, got (1, 1) (allowed: (3, 3))" in node.output()


def test_second_axis_is_compensated_where_the_model_has_it(tmp_path, probe, start):
    leaky = MODEL | {"effects": ["cross_axis"], "cross_axis": {"gain": 0.1}}
    node = start("compensator", model_file(tmp_path / "leaky.yaml", leaky), rate_hz=200.0)
    heard = probe.record("voltage")
    publisher, cross = probe.publisher("desired_position"), probe.publisher("cross_position")
    probe.until_active(node)
    probe.drive(cross, lambda t: 10e-6, 0.3)
    probe.drive_until(publisher, 1e-6, lambda: len(heard) > 20, "voltages")
    # 0.1 of the other axis's 10 um is already there: nothing is left to do.
    assert abs(heard[-1][1].data) < 1e-9
    probe.drive(cross, lambda t: 0.0, 0.3)
    probe.drive_until(publisher, 1e-6, lambda: heard[-1][1].data > 0.3, "the stage's own way to the target")
