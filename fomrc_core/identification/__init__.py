"""From recordings to a model: the convex route, the paper's route, uncertainty, fleets.

``identify`` is the way in.
"""

__all__ = [
    "axes",
    "convex",
    "element_count",
    "fit",
    "fleet",
    "moving_blocks",
    "paper",
    "parameter_errors",
    "repeated_fits",
    "uncertainty",
]
