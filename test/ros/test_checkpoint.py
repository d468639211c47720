"""The memory survives kill -9; a damaged one is refused."""

from __future__ import annotations

import math
import os
import random
from itertools import pairwise

import pytest
from harness import model_file
from small_model import MODEL

PERIOD_S = 2e-3
DYNAMICS = {
    "amplifier_bandwidth": {"cutoff_hz": 200.0},
    "mechanical_resonance": {"frequency_hz": 120.0, "damping_ratio": 0.1},
    "transport_delay": {"delay_s": 1e-3},
}


@pytest.mark.parametrize("seed", range(int(os.environ.get("FOMRC_KILLS", "2"))))
def test_killed_and_restarted_it_goes_on_where_it_would_have_been(tmp_path, probe, start, seed):
    """Two compensators follow the same target; one of them is killed and comes back."""
    generator = random.Random(seed)
    # Every second one with a preview, behind which the target is ahead of the memory.
    has_preview = seed % 2 == 1
    model = MODEL | {"effects": list(DYNAMICS)} | DYNAMICS if has_preview else MODEL
    file = model_file(tmp_path / "model.yaml", model, stop_policy="hold")
    options = {"rate_hz": 1.0 / PERIOD_S, "checkpoint_period_s": 0.2, "preview_s": 0.03 if has_preview else 0.0}
    steady = start("compensator", file, namespace="/steady", **options)
    killed = start("compensator", file, namespace="/killed", checkpoint_file=tmp_path / "memory", **options)
    heard = {axis: probe.record(f"{axis}/voltage") for axis in ("/steady", "/killed")}
    publishers = [probe.publisher(f"{axis}/desired_position") for axis in ("/steady", "/killed")]
    for node in (steady, killed):
        probe.until_active(node)
    probe.drive(Both(publishers), lambda t: 1e-6 * math.sin(3.0 * t), 1.0 + generator.random())
    held = 0.5e-6 * generator.random()
    probe.drive(Both(publishers), lambda t: held, 0.1 + 0.4 * generator.random())
    probe.until(lambda: all(rests(entries) for entries in heard.values()), "both at the held target")
    # The two got their targets at slightly different times: what they differed by before is not the restart's.
    before = apart(heard["/killed"][-1], heard["/steady"])
    killed.process.kill()
    killed.process.wait()
    probe.spin_for(0.1)
    heard["/killed"].clear()
    restarted = start("compensator", file, namespace="/killed", checkpoint_file=tmp_path / "memory", **options)
    probe.until(lambda: len(heard["/killed"]) > 200, "voltage of the restarted one, without a new target")
    errors = [apart(entry, heard["/steady"]) - before for entry in heard["/killed"][:200]]
    # A tick that comes late has held its voltage until then, and what the actuator crept meanwhile is made good for:
    # by as much two compensators may differ that were late at different times.
    late_v = max(late_creep_v(heard[axis][-1500:]) for axis in heard)
    print(f"seed {seed}: first {errors[0]:.2e} V, worst of 200 {max(map(abs, errors)):.2e} V, late by {late_v:.1e} V")
    assert max(map(abs, errors)) < 1e-3 + late_v
    assert "refused" not in restarted.output()
    assert len(list(tmp_path.glob(".memory.*.tmp"))) <= 1, "at most the one being written"


def rests(entries) -> bool:
    """Return whether a voltage has come to rest but for its creep."""
    last = [entry[1].data for entry in entries[-50:]]
    return len(last) == 50 and max(last) - min(last) < 3e-4


def late_creep_v(entries) -> float:
    """Return by how much the voltage changed over the longest time between two of them [V], less one period's."""
    gaps = [(after[0] - before[0], abs(after[1].data - before[1].data)) for before, after in pairwise(entries)]
    longest_s, change_v = max(gaps)
    return change_v if longest_s > 2.5 * PERIOD_S else 0.0


def apart(entry, steady) -> float:
    """Return by how much a voltage differs from that of the steady compensator at the same time."""
    nearest = min(steady[-1500:], key=lambda other: abs(other[0] - entry[0]))
    return entry[1].data - nearest[1].data


class Both:
    """One signal to several publishers."""

    def __init__(self, publishers) -> None:
        self._publishers = publishers
        self.msg_type = publishers[0].msg_type

    def publish(self, message) -> None:
        for publisher in self._publishers:
            publisher.publish(message)


@pytest.mark.parametrize("damage", ["snapshot", "journal"])
def test_damaged_memory_is_refused_and_relaxation_proposed(tmp_path, probe, start, damage):
    file = model_file(tmp_path / "model.yaml", stop_policy="hold")
    checkpoint = tmp_path / "memory"
    options = {"rate_hz": 500.0, "checkpoint_file": checkpoint, "checkpoint_period_s": 3600.0}
    node = start("compensator", file, **options)
    publisher = probe.publisher("desired_position")
    probe.until_active(node)
    probe.drive_until(publisher, 1e-6, lambda: any(tmp_path.glob("memory.journal.*")), "a journal")
    probe.drive(publisher, lambda t: 1e-6, 0.3)
    node.process.kill()
    node.process.wait()
    target = checkpoint if damage == "snapshot" else next(tmp_path.glob("memory.journal.*"))
    content = bytearray(target.read_bytes())
    content[len(content) // 3] ^= 0xFF
    target.write_bytes(content)
    node = start("compensator", file, **options)
    probe.until(lambda: "checkpoint refused" in node.output(), "refusal in the log")
    probe.until(lambda: "~/relax" in probe.messages.get(node.name, ""), "relaxation proposed")
    assert "damaged" in node.output()
    assert (tmp_path / "memory.damaged").exists()
    heard = probe.record("voltage")
    probe.drive_until(publisher, 1e-6, lambda: heard, "voltage after the refusal")
