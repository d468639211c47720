"""Parameters change live, all or nothing."""

from __future__ import annotations

import copy
import time

import numpy as np
import pytest
from harness import in_ticks, journal_records, model_file
from rclpy.parameter import Parameter
from small_model import MODEL, compensator_of

OTHER = {"kappa_um_per_v": [18.0, 13.0, 8.0, 1.3], "saturation_v": [0.03, 0.06, 0.25], "creep_order": 0.015}


@pytest.fixture
def tracking(tmp_path, probe, start):
    """A compensator that follows, and what it publishes."""
    file = model_file(tmp_path / "model.yaml")
    node = start(
        "compensator",
        file,
        rate_hz=200.0,
        checkpoint_file=tmp_path / "memory",
        checkpoint_period_s=3600.0,
        stop_policy="hold",
        parameters_file=file,
    )
    heard = probe.record("voltage")
    publisher = probe.publisher("desired_position")
    probe.drive_until(publisher, 0.0, lambda: heard, "a voltage")
    probe.drive(publisher, lambda t: 1e-6 * np.sin(9.0 * t), 0.3)
    return node, heard, publisher, file


def test_live_changes(probe, tracking):
    node, heard, publisher, _ = tracking
    # An integer where a number is meant, as people type it.
    assert probe.set_one(node.name, "model.creep_order", 0).successful
    assert probe.get(node.name, "model.creep_order") == 0.0
    assert probe.set_one(node.name, "model.kappa_um_per_v", [20, 12, 9, 2]).successful
    assert probe.get(node.name, "model.kappa_um_per_v")[-1] == 2.0
    assert probe.set_one(node.name, "safe_voltage_v", 1).successful
    changed = {
        "model__kappa_um_per_v": OTHER["kappa_um_per_v"] + [1.0],
        "model__saturation_v": [0.1, 0.2, 0.3, 0.4],
    }
    assert probe.set_all(node.name, **changed).successful
    probe.drive(publisher, lambda t: 0.5e-6, 0.5)
    assert np.isfinite(heard[-1][1].data)

    refused = (
        ("model.creep_order", 1.5),
        ("model.creep_order", float("nan")),
        ("model.creep_order", "high"),
        ("model.kappa_um_per_v", [1.0, 2.0]),
        ("model.kappa_um_per_v", [1.0, -1.0, 2.0, 3.0, 4.0]),
        ("model.saturation_v", [float("inf")] * 4),
        ("model.effects", ["magic"]),
        ("model.magic.strength", 1.0),
        ("model.effects", ["mechanical_resonance"]),
        ("minimum_voltage_v", 7.0),
        ("stale_policy", "panic"),
        ("rate_hz", 10.0),
        ("interface", "joint_state"),
        ("nonsense", 1),
        ("slew_limit_v_per_s", 0.0),
        ("model.creep_order", Parameter("model.creep_order", Parameter.Type.NOT_SET)),
    )
    for name, value in refused:
        result = probe.set_one(node.name, name, value)
        assert not result.successful, name
        assert result.reason, name
    # One bad value spoils the whole set.
    before = probe.get(node.name, "model.saturation_v")
    result = probe.set_all(node.name, model__saturation_v=[0.2] * 4, model__creep_order=2.0)
    assert not result.successful
    assert "0" in result.reason
    assert probe.get(node.name, "model.saturation_v") == before
    n = len(heard)
    probe.until(lambda: len(heard) > n + 20, "voltage after refused changes")


def test_effects_come_and_go_live(probe, tracking):
    node, heard, publisher, _ = tracking
    result = probe.set_all(node.name, model__effects=["amplifier_bandwidth"], model__amplifier_bandwidth__cutoff_hz=100)
    assert result.successful, result.reason
    assert probe.get(node.name, "model.amplifier_bandwidth.cutoff_hz") == 100.0
    assert not probe.set_one(node.name, "model.amplifier_bandwidth.cutoff_hz", -1.0).successful
    assert probe.set_one(node.name, "model.amplifier_bandwidth.cutoff_hz", 200).successful
    probe.drive(publisher, lambda t: 1e-6 * np.sin(9.0 * t), 0.5)
    probe.until(lambda: probe.diagnostics.get(node.name, {}).get("swapping") == "False", "swap done")
    empty = Parameter("model.effects", Parameter.Type.STRING_ARRAY, [])
    result = probe.set_one(node.name, "model.effects", empty)
    assert result.successful, result.reason
    n = len(heard)
    probe.until(lambda: len(heard) > n + 20, "voltage")


@pytest.mark.parametrize(
    "changed",
    [
        {"kappa_um_per_v": OTHER["kappa_um_per_v"], "saturation_v": OTHER["saturation_v"]},
        {"creep_order": 0.02},
    ],
    ids=["elements", "creep order"],
)
def test_swapped_model_stands_as_if_it_had_run_all_along(tmp_path, probe, tracking, changed):
    node, heard, publisher, _ = tracking
    swing = lambda t: 1e-6 * (np.sin(2.3 * t) + 0.5 * np.sin(7.1 * t))  # noqa: E731
    probe.drive(publisher, swing, 1.5)
    limit = 500.0
    slow = 20.0
    assert probe.set_one(node.name, "slew_limit_v_per_s", slow).successful
    values = {f"model__{name}": value for name, value in changed.items()}
    slow_from_s, n_before = time.time(), len(heard)
    assert probe.set_all(node.name, **values).successful
    probe.drive(publisher, lambda t: swing(t + 1.5), 1.5)
    probe.until(lambda: probe.diagnostics[node.name].get("swapping") == "False", "swap done")
    assert slow < limit
    node.stop()

    ticks = journal_records(tmp_path / "memory")
    # A late tick makes more than one step, noted at one time: the limit is one on the rate from voltage to voltage.
    slewed = in_ticks(ticks[ticks[:, 0] > slow_from_s])
    assert len(slewed) > 100
    assert np.max(np.abs(np.diff(slewed[:, 3])) / slewed[1:, 1]) <= slow * (1.0 + 1e-9)
    assert {message.data for _, message in heard[n_before:]} <= set(ticks[:, 3]), "what was published is what is noted"
    first = first_sample(tmp_path / "memory")
    steps, followed = np.concatenate(([0.005], ticks[:, 1])), np.concatenate(([first], ticks[:, 2]))
    replayed = compensator_of(copy.deepcopy(MODEL) | changed).run(steps, followed)[1:]
    np.testing.assert_allclose(ticks[-100:, 3], replayed[-100:], rtol=0.0, atol=1e-6)
    old = compensator_of().run(steps, followed)[1:]
    assert np.max(np.abs(old[-100:] - replayed[-100:])) > 1e-4, "the models must differ for this to mean anything"


def first_sample(checkpoint) -> float:
    import json

    return json.loads(checkpoint.read_bytes().partition(b"\n")[2])["desired_um"]


def test_reload(probe, tracking):
    node, heard, _, file = tracking
    model_file(file, OTHER, safe_voltage_v=1)
    answer = probe.trigger(f"{node.name}/reload_parameters")
    assert answer.success, answer.message
    assert probe.get(node.name, "model.saturation_v") == OTHER["saturation_v"]
    assert probe.get(node.name, "safe_voltage_v") == 1.0
    # A file for this node alone, nested as model files are, with an effect it has not had.
    file.write_text(
        "/compensator:\n  ros__parameters:\n    model.creep_order: 1e-2\n    model:\n"
        "      effects: [mechanical_resonance]\n      mechanical_resonance: {frequency_hz: 900, damping_ratio: 0.1}\n"
    )
    answer = probe.trigger(f"{node.name}/reload_parameters")
    assert answer.success, answer.message
    assert probe.get(node.name, "model.creep_order") == 0.01
    n = len(heard)
    probe.until(lambda: len(heard) > n + 20, "voltage after reload")


def bad_files(folder):
    """Twenty kinds of parameter file that must be refused whole."""
    good = "/**:\n  ros__parameters:\n    safe_voltage_v: 2.0\n"
    model = "    model:\n      kappa_um_per_v: [1.0, 2.0]\n      saturation_v: [0.1]\n"
    return {
        "empty": "",
        "only a comment": "# nothing\n",
        "broken YAML": good + "    model: [1.0,\n",
        "tabs": good + "\tmodel: 1\n",
        "not a mapping": "- 1\n- 2\n",
        "a number": "3.0\n",
        "binary": b"\x00\x01\xff\xfe" * 100,
        "not UTF-8": b"/**:\n  ros__parameters:\n    joint_name: \xe9\n",
        "alias bomb": "a: &a [x, x]\nb: &b [*a, *a]\n" + good,
        "python tag": good + "    joint_name: !!python/object/apply:os.system ['true']\n",
        "key twice": good + "    safe_voltage_v: 1.0\n",
        "no ros__parameters": "/**:\n  safe_voltage_v: 2.0\n",
        "another node": "/nobody:\n  ros__parameters:\n    safe_voltage_v: 2.0\n",
        "unknown name": good + "    safe_votage_v: 2.0\n",
        "wrong type": good + "    stale_after_s: soon\n",
        "out of range": good + "    slew_limit_v_per_s: -1.0\n",
        "not finite": good + "    stale_after_s: .nan\n",
        "lengths do not fit": good + "    model:\n      kappa_um_per_v: [1.0, 2.0, 3.0]\n      saturation_v: [0.1]\n",
        "negative saturation": good + model.replace("0.1", "-0.1"),
        "creep order above one": good + model + "      creep_order: 1.01\n",
        "unknown effect": good + model + "      effects: [magic]\n",
        "effect without parameters": good + model + "      effects: [mechanical_resonance]\n",
        "read-only": good + "    rate_hz: 10.0\n",
        "no value": good + "    stale_after_s:\n",
        "list for a number": good + "    stale_after_s: [1.0]\n",
        "text in a list": good + "    model:\n      saturation_v: [0.1, much]\n",
        "too large": good + "    # " + "x" * 2_000_000 + "\n",
        "nested too deeply": good + "    model: " + "{a: " * 40 + "1" + "}" * 40 + "\n",
    }


def test_bad_files_are_refused_whole(tmp_path, probe, tracking):
    node, heard, _, file = tracking
    names = ("safe_voltage_v", "model.saturation_v", "model.creep_order", "stale_after_s")
    before = [probe.get(node.name, name) for name in names]
    files = bad_files(tmp_path)
    assert len(files) >= 20
    reasons = {}
    for kind, content in files.items():
        file.write_bytes(content if isinstance(content, bytes) else content.encode())
        answer = probe.trigger(f"{node.name}/reload_parameters")
        assert not answer.success, kind
        reasons[kind] = answer.message
        assert [probe.get(node.name, name) for name in names] == before, kind
    assert all(len(reason) > 10 and "\n" not in reason for reason in reasons.values()), reasons
    for path in ("/etc/passwd", "../../../etc/passwd", "", "missing.yaml", str(tmp_path)):
        assert probe.set_one(node.name, "parameters_file", path).successful
        answer = probe.trigger(f"{node.name}/reload_parameters")
        assert not answer.success, path
        assert answer.message, path
    n = len(heard)
    probe.until(lambda: len(heard) > n + 20, "voltage after refused files")
    assert node.process.poll() is None
