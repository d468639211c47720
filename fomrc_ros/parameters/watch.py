"""Parameters of the watch."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from fomrc_core.diagnosis.watch.model_watch import WatchSettings
from fomrc_core.model.piezo_model import PiezoModel
from fomrc_ros.conversions import INTERFACES
from fomrc_ros.node.model_parameters import MODEL_SPECS, model_from_values
from fomrc_ros.node.parameter_files import default_folders
from fomrc_ros.node.parameters import ParameterSpec
from fomrc_ros.parameters.shared import SERVICE_TIMEOUT, VOLTAGE_INTERFACE

_USUAL = WatchSettings()


def watch_specs() -> tuple[ParameterSpec, ...]:
    """Return the watch's parameters."""
    # Long: a table, one entry for each parameter.
    return (
        ParameterSpec(
            "compensator", "compensator", "whose model is watched; empty: the one in model.*", is_read_only=True
        ),
        ParameterSpec("interface", "float64", "message type of displacement", choices=INTERFACES, is_read_only=True),
        VOLTAGE_INTERFACE,
        ParameterSpec("joint_name", "piezo", "name of the joint where interface is joint_state", is_read_only=True),
        ParameterSpec(
            "false_alarms_per_day",
            _USUAL.false_alarms_per_day,
            "mean number of false alarms in a day of normal work",
            unit="1/d",
            minimum=1e-6,
            maximum=100.0,
            is_read_only=True,
        ),
        ParameterSpec(
            "learn_s",
            _USUAL.learn_s,
            "motion that normal work is learnt from",
            unit="s",
            minimum=10.0,
            maximum=1e5,
            is_read_only=True,
        ),
        ParameterSpec(
            "follow_s",
            _USUAL.follow_s,
            "how long after an alarm a diagnosis waits for data",
            unit="s",
            minimum=1.0,
            maximum=600.0,
            is_read_only=True,
        ),
        ParameterSpec(
            "memory_s",
            _USUAL.memory_s,
            "how much of the recent past is kept for it",
            unit="s",
            minimum=60.0,
            maximum=3600.0,
            is_read_only=True,
        ),
        ParameterSpec("auto_apply", False, "hand an extended model that is better to the compensator, if it passes"),
        ParameterSpec("output_folder", "watch", "folder for the log and a page of each change", is_read_only=True),
        ParameterSpec(
            "allowed_folders", default_folders(), "folders files may be read from and written to", is_read_only=True
        ),
        SERVICE_TIMEOUT,
        *MODEL_SPECS,
    )


@dataclass(frozen=True)
class WatchNodeSettings:
    """The parameter values, checked as a whole."""

    values: Mapping[str, Any]
    watch: WatchSettings
    model: PiezoModel | None


def build_settings(values: Mapping[str, Any]) -> WatchNodeSettings:
    """Return the settings; raises ParameterError where values do not fit together."""
    settings = WatchSettings(
        values["false_alarms_per_day"],
        learn_s=values["learn_s"],
        memory_s=values["memory_s"],
        follow_s=values["follow_s"],
    )
    return WatchNodeSettings(dict(values), settings, model_from_values(values))
