"""Several axes on one body: hysteresis and creep of each input, modes they share, what joints and levels change.

``AxesModel`` says what a stage is; ``AxesState`` is the one thing that changes while it is stepped.
"""

from fomrc_core.model.axes.axes_model import AxesModel, AxesState
from fomrc_core.model.axes.compensator import AxesCompensator
from fomrc_core.model.axes.dynamic_inverse import AxesDynamicInverse
from fomrc_core.model.axes.modes import AxesModes, LevelLaw, RateRelay
from fomrc_core.model.axes.response import ModeAnswers, axes_response, mode_answers

__all__ = [
    "AxesCompensator",
    "AxesDynamicInverse",
    "AxesModel",
    "AxesModes",
    "AxesState",
    "LevelLaw",
    "ModeAnswers",
    "RateRelay",
    "axes_response",
    "mode_answers",
]
