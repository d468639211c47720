"""From recordings to causes: screen, fit, accept on held-out data, extend the model, say what is left.

``diagnose`` is the way in.
"""

__all__ = [
    "candidate",
    "data_split",
    "decision",
    "diagnosis",
    "extended_model",
    "findings",
    "fit_starts",
    "held_out_score",
    "leverage",
    "missing_elements",
    "next_experiment",
    "prehistory_search",
    "record_effects",
    "screening",
    "search",
]
