"""What went wrong between the sensor and the file: found before a fit, masked where it can be, and told.

``examine`` looks at a record alone, ``examine_residual`` at what a first fit leaves of it.
"""

from fomrc_core.records.quality.clipping import NoisyEnd, noisy_end
from fomrc_core.records.quality.drive_part import drive_part
from fomrc_core.records.quality.examination import Examined, bridged, examine, examine_residual
from fomrc_core.records.quality.faults import DataFault, DataQuality, FaultKind
from fomrc_core.records.quality.lags import Lags, find_lags
from fomrc_core.records.quality.levels import levels_of
from fomrc_core.records.quality.long_record import examine_long
from fomrc_core.records.quality.slips import Slip, find_slips, without_slips

__all__ = [
    "DataFault",
    "DataQuality",
    "Examined",
    "FaultKind",
    "Lags",
    "NoisyEnd",
    "Slip",
    "bridged",
    "drive_part",
    "examine",
    "examine_long",
    "examine_residual",
    "find_lags",
    "find_slips",
    "levels_of",
    "noisy_end",
    "without_slips",
]
