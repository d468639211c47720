"""Recordings to a model, in a process of its own, while the node goes on."""

from __future__ import annotations

import numpy as np
import pytest
import yaml
from diagnostic_msgs.msg import DiagnosticStatus
from rclpy.qos import DurabilityPolicy, QoSProfile
from small_model import MODEL
from std_msgs.msg import String
from std_srvs.srv import Trigger

from fomrc_core.model.piezo_model import PiezoModel
from fomrc_core.records import excitation


@pytest.fixture
def recording(tmp_path):
    """A record of the actuator of ``MODEL``, with 1 nm noise."""
    drive = np.concatenate(
        (
            excitation.triangle(1.5, slope_v_per_s=2.0, n_cycles=3, rate_hz=200.0).voltage_v,
            excitation.staircase(1.5, step_v=0.3, dwell_s=0.5, rate_hz=200.0).voltage_v,
        )
    )
    moved = PiezoModel.from_mapping(MODEL).simulate(np.full(drive.size, 0.005), drive)
    moved += 1e-3 * np.random.default_rng(3).standard_normal(moved.size)
    rows = np.column_stack((0.005 * np.arange(drive.size), drive, moved))
    path = tmp_path / "record.csv"
    np.savetxt(path, rows, delimiter=",", header="time_s,voltage_v,displacement_um", comments="")
    return path


def test_identify(tmp_path, probe, start, recording):
    node = start("identification", output_file="found.yaml", n_elements=5)
    assert probe.set_one(node.name, "recordings", [str(recording)]).successful
    answer = probe.trigger(f"{node.name}/identify")
    assert answer.success, answer.message
    found = yaml.safe_load((tmp_path / "found.yaml").read_text())["/**"]["ros__parameters"]["model"]
    assert abs(found["creep_order"] - MODEL["creep_order"]) < 0.1 * MODEL["creep_order"]
    # Whoever comes later sees the model too.
    seen: list = []
    latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    probe.subscribe(String, f"{node.name}/model", lambda _, message: seen.append(message), latched)
    probe.until(lambda: seen, "the model")
    assert yaml.safe_load(seen[0].data)["/**"]["ros__parameters"]["model"] == found

    refused = (
        ("recordings", ["missing.csv"], "missing.csv"),
        ("recordings", ["/etc/passwd"], "allowed"),
        ("recordings", ["found.yaml"], "found.yaml"),
        ("recordings", [""], "recordings"),
    )
    for name, value, named in refused:
        assert probe.set_one(node.name, name, value).successful
        answer = probe.trigger(f"{node.name}/identify")
        assert not answer.success, value
        assert named in answer.message, answer.message
    assert yaml.safe_load((tmp_path / "found.yaml").read_text())["/**"]["ros__parameters"]["model"] == found
    assert not probe.set_one(node.name, "n_elements", -1).successful
    assert probe.set_one(node.name, "output_file", "/nowhere/model.yaml").successful
    assert probe.set_one(node.name, "recordings", [str(recording)]).successful
    assert "allowed" in probe.trigger(f"{node.name}/identify").message
    probe.until(lambda: probe.levels.get(node.name) == DiagnosticStatus.WARN, "the failure in diagnostics")


@pytest.fixture
def lagging_recording(tmp_path):
    """A record at 500 Hz of the same actuator behind an amplifier of 12 Hz, worked at a tenth of the sample period."""
    parts, rate_hz, cutoff_hz = 10, 500.0, 12.0
    pieces = [
        excitation.triangle(1.5, slope_v_per_s=3.0, n_cycles=3, rate_hz=rate_hz).voltage_v,
        excitation.steps([1.2, -0.7, 0.9, -1.4, 0.3, 0.0], dwell_s=0.5, lead_in_s=0.1, rate_hz=rate_hz).voltage_v,
        excitation.triangle(1.0, slope_v_per_s=40.0, n_cycles=6, rate_hz=rate_hz).voltage_v,
    ]
    drive = np.concatenate(pieces)
    fine = np.interp(np.arange(parts * (drive.size - 1) + 1) / parts, np.arange(drive.size), drive)
    share = 1.0 - np.exp(-2.0 * np.pi * cutoff_hz / (parts * rate_hz))
    lagged, at = np.zeros(fine.size), 0.0
    for k in range(1, fine.size):
        at += share * (0.5 * (fine[k - 1] + fine[k]) - at)  # the middle of each part: no delay of its own
        lagged[k] = at
    moved = PiezoModel.from_mapping(MODEL).simulate(np.full(fine.size, 1.0 / (parts * rate_hz)), lagged)[::parts]
    moved += 1e-3 * np.random.default_rng(4).standard_normal(moved.size)
    path = tmp_path / "lagging.csv"
    rows = np.column_stack((np.arange(drive.size) / rate_hz, drive, moved))
    np.savetxt(path, rows, delimiter=",", header="time_s,voltage_v,displacement_um", comments="")
    return path


def test_diagnose_names_the_lag_and_writes_the_extended_model(tmp_path, probe, start, lagging_recording):
    node = start("identification", output_folder="result")
    assert probe.set_one(node.name, "recordings", [str(lagging_recording)]).successful
    answer = probe.trigger(f"{node.name}/diagnose", timeout_s=240.0)
    assert answer.success, answer.message
    assert "amplifier_bandwidth" in answer.message
    block = yaml.safe_load((tmp_path / "result" / "extended_model.yaml").read_text())["/**"]["ros__parameters"]["model"]
    assert block["effects"][0] == "amplifier_bandwidth"
    assert abs(block["amplifier_bandwidth"]["cutoff_hz"] - 12.0) < 0.6
    assert (tmp_path / "result" / "report.html").stat().st_size > 10_000
    # What was found runs: the compensator takes the file as it is.
    compensator = start("compensator", tmp_path / "result" / "extended_model.yaml")
    assert probe.get(compensator.name, "model.effects") == ["amplifier_bandwidth"]
    probe.until(lambda: "fit_rms_um" in probe.diagnostics.get(compensator.name, {}), "the fit's error in diagnostics")
    assert float(probe.diagnostics[compensator.name]["fit_rms_um"]) == pytest.approx(block["fit_rms_um"], rel=1e-3)


def test_the_node_goes_on_while_it_fits_and_can_be_told_to_stop(tmp_path, probe, start, recording):
    node = start("identification", n_elements=0)
    probe.set_one(node.name, "recordings", [str(recording)] * 3)
    client = probe.client(Trigger, f"{node.name}/identify")
    probe.until(client.service_is_ready, "service")
    future = client.call_async(Trigger.Request())
    probe.until(lambda: "progress_percent" in probe.diagnostics.get(node.name, {}), "progress")
    assert not future.done()
    assert probe.get(node.name, "method") == "convex"
    assert not future.done(), "answered in the middle of the fit"
    assert "busy" in probe.trigger(f"{node.name}/identify").message
    assert probe.trigger(f"{node.name}/cancel").success
    probe.until(future.done, "the end of the fit")
    assert not future.result().success
    assert "cancelled" in future.result().message
    assert not probe.trigger(f"{node.name}/cancel").success
    # Ended in the middle of a fit it leaves nothing behind and says nothing.
    future = client.call_async(Trigger.Request())
    probe.until(lambda: probe.diagnostics[node.name].get("activity") == "identify", "a second fit")
    assert node.stop() == 0
    assert "Traceback" not in node.output()


def test_identify_a_bag(tmp_path, probe, start, recording):
    pytest.importorskip("rosbags")
    from fomrc_core.storage import read_recording, write_bag

    write_bag(read_recording(recording), tmp_path / "bag")
    node = start("identification", n_elements=5, output_file="found.yaml")
    assert probe.set_one(node.name, "recordings", [str(tmp_path / "bag")]).successful
    answer = probe.trigger(f"{node.name}/identify")
    assert answer.success, answer.message
    assert probe.set_one(node.name, "topics", "voltage=/nothing,displacement=/nowhere").successful
    assert not probe.trigger(f"{node.name}/identify").success
