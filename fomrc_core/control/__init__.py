"""The compensation loop without ROS: limits, memory of the actuator, timing, checkpoint.

A node of any middleware can be built on it; it knows steps, targets and voltages only.
"""

__all__ = [
    "actuator_memory",
    "checkpoint",
    "compensation_loop",
    "loop_timing",
    "target_history",
    "tick_grid",
    "turning_points",
    "voltage_limits",
]
