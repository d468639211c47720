"""A recording, and what can be said of it without a model: noise, usability, excitation, residual.

What a drive of a certain shape is (turning points, kinds of loops, repeats) is answered here, once.
"""

__all__ = [
    "arguments",
    "direction",
    "drive",
    "drive_outline",
    "excitation",
    "noise",
    "noise_estimate",
    "noise_growth",
    "noise_model",
    "plausibility",
    "quality",
    "recording",
    "repeats",
    "residual",
    "sensor_step",
    "usability",
    "whitening",
]
