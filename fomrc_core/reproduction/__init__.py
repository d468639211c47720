"""The paper's tables and figures, made again on a simulated plant.

``reproduce`` is the way in; each claim of the paper is one entry with its bar.
"""

__all__ = ["reproduction", "result"]
