"""A model under fit: weights of either sign, effects, records, and their joint least squares.

Identification and diagnosis both fit with what is here; neither has a fit of its own.
"""

__all__ = [
    "base_fit",
    "bend_windows",
    "element_fit",
    "evidence",
    "fit_record",
    "free_parameters",
    "joint_fit",
    "linear_part",
    "long_records",
    "memory_plan",
    "play_columns",
    "steady_tones",
    "structure_within",
    "thinned_record",
    "trial_model",
    "work_of_run",
]
