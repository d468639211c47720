"""Compensator and stage on three hosts: network namespaces with their own addresses, a cut link, loss and delay.

    sudo python test/network/across_hosts.py

Driver, compensator and stage each run in a network namespace of their own, joined by a switch in user space. The
driver's link is cut for 5 s (the target is stale: the voltage must go to the safe one) and restored, then every link
loses 20 % of its packets and delays the rest by 5 ms. Needs root, iproute2 and /dev/net/tun.
"""

from __future__ import annotations

import argparse
import json
import os
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from lossy_switch import LossySwitch

REPOSITORY = Path(__file__).resolve().parents[2]
HOSTS = ("driver", "compensator", "stage")
PREFIX = f"fomrc{os.getpid() % 1000}"
SAFE_V, TARGET_UM = 0.0, 1.0


def ip(*arguments: str, check: bool = True) -> None:
    subprocess.run(["ip", *arguments], check=check, capture_output=True, text=True)


def namespace(host: str) -> str:
    return f"{PREFIX}{host}"


def port(host: str) -> str:
    return f"{PREFIX}p{HOSTS.index(host)}"


def make_network() -> LossySwitch:
    """Make three namespaces, each with one interface, on one switch."""
    switch = LossySwitch([port(host) for host in HOSTS])
    for k, host in enumerate(HOSTS):
        ip("netns", "add", namespace(host))
        ip("link", "set", port(host), "netns", namespace(host))
        for command in (
            ("addr", "add", f"10.77.0.{k + 1}/24", "dev", port(host)),
            ("link", "set", port(host), "up", "multicast", "on"),
            ("link", "set", "lo", "up"),
            ("route", "add", "224.0.0.0/4", "dev", port(host)),
        ):
            ip("-n", namespace(host), *command)
    return switch


def remove_network() -> None:
    for host in HOSTS:
        ip("netns", "del", namespace(host), check=False)


def in_host(host: str, *command: str, log: Path) -> subprocess.Popen:
    environment = dict(
        os.environ,
        PYTHONPATH=str(REPOSITORY),
        ROS_DOMAIN_ID="17",
        ROS_AUTOMATIC_DISCOVERY_RANGE="SUBNET",
        FASTDDS_BUILTIN_TRANSPORTS="UDPv4",
    )
    with log.open("wb") as output:
        return subprocess.Popen(
            ["ip", "netns", "exec", namespace(host), sys.executable, *command],
            env=environment,
            stdout=output,
            stderr=output,
        )


def drive(path: Path) -> int:
    """Be the driver: publish a target, note every displacement, until ended."""
    import rclpy
    from rclpy.qos import qos_profile_sensor_data
    from rclpy.signals import SignalHandlerOptions
    from rclpy.task import Future
    from std_msgs.msg import Float64

    from fomrc_ros.node.runtime import make_executor

    rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
    node = rclpy.create_node("driver")
    executor = make_executor()
    executor.add_node(node)
    publisher = node.create_publisher(Float64, "desired_position", 1)
    done = Future()
    signal.signal(signal.SIGTERM, lambda *_: done.set_result(None))
    with path.open("w", buffering=1) as file:
        node.create_timer(0.01, lambda: publisher.publish(Float64(data=1e-6 * TARGET_UM)))
        node.create_subscription(
            Float64, "displacement", lambda m: file.write(f"{time.time()} {m.data}\n"), qos_profile_sensor_data
        )
        executor.spin_until_future_complete(done, timeout_sec=1e9)
        executor.shutdown()
    node.destroy_node()
    rclpy.try_shutdown()
    return 0


def watch(path: Path) -> int:
    """Be at the stage's host: note every voltage."""
    import rclpy
    from rclpy.signals import SignalHandlerOptions
    from rclpy.task import Future
    from std_msgs.msg import Float64

    from fomrc_ros.node.runtime import make_executor

    rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
    node = rclpy.create_node("watcher")
    executor = make_executor()
    executor.add_node(node)
    done = Future()
    signal.signal(signal.SIGTERM, lambda *_: done.set_result(None))
    with path.open("w", buffering=1) as file:
        node.create_subscription(Float64, "voltage", lambda m: file.write(f"{time.time()} {m.data}\n"), 100)
        executor.spin_until_future_complete(done, timeout_sec=1e9)
        executor.shutdown()
    node.destroy_node()
    rclpy.try_shutdown()
    return 0


def read(path: Path, since: float) -> list[tuple[float, float]]:
    rows = []
    for line in path.read_text().splitlines():
        fields = line.split()
        if len(fields) == 2 and float(fields[0]) >= since:
            rows.append((float(fields[0]), float(fields[1])))
    return rows


def until(condition, what: str, timeout_s: float) -> float:
    """Wait for a condition; return how long it took."""
    began = time.time()
    while not condition():
        if time.time() - began > timeout_s:
            raise SystemExit(f"FAILED: not within {timeout_s:g} s: {what}")
        time.sleep(0.01)
    return time.time() - began


def main() -> int:
    if os.geteuid() != 0:
        print("needs root, for network namespaces")
        return 77
    found: dict[str, object] = {}
    processes: list[subprocess.Popen] = []
    with tempfile.TemporaryDirectory(prefix="fomrc_network_") as folder:
        logs = Path(folder)
        try:
            switch = make_network()
        except (subprocess.CalledProcessError, OSError) as error:
            remove_network()
            print(f"network namespaces are not available here: {getattr(error, 'stderr', error)}")
            return 77
        try:
            model = str(REPOSITORY / "config" / "pi_p753_table1.yaml")
            common = ["--ros-args", "--params-file", model, "-p", "rate_hz:=200.0"]
            stale = ["-p", "stale_after_s:=0.5", "-p", "stale_policy:=ramp", "-p", "safe_ramp_v_per_s:=5.0"]
            script = str(Path(__file__).resolve())
            processes += [
                in_host("compensator", "-m", "fomrc_ros.compensator", *common, *stale, log=logs / "c"),
                in_host("stage", "-m", "fomrc_ros.simulated_stage", *common, "-p", "plant:=fomrc", log=logs / "s"),
                in_host("driver", script, "--drive", str(logs / "moved"), log=logs / "d"),
                in_host("stage", script, "--watch", str(logs / "volts"), log=logs / "w"),
            ]
            moved, volts = logs / "moved", logs / "volts"

            def tracks() -> bool:
                last = read(moved, time.time() - 0.2) if moved.exists() else []
                return bool(last) and abs(last[-1][1] * 1e6 - TARGET_UM) < 0.02

            def is_safe() -> bool:
                last = read(volts, time.time() - 0.2)
                return bool(last) and last[-1][1] == SAFE_V

            found["first_tracking_s"] = until(tracks, "tracking over the network", 60.0)
            cut = time.time()
            switch.cut.add(port("driver"))
            found["safe_after_cut_s"] = until(is_safe, "safe voltage while the link is cut", 4.0)
            while time.time() < cut + 5.0:
                time.sleep(0.05)
            found["safe_until_restored"] = is_safe()
            switch.cut.clear()
            found["tracking_after_restore_s"] = until(tracks, "tracking after the link is back", 30.0)
            begun = time.time()
            switch.n_frames = switch.n_lost = 0
            switch.loss, switch.delay_s = 0.2, 0.005
            found["tracking_under_loss_s"] = until(tracks, "tracking under loss", 30.0)
            while time.time() < begun + 6.0:
                time.sleep(0.05)
            during = [v for _, v in read(volts, begun)]
            found["voltage_under_loss_v"] = [min(during), max(during)]
            found["frames_lost"] = f"{switch.n_lost} of {switch.n_frames}, each delayed by 5 ms"
            switch.loss = switch.delay_s = 0.0
            found["tracking_after_loss_s"] = until(tracks, "tracking after the loss", 30.0)
            every = [v for _, v in read(volts, 0.0)]
            found["voltage_range_v"] = [min(every), max(every)]
            found["alive"] = all(process.poll() is None for process in processes)
        finally:
            for process in processes:
                process.terminate()
            for process in processes:
                try:
                    process.wait(15.0)
                except subprocess.TimeoutExpired:
                    process.kill()
            switch.close()
            remove_network()
            for log in sorted(logs.glob("?")):
                if log.read_text().strip():
                    print(f"{log.name}: {log.read_text().strip()[-500:]}")
    print(json.dumps(found, indent=1))
    is_good = found.get("alive") and found.get("safe_until_restored") and found["tracking_after_restore_s"] <= 1.0
    is_good = is_good and found["tracking_after_loss_s"] <= 1.0 and max(map(abs, found["voltage_range_v"])) <= 2.5
    print("ok" if is_good else "FAILED")
    return 0 if is_good else 1


if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    parser.add_argument("--drive", type=Path)
    parser.add_argument("--watch", type=Path)
    options = parser.parse_args()
    sys.exit(drive(options.drive) if options.drive else watch(options.watch) if options.watch else main())
