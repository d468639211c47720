"""Parameters of the gap nodes."""

from __future__ import annotations

from fomrc_ros.node.parameters import ParameterSpec

GEOMETRY_SPEC = ParameterSpec(
    "geometry",
    # Actuators on a circle of 10 mm radius, 120 degrees apart.
    [1.0, 0.0, 0.010, 1.0, 0.00866, -0.005, 1.0, -0.00866, -0.005],
    "3x3 matrix, row by row: displacement of each actuator [m] per piston [m], tip [rad], tilt [rad]",
    unit="1, m, m",
)
AXES_SPEC = ParameterSpec("axes", ["axis1", "axis2", "axis3"], "namespaces of the three axes", is_read_only=True)
AXES_MODEL_SPEC = ParameterSpec(
    "axes_model",
    "",
    "file of a model of the three axes together (fomrc identify-axes, or by hand): what one axis moves another is "
    "undone; empty: nothing",
    is_read_only=True,
)
RATE_SPEC = ParameterSpec(
    "rate_hz", 100.0, "rate of the gap", unit="Hz", minimum=1.0, maximum=1000.0, is_read_only=True
)
STALE_SPEC = ParameterSpec(
    "stale_after_s",
    1.0,
    "age at which a displacement counts as stale: there is no gap then",
    unit="s",
    minimum=0.01,
    maximum=1e6,
)
