"""Rate, latency, jitter and CPU of the compensator's loop beside a stage, in two processes; or a long soak.

    python benchmarks/ros_latency.py                 # 20 s at 1 kHz
    python benchmarks/ros_latency.py --duration 1200 # soak: memory must not grow, shutdown must be clean

No claim of hard real time: what is measured is what this machine did while this ran.
"""

from __future__ import annotations

import argparse
import os
import random
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.executors import Executor
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions
from rclpy.task import Future
from std_msgs.msg import Float64

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from fomrc_ros.demo.node_processes import NodeProcess, private_environment
from fomrc_ros.node.runtime import make_executor

REPOSITORY = Path(__file__).resolve().parents[1]
MODEL = REPOSITORY / "config" / "pi_p753_table1.yaml"
DYNAMICS = {
    "model.effects": ["amplifier_bandwidth", "mechanical_resonance", "transport_delay"],
    "model.amplifier_bandwidth.cutoff_hz": 500.0,
    "model.mechanical_resonance.frequency_hz": 300.0,
    "model.mechanical_resonance.damping_ratio": 0.02,
    "model.transport_delay.delay_s": 5e-4,
}
TICKS_PER_S = os.sysconf("SC_CLK_TCK")


def cpu_s(pid: int) -> float:
    """Return the CPU time a process has used [s]."""
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / TICKS_PER_S


def resident_mb(pid: int) -> float:
    """Return the resident memory of a process [MB]."""
    return int(Path(f"/proc/{pid}/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE") / 1e6


def watching() -> tuple[dict[str, str], rclpy.Context, Node, Executor]:
    """Return the environment of nodes in a domain of their own, and a node there that watches them."""
    domain_id = random.randint(1, 100)
    context = rclpy.Context()
    rclpy.init(context=context, domain_id=domain_id, signal_handler_options=SignalHandlerOptions.NO)
    watcher = rclpy.create_node("watcher", context=context)
    executor = make_executor(context)
    executor.add_node(watcher)
    return private_environment(domain_id), context, watcher, executor


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--duration", type=float, default=20.0, help="seconds measured")
    parser.add_argument("--rate", type=float, default=1000.0, help="Hz")
    parser.add_argument("--plant", default="fomrc", choices=("fomrc", "electromechanical"))
    parser.add_argument("--fast", action="store_true", help="with a resonance, a preview of 20 ms and a sensor")
    options = parser.parse_args()
    environment, context, watcher, executor = watching()
    statuses: dict[str, list[dict[str, str]]] = {"compensator": [], "simulated_pea": []}

    def on_diagnostics(message: DiagnosticArray) -> None:
        for status in message.status:
            statuses[status.name].append({pair.key: pair.value for pair in status.values})

    watcher.create_subscription(DiagnosticArray, "/diagnostics", on_diagnostics, 10)
    target = watcher.create_publisher(Float64, "desired_position", 1)
    phase = [0.0]

    def drive() -> None:
        phase[0] += 0.02
        target.publish(Float64(data=1e-6 * float(np.sin(2.0 * phase[0]))))

    watcher.create_timer(0.02, drive)
    with tempfile.TemporaryDirectory() as folder:
        logs = Path(folder)
        common = {"rate_hz": options.rate}
        fast = {**DYNAMICS, "preview_s": 0.02, "feedback": True, "feedback_bandwidth_hz": 1.0} if options.fast else {}
        dynamics = DYNAMICS if options.fast else {}
        nodes = {
            "compensator": NodeProcess(
                "fomrc_ros.compensator", "/", [MODEL], {**common, **fast}, environment, logs / "c"
            ),
            "simulated_pea": NodeProcess(
                "fomrc_ros.simulated_stage",
                "/",
                [MODEL],
                {**common, **dynamics, "plant": options.plant},
                environment,
                logs / "s",
            ),
        }
        deadline = time.monotonic() + 60.0
        while not all(len(seen) > 3 for seen in statuses.values()):
            executor.spin_until_future_complete(Future(), timeout_sec=0.2)
            if time.monotonic() > deadline:
                print("the nodes did not start:", *(node.output() for node in nodes.values()))
                return 1
        for seen in statuses.values():
            seen.clear()
        pids = {name: node.pid for name, node in nodes.items()}
        cpu = {name: cpu_s(pid) for name, pid in pids.items()}
        memory = {name: resident_mb(pid) for name, pid in pids.items()}
        began = time.monotonic()
        executor.spin_until_future_complete(Future(), timeout_sec=options.duration)
        elapsed = time.monotonic() - began
        print(f"{options.rate:.0f} Hz, {elapsed:.0f} s, load {os.getloadavg()[0]:.1f} on {os.cpu_count()} cores")
        print("| node | rate [Hz] | CPU [% of a core] | memory grew by [MB] | largest gap [ms] | late ticks |")
        print("|---|---|---|---|---|---|")
        for name, pid in pids.items():
            seen = statuses[name]
            rate = np.mean([float(status["rate_hz"]) for status in seen])
            late = sum(int(status["late_ticks"]) for status in seen)
            gap = max(float(status["largest_gap_ms"]) for status in seen)
            used = 100.0 * (cpu_s(pid) - cpu[name]) / elapsed
            print(f"| {name} | {rate:.1f} | {used:.0f} | {resident_mb(pid) - memory[name]:.1f} | {gap:.1f} | {late} |")
        spent = statuses["compensator"]
        print(
            "compensator, tick to publish [us]: mean "
            f"{np.mean([float(s['tick_to_publish_mean_us']) for s in spent]):.0f}, p99 (median over seconds) "
            f"{np.median([float(s['tick_to_publish_p99_us']) for s in spent]):.0f}, p99 (worst second) "
            f"{max(float(s['tick_to_publish_p99_us']) for s in spent):.0f}, max "
            f"{max(float(s['tick_to_publish_max_us']) for s in spent):.0f}"
        )
        codes = {name: node.stop() for name, node in nodes.items()}
        # a sensor is missed and back whenever a process was held up, and said so
        noise = {name: node.output().strip() for name, node in nodes.items() if node.output().strip() and not fast}
        print(f"exit status {codes}, output {noise or 'none'}")
    executor.shutdown()
    watcher.destroy_node()
    rclpy.try_shutdown(context=context)
    return 0 if not any(codes.values()) and not noise else 1


if __name__ == "__main__":
    sys.exit(main())
