"""What goes wrong in a calibration, or beside it: no model, no memory and no voltage that is not true is in force."""

from __future__ import annotations

import signal

import numpy as np
import pytest
import yaml
from diagnostic_msgs.msg import DiagnosticStatus
from harness import model_file
from small_model import MODEL
from std_msgs.msg import Float64
from std_srvs.srv import Trigger

RATE_HZ = 500.0
HASTY = {
    "calibrate_amplitude_v": 1.0,
    "calibrate_step_v": 0.5,
    "calibrate_slope_v_per_s": 5.0,
    "calibrate_dwell_s": 0.2,
    "relax_duration_s": 1.0,
    "relax_frequency_hz": 20.0,
    "safe_ramp_v_per_s": 20.0,
    "slew_limit_v_per_s": 2000.0,
    "n_elements": 3,
    # On a busy machine a borrower may be held up; the test of the lease has a short one.
    "lease_s": 20.0,
}


def compensator_and_identification(tmp_path, start, **options):
    file = model_file(tmp_path / "model.yaml", **(HASTY | options))
    return (
        start("compensator", file, rate_hz=RATE_HZ),
        start("identification", file, rate_hz=RATE_HZ),
    )


def doing(probe, node, text: str) -> bool:
    return text in probe.diagnostics.get(node.name, {}).get("doing", "")


def in_force(probe, node) -> list[float]:
    return list(probe.get(node.name, "model.kappa_um_per_v"))


@pytest.mark.parametrize("kind", ["noise", "reversed", "stuck", "outliers"])
def test_row_01_a_calibration_on_a_broken_sensor_is_refused(tmp_path, probe, start, spoilt, kind):
    spoilt(kind)
    compensator, identification = compensator_and_identification(tmp_path, start)
    moved = probe.record("displacement")
    probe.until(lambda: moved, "the stage")
    answer = probe.trigger(f"{identification.name}/calibrate")
    print(answer.message)
    assert not answer.success
    assert "the old model goes on" in answer.message
    assert in_force(probe, compensator) == MODEL["kappa_um_per_v"]
    assert probe.state(compensator.name) == "active"
    assert not (tmp_path / "identified_model.yaml").exists()
    kept = tmp_path / "identified_model.refused_record.csv"
    assert str(kept) in answer.message
    assert len(kept.read_text().splitlines()) > 500
    heard = probe.record("voltage")
    probe.drive(probe.publisher("desired_position"), lambda t: 0.1e-6, 0.3)
    probe.until(lambda: len(heard) > 50, "voltage")
    assert 0.0 < heard[-1][1].data < 0.3, "a target of 0.1 um is a small voltage still"


def test_row_01_a_sound_calibration_passes_the_gate(tmp_path, probe, start, spoilt):
    spoilt("sound")
    wrong = MODEL | {"kappa_um_per_v": [1.5 * kappa for kappa in MODEL["kappa_um_per_v"]]}
    file = model_file(tmp_path / "model.yaml", wrong, **HASTY)
    compensator = start("compensator", file, rate_hz=RATE_HZ)
    identification = start("identification", file, rate_hz=RATE_HZ)
    moved = probe.record("displacement")
    probe.until(lambda: moved, "the stage")
    for _ in range(3):
        answer = probe.trigger(f"{identification.name}/calibrate")
        print(answer.message)
        if "undetermined" not in answer.message:
            break  # else the machine held the drive up for so long that nothing could be learnt: as it says, once more
    assert answer.success, answer.message
    model = yaml.safe_load((tmp_path / "identified_model.yaml").read_text())["/**"]["ros__parameters"]["model"]
    assert in_force(probe, compensator) == model["kappa_um_per_v"] != wrong["kappa_um_per_v"]


def test_row_02_after_an_interrupted_calibration_the_memory_is_what_was_driven(tmp_path, probe, start, spoilt):
    # A voltage that a busy machine keeps from the stage is in the memory all the same: the best of three counts.
    stood_m = []
    for attempt in range(3):
        folder = tmp_path / str(attempt)
        folder.mkdir()
        stood_m.append(stands_after_an_interrupted_calibration(folder, probe, start, spoilt))
        print(f"a target of 1 um stands at {1e6 * stood_m[-1]:.4f} um")
        if abs(stood_m[-1] - 1e-6) < 10e-9:
            return
    raise AssertionError(f"1 um is missed by 10 nm or more each time: {stood_m}")


def stands_after_an_interrupted_calibration(folder, probe, start, spoilt) -> float:
    stage = spoilt("sound")
    compensator, identification = compensator_and_identification(folder, start, calibrate_dwell_s=1.0)
    moved = probe.record("displacement")
    probe.until(lambda: moved, "the stage")
    probe.ask(Trigger, f"{identification.name}/calibrate", Trigger.Request())
    probe.until(lambda: doing(probe, identification, "driving"), "the drive")
    probe.spin_for(0.7)
    assert identification.stop(signal.SIGINT) == 0
    probe.until(lambda: probe.messages.get(compensator.name) == "waiting for a target", "the voltage returned")
    publisher = probe.publisher("desired_position")
    probe.drive(publisher, lambda t: 1e-6, 1.0)
    probe.until(lambda: len(moved) > 200 and np.ptp([m.data for _, m in moved[-100:]]) < 20e-9, "the stage at rest")
    stood_m = float(np.mean([message.data for _, message in moved[-100:]]))
    assert compensator.stop() == 0
    stage.kill()
    stage.wait()
    probe.diagnostics.clear()
    probe.messages.clear()
    return stood_m


def test_row_02_without_a_model_the_memory_is_said_to_be_unknown(tmp_path, probe, start, spoilt):
    spoilt("sound")
    compensator = start("compensator", rate_hz=RATE_HZ)
    file = tmp_path / "identification.yaml"
    file.write_text(yaml.safe_dump({"/**": {"ros__parameters": HASTY}}))
    identification = start("identification", file, rate_hz=RATE_HZ)
    moved = probe.record("displacement")
    probe.until(lambda: moved, "the stage")
    probe.ask(Trigger, f"{identification.name}/calibrate", Trigger.Request())
    probe.until(lambda: doing(probe, identification, "driving"), "the drive")
    assert identification.stop(signal.SIGINT) == 0
    values = {f"model__{name}": value for name, value in MODEL.items()}
    assert probe.set_all(compensator.name, **values).successful
    assert probe.transition(compensator.name, "configure")
    assert probe.transition(compensator.name, "activate")
    warn = DiagnosticStatus.WARN
    probe.until(
        lambda: (
            "memory is unknown" in probe.messages.get(compensator.name, "") and probe.levels[compensator.name] == warn
        ),
        "the warning of the active node",
    )
    assert "~/relax" in probe.messages[compensator.name]


def test_row_03_an_amplitude_wider_than_the_compensators_limits_is_refused_before_anything(
    tmp_path, probe, start, spoilt
):
    spoilt("sound")
    file = model_file(tmp_path / "model.yaml", **HASTY)
    compensator = start("compensator", file, rate_hz=RATE_HZ, maximum_voltage_v=0.4, minimum_voltage_v=-0.4)
    identification = start("identification", file, rate_hz=RATE_HZ)
    heard = probe.record("voltage")
    probe.until(lambda: probe.messages.get(compensator.name) == "waiting for a target", "the active compensator")
    answer = probe.trigger(f"{identification.name}/calibrate")
    assert not answer.success
    assert "calibrate_amplitude_v 1 V does not fit" in answer.message
    assert not heard, "nothing was driven"
    assert probe.state(compensator.name) == "active"
    probe.drive(probe.publisher("desired_position"), lambda t: 0.2e-6, 0.3)
    probe.until(lambda: len(heard) > 20, "voltage")


def test_row_04_the_narrower_limits_win(tmp_path, probe, start, spoilt):
    spoilt("sound")
    file = model_file(tmp_path / "model.yaml", **HASTY)
    compensator = start("compensator", file, rate_hz=RATE_HZ)
    identification = start("identification", file, rate_hz=RATE_HZ, calibrate_amplitude_v=0.5)
    heard, moved = probe.record("voltage"), probe.record("displacement")
    probe.until(lambda: moved, "the stage")
    calibrated = probe.ask(Trigger, f"{identification.name}/calibrate", Trigger.Request())
    probe.until(lambda: doing(probe, identification, "driving"), "the drive")
    # Narrowed while it drives: the compensator is the one that publishes, and keeps to it at once.
    assert probe.set_all(compensator.name, minimum_voltage_v=-0.2, maximum_voltage_v=0.2).successful
    answered_s = probe.now_s()
    probe.until(calibrated.done, "the end of the calibration")
    voltages = np.array([message.data for _, message in probe.sent_since(heard, answered_s)])
    assert voltages.size > 100
    assert np.abs(voltages).max() <= 0.2


def test_row_05_the_voltage_lent_to_a_killed_identification_is_taken_back(tmp_path, probe, start, spoilt):
    spoilt("sound")
    compensator, identification = compensator_and_identification(tmp_path, start, calibrate_dwell_s=3.0, lease_s=1.0)
    heard, moved = probe.record("voltage"), probe.record("displacement")
    probe.until(lambda: moved, "the stage")
    probe.ask(Trigger, f"{identification.name}/calibrate", Trigger.Request())
    probe.until(lambda: doing(probe, identification, "driving"), "the drive")
    heard.clear()
    probe.until(lambda: heard and abs(heard[-1][1].data) > 0.7, "a voltage that is not the safe one")
    identification.process.kill()
    identification.process.wait()
    probe.until(lambda: heard[-1][1].data == 0.0, "the safe voltage")
    probe.until(lambda: "fell silent" in probe.messages.get(compensator.name, ""), "the warning")
    assert probe.levels[compensator.name] == DiagnosticStatus.WARN
    assert probe.state(compensator.name) == "active"
    publisher = probe.publisher("desired_position")
    probe.drive(publisher, lambda t: 1e-6, 1.0)
    probe.until(lambda: len(moved) > 200 and np.ptp([m.data for _, m in moved[-100:]]) < 20e-9, "the stage at rest")
    stood_m = float(np.mean([message.data for _, message in moved[-100:]]))
    print(f"a target of 1 um stands at {1e6 * stood_m:.4f} um")
    assert abs(stood_m - 1e-6) < 10e-9
    # A second one may calibrate then.
    assert probe.trigger(f"{compensator.name}/borrow_voltage").success
    assert "lent already" in probe.trigger(f"{compensator.name}/borrow_voltage").message
    assert probe.trigger(f"{compensator.name}/return_voltage").success
    assert not probe.trigger(f"{compensator.name}/return_voltage").success


def test_row_06_two_that_drive_one_voltage_say_so_and_no_calibration_begins(tmp_path, probe, start):
    compensator, identification = compensator_and_identification(tmp_path, start)
    # A second compensator in another namespace, its voltage remapped onto the first one's.
    other = start(
        "compensator",
        model_file(tmp_path / "other.yaml"),
        namespace="/other",
        remaps={"voltage": "/voltage"},
        rate_hz=RATE_HZ,
    )
    probe.until(lambda: other.name in probe.messages.get(compensator.name, ""), "the warning of the one")
    probe.until(lambda: f"by {compensator.name}" in probe.messages.get(other.name, ""), "the warning of the other")
    assert probe.levels[compensator.name] == probe.levels[other.name] == DiagnosticStatus.WARN
    answer = probe.trigger(f"{identification.name}/calibrate")
    assert not answer.success
    assert f"also published by {other.name}" in answer.message
    assert other.stop() == 0
    # Nor where a program of one's own drives it.
    probe.node.create_publisher(Float64, "voltage", 10)
    probe.until(lambda: probe.node.get_name() in probe.messages.get(compensator.name, ""), "the warning of it")


def test_a_cancel_that_comes_too_late_says_so(tmp_path, probe, start, spoilt):
    spoilt("sound")
    compensator, identification = compensator_and_identification(tmp_path, start, calibrate_amplitude_v=1.8)
    moved = probe.record("displacement")
    probe.until(lambda: moved, "the stage")
    told = lambda: float(probe.diagnostics.get(identification.name, {}).get("progress_percent", 0.0))  # noqa: E731
    for _ in range(20):  # the moment is short: on a busy machine it passes unseen, again and again
        probe.diagnostics.clear()
        calibrated = probe.ask(Trigger, f"{identification.name}/calibrate", Trigger.Request())
        probe.until(lambda calibrated=calibrated: told() > 85.0 or calibrated.done(), "the model put in force")
        answer = probe.trigger(f"{identification.name}/cancel")
        if not calibrated.done() and not answer.success:
            break
        # one that passed unseen, that readings at a bad phase spoilt, or that the end of the one before was taken for
        probe.until(calibrated.done, "the end of a calibration that was not at that moment")
        print(calibrated.result().message)
    assert not answer.success
    assert "too late" in answer.message
    probe.until(calibrated.done, "the end of the calibration")
    assert calibrated.result().success, calibrated.result().message
    assert in_force(probe, compensator) != MODEL["kappa_um_per_v"]
    assert "nothing runs" in probe.trigger(f"{identification.name}/cancel").message
