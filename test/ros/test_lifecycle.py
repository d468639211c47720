"""The compensator as a managed node."""

from __future__ import annotations

from harness import model_file
from small_model import MODEL


def test_transitions(tmp_path, probe, start):
    node = start(
        "compensator", model_file(tmp_path / "model.yaml"), rate_hz=200.0, autostart=False, safe_ramp_v_per_s=5.0
    )
    heard = probe.record("voltage")
    publisher = probe.publisher("desired_position")
    assert probe.state(node.name) == "unconfigured"
    assert not probe.trigger(f"{node.name}/relax").success
    assert probe.transition(node.name, "configure")
    probe.drive(publisher, lambda t: 1e-6, 0.3)
    assert probe.state(node.name) == "inactive"
    assert not heard, "inactive means no voltage"
    assert probe.transition(node.name, "activate")
    heard.clear()
    probe.drive_until(publisher, 1e-6, lambda: heard and heard[-1][1].data > 0.3, "the target followed")
    assert probe.transition(node.name, "deactivate")
    probe.until(lambda: heard[-1][1].data == 0.0, "safe voltage")
    probe.spin_for(0.2)  # what is still on its way
    n = len(heard)
    probe.drive(publisher, lambda t: 1e-6, 0.3)
    assert len(heard) == n, "inactive means no voltage"
    assert probe.transition(node.name, "activate")
    heard.clear()
    probe.drive_until(publisher, 1e-6, lambda: heard and heard[-1][1].data > 0.3, "the target followed")
    assert probe.transition(node.name, "deactivate")
    assert probe.transition(node.name, "cleanup")
    assert probe.state(node.name) == "unconfigured"
    assert probe.transition(node.name, "configure")
    assert probe.transition(node.name, "activate")
    assert probe.transition(node.name, "shutdown")
    assert node.wait_for_exit() == 0


def test_a_model_can_come_later_and_failures_are_logged(tmp_path, probe, start):
    node = start("compensator", rate_hz=200.0)
    assert probe.state(node.name) == "unconfigured"
    assert not probe.transition(node.name, "configure")
    probe.until(lambda: "on_configure: no model" in node.output(), "the failure in the log")
    probe.until(lambda: "no model" in probe.messages.get(node.name, ""), "the failure in diagnostics")
    values = {f"model__{name}": value for name, value in MODEL.items()}
    assert probe.set_all(node.name, **values).successful
    assert probe.transition(node.name, "configure")
    assert probe.transition(node.name, "activate")
    heard = probe.record("voltage")
    probe.drive_until(probe.publisher("desired_position"), 1e-6, lambda: heard, "voltage")


def test_relaxation_leaves_a_relaxed_stage(tmp_path, probe, start):
    file = model_file(tmp_path / "model.yaml")
    node = start(
        "compensator",
        file,
        rate_hz=500.0,
        relax_duration_s=2.0,
        relax_frequency_hz=20.0,
        relax_amplitude_v=2.0,
        slew_limit_v_per_s=1000.0,
    )
    start("simulated_pea", file, plant="fomrc", noise_rms_m=0.0, rate_hz=500.0)
    heard, moved = probe.record("voltage"), probe.record("displacement")
    publisher = probe.publisher("desired_position")
    probe.drive_until(publisher, 1.5e-6, lambda: moved and moved[-1][1].data > 1.4e-6, "the stage at the target")
    heard.clear()
    answer = probe.trigger(f"{node.name}/relax")
    assert answer.success, answer.message
    voltages = [message.data for _, message in heard]
    assert min(voltages) < -1.5
    assert max(voltages) > 1.5
    probe.drive(publisher, lambda t: 0.0, 0.3)
    n_heard = len(moved)
    probe.until(lambda: len(moved) > n_heard, "displacement")
    assert abs(moved[-1][1].data) < 0.02e-6, "zero is zero again"
