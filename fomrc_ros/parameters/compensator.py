"""Parameters of the compensator node, and the settings they make."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from fomrc_core.control.actuator_drive import DriveSettings
from fomrc_core.control.compensation_loop import LoopSettings
from fomrc_core.control.gain_margin import largest_bandwidth_hz
from fomrc_core.control.voltage_limits import VoltageLimits
from fomrc_core.errors import ParameterError
from fomrc_core.model.compensator import Compensator
from fomrc_core.model.piezo_model import PiezoModel
from fomrc_core.model.preview_inverse import LONGEST_PREVIEW_S, PreviewInverse
from fomrc_ros.conversions import INTERFACES, m_to_um
from fomrc_ros.node.model_parameters import MODEL_SPECS, model_from_values
from fomrc_ros.node.parameter_files import default_folders, started_with
from fomrc_ros.node.parameters import ParameterSpec
from fomrc_ros.node.voltage_parameters import LIMIT_SPECS, POLICIES
from fomrc_ros.parameters.shared import VOLTAGE_INTERFACE


def compensator_specs() -> tuple[ParameterSpec, ...]:
    """Return the compensator's parameters."""
    # Long: a table, one entry for each parameter.
    return (
        ParameterSpec(
            "rate_hz",
            1000.0,
            "rate of the loop and of voltage",
            unit="Hz",
            minimum=1.0,
            maximum=5000.0,
            is_read_only=True,
        ),
        ParameterSpec(
            "autostart",
            True,
            "configure and activate at start, without a lifecycle manager",
            is_read_only=True,
        ),
        ParameterSpec(
            "interface", "float64", "message type of desired_position", choices=INTERFACES, is_read_only=True
        ),
        VOLTAGE_INTERFACE,
        ParameterSpec(
            "voltage_promises",
            False,
            "promise deadline and liveliness on voltage, so that a driver is told when they are broken",
            is_read_only=True,
        ),
        ParameterSpec("joint_name", "piezo", "name of the joint where interface is joint_state", is_read_only=True),
        *LIMIT_SPECS,
        ParameterSpec(
            "stale_after_s",
            1.0,
            "age at which a target counts as stale, 0 for never",
            unit="s",
            minimum=0.0,
            maximum=1e6,
        ),
        ParameterSpec(
            "stale_policy",
            "hold",
            "on a stale target: hold it, creep compensation going on, or ramp to the safe voltage",
            choices=POLICIES,
        ),
        ParameterSpec(
            "stop_policy",
            "ramp",
            "on deactivate and shutdown: hold the last voltage or ramp to the safe one",
            choices=POLICIES,
        ),
        ParameterSpec(
            "relax_amplitude_v",
            2.5,
            "first amplitude of the relaxation routine (27)-(28)",
            unit="V",
            minimum=1e-3,
            maximum=1000.0,
        ),
        ParameterSpec(
            "relax_duration_s",
            10.0,
            "duration of the relaxation routine",
            unit="s",
            minimum=0.1,
            maximum=600.0,
        ),
        ParameterSpec(
            "relax_frequency_hz",
            10.0,
            "frequency of the relaxation routine",
            unit="Hz",
            minimum=0.01,
            maximum=100.0,
        ),
        ParameterSpec(
            "lease_s",
            2.0,
            "how long a borrower of the voltage may be silent before it is taken back and ramped to the safe one",
            unit="s",
            minimum=0.1,
            maximum=60.0,
        ),
        ParameterSpec(
            "history_s",
            120.0,
            "how much of the past is kept sample by sample for a changed creep order; thirty times as much in outline",
            unit="s",
            minimum=1.0,
            maximum=3600.0,
            is_read_only=True,
        ),
        ParameterSpec(
            "preview_s",
            0.0,
            "how late targets are followed, so that resonances, delays and the amplifier are undone; 0: at once",
            unit="s",
            minimum=0.0,
            maximum=LONGEST_PREVIEW_S,
            is_read_only=True,
        ),
        ParameterSpec(
            "arrival_tolerance_m",
            0.0,
            "how near the target counts as arrived, on ~/arrived; 0 for never",
            unit="m",
            minimum=0.0,
            maximum=1e-2,
        ),
        ParameterSpec(
            "feedback",
            False,
            "add an integral correction by displacement, where there is a sensor",
            is_read_only=True,
        ),
        ParameterSpec(
            "feedback_bandwidth_hz",
            1.0,
            "bandwidth of the correction; refused where the model leaves a gain margin below 6 dB",
            unit="Hz",
            minimum=1e-3,
            maximum=2500.0,
        ),
        ParameterSpec(
            "checkpoint_file",
            "",
            "file that keeps the memory over a restart, none if empty",
            is_read_only=True,
        ),
        ParameterSpec(
            "checkpoint_period_s",
            1.0,
            "time between two checkpoints; a journal keeps the ticks between",
            unit="s",
            minimum=0.1,
            maximum=3600.0,
            is_read_only=True,
        ),
        ParameterSpec("parameters_file", started_with(), "file that ~/reload_parameters reads"),
        ParameterSpec(
            "allowed_folders",
            default_folders(),
            "folders files may be read from and written to",
            is_read_only=True,
        ),
        *MODEL_SPECS,
    )


@dataclass(frozen=True)
class CompensatorSettings:
    """Everything that can change while the node runs.

    Args:
        compensator: of the model, None while no model has been given.
        loop: limits and policies of the loop.
        drive: what every voltage keeps to, whoever asks for it.
        relax_amplitude_v: first amplitude of the relaxation routine [V].
        relax_duration_s: its duration [s].
        relax_frequency_hz: its frequency [Hz].
        preview: undoes dynamics with the target's future; None where targets are followed at once.
        arrival_tolerance_um: how near the target counts as arrived [um]; 0 where nobody asks.
        feedback_bandwidth_hz: of the correction by a sensor [Hz]; 0 without one.
    """

    compensator: Compensator | None
    loop: LoopSettings
    drive: DriveSettings
    relax_amplitude_v: float
    relax_duration_s: float
    relax_frequency_hz: float
    preview: PreviewInverse | None = None
    arrival_tolerance_um: float = 0.0
    feedback_bandwidth_hz: float = 0.0


class SettingsBuilder:
    """Make settings of parameter values; a compensator is made anew only where the model changed."""

    def __init__(self) -> None:
        self._model_values: dict[str, Any] = {}
        self._compensator: Compensator | None = None
        self._preview: PreviewInverse | None = None
        self._model: PiezoModel | None = None

    def __call__(self, values: Mapping[str, Any]) -> CompensatorSettings:
        """Return the settings.

        Raises:
            ParameterError: values that do not fit together.
        """
        limits = VoltageLimits.from_values(values)
        amplitude = values["relax_amplitude_v"]
        if not limits.minimum_v <= 0.0 <= limits.maximum_v and not amplitude < limits.maximum_v - limits.minimum_v:
            raise ParameterError("wider than the voltage limits", where="relax_amplitude_v", value=amplitude)
        if values["preview_s"] > values["history_s"]:
            raise ParameterError(
                "longer than the history", where="preview_s", value=values["preview_s"], allowed="up to history_s"
            )
        return CompensatorSettings(
            self._made(values),
            LoopSettings(
                limits,
                values["stale_after_s"],
                values["stale_policy"] == "ramp",
                1.0 / values["rate_hz"],
                values["history_s"],
            ),
            DriveSettings(limits, values["stop_policy"] == "ramp", values["lease_s"]),
            amplitude,
            values["relax_duration_s"],
            values["relax_frequency_hz"],
            self._preview,
            m_to_um(values["arrival_tolerance_m"]),
            self._feedback_bandwidth_hz(values) if values["feedback"] else 0.0,
        )

    def _feedback_bandwidth_hz(self, values: Mapping[str, Any]) -> float:
        """Return the bandwidth [Hz]; raises ParameterError where the model does not bear it."""
        bandwidth_hz: float = values["feedback_bandwidth_hz"]
        # Without a model as with one that has no dynamics: the loop's own two periods count.
        effects = () if self._model is None else self._model.effects
        largest_hz = largest_bandwidth_hz(effects, 1.0 / values["rate_hz"])
        if bandwidth_hz > largest_hz:
            raise ParameterError(
                "gain margin below 6 dB by the model",
                where="feedback_bandwidth_hz",
                value=bandwidth_hz,
                allowed=f"up to {math.floor(1e3 * largest_hz) / 1e3:.4g} Hz",
            )
        return bandwidth_hz

    def _made(self, values: Mapping[str, Any]) -> Compensator | None:
        model_values = {name: value for name, value in values.items() if name.startswith("model.")}
        if model_values != self._model_values or self._compensator is None:
            model = model_from_values(values)
            preview = compensator = None
            if model is not None and values["preview_s"] > 0.0:
                preview = PreviewInverse.of(model, 1.0 / values["rate_hz"], values["preview_s"])
                compensator = warmed_up(preview.core)
                preview.warm_up()
            elif model is not None:
                compensator = warmed_up(Compensator(model))
            self._model, self._compensator, self._preview = model, compensator, preview
            self._model_values = model_values
        return self._compensator


def warmed_up(compensator: Compensator) -> Compensator:
    """Return the compensator after one step on a throw-away state, so that nothing is compiled in the loop."""
    try:
        compensator.advance(compensator.initial_state(), 0.0, 1e-3)
    except (ArithmeticError, ValueError) as error:
        raise ParameterError(f"the model cannot be inverted: {error}", where="model") from None
    return compensator
