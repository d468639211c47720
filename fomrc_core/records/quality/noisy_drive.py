"""Noise of the recorded drive: fluctuations of the voltage column of which the displacement shows nothing.

Where the drive is a monitor's reading it carries the monitor's noise, which the actuator has never seen. A model that
is given it makes it a displacement, and what is left then follows the drive: filters are named that only take it out
again (errors in variables). So it is smoothed out, by polynomials over windows as long as each sample's neighbours
allow: the longest whose estimate agrees with those of all shorter ones (intersection of confidence intervals:
Goldenshluger and Nemirovski, 1997; Katkovnik, 1999), which leaves steps and corners where they are.
"""

from __future__ import annotations

import math

import numpy as np
from scipy.fft import irfft, rfft
from scipy.linalg import toeplitz
from scipy.signal import savgol_coeffs, savgol_filter

from fomrc_core.compute.arrays import Array

_ORDERS = (4, 6, 8)  # of differences: white noise has the same size in all, a drive that somebody made has not
_ALIKE = 0.15  # of a size: twice the standard error of eighth differences' over a thousand samples
_LEAST_SAMPLES = 400  # from which on the sizes are known so well
_FELT = 0.25  # of the reading's noise: what a drive's makes of the displacement raises it by 3 % from here on
_ROUNDING = 1e-12  # of the drive's range: less is of its numbers, whatever a reading in coarse steps shows of it
_LARGEST_SHARE = 0.02  # of the drive's range: more is a drive and no noise of its reading
_MOST_LAGS = 16  # samples in which the displacement may follow
_SURE = 0.01  # of the hypothesis that the displacement shows nothing of it
_N_MOVED = 400
_MEDIAN_TO_RMS = 1.4826  # of normal numbers
_FAR = 4.0  # times the noise: what is larger is none
_EVEN = 0.01  # of a step: where the clock is less even there is no one window
_HALF_WIDTHS = (4, 8, 16, 32)  # of the windows [samples]
# Standard errors to either side, and order of the polynomials: of those tried (0.7 to 2, 2 and 4) the least error on
# sines, triangles and steps together; with 2 and 2 a sine loses so much of its height that a lag is found for it.
_N_ERRORS, _ORDER = 1.4, 4


def drive_noise_v(time_s: Array, voltage_v: Array, displacement_um: Array) -> float:
    """Return the rms of the noise of the recorded drive [V]; 0 where there is none that matters, or all is followed.

    Args:
        time_s: sample times [s], shape (n_samples,).
        voltage_v: recorded drive [V], shape (n_samples,).
        displacement_um: what was read [um], shape (n_samples,).
    """
    steps_s = np.diff(time_s)
    range_v, range_um = float(np.ptp(voltage_v)), float(np.ptp(displacement_um))
    if voltage_v.size < _LEAST_SAMPLES or not range_v > 0.0:
        return 0.0
    if float(np.max(np.abs(steps_s - np.median(steps_s)))) > _EVEN * float(np.median(steps_s)):
        return 0.0
    sizes = [_size(voltage_v, order) for order in _ORDERS]
    noise_v = float(np.median(sizes))
    is_white = noise_v > 0.0 and max(sizes) - min(sizes) <= _ALIKE * noise_v
    is_felt = noise_v * range_um > _FELT * _size(displacement_um, _ORDERS[0]) * range_v
    if not (is_white and is_felt and _ROUNDING * range_v < noise_v < _LARGEST_SHARE * range_v):
        return 0.0
    return 0.0 if _is_followed(voltage_v, displacement_um, noise_v) else noise_v


def smoothed_drive_v(voltage_v: Array, noise_v: float) -> Array:
    """Return the drive without white noise of this rms [V], shape (n_samples,)."""
    low, high = voltage_v - _N_ERRORS * noise_v, voltage_v + _N_ERRORS * noise_v
    best, is_open = voltage_v.copy(), np.ones(voltage_v.size, dtype=np.bool_)
    for half in _HALF_WIDTHS:
        width = 2 * half + 1
        if width > voltage_v.size:
            break
        estimate = savgol_filter(voltage_v, width, _ORDER)
        error_v = noise_v * math.sqrt(float(savgol_coeffs(width, _ORDER)[half]))
        low = np.maximum(low, estimate - _N_ERRORS * error_v)
        high = np.minimum(high, estimate + _N_ERRORS * error_v)
        is_open &= low <= high
        best[is_open] = estimate[is_open]
    return np.asarray(best)


def _size(values: Array, order: int) -> float:
    """Return the rms of white noise whose differences of an order are as large as half of these are."""
    differences = np.diff(values, order)
    return _MEDIAN_TO_RMS * float(np.median(np.abs(differences))) / math.sqrt(math.comb(2 * order, order))


def _is_followed(voltage_v: Array, displacement_um: Array, noise_v: float) -> bool:
    """Return whether the displacement follows the noise of the drive, at once or some samples later.

    What the last samples of the noise explain of the quick part of the displacement is compared with what they explain
    of it moved by many samples, end to end: of that they can explain only what chance does.
    """
    noise = _without_outliers(voltage_v - smoothed_drive_v(voltage_v, noise_v))
    # less a polynomial over twice as many samples as it may be late: of what an amplifier lets through slowly
    # differences, in which the quickest counts most, show next to nothing
    width = 2 * _MOST_LAGS + 1
    quick_um = _without_outliers(displacement_um - savgol_filter(displacement_um, width, _ORDER))
    n = noise.size
    spectrum = rfft(noise)
    own = irfft(np.abs(spectrum) ** 2, n)[: _MOST_LAGS + 1]
    shared = irfft(rfft(quick_um) * np.conj(spectrum), n)
    moved = np.linspace(2 * _MOST_LAGS, n - 3 * _MOST_LAGS, _N_MOVED).astype(np.int64)
    moments = shared[np.concatenate(([0], moved))[:, None] + np.arange(_MOST_LAGS + 1)]
    # noise that a quantised drive shows at a few samples alone leaves lags that say the same
    solved, *_ = np.linalg.lstsq(toeplitz(own), moments.T)
    explained = np.einsum("ij,ij->i", moments, solved.T)
    return bool(np.mean(explained[1:] >= explained[0]) < _SURE)


def _without_outliers(values: Array) -> Array:
    """Return values without those that are no noise, as beside steps and corners."""
    largest = _FAR * _MEDIAN_TO_RMS * float(np.median(np.abs(values)))
    return np.asarray(np.where(np.abs(values) <= largest, values, 0.0))
