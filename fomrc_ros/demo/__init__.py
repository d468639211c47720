"""``make demo``: a simulated stage linearised through real nodes, then a measured actuator identified.

The figures are judged by the paper's own measure.
"""

__all__ = ["demo", "node_processes"]
