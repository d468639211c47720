"""The error of the gap nodes on a stage whose axes move each other by 5 %, with and without its model of all axes.

    python -m benchmarks.gap_coupling

Real processes on topics: three compensators, the stage, gap_command and gap_monitor. Each target is held until the gap
rests; what counts is its mean at the end of the hold, told as displacements of the axes.
"""

from __future__ import annotations

import random
import tempfile
import time
from collections.abc import Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import numpy as np
import rclpy
from numpy.typing import NDArray
from rclpy.signals import SignalHandlerOptions
from sensor_msgs.msg import JointState

from benchmarks.coupled_stage import AXES, REPOSITORY, stage_model
from fomrc_core.storage.axes_files import write_axes_model
from fomrc_ros.demo.node_processes import NodeProcess, private_environment
from fomrc_ros.gap.geometry import MOTIONS, GapGeometry
from fomrc_ros.node.quality_of_service import COMMAND, MEASUREMENT
from fomrc_ros.node.runtime import make_executor
from fomrc_ros.parameters.gap import GEOMETRY_SPEC

Array = NDArray[np.float64]

CONFIG = REPOSITORY / "config" / "tunable_filter.yaml"
# piston [m], tip and tilt [rad]
TARGETS = ((1.0e-6, 0.0, 0.0), (0.2e-6, 60e-6, -40e-6), (-0.8e-6, -50e-6, 50e-6), (0.0, 80e-6, 60e-6))
_HOLD_S, _LOOK_S = 1.2, 0.5
_PATIENCE_S = 60.0
_READY_M = 0.04e-6
_AT_REST_UM = 2e-3  # between two looks


class GapProbe:
    """Publishes desired gaps and hears the gaps there are.

    Args:
        domain_id: of the middleware; None for that of the environment.
    """

    def __init__(self, domain_id: int | None = None) -> None:
        self._geometry = GapGeometry.from_list(GEOMETRY_SPEC.default)
        self._context = rclpy.Context()
        rclpy.init(context=self._context, domain_id=domain_id, signal_handler_options=SignalHandlerOptions.NO)
        self._node = rclpy.create_node("gap_probe", context=self._context)
        self._executor = make_executor(self._context)
        self._executor.add_node(self._node)
        self._heard: list[tuple[float, Array]] = []
        self._publisher = self._node.create_publisher(JointState, "desired_gap", COMMAND)
        self._node.create_subscription(JointState, "gap", self._on_gap, MEASUREMENT)

    def close(self) -> None:
        """Leave the middleware."""
        self._node.destroy_node()
        rclpy.try_shutdown(context=self._context)

    def until_ready(self) -> None:
        """Move the gap to and fro until each axis follows: then every node hears those it must.

        A node may find another seconds late, and what an axis does before the stage hears it is in its compensator's
        memory alone; the moves are small, for what they leave there to be lost in that of the first target.
        """
        deadline = time.monotonic() + _PATIENCE_S
        for piston_m in (_READY_M, -_READY_M):
            wanted = np.array([piston_m, 0.0, 0.0])
            while not (self._heard and np.max(np.abs(self._off_um(self._heard[-1][1], wanted))) < 0.5e6 * _READY_M):
                if time.monotonic() > deadline:
                    raise TimeoutError(f"the gap does not follow: {self._heard[-1:]}")
                self._command(wanted)
        self._heard.clear()

    def errors_um(self, targets: Sequence[tuple[float, float, float]]) -> Array:
        """Return the errors of the axes at the end of each hold [um], (n_targets, 3)."""
        found = []
        for target in targets:
            wanted = np.array(target)
            begun_s, before = time.monotonic(), np.full(3, np.inf)
            while True:
                end_s = time.monotonic() + (_HOLD_S if np.isinf(before[0]) else _LOOK_S)
                while time.monotonic() < end_s:
                    self._command(wanted)
                seen = [gap for heard_s, gap in self._heard if heard_s > end_s - _LOOK_S]
                off = self._off_um(np.mean(seen, axis=0), wanted)
                # where the machine is busy the way takes longer than the hold
                if np.max(np.abs(off - before)) < _AT_REST_UM or end_s > begun_s + _PATIENCE_S:
                    break
                before = off
            found.append(off)
            self._heard.clear()
        return np.array(found)

    def _off_um(self, gap: Array, wanted: Array) -> Array:
        return 1e6 * self._geometry.displacements_m(gap - wanted)

    def _command(self, motions: Array) -> None:
        self._publisher.publish(JointState(name=list(MOTIONS), position=motions.tolist()))
        self._executor.spin_once(timeout_sec=0.02)

    def _on_gap(self, message: Any) -> None:
        self._heard.append((time.monotonic(), np.array(message.position)))


def measured_errors_um(folder: Path, domain_id: int, n_targets: int = len(TARGETS)) -> dict[str, Array]:
    """Return the errors [um] with the model of all axes and with three separate ones, by name, (n_targets, 3) each.

    Args:
        folder: for the model file and the logs of the nodes.
        domain_id: of the middleware, for nobody else to hear.
        n_targets: how many of the targets.
    """
    environment = private_environment(domain_id)
    model = folder / "stage.yaml"
    write_axes_model(stage_model(), model)

    def process(module: str, namespace: str, name: str, **parameters: Any) -> NodeProcess:
        files = [] if module.startswith("benchmarks") else [CONFIG]
        return NodeProcess(module, namespace, files, parameters, environment, folder / f"{name}.log")

    found: dict[str, Array] = {}
    with ExitStack() as stack:
        stack.enter_context(process("benchmarks.coupled_stage", "/", "stage"))
        for axis in AXES:
            stack.enter_context(process("fomrc_ros.compensator", f"/{axis}", axis))
        stack.enter_context(NodeProcess("fomrc_ros.gap --monitor", "/", [CONFIG], {}, environment, folder / "m.log"))
        probe = GapProbe(domain_id)
        stack.callback(probe.close)
        for name, parameters in (("model of all axes", {"axes_model": model}), ("three separate models", {})):
            with process("fomrc_ros.gap", "/", "command", **parameters):
                probe.until_ready()
                found[name] = probe.errors_um(TARGETS[:n_targets])
    return found


def main() -> None:
    """Print the errors, and their ratio."""
    with tempfile.TemporaryDirectory() as folder:
        found = measured_errors_um(Path(folder), random.randint(1, 100))
    sizes = {name: 1e3 * float(np.sqrt(np.mean(errors**2))) for name, errors in found.items()}
    for name, size_nm in sizes.items():
        print(f"{name}: {size_nm:.2f} nm rms over {len(TARGETS)} gaps")
    together, apart = sizes.values()
    print(f"ratio: {apart / together:.1f}")


if __name__ == "__main__":
    main()
