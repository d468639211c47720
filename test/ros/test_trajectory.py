"""A motion told beforehand is followed on its stamps, its dynamics undone; what cannot be used is refused whole."""

from __future__ import annotations

import math

import numpy as np
from builtin_interfaces.msg import Duration
from harness import model_file
from small_model import MODEL
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

FAST = MODEL | {
    "effects": ["amplifier_bandwidth", "mechanical_resonance", "transport_delay"],
    "amplifier_bandwidth": {"cutoff_hz": 500.0},
    "mechanical_resonance": {"frequency_hz": 300.0, "damping_ratio": 0.5},
    "transport_delay": {"delay_s": 5e-4},
}
AHEAD_S = 0.5
N_HEARD = 30  # of the hundred messages of a half period at 1 kHz
N_TIMES = 3
LATE_S, ERROR_M = 3.5e-3, 0.03 * 2e-6


def trajectory(times_s, positions_m, velocities=None, accelerations=None, name="piezo") -> JointTrajectory:
    points = []
    for k, (time_s, position_m) in enumerate(zip(times_s, positions_m, strict=True)):
        nanoseconds = round(time_s * 1e9)
        point = JointTrajectoryPoint(positions=[float(position_m)])
        point.time_from_start = Duration(sec=nanoseconds // 10**9, nanosec=nanoseconds % 10**9)
        point.velocities = [] if velocities is None else [float(velocities[k])]
        point.accelerations = [] if accelerations is None else [float(accelerations[k])]
        points.append(point)
    return JointTrajectory(joint_names=[name], points=points)


def test_a_trajectory_is_followed_replaced_and_cancelled(tmp_path, probe, start):
    file = model_file(tmp_path / "model.yaml", FAST)
    options = {"rate_hz": 1000.0, "preview_s": 0.01}
    node = start("compensator", file, **options)
    start("simulated_pea", file, plant="fomrc", rate_hz=1000.0, interface="float64", noise_rms_m=0.0)
    seen = probe.record("displacement")
    publisher = probe.publisher("/compensator/trajectory", JointTrajectory)

    # A sine of 5 Hz in cubic pieces of 10 ms: where a point lies is where the stage is at that time.
    since_s = 0.01 * np.arange(1, 101)
    sine_m, rate = 1e-6 * np.sin(10.0 * math.pi * since_s), 1e-5 * math.pi * np.cos(10.0 * math.pi * since_s)
    message = trajectory(since_s, sine_m, rate)
    probe.until(lambda: len(seen) > 100, "displacement")
    probe.until_active(node)
    # A busy machine only makes the nodes late and their stage seldom heard: what they can do is the best they did.
    late_s, error_m = math.inf, math.inf
    for _ in range(N_TIMES):
        began_s = probe.epoch_s() + AHEAD_S
        message.header.stamp = probe.stamp(began_s)
        publisher.publish(message)
        ends_s = began_s + 1.0 - probe.epoch_offset_s()
        at_last_point = lambda s=ends_s: seen[-1][0] > s and abs(seen[-1][1].data - sine_m[-1]) < 5e-9  # noqa: E731
        probe.until(at_last_point, "the last point")
        probe.spin_for(0.1)
        assert at_last_point(), "it stays there"
        times_s = np.array([entry[0] for entry in seen]) + probe.epoch_offset_s() - began_s
        found_late_s, found_error_m = followed(times_s, np.array([entry[1].data for entry in seen]))
        late_s, error_m = min(late_s, found_late_s), min(error_m, found_error_m)
        print(f"late by {1e3 * found_late_s:.1f} ms, error {found_error_m / 2e-6:.2%} of the range")
        if late_s < LATE_S and error_m < ERROR_M:
            break
    assert late_s < LATE_S, "late by what two processes take to hand a voltage on, not by the preview"
    assert error_m < ERROR_M

    # Replaced while it runs; then cancelled, and it stays where it is.
    publisher.publish(trajectory([1.0, 5.0], [0.0, 2e-6]))
    publisher.publish(trajectory([10.0], [-2e-6], [0.0]))
    probe.until(lambda: node_values(probe, node)["trajectory"] == "followed", "the second one followed")
    probe.until(lambda: seen[-1][1].data < -0.05e-6, "the way down")
    publisher.publish(JointTrajectory(joint_names=["piezo"]))
    probe.until(lambda: node_values(probe, node)["trajectory"] == "none", "none followed")
    probe.spin_for(0.2)  # what is still on its way
    held_m = seen[-1][1].data
    probe.spin_for(0.3)
    assert abs(seen[-1][1].data - held_m) < 0.05e-6
    assert "refused" not in node.output()


def followed(times_s: np.ndarray, moved_m: np.ndarray) -> tuple[float, float]:
    """Return how late the stage is [s] in that half period in which it was least late, and its error [m] in all."""
    lags_s = np.arange(0.0, 14e-3, 1e-4)
    begins_s = [s for s in np.linspace(0.05, 0.85, 9) if np.sum((times_s > s) & (times_s < s + 0.1)) > N_HEARD]
    late_s = [lags_s[np.argmin(errors_at(lags_s, times_s, moved_m, s, s + 0.1))] for s in begins_s]
    if not late_s:
        return math.inf, math.inf
    return float(min(late_s)), min(errors_at(lags_s, times_s, moved_m, 0.05, 0.95))


def errors_at(lags_s, times_s, moved_m, begin_s: float, end_s: float) -> list[float]:
    """Return the median distance [m] from the sine for each lag, of what is heard from begin to end.

    The median, for a process may be held up.
    """
    inside = (times_s > begin_s) & (times_s < end_s)
    told_m = [1e-6 * np.sin(10.0 * math.pi * (times_s[inside] - lag)) for lag in lags_s]
    return [float(np.median(np.abs(moved_m[inside] - told))) for told in told_m]


def node_values(probe, node) -> dict[str, str]:
    return probe.diagnostics.get(node.name, {"trajectory": "not heard"})


def test_bad_trajectories_are_refused_whole(tmp_path, probe, start):
    node = start("compensator", model_file(tmp_path / "model.yaml"), rate_hz=200.0)
    publisher = probe.publisher("/compensator/trajectory", JointTrajectory)
    uneven = trajectory([0.1, 0.2], [0.0, 1e-6])
    uneven.points[1].positions = []
    late = trajectory([0.1], [1e-6])
    late.header.stamp = probe.stamp(probe.epoch_s() - 60.0)
    bad = {
        "does not come after the one before": trajectory([0.1, 0.3, 0.2], [0.0, 1e-6, 0.0]),
        "joint not in the message": trajectory([0.1], [1e-6], name="another"),
        "positions: of point 1 not finite": trajectory([0.1, 0.2], [0.0, math.nan]),
        "velocities: of point 0 not finite": trajectory([0.1], [0.0], [math.inf]),
        "is it in metres": trajectory([0.1], [5.0]),
        "one for each joint": uneven,
        "accelerations without velocities": trajectory([0.1], [0.0], None, [1.0]),
        "ends before now": late,
        "0 s or later": negative(),
    }
    heard = probe.record("voltage")
    for n_refused, (reason, message) in enumerate(bad.items(), start=1):
        publisher.publish(message)
        probe.until(
            lambda n=n_refused: node_values(probe, node).get("refused_messages") == str(n), f"refusal: {reason}"
        )
        assert reason in probe.diagnostics[node.name]["last_refusal"]
    assert not heard, "nothing of them was followed"
    publisher.publish(trajectory([0.1], [1e-6]))
    probe.until(lambda: heard and heard[-1][1].data > 0.1, "a good one is followed")


def negative() -> JointTrajectory:
    message = trajectory([0.1], [0.0])
    message.points[0].time_from_start = Duration(sec=-1, nanosec=0)
    return message
