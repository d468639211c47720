"""Whether what is left has a steady line in its spectrum: a tone that no noise of a sensor has, of whatever colour.

A tone beside a line of a drive, or a harmonic of one, may be of the drive and is no hum (``effects/mains_hum.py``); no
regression on a drive of which only harmonics are there follows it either. It is something all the same. Noise of any
colour is a smooth spectrum: a line is what stands out of its neighbourhood, and the chance that noise does so in any of
the cells of a spectrum is that of Fisher's test of the largest ordinate (1929) with the neighbourhood's level for the
level of all.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from fomrc_core.diagnosis.remainder import Dependence, DrivenRecord
from fomrc_core.diagnosis.unevenness import is_rounding
from fomrc_core.effects.base.spectra import Spectrum

_LEAST_CYCLES = 10.0  # in a record: what turns less often is a wander
_LEAST_CELLS = 50
_SURE = 0.01  # of one record's line: only what surely stands out has a share


def steady_line(records: Sequence[DrivenRecord]) -> Dependence:
    """Return which share of the power of all records is in the highest line of each, and how surely one is there.

    Args:
        records: with the residual of one and the same model.
    """
    told = [record for record in records if np.count_nonzero(record.is_used) >= 2 * _LEAST_CELLS]
    total = sum(record.left_um2 for record in told)
    told = [record for record in told if not is_rounding(record)]
    least_p, in_lines, most, at_hz = 1.0, 0.0, 0.0, 0.0
    for record in told:
        p_value, power, line_hz = _highest(record)
        p_value = min(1.0, len(told) * p_value)
        least_p = min(least_p, p_value)
        if p_value < _SURE:
            in_lines += power
            most, at_hz = max((most, at_hz), (power, line_hz))
    on = f"a steady line at {at_hz:.4g} Hz" if at_hz > 0.0 else "a steady line"
    return Dependence(on, min(in_lines / total, 1.0) if total > 0.0 else 0.0, least_p, is_of_drive=False)


def _highest(record: DrivenRecord) -> tuple[float, float, float]:
    """Return of a record's highest line how likely noise has one as high, its power times samples, where it is [Hz]."""
    used = record.is_used
    left_um = np.where(used, record.residual_um - np.mean(record.residual_um[used]), 0.0)
    spectrum = Spectrum.of(left_um, float(np.median(np.diff(record.time_s))))
    is_fast = spectrum.frequency_hz > _LEAST_CYCLES * spectrum.resolution_hz
    height = np.where(is_fast, spectrum.standing(), 0.0)
    at = int(np.argmax(height))
    power = 0.5 * float(spectrum.amplitude[at]) ** 2 * used.size
    return spectrum.chance_of(float(height[at])), power, float(spectrum.frequency_hz[at])
