"""From recordings of several axes and their model to what the model gets wrong.

``diagnosis.diagnose_axes`` is the way in; each cause is a file in ``causes/``.
"""

from fomrc_core.diagnosis.axes.diagnosis import AxesDiagnosis, diagnose_axes
from fomrc_core.diagnosis.axes.findings import AxesFinding, AxisDiagnosis
from fomrc_core.diagnosis.axes.records import AxesRecord

__all__ = ["AxesDiagnosis", "AxesFinding", "AxesRecord", "AxisDiagnosis", "diagnose_axes"]
