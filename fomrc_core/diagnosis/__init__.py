"""From recordings to causes: screen, fit, accept on held-out data, extend the model, say what is left.

``diagnose`` is the way in.
"""

__all__ = [
    "axes",
    "constancy",
    "detectable",
    "diagnosis",
    "findings",
    "judgement",
    "record_view",
    "unnamed_extension",
    "watch",
]
