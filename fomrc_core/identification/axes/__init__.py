"""From periodic records of several axes to a model: poles, shapes, level law, hysteresis, joints.

``identify_axes`` is the way in.
"""

from fomrc_core.identification.axes.identify import AxesOptions, identify_axes
from fomrc_core.identification.axes.kept_descents import kept_identification
from fomrc_core.identification.axes.periodic import PeriodicRecord, broken_records, periodic_record
from fomrc_core.identification.axes.result import AxesIdentification
from fomrc_core.identification.axes.standard_errors import AxesStandardErrors

__all__ = [
    "AxesIdentification",
    "AxesOptions",
    "AxesStandardErrors",
    "PeriodicRecord",
    "broken_records",
    "identify_axes",
    "kept_identification",
    "periodic_record",
]
