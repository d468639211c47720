"""The model of the chain, its state, its simulation and its inverse.

``PiezoModel`` says what an actuator is; ``ModelState`` is the one thing that changes while it is stepped.
"""

__all__ = [
    "actuator_array",
    "axes",
    "causes",
    "compensator",
    "divided_drive",
    "dynamic_inverse",
    "influence_matrix",
    "kernels",
    "known_rounds",
    "known_target",
    "literal_model",
    "loop_filters",
    "near_sample_rate",
    "piezo_model",
    "plain_kernels",
    "prehistory",
    "preview_filter",
    "preview_inverse",
    "preview_window",
    "record_start",
    "simulation",
    "state",
    "streaming",
    "substeps",
    "waveform",
]
