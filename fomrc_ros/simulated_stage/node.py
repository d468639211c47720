"""The simulated actuator: voltage in, displacement out, with sensor noise and quantisation."""

from __future__ import annotations

import copy
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from rclpy.node import Node
from rclpy.qos import QoSProfile
from rclpy.task import Future

from fomrc_core.control.held_inputs import HeldInputs
from fomrc_core.control.loop_timing import LoopTiming
from fomrc_core.control.tick_grid import TickGrid
from fomrc_core.errors import InputError, ParameterError
from fomrc_core.plants import electromechanical
from fomrc_ros.conversions import m_to_um, position_interface
from fomrc_ros.node.diagnostics import WARN, DiagnosticsPublisher, Report
from fomrc_ros.node.inbox import Inbox
from fomrc_ros.node.model_parameters import model_from_values
from fomrc_ros.node.parameters import NodeParameters
from fomrc_ros.node.quality_of_service import COMMAND, MEASUREMENT, overridable
from fomrc_ros.node.runtime import run
from fomrc_ros.node.sender import Sender
from fomrc_ros.node.voltage_interface import voltage_interface
from fomrc_ros.parameters.names import WITH_EFFECTS
from fomrc_ros.parameters.simulated_stage import SPECS

# So many voltages wait for a tick that is late: a second of the fastest loop.
_DEPTH = 1000


class Plant(Protocol):
    """Anything stepped by a voltage."""

    def initial_state(self) -> Any:
        """Return the relaxed state."""

    def advance(self, state: Any, voltage_v: float, step_s: float) -> float:
        """Return the displacement [um] after one step; the state moves on."""


@dataclass(frozen=True)
class StageSettings:
    """What the stage simulates and how its sensor sees it."""

    plant: Plant
    noise_um: float
    quantization_um: float


class SimulatedPea(Node):
    """Subscribes ``voltage`` (V), publishes ``displacement`` (m) at ``rate_hz``."""

    def __init__(self) -> None:
        super().__init__("simulated_pea", allow_undeclared_parameters=True)
        self.stopped = Future()
        self._plant: Plant | None = None
        self.parameters = NodeParameters(self, SPECS, self._build, self._apply, WITH_EFFECTS)
        values = self.parameters.values
        self._interface = position_interface(values["interface"], values["joint_name"])
        self._random = np.random.default_rng(values["seed"])
        self._inputs = HeldInputs()
        self._n_voltages = 0
        self._n_refused = 0
        self._refusal = ""
        self._displacement_um = 0.0
        self._apply(self.parameters.settings)
        self._warm_up()
        self.parameters.watch()

        period_s = 1.0 / values["rate_hz"]
        self._grid = TickGrid(period_s)
        self._timing = LoopTiming(period_s)
        self._sender = Sender(self, self._interface.message_type, "displacement", MEASUREMENT)
        self._voltage = voltage_interface(values["voltage_interface"], values["joint_name"])
        self._inbox = Inbox(self)
        self._voltages = self._inbox.subscription(self._voltage.message_type, "voltage", self._voltage_quality())
        self.create_timer(period_s, self._tick)
        self._diagnostics = DiagnosticsPublisher(self, values["joint_name"], self._describe, (self._sender,))

    def request_stop(self) -> None:
        """Stop at once: a simulated stage has nothing to bring to safety."""
        if not self.stopped.done():
            self.stopped.set_result(None)

    def close(self) -> None:
        """Listen no more."""
        self._inbox.close()

    def _voltage_quality(self) -> QoSProfile:
        # A subscription of this node's own declares the parameters that override its quality; then it has served.
        quality = copy.copy(COMMAND)
        quality.depth = _DEPTH
        self.destroy_subscription(
            self.create_subscription(
                self._voltage.message_type,
                "voltage",
                lambda message: None,
                quality,
                qos_overriding_options=overridable(),
            )
        )
        return quality

    def _build(self, values: Mapping[str, Any]) -> StageSettings:
        model = model_from_values(values)
        plant: Plant
        if values["plant"] == "electromechanical":
            if self._plant is None:
                self._plant = electromechanical.table1_plant()
            plant = self._plant
        elif model is None:
            raise ParameterError(
                "plant fomrc needs a model",
                where="model.kappa_um_per_v",
                allowed="a model file given with --params-file",
            )
        else:
            plant = model
        return StageSettings(plant, m_to_um(values["noise_rms_m"]), m_to_um(values["quantization_m"]))

    def _apply(self, settings: StageSettings) -> None:
        before = getattr(self, "_settings", None)
        self._settings = settings
        if before is None or before.plant is not settings.plant:
            # Another actuator: it arrives relaxed, as a real one would after being mounted.
            self._state = settings.plant.initial_state()

    def _warm_up(self) -> None:
        # Compiling the first step takes seconds; it must not fall into the loop.
        self._settings.plant.advance(self._settings.plant.initial_state(), 0.0, 1e-3)

    def _sent_voltages(self) -> list[tuple[float, float]]:
        """Return when [s] which voltages [V] were sent since the last tick; what is none is refused."""
        sent = []
        for message, sent_s in self._voltages():
            try:
                sent.append((self._voltage.time_s(message, sent_s), self._voltage.voltage_v(message)))
                self._n_voltages += 1
            except InputError as error:
                self._n_refused += 1
                self._refusal = str(error)
        return sent

    def _tick(self) -> None:
        began = self._timing.begin()
        now = self.get_clock().now()
        step_s = self._grid.step_s(1e-9 * now.nanoseconds)
        settings = self._settings
        # An actuator does not wait for this process: after a late tick it has been where the voltages brought it.
        sent = self._sent_voltages()
        for voltage_v, part_s in self._inputs.during(sent, 1e-9 * now.nanoseconds, step_s, self._grid.period_s):
            true_um = settings.plant.advance(self._state, voltage_v, part_s)
        seen_um = true_um + settings.noise_um * self._random.standard_normal() if settings.noise_um else true_um
        if settings.quantization_um:
            seen_um = settings.quantization_um * round(seen_um / settings.quantization_um)
        self._displacement_um = seen_um
        self._sender.send(self._interface.to_message(seen_um, now.to_msg()))
        self._timing.end(began)

    def _describe(self) -> Report:
        timing = self._timing.report()
        report = Report(
            values={
                "rate_hz": timing.rate_hz,
                "late_ticks": timing.n_late,
                "largest_gap_ms": 1e3 * timing.latest_s,
                "step_mean_us": 1e6 * timing.busy_mean_s,
                "voltage_v": self._inputs.held,
                "voltage_messages": self._n_voltages,
                "displacement_um": self._displacement_um,
                "refused_messages": self._n_refused,
                "last_refusal": self._refusal,
            }
        )
        if timing.rate_hz < 0.9 / self._grid.period_s and not self.get_parameter("use_sim_time").value:
            report.worsen(WARN, f"runs at {timing.rate_hz:.0f} Hz of {1.0 / self._grid.period_s:.0f}")
        return report


def main(arguments: list[str] | None = None) -> int:
    """Run the node; the entry point of ``ros2 run fomrc_ros simulated_pea``."""
    return run(SimulatedPea, arguments)
