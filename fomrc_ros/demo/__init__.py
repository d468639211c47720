"""``make demo``: a simulated stage linearised through real nodes, then a measured actuator identified.

The figures are judged by the paper's own measure, on the samples taken while the machine kept up.
"""

__all__ = ["demo", "node_processes"]
