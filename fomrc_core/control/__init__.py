"""The compensation loop without ROS: limits, memory of the actuator, timing, checkpoint.

A node of any middleware can be built on it; it knows steps, targets and voltages only.
"""

__all__ = [
    "actuator_drive",
    "arrival",
    "checkpoint",
    "compensation_loop",
    "feedback",
    "gain_margin",
    "heard_stage",
    "held_inputs",
    "loop_account",
    "loop_timing",
    "model_gate",
    "plausible_model",
    "previewed_target",
    "stage_motion",
    "stage_stream",
    "tick_grid",
    "trajectory",
    "voltage_limits",
]
