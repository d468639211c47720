"""Desired position in, voltage out: what comes over the topics is what the model says."""

from __future__ import annotations

import math

import numpy as np
from diagnostic_msgs.msg import DiagnosticStatus
from harness import in_ticks, journal_records, model_file
from sensor_msgs.msg import JointState
from small_model import compensator_of
from std_msgs.msg import Float64


def swing(t: float) -> float:
    return 1e-6 * (0.8 * math.sin(2.0 * math.pi * 0.7 * t) + 0.3 * math.sin(2.0 * math.pi * 1.9 * t))


def test_voltage_is_the_models_and_goes_on_at_rest(tmp_path, probe, start):
    checkpoint = tmp_path / "memory"
    node = start(
        "compensator",
        model_file(tmp_path / "model.yaml"),
        rate_hz=500.0,
        checkpoint_file=checkpoint,
        checkpoint_period_s=3600.0,
        stop_policy="hold",
        slew_limit_v_per_s=5000.0,
    )
    heard = probe.record("voltage")
    publisher = probe.publisher("desired_position")
    probe.until_active(node)
    probe.drive(publisher, swing, 1.5)
    probe.until(lambda: len(heard) > 100, "voltages")
    n_moving = len(heard)
    probe.until(lambda: len(heard) > n_moving + 200, "voltages while the target rests")
    voltages = [message.data for _, message in heard]
    assert voltages[-1] != voltages[-100], "creep compensation must go on at rest"
    node.stop()

    ticks = journal_records(checkpoint)
    # The first tick is in the snapshot the journal began with: one period at the first target, or some if it was late.
    followed = np.concatenate(([first_target(checkpoint)], ticks[:, 2]))

    def driven(n_periods: int) -> np.ndarray:
        return compensator_of().run(np.concatenate(([0.002 * n_periods], ticks[:, 1])), followed)

    expected = min((driven(n) for n in range(1, 51)), key=lambda found: np.max(np.abs(found[1:] - ticks[:, 3])))
    np.testing.assert_allclose(ticks[:, 3], expected[1:], rtol=0.0, atol=1e-12)
    first_v = min(voltages, key=lambda voltage: abs(voltage - expected[0]))
    assert abs(first_v - expected[0]) < 1e-12
    assert set(voltages) <= {first_v, *ticks[:, 3].tolist()}


def first_target(checkpoint) -> float:
    import json

    return json.loads(checkpoint.read_bytes().partition(b"\n")[2])["desired_um"]


def test_stage_follows_over_joint_states(tmp_path, probe, start):
    file = model_file(tmp_path / "model.yaml", interface="joint_state", joint_name="z_axis")
    node = start("compensator", file)
    start("simulated_pea", file, plant="fomrc", noise_rms_m=0.0)
    seen = probe.record("displacement", JointState)
    publisher = probe.publisher("desired_position", JointState)
    probe.until(lambda: seen, "displacement")
    probe.until_active(node)
    levels_m = 1e-6 * np.array([0.0, 0.9, 0.3, -0.6, -0.2, 0.7])
    reached_m = []
    for level in levels_m:
        probe.drive(publisher, lambda t, level=level: level, 0.5, name="z_axis", rate_hz=500.0)
        probe.until(
            lambda level=level: (
                np.ptp([m.position[0] for _, m in seen[-100:]]) < 1e-9 and abs(seen[-1][1].position[0] - level) < 0.2e-6
            ),
            f"the stage at rest at {level} m",
        )
        reached_m.append(seen[-1][1].position[0])
    stamps = [message.header.stamp.sec + 1e-9 * message.header.stamp.nanosec for _, message in seen]
    assert seen[-1][1].name == ["z_axis"]
    assert np.all(np.diff(stamps) > 0.0)
    # Levels, not a moving target: how long a message takes is the machine's affair. What is left of it is the
    # creep of the milliseconds between a voltage and its displacement.
    assert np.max(np.abs(np.array(reached_m) - levels_m)) < 1e-8


def test_bad_targets_are_refused_and_the_loop_lives_on(tmp_path, probe, start):
    node = start("compensator", model_file(tmp_path / "model.yaml"), rate_hz=200.0)
    heard = probe.record("voltage")
    publisher = probe.publisher("desired_position")
    probe.drive_until(publisher, 0.5e-6, lambda: heard, "a voltage")
    bad = (math.nan, math.inf, -math.inf, 1e300, 1.0)
    # Each alone, until it has been refused: of several that wait for a busy node only the last is read.
    n_refused = 0

    def refused() -> int:
        return int(probe.diagnostics.get(node.name, {}).get("refused_messages", 0))

    def is_refused(value: float) -> bool:
        publisher.publish(Float64(data=value))
        return refused() >= n_refused

    for value in bad:
        # More than this one's own: what was sent of the one before may be counted after it.
        n_refused = refused() + 10
        probe.until(lambda value=value: is_refused(value), f"{value} refused")
    # what was still queued of the one before is counted, too
    probe.until(lambda: is_refused(1.0) and "0.1 m" in probe.diagnostics[node.name]["last_refusal"], "the last refused")
    n = len(heard)
    probe.until(lambda: len(heard) > n + 20, "voltage after bad targets")
    assert all(math.isfinite(message.data) and abs(message.data) < 1.0 for _, message in heard)


def test_voltage_is_clamped_and_slewed(tmp_path, probe, start):
    checkpoint = tmp_path / "memory"
    node = start(
        "compensator",
        model_file(tmp_path / "model.yaml"),
        rate_hz=200.0,
        minimum_voltage_v=-0.5,
        maximum_voltage_v=1.0,
        slew_limit_v_per_s=2.0,
        checkpoint_file=checkpoint,
        checkpoint_period_s=3600.0,
    )
    heard = probe.record("voltage")
    publisher = probe.publisher("desired_position")
    for goal_m, bound_v in ((50e-6, 1.0), (-50e-6, -0.5)):

        def is_there(goal_m=goal_m, bound_v=bound_v) -> bool:
            publisher.publish(Float64(data=goal_m))
            return bool(heard) and heard[-1][1].data == bound_v

        probe.until(is_there, f"{bound_v} V")
    voltages = np.array([message.data for _, message in heard])
    assert voltages.max() == 1.0
    assert voltages.min() == -0.5
    assert np.median(np.abs(np.diff(voltages))[np.abs(np.diff(voltages)) > 0]) <= 2.0 / 200.0 + 1e-12
    probe.until(lambda: int(probe.diagnostics.get(node.name, {}).get("clamped_ticks", 0)) > 0, "clamps counted")
    assert int(probe.diagnostics[node.name]["slewed_ticks"]) > 0
    node.stop()

    # Tick by tick, and by the time each took; of two voltages that wait for a busy listener it hears the later one.
    ticks = in_ticks(journal_records(checkpoint))
    steps_s, sent_v = ticks[1:, 1], ticks[:, 3]
    assert np.all(np.abs(np.diff(sent_v)) <= 2.0 * steps_s + 1e-12)
    assert set(voltages) <= {voltages[0], *sent_v.tolist()}


def test_stale_target_ramps_to_the_safe_voltage(tmp_path, probe, start):
    node = start(
        "compensator",
        model_file(tmp_path / "model.yaml"),
        rate_hz=200.0,
        stale_after_s=0.3,
        stale_policy="ramp",
        safe_voltage_v=0.2,
        safe_ramp_v_per_s=5.0,
    )
    heard = probe.record("voltage")
    publisher = probe.publisher("desired_position")
    probe.drive_until(publisher, 1e-6, lambda: heard and heard[-1][1].data > 0.4, "the target followed")
    probe.drive(publisher, lambda t: 1e-6, 0.5)
    tracking = heard[-1][1].data
    probe.until(lambda: heard[-1][1].data == 0.2, "safe voltage")
    probe.until(lambda: probe.levels.get(node.name) == DiagnosticStatus.WARN, "warning")
    probe.until(lambda: probe.messages[node.name] == "ramping to the safe voltage", "reason")
    # A target that comes again is followed again.
    probe.drive_until(publisher, 1e-6, lambda: abs(heard[-1][1].data - tracking) < 0.05, "the target followed again")
