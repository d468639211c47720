"""How much of a record is noise: from its fastest changes, and from its repeats where it has any."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.signal import welch

from fomrc_core.records.recording import Recording

Array = NDArray[np.float64]

_DIFFERENCE = np.array([1.0, -4.0, 6.0, -4.0, 1.0])


@dataclass(frozen=True)
class NoiseFloor:
    """Noise of a set of records, rms [um].

    Attributes:
        differences_um: from fourth differences while the drive rests or moves evenly.
        repeats_um: from repeated stretches of the drive; nan where there are none.
    """

    differences_um: float
    repeats_um: float

    @property
    def floor_um(self) -> float:
        """The repeats where there are any, for they see slow noise too; else the differences."""
        return self.repeats_um if self.sees_slow_noise else self.differences_um

    @property
    def sees_slow_noise(self) -> bool:
        """Whether the floor has the slow part of the noise in it: differences alone leave it out."""
        return bool(np.isfinite(self.repeats_um))


def noise_floor(recordings: list[Recording] | tuple[Recording, ...]) -> NoiseFloor:
    """Return the noise floor of the recordings [um]."""
    differences = [_difference_noise(r.voltage_v, r.measured_um) for r in recordings]
    repeats = [_repeat_noise(r) for r in recordings]
    seen = [value for value in repeats if np.isfinite(value)]
    return NoiseFloor(float(np.median(differences)), float(np.median(seen)) if seen else float("nan"))


def _difference_noise(voltage_v: Array, displacement_um: Array) -> float:
    bend = np.convolve(voltage_v, _DIFFERENCE, mode="valid")
    rough = np.convolve(displacement_um, _DIFFERENCE, mode="valid")
    # where the drive is even its own fourth difference vanishes; take the evenest third, and there too out what
    # follows the drive
    size = np.abs(bend)
    even = size <= max(float(np.quantile(size, 0.34)), 1e-12 * float(np.ptp(voltage_v)))
    power = float(np.dot(bend[even], bend[even]))
    if power > 0.0:
        rough = rough - bend * (float(np.dot(rough[even], bend[even])) / power)
    # median absolute deviation: transients that fall among the even samples do not count
    return float(np.median(np.abs(rough[even])) / 0.6745 / np.sqrt(np.sum(_DIFFERENCE**2)))


def find_repeats(voltage_v: Array) -> list[tuple[int, int, int]]:
    """Return (start, stop, period) in samples of stretches in which the drive repeats itself exactly and moves."""
    n = voltage_v.size
    span = float(np.ptp(voltage_v))
    if n < 64 or span == 0.0:
        return []
    change = np.diff(voltage_v)
    found: list[tuple[int, int, int]] = []
    n_padded = 1 << int(np.ceil(np.log2(2 * n)))
    busy = np.sign(change) * np.minimum(np.abs(change), 5.0 * np.median(np.abs(change)) + 1e-12)
    spectrum = np.fft.rfft(busy - busy.mean(), n_padded)
    likeness = np.fft.irfft(np.abs(spectrum) ** 2, n_padded)[: n // 2]
    # a repeated stretch is a sharp local maximum of the autocorrelation
    lags = np.flatnonzero((likeness[1:-1] > likeness[:-2]) & (likeness[1:-1] >= likeness[2:])) + 1
    lags = lags[lags > 20]
    best = lags[np.argsort(likeness[lags])[::-1][:40]]
    for lag in best:
        lag = int(lag)
        same = np.abs(voltage_v[lag:] - voltage_v[:-lag]) <= 1e-7 * span
        moves = np.abs(np.concatenate((change, [0.0]))[: n - lag]) > 1e-6 * span
        edges = np.flatnonzero(np.diff(np.concatenate(([0], same.astype(np.int8), [0]))))
        for start, stop in zip(edges[::2], edges[1::2], strict=True):
            if stop - start >= max(lag, 60) and np.mean(moves[start:stop]) > 0.8:
                if any(s < stop + lag and start < e + p for s, e, p in found):
                    continue
                found.append((int(start), int(stop), lag))
    return found


def _repeat_noise(recording: Recording) -> float:
    powers, weights = [], []
    for start, stop, period in find_repeats(recording.voltage_v):
        x = recording.measured_um
        # the first period still carries the past of the hysteresis
        first = start + period if stop - start >= 2 * period else start
        difference = (x[first + period : stop + period] - x[first:stop]) / np.sqrt(2.0)
        if difference.size < 60:
            continue
        difference = _without_drift(difference)
        frequency, density = welch(difference, fs=1.0, nperseg=min(256, difference.size))
        # a line (hum) stands out of its neighbours; the floor is what is left without it
        smooth = np.median(np.lib.stride_tricks.sliding_window_view(np.pad(density, 8, mode="reflect"), 17), axis=1)
        powers.append(float(np.trapezoid(np.minimum(density, 4.0 * smooth), frequency)))
        weights.append(difference.size)
    return float(np.sqrt(np.average(powers, weights=weights))) if powers else float("nan")


def _without_drift(values: Array) -> Array:
    t = np.linspace(-1.0, 1.0, values.size)
    return np.asarray(values - np.polynomial.polynomial.polyval(t, np.polynomial.polynomial.polyfit(t, values, 3)))


def autocorrelation_inflation(values: Array, longest: int = 2000) -> float:
    """Return 1 + 2 sum of the autocorrelation of the values: by how much their mean varies more than if white."""
    n = values.size
    centred = values - values.mean()
    n_padded = 1 << int(np.ceil(np.log2(2 * n)))
    spectrum = np.abs(np.fft.rfft(centred, n_padded)) ** 2
    correlation = np.fft.irfft(spectrum, n_padded)[: min(longest, n // 4) + 1]
    if correlation[0] <= 0.0:
        return 1.0
    rho = correlation / correlation[0]
    # Geyer: sum pairs while they stay positive
    pairs = rho[1:-1:2] + rho[2::2] if rho.size > 3 else np.zeros(0)
    stop = int(np.argmax(pairs <= 0.0)) if np.any(pairs <= 0.0) else pairs.size
    return float(max(1.0, 1.0 + 2.0 * np.sum(pairs[:stop])))
