"""The parameters of every node, one file for each: names, units, ranges, defaults, and the settings they make.

They lie together because one file may serve all nodes: each passes over what is another's, and no misspelt name.
"""

__all__ = ["compensator", "gap", "identification", "names", "simulated_stage", "watch"]
