"""Rasters through the nodes, compensator and stage in two processes at 1 kHz, with a preview and without.

    python -m benchmarks.ros_fast_scans

The stage is the model itself, amplifier, resonance and delay in it: what is measured is what the nodes add. A raster is
a trajectory of a point a millisecond. What handing voltages and displacements on takes, part of a period or one and a
part, is no model's: that constant time is taken out, and told. A process that is held up sets the mass ringing, so that
on a machine that is not idle periods differ: the best period is told, their median, and the whole.
"""

from __future__ import annotations

import os
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
import rclpy
import yaml
from builtin_interfaces.msg import Duration, Time
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.task import Future
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from benchmarks.fast_loop import PERIOD_S, scan_um
from benchmarks.fast_scans import model
from benchmarks.ros_latency import watching
from fomrc_ros.conversions import m_to_um, stamp_s, um_to_m
from fomrc_ros.demo.node_processes import NodeProcess
from fomrc_ros.node.quality_of_service import COMMAND, RECORDED_MEASUREMENT

PREVIEW_S = 0.01
_AHEAD_S = 1.0
_FROM_S = 1.0
_LAGS_S = np.arange(0.0, 4e-3, 5e-5)


def trajectory(target_um: np.ndarray, begins_s: float) -> JointTrajectory:
    """A point a period, with velocities."""
    rates = np.gradient(target_um, PERIOD_S)
    message = JointTrajectory(joint_names=["piezo"])
    message.header.stamp = Time(sec=int(begins_s), nanosec=int(1e9 * (begins_s % 1.0)))
    for k, (position, rate) in enumerate(zip(target_um, rates, strict=True)):
        since_ns = round(1e9 * PERIOD_S * k)
        point = JointTrajectoryPoint(positions=[um_to_m(position)], velocities=[um_to_m(rate)])
        point.time_from_start = Duration(sec=since_ns // 10**9, nanosec=since_ns % 10**9)
        message.points.append(point)
    return message


def main() -> int:
    """Print the error of each raster."""
    for preview_s in (PREVIEW_S, 0.0):
        for frequency_hz, (least, median, whole, lag_s) in _measured(preview_s).items():
            print(
                f"{frequency_hz:g} Hz, preview {1e3 * preview_s:g} ms: NRMSE {least:.3g} % (best period), "
                f"{median:.3g} % (their median), {whole:.3g} % (all of them), {1e3 * lag_s:.2f} ms taken out"
            )
    print(f"machine load {os.getloadavg()[0]:.1f} on {os.cpu_count()} processors")
    return 0


def _measured(preview_s: float) -> dict[float, tuple[float, float, float, float]]:
    environment, context, watcher, executor = watching()
    seen: list[tuple[float, float]] = []
    told: set[str] = set()
    watcher.create_subscription(
        JointState,
        "displacement",
        lambda message: seen.append((stamp_s(message.header.stamp), m_to_um(message.position[0]))),
        RECORDED_MEASUREMENT,
    )
    watcher.create_subscription(
        DiagnosticArray, "/diagnostics", lambda message: told.update(s.name for s in message.status), 10
    )
    publisher = watcher.create_publisher(JointTrajectory, "compensator/trajectory", COMMAND)
    found = {}
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "model.yaml"
        limits = {"maximum_voltage_v": 5.0, "minimum_voltage_v": -5.0, "slew_limit_v_per_s": 5000.0}
        file.write_text(yaml.safe_dump({"/**": {"ros__parameters": {"model": model().to_mapping()} | limits}}))
        common = {"rate_hz": 1.0 / PERIOD_S}
        parameters = {
            "fomrc_ros.compensator": {**common, "preview_s": preview_s},
            "fomrc_ros.simulated_stage": {**common, "plant": "fomrc", "interface": "joint_state", "noise_rms_m": 1e-9},
        }
        nodes = [
            NodeProcess(module, "/", [file], values, environment, Path(folder) / f"{module}.log")
            for module, values in parameters.items()
        ]
        while len(told) < len(nodes) or not publisher.get_subscription_count():
            executor.spin_until_future_complete(Future(), timeout_sec=0.2)
        for frequency_hz in (10.0, 30.0):
            begins_s, target_um = time.time() + _AHEAD_S, scan_um(frequency_hz)
            publisher.publish(trajectory(target_um, begins_s))
            seen.clear()
            executor.spin_until_future_complete(Future(), timeout_sec=_AHEAD_S + PERIOD_S * target_um.size + 0.5)
            found[frequency_hz] = _error(np.array(seen), target_um, begins_s, frequency_hz)
        for node in nodes:
            node.stop()
    executor.shutdown()
    watcher.destroy_node()
    rclpy.try_shutdown(context=context)
    return found


def _error(
    seen: np.ndarray, target_um: np.ndarray, begins_s: float, frequency_hz: float
) -> tuple[float, float, float, float]:
    times_s, moved_um = seen[:, 0] - begins_s, seen[:, 1]
    inside = (times_s > _FROM_S) & (times_s < PERIOD_S * (target_um.size - 10))
    times_s, moved_um = times_s[inside], moved_um[inside]
    at_s, range_um = PERIOD_S * np.arange(target_um.size), float(np.ptp(target_um))
    number = ((times_s - _FROM_S) * frequency_hz).astype(int)
    best = (np.inf, np.inf, np.inf, 0.0)
    for lag_s in _LAGS_S:
        off_um = moved_um - np.interp(times_s - lag_s, at_s, target_um)
        periods = [float(np.sqrt(np.mean(off_um[number == k] ** 2))) for k in np.unique(number)]
        best = min(best, (min(periods), float(np.median(periods)), float(np.sqrt(np.mean(off_um**2))), float(lag_s)))
    least_um, median_um, whole_um, lag_s = best
    return (*(100.0 * value / range_um for value in (least_um, median_um, whole_um)), lag_s)


if __name__ == "__main__":
    sys.exit(main())
