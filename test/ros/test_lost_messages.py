"""A message the middleware does not take is lost, counted and said; the node goes on."""

from __future__ import annotations

import signal
import subprocess
import sys
from pathlib import Path

import pytest
from diagnostic_msgs.msg import DiagnosticStatus
from harness import model_file


@pytest.mark.parametrize(("kind", "topic"), [("simulated_pea", "displacement"), ("compensator", "voltage")])
def test_a_reader_that_has_stalled_ends_no_node(tmp_path, probe, start, kind, topic):
    """Behind a topic that keeps all there is room for some thousand messages; then nothing more is taken."""
    keep_all = {
        f"qos_overrides./{topic}.publisher.{policy}": value
        for policy, value in (("history", "keep_all"), ("reliability", "reliable"))
    }
    node = start(kind, model_file(tmp_path / "model.yaml"), rate_hz=1000.0, **keep_all)
    if kind == "compensator":
        heard = probe.record("voltage")
        probe.drive_until(probe.publisher("desired_position"), 1e-6, lambda: heard, "a voltage")
    counted = lambda: int(probe.diagnostics.get(node.name, {}).get(f"lost_{topic}_messages", 0))  # noqa: E731
    script = Path(__file__).with_name("stalling_reader.py")
    with subprocess.Popen([sys.executable, str(script), f"/{topic}"], stdout=subprocess.PIPE, text=True) as reader:
        try:
            assert reader.stdout is not None
            assert reader.stdout.readline() == "heard\n"
            reader.send_signal(signal.SIGSTOP)
            probe.until(lambda: counted() > 2, "messages lost")
            assert probe.levels[node.name] >= DiagnosticStatus.WARN
            assert f"messages of /{topic} not sent" in probe.messages[node.name]
            assert f"/{topic}: not sent" in node.output()
            # Where the reader reads again all are taken again.
            reader.send_signal(signal.SIGCONT)
            probe.until(lambda: f"messages of /{topic}" not in probe.messages[node.name], "the end of the warning")
        finally:
            reader.kill()
    if kind == "compensator":
        probe.drive_until(
            probe.publisher("desired_position"), 1e-6, lambda: probe.messages[node.name] == "tracking", "tracking"
        )
    assert node.stop() == 0
