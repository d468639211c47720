"""The compensator: desired displacement in, voltage out, as a managed (lifecycle) node."""

from __future__ import annotations

import math
import time
from pathlib import Path
from typing import Any

from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState
from rclpy.lifecycle import LifecycleNode, LifecycleState, TransitionCallbackReturn
from rclpy.task import Future

from fomrc_core.control.actuator_drive import MEMORY_UNKNOWN, ActuatorDrive
from fomrc_core.control.checkpoint import CheckpointWriter, discard_checkpoint, read_checkpoint
from fomrc_core.control.compensation_loop import CompensationLoop
from fomrc_core.control.loop_timing import LoopTiming
from fomrc_core.control.tick_grid import TickGrid
from fomrc_core.errors import FomrcError, StorageError
from fomrc_ros.compensator.lending import LendingServices
from fomrc_ros.compensator.motion_topics import MotionTopics
from fomrc_ros.compensator.report import Condition, Refusals, describe
from fomrc_ros.compensator.services import RelaxServices, ReloadService
from fomrc_ros.compensator.trajectory_topic import TrajectoryTopic
from fomrc_ros.conversions import position_interface
from fomrc_ros.node.diagnostics import DiagnosticsPublisher, Report
from fomrc_ros.node.lifecycle_log import logged
from fomrc_ros.node.other_publishers import other_publishers
from fomrc_ros.node.parameter_files import confined_path
from fomrc_ros.node.parameters import NodeParameters
from fomrc_ros.node.quality_of_service import COMMAND, overridable
from fomrc_ros.node.runtime import run, steady_clock
from fomrc_ros.node.sender import Sender
from fomrc_ros.node.voltage_interface import voltage_interface, voltage_quality
from fomrc_ros.node.worker_process import WorkerRunner
from fomrc_ros.parameters.compensator import CompensatorSettings, SettingsBuilder, compensator_specs
from fomrc_ros.parameters.names import WITH_EFFECTS

_SAID_AGAIN_AFTER_S = 5.0
_WATCH_PERIOD_S = 0.05
# A clock that has not moved for this long stands still; what must end is then ended by the machine's own.
_STANDSTILL_S = 1.0
# Transitions that leave the active state, by number as by name.
_LEAVING_IDS = tuple(
    str(number)
    for number in (
        Transition.TRANSITION_DEACTIVATE,
        Transition.TRANSITION_ACTIVE_SHUTDOWN,
        Transition.TRANSITION_INACTIVE_SHUTDOWN,
    )
)


class CompensatorNode(LifecycleNode):
    """Subscribes ``desired_position`` (m), publishes ``voltage`` (V) at ``rate_hz``."""

    def __init__(self) -> None:
        super().__init__("compensator", allow_undeclared_parameters=True)
        self.stopped = Future()
        self._checkpoint: CheckpointWriter | None = None
        self._refusals = Refusals()
        self._has_been_told_to_stop = self._has_ended = False
        self._waiting_for_stop: list[Future] = []
        self.parameters = NodeParameters(self, compensator_specs(), SettingsBuilder(), self._apply, WITH_EFFECTS)
        values = self.parameters.values
        self._drive = ActuatorDrive(self.settings.drive)
        self.parameters.watch()
        self._period_s = 1.0 / values["rate_hz"]
        self._timing = LoopTiming(self._period_s)
        self._grid = TickGrid(self._period_s)
        self._interface = position_interface(values["interface"], values["joint_name"])
        # Not a managed publisher: the ramp to the safe voltage goes on where the node is no longer active.
        self._voltage = voltage_interface(values["voltage_interface"], values["joint_name"])
        quality = voltage_quality(self._period_s, values["voltage_promises"])
        self._sender = Sender(self, self._voltage.message_type, "voltage", quality)
        for topic, callback in (("desired_position", self._on_target), ("cross_position", self._on_cross)):
            self.create_subscription(
                self._interface.message_type, topic, callback, COMMAND, qos_overriding_options=overridable()
            )
        self._ticked_at_s = time.monotonic()
        self._stands_still = False
        self._timer = self.create_timer(self._period_s, self._tick)
        self._timer.cancel()
        self.create_timer(_WATCH_PERIOD_S, self._watch, clock=steady_clock())
        self._relaxing = RelaxServices(self, self._drive, lambda: self.settings)
        self._work = WorkerRunner(self)
        ReloadService(self, self.parameters, self._work)
        LendingServices(self, self._drive, self._sender.topic_name)
        TrajectoryTopic(self, self._drive, values["joint_name"], self._refuse)
        self._motion = MotionTopics(self, self._interface, self.settings, self._period_s)
        # The change of state waits for the ramp that comes before it, and holds nothing else up meanwhile.
        self._change_state = self._service_change_state.callback
        self._service_change_state.callback = self._on_change_state
        self._diagnostics = DiagnosticsPublisher(self, values["joint_name"], self._describe, (self._sender,))

    @property
    def settings(self) -> CompensatorSettings:
        """The settings in force."""
        settings: CompensatorSettings = self.parameters.settings
        return settings

    @property
    def problem(self) -> str:
        """What the user should know of and act on."""
        return self._drive.problem

    @problem.setter
    def problem(self, problem: str) -> None:
        self._drive.problem = problem

    def autostart(self) -> None:
        """Configure and activate where the parameter ``autostart`` says so."""
        if self.parameters.values["autostart"] and self.trigger_configure() == TransitionCallbackReturn.SUCCESS:
            self.trigger_activate()

    def close(self) -> None:
        """End what runs beside the node."""
        self._work.cancel("the node is shutting down")

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
        loop = None
        if checkpoint_file:
            path = confined_path(checkpoint_file, self.parameters.values["allowed_folders"], "checkpoint_file")
            loop = self._resumed(path)
            self._checkpoint = CheckpointWriter(path, self.parameters.values["checkpoint_period_s"])
        refusal = self.problem
        loop = loop or CompensationLoop(settings.compensator, settings.loop, preview=settings.preview)
        self._drive.take_loop(loop)
        self._motion.apply(settings)
        self._motion.begin(loop)
        self.problem = refusal or self.problem
        return super().on_configure(state)

    @logged
    def on_activate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Begin to publish."""
        result = super().on_activate(state)
        self._drive.end_stop()
        self._drive.is_active = True
        return result

    @logged
    def on_deactivate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Publish nothing more; the voltage is where it may stay, see ``_on_change_state``."""
        self._relaxing.end("deactivated")
        self._drive.is_active = False
        self._drive.end_stop()
        return super().on_deactivate(state)

    @logged
    def on_cleanup(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Forget the memory; the checkpoint stays."""
        self._release()
        return super().on_cleanup(state)

    @logged
    def on_shutdown(self, state: LifecycleState) -> TransitionCallbackReturn:
        """End; the voltage is where it may stay, see ``_on_change_state`` and ``request_stop``."""
        self._relaxing.end("shut down")
        self._drive.is_active = False
        self._release()
        self._has_ended = True
        return super().on_shutdown(state)

    @logged
    def on_error(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Bring the voltage to safety and go back to unconfigured, from where it can be configured again."""
        self._relaxing.end(self.problem)
        self._drive.fail(self.problem)
        self._drive.is_active = False
        self._release()
        return TransitionCallbackReturn.SUCCESS

    def _release(self) -> None:
        if self._checkpoint is not None:
            self._checkpoint.close()
            self._checkpoint = None
        self._drive.take_loop(None)

    def _resumed(self, path: Path) -> CompensationLoop | None:
        compensator = self.settings.compensator
        assert compensator is not None
        limits = self.settings.loop.limits
        try:
            resumed = read_checkpoint(path, compensator, self._period_s)
            if resumed is not None and limits.clamp(resumed.voltage_v) != resumed.voltage_v:
                raise StorageError(
                    "its voltage lies beyond the limits",
                    where=str(path),
                    value=resumed.voltage_v,
                    allowed=f"{limits.minimum_v:g} to {limits.maximum_v:g} V",
                )
        except StorageError as error:
            # Raises where it is not ours to move: then it must not be written over either.
            aside = discard_checkpoint(path)
            self.problem = f"checkpoint refused ({error}); moved to {aside.name}; {MEMORY_UNKNOWN}"
            self.get_logger().error(self.problem)
            return None
        if resumed is None:
            return None
        exactness = "" if resumed.is_exact else "; another model was in force then, its memory was taken over"
        self.get_logger().info(f"memory resumed after {resumed.down_time_s:.3f} s{exactness}")
        added_um = resumed.correction_um if self._motion.uses_sensor else 0.0
        loop = CompensationLoop(
            compensator,
            self.settings.loop,
            resumed.memory,
            resumed.voltage_v,
            resumed.target_um - added_um,
            preview=self.settings.preview,
        )
        loop.correction_um = added_um
        return loop

    async def _on_change_state(
        self, request: ChangeState.Request, response: ChangeState.Response
    ) -> ChangeState.Response:
        if self._drive.is_stopping:
            response.success = False
            return response
        name = request.transition.label or str(request.transition.id)
        if self._drive.needs_ticks and (name.endswith(("deactivate", "shutdown")) or name in _LEAVING_IDS):
            self._relaxing.end(f"ended by {name}")
            if self._drive.begin_stop():
                at_rest = Future(executor=self.executor)
                self._waiting_for_stop.append(at_rest)
                await at_rest
        if self._has_been_told_to_stop:
            response.success = False
            return response
        response = self._change_state(request, response)
        self._drive.end_stop()
        return response

    def request_stop(self) -> None:
        """Ramp to the safe voltage where the policy says so, then end; called until it has."""
        if self._has_ended:
            return
        if not self._has_been_told_to_stop:
            self._has_been_told_to_stop = True
            self._relaxing.end("shutting down")
            self._drive.begin_stop()
        if not self._drive.is_ramping:
            self.trigger_shutdown()

    # the loop

    def _on_target(self, message: Any) -> None:
        try:
            target_um = self._interface.to_um(message)
        except FomrcError as error:
            self._refuse("desired_position", error)
            return
        if self._drive.is_active and self._drive.loop is not None:
            self._drive.loop.set_target(target_um)

    def _on_cross(self, message: Any) -> None:
        try:
            cross_um = self._interface.to_um(message)
        except FomrcError as error:
            self._refuse("cross_position", error)
            return
        if self._drive.loop is not None:
            self._drive.loop.cross = cross_um

    def _refuse(self, topic: str, error: FomrcError) -> None:
        self._refusals.n_refused += 1
        self._refusals.last = str(error)
        self.get_logger().warning(f"{topic} refused: {error}", throttle_duration_sec=_SAID_AGAIN_AFTER_S)

    def _watch(self) -> None:
        """Run the loop's timer where there is something to drive, and end ramps where the clock stands still."""
        if self._has_ended and not self.stopped.done():
            # Here, not in the transition: whoever asked for it by service has its answer by now.
            self.stopped.set_result(None)
        if self._drive.needs_ticks and self._timer.is_canceled():
            self._ticked_at_s = time.monotonic()
            self._timer.reset()
        elif not self._drive.needs_ticks and not self._timer.is_canceled():
            self._timer.cancel()
        silent_s = time.monotonic() - self._ticked_at_s
        must_end = self._drive.is_ramping or self._drive.is_lent
        if must_end and silent_s > (_WATCH_PERIOD_S if self._stands_still else _STANDSTILL_S):
            self._stands_still = True
            self._drive_one(min(silent_s, _WATCH_PERIOD_S))
        if not self._drive.is_ramping:
            waiting, self._waiting_for_stop = self._waiting_for_stop, []
            for at_rest in waiting:
                at_rest.set_result(None)

    def _tick(self) -> None:
        began = self._timing.begin()
        self._stands_still = False
        self._drive_one(self._grid.step_s(1e-9 * self.get_clock().now().nanoseconds))
        self._relaxing.after_tick()
        self._timing.end(began)

    def _drive_one(self, step_s: float) -> None:
        self._ticked_at_s = time.monotonic()
        try:
            self._motion.before_tick(self._drive.loop)
            voltage_v = self._drive.tick(step_s, self._ticked_at_s, self._grid.clock_s)
            if voltage_v is not None:
                self._publish(voltage_v)
            self._motion.after_tick(self._drive.loop)
        except Exception as error:
            # Raised into the executor it would take the node down, and leave the voltage where it is.
            self.get_logger().error(f"the loop failed: {type(error).__name__}: {error}")
            self._drive.fail(f"the loop failed ({type(error).__name__}: {error}): configure anew, then call ~/relax")

    def _publish(self, voltage_v: float) -> None:
        # Whatever has gone wrong before, nothing leaves that is beyond the limits in force.
        if not math.isfinite(voltage_v) or voltage_v != self.settings.loop.limits.clamp(voltage_v):
            raise FomrcError(f"{voltage_v!r} V was about to be published")
        self._sender.send(self._voltage.to_message(voltage_v, self.get_clock().now().to_msg()))
        loop = self._drive.loop
        if self._checkpoint is not None and loop is not None:
            is_new, loop.is_discontinuous = loop.is_discontinuous, False
            self._checkpoint.note(
                loop.compensator,
                loop.memory,
                loop.moves,
                loop.followed_um,
                voltage_v,
                correction_um=loop.correction_um,
                is_discontinuous=is_new,
            )

    def _apply(self, settings: CompensatorSettings) -> None:
        self._drive.settings = settings.drive
        loop = self._drive.loop
        if loop is None:
            return
        loop.settings = settings.loop
        self._motion.apply(settings)
        if settings.compensator is not None and settings.compensator is not loop.newest_compensator:
            loop.swap(settings.compensator, settings.preview)

    def _describe(self) -> Report:
        report = describe(
            Condition(
                self._drive,
                self._timing.report(),
                self._timing.n_late_total,
                self._period_s,
                self.parameters.values,
                self._refusals,
                self._checkpoint,
                other_publishers(self, self._sender.topic_name),
                not self.get_parameter("use_sim_time").value,
            )
        )
        self._motion.describe(report)
        return report


def make_node() -> CompensatorNode:
    """Return the node, started as ``autostart`` says."""
    node = CompensatorNode()
    node.autostart()
    return node


def main(arguments: list[str] | None = None) -> int:
    """Run the node; the entry point of ``ros2 run fomrc_ros compensator``."""
    return run(make_node, arguments)
