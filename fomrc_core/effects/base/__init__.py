"""What an effect is: its stage, parameters, response, inverse, and the evidence it may look at.

Kernels that several effects share live here too; every other file of ``effects`` is one effect.
"""

__all__ = [
    "cause",
    "contact_times",
    "course",
    "covariates",
    "discovery",
    "effect",
    "evidence",
    "kernels",
    "lag",
    "linear_columns",
    "linear_modes",
    "linear_terms",
    "open_behind",
    "pairs_beside",
    "parameter",
    "ringing",
    "second_order",
    "signal_kernels",
    "signal_terms",
    "slopes",
    "spectra",
    "static_kernels",
    "step_form",
    "term_scales",
    "term_slopes",
    "terms",
]
