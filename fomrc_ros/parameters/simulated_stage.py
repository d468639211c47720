"""Parameters of the simulated stage."""

from __future__ import annotations

from fomrc_ros.conversions import INTERFACES
from fomrc_ros.node.model_parameters import MODEL_SPECS
from fomrc_ros.node.parameters import ParameterSpec
from fomrc_ros.parameters.shared import VOLTAGE_INTERFACE

PLANTS = ("electromechanical", "fomrc")

SPECS = (
    ParameterSpec(
        "rate_hz",
        1000.0,
        "rate of the plant's steps and of displacement",
        unit="Hz",
        minimum=1.0,
        maximum=5000.0,
        is_read_only=True,
    ),
    ParameterSpec(
        "plant",
        "electromechanical",
        "what is simulated: the circuit and mechanics of (3)-(10), or the model in the parameters model.*",
        choices=PLANTS,
        is_read_only=True,
    ),
    ParameterSpec("noise_rms_m", 1e-9, "rms of the sensor noise", unit="m", minimum=0.0, maximum=1e-3),
    ParameterSpec("quantization_m", 0.0, "step of the sensor, 0 for none", unit="m", minimum=0.0, maximum=1e-3),
    ParameterSpec("seed", 0, "seed of the sensor noise", minimum=0, maximum=2**31 - 1, is_read_only=True),
    ParameterSpec("interface", "float64", "message type of displacement", choices=INTERFACES, is_read_only=True),
    VOLTAGE_INTERFACE,
    ParameterSpec("joint_name", "piezo", "name of the joint where interface is joint_state", is_read_only=True),
    *MODEL_SPECS,
)
