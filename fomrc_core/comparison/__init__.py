"""The model beside the other models of the field, on the same data and the same split.

The others live in ``baselines``.
"""

__all__ = ["comparison", "mirror_benchmark", "mirror_figure", "result"]
