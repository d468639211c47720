"""Causes of several axes, one file each.

Each is a change of the model; ``CAUSES`` is what a diagnosis tries.
"""

from fomrc_core.diagnosis.axes.causes.axis_scale import AxisScale
from fomrc_core.diagnosis.axes.causes.cross_coupling import CrossCoupling
from fomrc_core.diagnosis.axes.causes.missing_mode import MissingMode
from fomrc_core.diagnosis.axes.causes.noncollocated_sensor import NoncollocatedSensor
from fomrc_core.diagnosis.axes.causes.shifted_modes import ShiftedModes
from fomrc_core.diagnosis.axes.causes.softening_modes import SofteningModes
from fomrc_core.diagnosis.axes.causes.swapped_axes import SwappedAxes

CAUSES = (SwappedAxes, AxisScale, CrossCoupling, ShiftedModes, SofteningModes, NoncollocatedSensor, MissingMode)

__all__ = ["CAUSES"]
