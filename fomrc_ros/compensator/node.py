"""The compensator: desired displacement in, voltage out, as a managed (lifecycle) node."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any

from rclpy.lifecycle import LifecycleNode, LifecycleState, TransitionCallbackReturn
from rclpy.task import Future
from std_msgs.msg import Float64

from fomrc_core.control.checkpoint import CheckpointWriter, discard_checkpoint, read_checkpoint
from fomrc_core.control.compensation_loop import CompensationLoop
from fomrc_core.control.loop_timing import LoopTiming
from fomrc_core.control.tick_grid import TickGrid
from fomrc_core.errors import FomrcError, StorageError
from fomrc_ros.compensator.parameters import CompensatorSettings, SettingsBuilder, compensator_specs
from fomrc_ros.compensator.report import describe
from fomrc_ros.compensator.services import CompensatorServices
from fomrc_ros.conversions import position_interface
from fomrc_ros.node.diagnostics import DiagnosticsPublisher, Report
from fomrc_ros.node.lifecycle_log import logged
from fomrc_ros.node.model_parameters import effect_spec, parameters_of_effects
from fomrc_ros.node.parameter_files import confined_path
from fomrc_ros.node.parameters import NodeParameters
from fomrc_ros.node.quality_of_service import COMMAND, overridable
from fomrc_ros.node.runtime import run

_SAID_AGAIN_AFTER_S = 5.0
# A ramp that has not ended by this much after its due time has no clock to end by.
_STOP_GRACE_S = 1.0


class CompensatorNode(LifecycleNode):
    """Subscribes ``desired_position`` (m), publishes ``voltage`` (std_msgs/Float64, V) at ``rate_hz``."""

    def __init__(self) -> None:
        super().__init__("compensator", allow_undeclared_parameters=True)
        self.stopped = Future()
        self.problem = ""
        self.loop: CompensationLoop | None = None
        self.checkpoint: CheckpointWriter | None = None
        self.n_refused = 0
        self.last_refusal = ""
        self.is_active = False
        self._stop_deadline_s: float | None = None
        self.parameters = NodeParameters(
            self, compensator_specs(), SettingsBuilder(), self._apply, effect_spec, parameters_of_effects
        )
        values = self.parameters.values
        self.parameters.watch()
        self.period_s = 1.0 / values["rate_hz"]
        self.timing = LoopTiming(self.period_s)
        self._grid = TickGrid(self.period_s)
        self._interface = position_interface(values["interface"], values["joint_name"])
        self._publisher = self.create_lifecycle_publisher(
            Float64, "voltage", COMMAND, qos_overriding_options=overridable()
        )
        self.create_subscription(
            self._interface.message_type,
            "desired_position",
            self._on_target,
            COMMAND,
            qos_overriding_options=overridable(),
        )
        self.create_subscription(
            self._interface.message_type,
            "cross_position",
            self._on_cross,
            COMMAND,
            qos_overriding_options=overridable(),
        )
        self._message = Float64()
        self._timer = self.create_timer(self.period_s, self._tick)
        self._timer.cancel()
        self._services_offered = CompensatorServices(self)
        self._diagnostics = DiagnosticsPublisher(self, values["joint_name"], self._describe)

    @property
    def settings(self) -> CompensatorSettings:
        """The settings in force."""
        settings: CompensatorSettings = self.parameters.settings
        return settings

    @property
    def is_stopping(self) -> bool:
        """Whether the node has been told to stop."""
        return self._stop_deadline_s is not None

    def autostart(self) -> None:
        """Configure and activate where the parameter ``autostart`` says so."""
        if self.parameters.values["autostart"] and self.trigger_configure() == TransitionCallbackReturn.SUCCESS:
            self.trigger_activate()

    # lifecycle

    @logged
    def on_configure(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Begin with the memory of the checkpoint, or with a relaxed actuator."""
        settings = self.settings
        if settings.compensator is None:
            raise FomrcError(
                "no model: start with --params-file MODEL.yaml, or set model.kappa_um_per_v, "
                "model.saturation_v and model.creep_order atomically"
            )
        self.problem = ""
        checkpoint_file = self.parameters.values["checkpoint_file"]
        if checkpoint_file:
            path = confined_path(checkpoint_file, self.parameters.values["allowed_folders"], "checkpoint_file")
            self._resume(path)
            self.checkpoint = CheckpointWriter(path, self.parameters.values["checkpoint_period_s"])
        if self.loop is None:
            self.loop = CompensationLoop(settings.compensator, settings.loop)
        return super().on_configure(state)

    @logged
    def on_activate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Begin to publish."""
        result = super().on_activate(state)
        self.is_active = True
        self._timer.reset()
        return result

    @logged
    def on_deactivate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Bring the voltage to where it may stay, then stop publishing."""
        self._timer.cancel()
        self._services_offered.end_routine("deactivated")
        self._ramp_now()
        self.is_active = False
        return super().on_deactivate(state)

    @logged
    def on_cleanup(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Forget the memory; the checkpoint stays."""
        self._release()
        return super().on_cleanup(state)

    @logged
    def on_shutdown(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Bring the voltage to where it may stay, and end."""
        self._timer.cancel()
        self._services_offered.end_routine("shut down")
        if self.is_active:
            self._ramp_now()
        self.is_active = False
        self._release()
        if not self.stopped.done():
            self.stopped.set_result(None)
        return super().on_shutdown(state)

    @logged
    def on_error(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Stop publishing and go back to unconfigured, from where it can be configured again."""
        self._timer.cancel()
        self.is_active = False
        self._release()
        return TransitionCallbackReturn.SUCCESS

    def _release(self) -> None:
        if self.checkpoint is not None:
            self.checkpoint.close()
            self.checkpoint = None
        self.loop = None

    def _resume(self, path: Path) -> None:
        compensator = self.settings.compensator
        assert compensator is not None
        try:
            resumed = read_checkpoint(path, compensator, self.period_s)
        except StorageError as error:
            aside = discard_checkpoint(path)
            self.problem = f"checkpoint refused ({error}); moved to {aside.name}; the memory is unknown: call ~/relax"
            self.get_logger().error(self.problem)
            return
        if resumed is None:
            return
        self.loop = CompensationLoop(
            compensator, self.settings.loop, resumed.memory, resumed.voltage_v, resumed.target_um
        )
        exactness = "" if resumed.is_exact else "; another model was in force then, its memory was taken over"
        self.get_logger().info(f"memory resumed after {resumed.down_time_s:.3f} s{exactness}")

    def request_stop(self) -> None:
        """Ramp to the safe voltage where the policy says so, then end; called until it has."""
        now = time.monotonic()
        if self._stop_deadline_s is None:
            self._services_offered.end_routine("shutting down")
            limits = self.settings.loop.limits
            travel_v = limits.maximum_v - limits.minimum_v
            ramp_s = travel_v / min(limits.safe_ramp_v_per_s, limits.slew_v_per_s)
            self._stop_deadline_s = now + (_STOP_GRACE_S + ramp_s if self._ramps_to_stop() else 0.0)
        elif self.stopped.done():
            return
        loop = self.loop
        is_safe = loop is None or loop.voltage_v == self.settings.loop.limits.safe_v
        if not self._ramps_to_stop() or is_safe or now >= self._stop_deadline_s:
            self.trigger_shutdown()

    def _ramps_to_stop(self) -> bool:
        has_driven = self.loop is not None and self.loop.target_um is not None
        return self.is_active and has_driven and self.settings.ramps_on_stop

    def _ramp_now(self) -> None:
        # Within a transition nothing else may run, so the ramp is driven from here, by the real clock.
        loop = self.loop
        if loop is None or not self._ramps_to_stop():
            return
        due = time.monotonic()
        while loop.voltage_v != self.settings.loop.limits.safe_v:
            self._publish(loop, loop.tick_to_safe(self.period_s), self.period_s)
            due += self.period_s
            time.sleep(max(due - time.monotonic(), 0.0))

    # the loop

    def _on_target(self, message: Any) -> None:
        try:
            target_um = self._interface.to_um(message)
        except FomrcError as error:
            self._refuse("desired_position", error)
            return
        if self.is_active and self.loop is not None:
            self.loop.set_target(target_um)

    def _on_cross(self, message: Any) -> None:
        try:
            cross_um = self._interface.to_um(message)
        except FomrcError as error:
            self._refuse("cross_position", error)
            return
        if self.loop is not None:
            self.loop.cross = cross_um

    def _refuse(self, topic: str, error: FomrcError) -> None:
        self.n_refused += 1
        self.last_refusal = str(error)
        self.get_logger().warning(f"{topic} refused: {error}", throttle_duration_sec=_SAID_AGAIN_AFTER_S)

    def _tick(self) -> None:
        loop = self.loop
        if loop is None or not self.is_active:
            return
        began = self.timing.begin()
        step_s = self._grid.step_s(1e-9 * self.get_clock().now().nanoseconds)
        voltage_v = loop.tick_to_safe(step_s) if self.is_stopping and self._ramps_to_stop() else loop.tick(step_s)
        if voltage_v is not None:
            self._publish(loop, voltage_v, step_s)
        if not loop.is_in_routine:
            self._services_offered.finish_relaxing("")
        self.timing.end(began)

    def _publish(self, loop: CompensationLoop, voltage_v: float, step_s: float) -> None:
        self._message.data = voltage_v
        self._publisher.publish(self._message)
        if self.checkpoint is not None:
            is_new, loop.is_discontinuous = loop.is_discontinuous, False
            self.checkpoint.note(
                loop.compensator,
                loop.memory,
                step_s,
                loop.followed_um,
                loop.cross,
                voltage_v,
                is_discontinuous=is_new,
            )

    def _apply(self, settings: CompensatorSettings) -> None:
        loop = self.loop
        if loop is None:
            return
        loop.settings = settings.loop
        if settings.compensator is not None and settings.compensator is not loop.newest_compensator:
            loop.swap(settings.compensator)

    def _describe(self) -> Report:
        return describe(self)


def make_node() -> CompensatorNode:
    """Return the node, started as ``autostart`` says."""
    node = CompensatorNode()
    node.autostart()
    return node


def main(arguments: list[str] | None = None) -> int:
    """Run the node; the entry point of ``ros2 run fomrc_ros compensator``."""
    return run(make_node, arguments)
