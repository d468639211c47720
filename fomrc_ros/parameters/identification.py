"""Parameters of the identification node."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from fomrc_core.control.voltage_limits import VoltageLimits
from fomrc_ros.conversions import INTERFACES
from fomrc_ros.node.parameter_files import default_folders
from fomrc_ros.node.parameters import Kind, ParameterSpec
from fomrc_ros.node.voltage_parameters import LIMIT_SPECS
from fomrc_ros.parameters.shared import SERVICE_TIMEOUT, VOLTAGE_INTERFACE

METHODS = ("convex", "paper")


def identification_specs() -> tuple[ParameterSpec, ...]:
    """Return the identification node's parameters."""
    # Long: a table, one entry for each parameter.
    return (
        ParameterSpec("recordings", [], "files to fit: CSV, plain columns, rosbag2", kind=Kind.STRING_ARRAY),
        ParameterSpec("test_recording", "", "file the result is tried on, none if empty"),
        ParameterSpec("columns", "", "columns of files without a header, e.g. time=none,voltage=0,displacement=4"),
        ParameterSpec(
            "topics", "", "topics of rosbag2 folders, e.g. voltage=/axis1/voltage,displacement=/axis1/displacement"
        ),
        ParameterSpec(
            "record_rate_hz",
            0.0,
            "sampling rate of files without a time column, 0 where they have one",
            unit="Hz",
            minimum=0.0,
            maximum=1e7,
        ),
        ParameterSpec("n_elements", 10, "number of elements, 0 for as many as the data support", minimum=0, maximum=60),
        ParameterSpec("method", "convex", "how to fit", choices=METHODS),
        ParameterSpec("output_file", "identified_model.yaml", "model file to write"),
        ParameterSpec("output_folder", "diagnosis", "folder the diagnosis is written to"),
        ParameterSpec("model_file", "", "model a diagnosis begins with, fitted first if empty"),
        ParameterSpec(
            "allowed_folders",
            default_folders(),
            "folders files may be read from and written to",
            is_read_only=True,
        ),
        ParameterSpec("compensator", "compensator", "name of the compensator that is calibrated", is_read_only=True),
        ParameterSpec("interface", "float64", "message type of displacement", choices=INTERFACES, is_read_only=True),
        VOLTAGE_INTERFACE,
        ParameterSpec("joint_name", "piezo", "name of the joint where interface is joint_state", is_read_only=True),
        ParameterSpec(
            "rate_hz",
            1000.0,
            "rate at which a calibration drives the stage",
            unit="Hz",
            minimum=1.0,
            maximum=5000.0,
            is_read_only=True,
        ),
        *LIMIT_SPECS,
        ParameterSpec(
            "calibrate_amplitude_v",
            2.5,
            "largest excursion from the middle of a calibration",
            unit="V",
            minimum=1e-3,
            maximum=1000.0,
        ),
        ParameterSpec("calibrate_slope_v_per_s", 1.0, "slope of the triangle", unit="V/s", minimum=1e-3, maximum=1e4),
        ParameterSpec(
            "calibrate_step_v",
            0.25,
            "height of the staircase's steps",
            unit="V",
            minimum=1e-3,
            maximum=1000.0,
        ),
        ParameterSpec(
            "calibrate_dwell_s",
            3.0,
            "length of the staircase's steps",
            unit="s",
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
            "displacement_timeout_s",
            2.0,
            "a calibration fails where no displacement comes, or the compensator does not follow, for this long",
            unit="s",
            minimum=0.05,
            maximum=60.0,
        ),
        SERVICE_TIMEOUT,
    )


@dataclass(frozen=True)
class IdentificationSettings:
    """The parameter values, checked as a whole."""

    values: Mapping[str, Any]
    limits: VoltageLimits


def build_settings(values: Mapping[str, Any]) -> IdentificationSettings:
    """Return the settings; raises ParameterError where values do not fit together."""
    return IdentificationSettings(dict(values), VoltageLimits.from_values(values))
