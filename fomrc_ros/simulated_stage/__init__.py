"""A stage to try things on: takes a voltage, publishes a displacement.

Its plant is the model or the electromechanical truth.
"""

__all__ = [
    "node",
]
