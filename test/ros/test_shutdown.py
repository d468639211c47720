"""Every node ends on SIGINT and SIGTERM, with the voltage where it may stay and nothing to read on stderr."""

from __future__ import annotations

import signal

import pytest
from harness import clean, model_file
from node_under_test import MODULES, PATIENCE_S, server


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM], ids=["SIGINT", "SIGTERM"])
def test_nodes_end_without_noise(tmp_path, probe, start, number):
    file = model_file(tmp_path / "model.yaml")
    memory = tmp_path / "memory"
    compensator = start("compensator", file, is_fresh=True, checkpoint_file=memory, safe_ramp_v_per_s=5.0)
    others = [start(kind, file, is_fresh=True) for kind in ("simulated_pea", "identification")]
    heard = probe.record("voltage")
    moved = probe.record("displacement")
    publisher = probe.publisher("desired_position")
    probe.drive_until(publisher, 1e-6, lambda: moved and heard and heard[-1][1].data > 0.3, "a voltage")
    probe.until(lambda: others[1].name in probe.diagnostics, "the identification")
    compensator.process.send_signal(number)
    probe.until(lambda: compensator.process.poll() is not None, "the compensator's end")
    assert compensator.process.returncode == 0
    probe.spin_for(0.2)
    voltages = [message.data for _, message in heard]
    assert voltages[-1] == 0.0, "ramped to the safe voltage"
    ramp = [v for v in voltages[-200:] if 0.0 < v < 0.3]
    assert len(ramp) > 10, "and not in one jump"
    for node in others:
        assert node.stop(number) == 0
    for node in (compensator, *others):
        assert clean(node.output()) == [], node.name


def test_what_cannot_start_says_so_in_one_line(tmp_path, start):
    bad_model = model_file(tmp_path / "bad.yaml", {"kappa_um_per_v": [1.0], "saturation_v": [1.0], "creep_order": 0.1})
    broken = tmp_path / "broken.yaml"
    broken.write_text("/**:\n  ros__parameters: [1\n")
    good = model_file(tmp_path / "good.yaml")
    cases = [
        (start("compensator", bad_model, is_fresh=True), "kappa_um_per_v"),
        (start("compensator", broken), "broken.yaml"),
        (start("simulated_pea", good, rate_hz="fast"), "rate_hz"),
        (start("simulated_pea", is_fresh=True, plant="fomrc"), "model"),
        (start("identification", good, method="magic"), "method"),
        (start("compensator", good, minimum_voltage_v=5.0), "minimum_voltage_v"),
    ]
    for node, named in cases:
        assert node.wait_for_exit() == 2, node.output()
        # The client library adds a line of its own where it cannot read a file.
        lines = [line for line in clean(node.output()) if "[rcl]" not in line]
        assert len(lines) == 1, lines
        assert named in lines[0]


@pytest.mark.parametrize("kind", sorted(MODULES))
def test_an_argument_that_is_none_of_ros_is_refused(tmp_path, kind):
    for words, status, named in (
        (["--nope"], 2, "unknown argument '--nope'; allowed: --ros-args"),
        (["--ros-arg", "-p", "rate_hz:=100.0"], 2, "unknown argument '--ros-arg'"),
        (["--ros-args", "-p", "use_sim_time:=false", "--", "left"], 2, "unknown argument 'left'"),
        (["--help"], 0, "usage: --ros-args"),
    ):
        monitor = ["--monitor"] if kind == "gap_monitor" else []
        output = tmp_path / "said.log"
        process = server().fork(MODULES[kind], [*monitor, *words], tmp_path, output)
        assert process.wait(PATIENCE_S) == status
        lines = clean(output.read_text())
        assert len(lines) == 1, lines
        assert named in lines[0]
