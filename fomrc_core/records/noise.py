"""How much of a record is noise: from its fastest changes, and from its repeats where it has any."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import gammainc, gammaincc

from fomrc_core.compute.arrays import Array
from fomrc_core.records.noise_spectrum import spectrum_of
from fomrc_core.records.noise_stretches import stretches_of_repeats
from fomrc_core.records.recording import Recording
from fomrc_core.records.repeats import find_repeats
from fomrc_core.records.sensor_step import sensor_step_um
from fomrc_core.records.spectral_lines import without_lines

# pairs of lags 1-2 and 3-4 within half of the values
_N_CORRELATED_MIN = 10
_MOST_UNSEEN = 0.2  # of the variance: it raises an rms by 10 %, half of what a noise known from repeats is allowed
_ALIKE = 0.023  # chance of one as far off to its side: two standard errors
_ROUNDING = 1e-12  # of the largest displacement
_DIFFERENCE = np.array([1.0, -4.0, 6.0, -4.0, 1.0])


@dataclass(frozen=True)
class NoiseFloor:
    """Noise of a set of records, rms [um].

    Attributes:
        differences_um: from fourth differences while the drive rests or moves evenly.
        repeats_um: from repeated stretches of the drive; nan where there are none.
        unseen_share: share of the variance that may be slower than what the repeats show [1].
        repeats_error: relative standard error of the repeats [1].
        slowest_seen_s: longest period of the noise that repeats show [s].
    """

    differences_um: float
    repeats_um: float
    unseen_share: float = 0.0
    repeats_error: float = 0.0
    slowest_seen_s: float = math.inf

    @property
    def floor_um(self) -> float:
        """The repeats, for they see slower noise too; the differences where there are none, or few that agree."""
        if not np.isfinite(self.repeats_um):
            return self.differences_um
        return self.differences_um if self._is_alike and not self.sees_slow_noise else self.repeats_um

    @property
    def _is_alike(self) -> bool:
        """Whether the repeats may show the noise that the differences do: a power of few degrees of freedom."""
        if not self.repeats_error > 0.0 or not self.differences_um > 0.0:
            return self.repeats_um == self.differences_um
        freedom = 0.5 / self.repeats_error**2
        power = freedom * (self.repeats_um / self.differences_um) ** 2
        return min(float(gammainc(0.5 * freedom, 0.5 * power)), float(gammaincc(0.5 * freedom, 0.5 * power))) > _ALIKE

    @property
    def sees_slow_noise(self) -> bool:
        """Whether the floor has the slow part of the noise in it.

        Differences alone leave it out, and so do repeats that follow each other within the noise's correlation.
        """
        return bool(np.isfinite(self.repeats_um)) and self.unseen_share < _MOST_UNSEEN


def noise_floor(recordings: Sequence[Recording]) -> NoiseFloor:
    """Return the noise floor of the recordings [um]."""
    differences = [difference_noise_um(r) for r in recordings]
    repeats = [_repeat_noise(r) for r in recordings]
    seen = np.array([told for told in repeats if np.isfinite(told[0])])
    if not seen.size:
        return NoiseFloor(float(np.median(differences)), float("nan"))
    rms_um, unseen, error, slowest_s = np.median(seen, axis=0)
    return NoiseFloor(float(np.median(differences)), float(rms_um), float(unseen), float(error), float(slowest_s))


def noise_of_residuals(recordings: Sequence[Recording], left_um: Sequence[Array]) -> NoiseFloor:
    """Return the noise floor of what a model leaves of recordings [um], what it follows taken out of their repeats."""
    return noise_floor([replace(r, displacement_um=left) for r, left in zip(recordings, left_um, strict=True)])


def sensor_rounding_um(recordings: Sequence[Recording]) -> float:
    """Return the rms of what a sensor's step hides of the displacement [um], 0 where readings are on no lattice.

    Where noise does not stir them, readings of a coarse sensor stand still while the drive moves on, and differences
    from sample to sample are mostly none; two readings of one place are alike. No reading is surer than the step over
    the root of twelve all the same (Widrow & Kollar, "Quantization Noise", 2008, ch. 4).
    """
    steps_um = [sensor_step_um(r.measured_um[r.valid_samples]) for r in recordings]
    return float(np.median(np.nan_to_num(steps_um))) / math.sqrt(12.0)


def rounding_of(values_um: Sequence[Array]) -> float:
    """Return what sums over plays and creep of displacements [um] like these are rounded to at best [um]."""
    return _ROUNDING * max(float(np.max(np.abs(values))) for values in values_um)


def known_noise(recordings: Sequence[Recording]) -> NoiseFloor:
    """Return the noise floor of the recordings [um], no less than what they or their sensor are rounded to."""
    least_um = max(rounding_of([r.measured_um for r in recordings]), sensor_rounding_um(recordings))
    noise = noise_floor(recordings)
    return replace(
        noise,
        differences_um=max(noise.differences_um, least_um),
        repeats_um=float(np.maximum(noise.repeats_um, least_um)),
    )


def difference_noise_um(recording: Recording) -> float:
    """Return the rms of the noise from fourth differences [um]."""
    voltage_v, displacement_um = recording.voltage_v, recording.measured_um
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


def _repeat_noise(recording: Recording) -> tuple[float, float, float, float]:
    """Return what repeats show of the noise.

    Its rms [um] (nan without any), the share unseen [1], its relative error [1], the longest period seen [s].
    """
    stretches = stretches_of_repeats(recording, find_repeats(recording.voltage_v))
    cleaned = [replace(s, values_um=without_lines(s.values_um)[0]) for s in stretches]
    if not any(np.any(s.values_um) for s in cleaned):
        return (0.0 if cleaned else float("nan")), 0.0, 0.0, math.inf
    spectrum = spectrum_of(cleaned, recording.n_samples)
    rms_um = float(np.sqrt(spectrum.variance_um2(spectrum.lowest_seen)))
    error = 1.0 / np.sqrt(2.0 * max(spectrum.degrees_of_freedom, 1.0))
    return rms_um, spectrum.unseen_share(), error, float(np.median(recording.steps_s)) / spectrum.lowest_seen


def autocorrelation_inflation(values: Array) -> float:
    """Return 1 + 2 sum of the autocorrelation of the values: by how much their mean varies more than if white.

    The sum goes over pairs of lags as long as they stay positive (Geyer, "Practical Markov chain Monte Carlo",
    Statistical Science 7 (1992)), whatever the number of values.
    """
    n = values.size
    if n < _N_CORRELATED_MIN:
        return 1.0
    centred = values - values.mean()
    n_padded = 1 << int(np.ceil(np.log2(2 * n)))
    spectrum = np.abs(np.fft.rfft(centred, n_padded)) ** 2
    correlation = np.fft.irfft(spectrum, n_padded)[: n // 2]
    if correlation[0] <= 0.0:
        return 1.0
    rho = correlation / correlation[0]
    pairs = rho[1:-1:2] + rho[2::2]
    stop = int(np.argmax(pairs <= 0.0)) if np.any(pairs <= 0.0) else pairs.size
    return float(np.clip(1.0 + 2.0 * np.sum(pairs[:stop]), 1.0, n))
