"""Nodes for a tunable filter on several piezos: gap and tilt to axes, and back.

Geometry is apart from topics.
"""

__all__ = ["geometry", "nodes"]
