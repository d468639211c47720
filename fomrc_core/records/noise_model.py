"""A model of the noise of a displacement sensor, and what it says of a residual."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

import numpy as np

from fomrc_core.compute.arrays import Array, Mask
from fomrc_core.compute.runs import runs_of
from fomrc_core.records.noise_spectrum import NoiseSpectrum
from fomrc_core.records.whiteness import WhitenessTest, whiteness_test

# Slow functions any fit of an actuator has and noise of their slowness hides behind: an offset, and creep, which over
# some decades of time bends like a cubic polynomial of the logarithm of time.
N_SLOW = 4


class NoiseSource(Enum):
    """What a noise model was estimated from."""

    REPEATS = "repeats"
    RESTS = "rests"
    REPEATS_AND_RESTS = "repeats and rests"
    DIFFERENCES = "differences"
    RESIDUAL = "residual"


@dataclass(frozen=True, eq=False)
class NoiseModel:
    """Stationary Gaussian noise times a factor that may grow with displacement.

    The standard deviation at displacement x is proportional to ``sqrt(1 + (growth_per_um (x - growth_centre_um))^2)``.

    Attributes:
        spectrum: spectral density and whitening filter of the stationary part.
        sample_period_s: period the spectrum is for [s].
        n_record: samples of the longest record it was made for.
        source: what it rests on.
        n_samples: number of samples it rests on.
        sees_slow_noise: whether what was too slow to be seen, were it flicker noise, would change the rms by less
            than 25 %. Never for differences.
        growth_per_um: relative growth [1/um]; 0 where the data show none.
        growth_centre_um: displacement of least noise [um].
        mean_square_growth: mean of the squared factor over the displacements of the records [1].
        step_um: step of the sensor [um]; nan where it has none. Its error is in the spectrum.
        lines_hz: lines that stood out of the spectrum (mains hum) and are not counted as noise [Hz].
    """

    spectrum: NoiseSpectrum
    sample_period_s: float
    n_record: int
    source: NoiseSource
    n_samples: int
    sees_slow_noise: bool
    growth_per_um: float = 0.0
    growth_centre_um: float = 0.0
    mean_square_growth: float = 1.0
    step_um: float = float("nan")
    lines_hz: tuple[float, ...] = ()

    @property
    def rms_um(self) -> float:
        """Rms of the noise in a residual of the longest record, mean over its displacements [um]."""
        return self.expected_rms_um(self.n_record)

    @property
    def rms_interval_um(self) -> tuple[float, float]:
        """Interval that holds ``rms_um`` with 95 % [um].

        It allows for what may lie below what was seen; upwards for a random walk there, where slow noise is not seen.
        """
        from scipy.stats import chi2  # slow to import, and no node that only drives needs it

        freedom = max(self.spectrum.degrees_of_freedom, 1.0)
        low = self.rms_um * np.sqrt(freedom / chi2.ppf(0.975, freedom))
        high = self.rms_um**2 * freedom / chi2.ppf(0.025, freedom) + self._hidden_um2()
        if not self.sees_slow_noise:
            # what is continued below what was seen may not be there
            low = min(low, np.sqrt(self.mean_square_growth * self.spectrum.variance_um2(self.spectrum.lowest_seen)))
        return float(low), float(np.sqrt(high))

    @property
    def lowest_frequency_hz(self) -> float:
        """Frequency below which the spectrum is continued and not measured [Hz]."""
        return self.spectrum.lowest_seen / self.sample_period_s

    def factor(self, displacement_um: Array | None) -> Array:
        """Return the standard deviation at displacements [um] over that of the stationary part, same shape."""
        if displacement_um is None:
            return np.full((), np.sqrt(self.mean_square_growth))
        return np.sqrt(1.0 + (self.growth_per_um * (np.asarray(displacement_um) - self.growth_centre_um)) ** 2)

    def expected_rms_um(self, n_samples: int, quantile: float | None = None, n_slow: int = N_SLOW) -> float:
        """Return the rms that noise leaves in a residual of so many samples [um].

        Args:
            n_samples: number of samples.
            quantile: the rms that is not passed with this probability, what is not known of the noise included;
                without it, the root of the mean square.
            n_slow: slow functions the fit has taken out: noise below ``n_slow / (2 n_samples)`` cycles per sample is
                gone with them.
        """
        power = self.mean_square_growth * self.spectrum.variance_um2(self._low(n_samples, n_slow))
        if quantile is not None:
            from scipy.stats import f as fisher  # slow to import, and no node that only drives needs it

            power *= float(fisher.ppf(quantile, self._freedom(n_samples, n_slow), self.spectrum.degrees_of_freedom))
        return float(np.sqrt(power))

    def consistency_p_value(self, residual_um: Array, n_parameters: int = 0) -> float:
        """Return the probability that noise alone leaves as large a residual or a larger one.

        An F test of the mean square of the residual against that of the noise, with the effective degrees of freedom
        of both. What is as slow as the record is left out: a cubic polynomial of time is taken out of the residual.

        Args:
            residual_um: residual of contiguous samples [um], shape (n_samples,).
            n_parameters: number of parameters fitted to these samples, besides the slow ones.
        """
        from scipy.stats import f as fisher  # slow to import, and no node that only drives needs it

        n = residual_um.size
        freedom = self._freedom(n, N_SLOW)
        kept = max(1.0 - n_parameters / freedom, 1.0 / freedom)
        expected = self.expected_rms_um(n) ** 2 * kept
        slow = np.polynomial.legendre.legvander(np.linspace(-1.0, 1.0, n), N_SLOW - 1)
        left = residual_um - slow @ np.linalg.lstsq(slow, residual_um, rcond=None)[0]
        power = float(np.mean(left**2))
        if expected <= 0.0:
            return 0.0 if power > 0.0 else 1.0
        return float(fisher.sf(power / expected, freedom * kept, self.spectrum.degrees_of_freedom))

    def whiten(self, residual_um: Array, displacement_um: Array | None = None, is_usable: Mask | None = None) -> Array:
        """Return the residual whitened: independent with unit variance if it is this noise.

        Args:
            residual_um: residual, or columns of a linear model, to be whitened alike [um], shape (n_samples,) or
                (n_samples, n_columns).
            displacement_um: measured displacement [um], where the noise grows with it, shape (n_samples,).
            is_usable: samples to be used, shape (n_samples,); the filter starts anew after each gap.

        Returns:
            The whitened values, of the same shape, zero where not usable.
        """
        values = np.asarray(residual_um, dtype=np.float64)
        factor = np.broadcast_to(self.factor(displacement_um), values.shape[:1])
        scaled = values / (factor if values.ndim == 1 else factor[:, None])
        if is_usable is None or bool(np.all(is_usable)):
            return self.spectrum.process.whiten(scaled)
        white = np.zeros_like(scaled)
        for start, stop in runs_of(is_usable):
            white[start:stop] = self.spectrum.process.whiten(scaled[start:stop])
        return white

    def log_likelihood(self, residual_um: Array, displacement_um: Array | None = None) -> float:
        """Return the logarithm of the Gaussian probability density of a residual [log 1/um^n_samples]."""
        white = self.whiten(residual_um, displacement_um)
        factor = np.broadcast_to(self.factor(displacement_um), white.shape)
        determinant = self.spectrum.process.log_determinant(white.size) + 2.0 * float(np.sum(np.log(factor)))
        return float(-0.5 * (np.dot(white, white) + determinant + white.size * np.log(2.0 * np.pi)))

    def whiteness(
        self, residual_um: Array, displacement_um: Array | None = None, is_usable: Mask | None = None
    ) -> WhitenessTest:
        """Return a test of the hypothesis that the whitened residual has no correlation left.

        Frequencies are tested down to where noise was seen: slower correlation cannot be told from slower noise.
        """
        white = self.whiten(residual_um, displacement_um, is_usable)
        return whiteness_test(
            white if is_usable is None else white[is_usable], self.n_samples, self.spectrum.lowest_seen
        )

    def is_white(self, residual_um: Array, displacement_um: Array | None = None, level: float = 0.01) -> bool:
        """Return whether ``whiteness`` is not rejected at a level."""
        return self.whiteness(residual_um, displacement_um).p_value >= level

    def effective_count(self, n_samples: int) -> float:
        """Return how many independent samples have a mean as sure as that of so many samples of this noise."""
        # variance of the mean: the density seen through the squared Dirichlet kernel, whose width is 1 / n
        f, density = self.spectrum.frequency, self.spectrum.density
        below = 0.5 / n_samples
        if f[0] < below:
            inside = np.append(f[f < below], below)
            level = float(np.trapezoid(np.interp(inside, f, density), inside) + density[0] * f[0]) / below
        else:
            level = float(density[0])
        variance_of_mean = 0.5 * level / n_samples
        total = self.spectrum.variance_um2()
        return float(np.clip(total / variance_of_mean, 1.0, None)) if variance_of_mean > 0.0 else float(n_samples)

    def inflation(self, n_samples: int) -> float:
        """Return by how much the variance of a mean of so many samples exceeds that of as many independent ones."""
        return n_samples / self.effective_count(n_samples)

    def _low(self, n_samples: int, n_slow: int) -> float:
        return min(0.5 * n_slow / n_samples, 0.45)

    def _freedom(self, n_samples: int, n_slow: int) -> float:
        """Return the degrees of freedom of the mean square of so many samples: of its Fourier lines, two each."""
        low = self._low(n_samples, n_slow)
        f = np.unique(np.concatenate(([low], self.spectrum.frequency[self.spectrum.frequency > low])))
        density = np.interp(f, self.spectrum.frequency, self.spectrum.density)
        power, square = float(np.trapezoid(density, f)), float(np.trapezoid(density**2, f))
        return max(1.0, 2.0 * n_samples * power**2 / square) if square > 0.0 else float(n_samples)

    def _hidden_um2(self) -> float:
        """Return the power of a random walk below what was seen, beyond what is continued there [um^2]."""
        spectrum = self.spectrum
        low, seen = self._low(self.n_record, N_SLOW), spectrum.lowest_seen
        if low >= seen or self.sees_slow_noise:
            return 0.0
        hidden = float(np.interp(seen, spectrum.frequency, spectrum.density)) * seen * seen / low
        return float(max(0.0, hidden - spectrum.variance_um2(low, seen)) * self.mean_square_growth)
