"""The paper's two blocks: hysteresis by Maxwell elements, creep by a fractional integrator.

Each is a packed state and the kernels that move it; neither knows the other.
"""

__all__ = [
    "creep",
    "creep_batch",
    "creep_full_memory",
    "hysteresis",
]
