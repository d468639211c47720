"""From periodic records of several axes to a model: poles, shapes, level law, hysteresis, joints.

``identify_axes`` is the way in.
"""

from fomrc_core.identification.axes.identify import AxesIdentification, AxesOptions, identify_axes
from fomrc_core.identification.axes.periodic import PeriodicRecord, broken_records, periodic_record

__all__ = [
    "AxesIdentification",
    "AxesOptions",
    "PeriodicRecord",
    "broken_records",
    "identify_axes",
    "periodic_record",
]
