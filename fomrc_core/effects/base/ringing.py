"""Where a residual rings: what trial instances of resonances begin from."""

from __future__ import annotations

import math

import numpy as np

from fomrc_core.effects.base.evidence import Evidence

# Of the sample rate: a record that holds more samples a cycle was sampled for something else.
_SLOWEST = 2e-3
_LEAST_CYCLES = 30.0  # of the record: slower, it is told by creep and drift instead
_SEGMENTS = 16  # of a record that one spectrum is averaged over
_SHORTEST, _LONGEST = 64, 4096  # samples of a segment: lines of light damping are some thousandths of the rate wide
_N_PEAKS = 3
_REACH = 6  # bins about a peak in which it is high itself


def slowest_ringing_hz(evidence: Evidence) -> float:
    """Return the lowest frequency at which a resonance is looked for [Hz]."""
    rate = 1.0 / evidence.sample_period_s
    return min(max(_SLOWEST * rate, _LEAST_CYCLES / evidence.duration_s), 0.1 * rate)


def n_apart(low: float, high: float, factor: float) -> int:
    """Return how many values from low to high are about a factor apart."""
    return 1 + math.ceil(math.log(high / low) / math.log(factor))


def ringing_peaks_hz(evidence: Evidence) -> list[float]:
    """Return the frequencies at which the rate of the longest record's residual has most power [Hz], at most three.

    Of the residual itself hysteresis and creep leave most at low frequencies, of its rate a mode that rings.
    """
    from scipy.signal import welch  # slow to import, and only a diagnosis needs it

    rate = 1.0 / evidence.sample_period_s
    longest = max(evidence.records, key=lambda record: record.time_s.size)
    n = longest.time_s.size
    n_segment = min(max(1 << (n // _SEGMENTS).bit_length() - 1, _SHORTEST), _LONGEST, n)
    frequency, power = welch(longest.residual_um, fs=rate, nperseg=n_segment)
    power = np.where(frequency >= slowest_ringing_hz(evidence), power * frequency**2, 0.0)
    found: list[float] = []
    for _ in range(_N_PEAKS):
        peak = int(np.argmax(power))
        if not power[peak] > 0.0:
            break
        found.append(float(frequency[peak]))
        power[max(0, peak - _REACH) : peak + _REACH + 1] = 0.0
    return found
