"""What the watch takes of a core beside a compensator and a stage at 1 kHz, as three processes.

python benchmarks/watch_load.py [--duration 60]
"""

from __future__ import annotations

import argparse
import math
import os
import random
import subprocess
import sys
import tempfile
import time
from pathlib import Path

os.environ.setdefault("ROS_DOMAIN_ID", str(random.randint(1, 100)))
os.environ.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")

import rclpy
import rclpy.node
from std_msgs.msg import Float64

_ROOT = Path(__file__).resolve().parents[1]
_MODEL = _ROOT / "config" / "pi_p753_table1.yaml"
_TICKS_PER_S = os.sysconf("SC_CLK_TCK")
_PAGE_BYTES = os.sysconf("SC_PAGESIZE")


def used(process: subprocess.Popen[bytes]) -> tuple[float, float]:
    """Return processor time [s] and resident memory [MB] of a process."""
    fields = Path(f"/proc/{process.pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / _TICKS_PER_S, int(fields[21]) * _PAGE_BYTES / 1e6


def rclpy_takes(node: rclpy.node.Node) -> bool:
    """Take one message of the node's subscription; return whether there was one."""
    (subscription,) = node.subscriptions
    with subscription.handle:
        taken = subscription.handle.take_message(subscription.msg_type, False)
    if taken is None:
        return False
    subscription.callback(taken[0])
    return True


def main() -> None:
    """Print what was measured."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--duration", type=float, default=60.0, help="measured time [s]")
    duration_s = parser.parse_args().duration
    folder = tempfile.mkdtemp()
    environment = dict(os.environ, PYTHONPATH=str(_ROOT))
    nodes = {
        name: subprocess.Popen(
            [sys.executable, "-m", module, "--ros-args", "--params-file", str(_MODEL), *options],
            cwd=folder,
            env=environment,
        )
        for name, module, options in (
            ("compensator", "fomrc_ros.compensator", ["-p", "stale_after_s:=0.0"]),
            ("simulated_pea", "fomrc_ros.simulated_stage", ["-p", "plant:=fomrc"]),
            ("watch", "fomrc_ros.watch", []),
        )
    }
    rclpy.init()
    node = rclpy.create_node("target")
    heard = [0]
    node.create_subscription(Float64, "voltage", lambda _: heard.__setitem__(0, heard[0] + 1), 10_000)
    publisher = node.create_publisher(Float64, "desired_position", 1)
    try:
        began = time.monotonic()
        before: dict[str, tuple[float, float]] = {}
        settle_s = 25.0  # compiled, the lag found, learning
        while (now := time.monotonic() - began) < settle_s + duration_s:
            publisher.publish(Float64(data=1e-6 * (math.sin(2.0 * now) + 0.5 * math.sin(5.3 * now))))
            while rclpy_takes(node):
                pass
            if not before and now > settle_s:
                heard[0] = 0
                before = {name: used(process) for name, process in nodes.items()}
            time.sleep(0.01)
        print(f"voltage at {heard[0] / duration_s:.0f} Hz")
        for name, process in nodes.items():
            (seconds, megabytes), (seconds_before, megabytes_before) = used(process), before[name]
            print(
                f"{name:14s} {100.0 * (seconds - seconds_before) / duration_s:5.1f} % of a core, "
                f"{megabytes:.0f} MB, grew by {megabytes - megabytes_before:.1f} MB"
            )
    finally:
        for process in nodes.values():
            process.terminate()
        for process in nodes.values():
            process.wait()
        rclpy.shutdown()


if __name__ == "__main__":
    main()
