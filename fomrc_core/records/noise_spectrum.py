"""The spectrum of a noise from stretches of it: an autoregressive shape, and slow parts beside it.

An autoregressive process (Burg) takes what is fast: the filter of a sensor, first-order correlation. What it leaves in
the slow part of its own residual is fitted with a sum of white noise and first-order processes. The order is the one
that does best with the sum beside it, by Schwarz's criterion: a high order would bend to what few parts describe.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fomrc_core.compute.arrays import Array
from fomrc_core.records.noise_parts import N_TAPERS, Bands, OrnsteinUhlenbeckSum, bands_of, slow_part
from fomrc_core.records.whitening import AutoregressiveFilter, burg, levinson, process_of

_MAX_ORDER = 64
# The correlation length of what cannot be told from a random walk, in lengths of what was seen of it.
_WALK_LENGTHS = 16
_N_BLOCKS = 64
_LONGEST_FILTER = 1024
# By how much twice the log likelihood of a stationary noise grows over that of a walk for each slow function taken out
# of a walk (simulated: 9 in the mean for four, 21 in one case of twenty).
_LIKELIER_WITHOUT_DRIFT = 2.25
_POINTS_PER_OCTAVE = 12
_N_LINEAR = 1024


@dataclass(frozen=True)
class NoiseStretch:
    """A stretch of a record in which there is nothing but noise.

    Attributes:
        values_um: noise, what is common or drifts taken out [um], shape (n_samples,).
        displacement_um: where the actuator was [um], shape (n_samples,).
        power_gain: by how much the power of the noise is larger than that of the values [1].
        n_drift: number of slow functions taken out.
    """

    values_um: Array
    displacement_um: Array
    power_gain: float
    n_drift: int

    @property
    def lowest_frequency(self) -> float:
        """Lowest frequency at which the stretch can be believed [cycles per sample].

        Each slow function takes one of the two degrees of freedom of a Fourier line, the tapers smear over
        ``n_tapers + 1`` half lines.
        """
        return 0.5 * (self.n_drift + N_TAPERS + 1) / self.values_um.size


@dataclass(frozen=True)
class NoiseSpectrum:
    """One-sided spectral density of a noise.

    Attributes:
        frequency: frequencies [cycles per sample], increasing, up to 0.5, shape (n_frequencies,).
        density: density [um^2 per cycle per sample], shape (n_frequencies,).
        lowest_seen: frequency below which the density is continued and not measured [cycles per sample].
        degrees_of_freedom: of the variance, as of a chi-squared variable [1].
        process: autoregressive process that whitens it.
    """

    frequency: Array
    density: Array
    lowest_seen: float
    degrees_of_freedom: float
    process: AutoregressiveFilter

    def variance_um2(self, low: float = 0.0, high: float = 0.5) -> float:
        """Return the variance between two frequencies [um^2]; a constant density below the table is counted."""
        f = np.concatenate(([0.0], self.frequency))
        s = np.concatenate((self.density[:1], self.density))
        inside = np.unique(np.concatenate(([low, high], f[(f > low) & (f < high)])))
        return float(np.trapezoid(np.interp(inside, f, s), inside))

    def unseen_share(self) -> float:
        """Return the share of the variance that may lie below what is seen, down to the lowest frequency [1]."""
        seen = self.variance_um2(self.lowest_seen)
        level = float(np.interp(self.lowest_seen, self.frequency, self.density))
        below = max(
            hidden_um2(level, self.lowest_seen, self.frequency[0]),
            self.variance_um2(self.frequency[0], self.lowest_seen),
        )
        return below / (below + seen) if below + seen > 0.0 else 0.0


def hidden_um2(density: float, lowest_seen: float, low: float) -> float:
    """Return the power that may lie between two frequencies below what is seen [um^2].

    The larger of two: flicker noise that goes on from the density at the lowest frequency seen, and a random walk of a
    third of that density, which would bend the lowest octave seen by no more than its own scatter.
    """
    ratio = lowest_seen / low
    return density * lowest_seen * max(float(np.log(ratio)), ratio / 3.0) if ratio > 1.0 else 0.0


def spectrum_of(stretches: Sequence[NoiseStretch], n_record: int) -> NoiseSpectrum:
    """Return the spectrum of the noise in the stretches, continued down to what a record can hold.

    Args:
        stretches: stretches of one noise at one sample period.
        n_record: number of samples of the longest record the spectrum is to serve for.
    """
    scaled = [s.values_um * np.sqrt(s.power_gain) for s in stretches]
    n = sum(s.size for s in scaled)
    # the usual highest order of an autoregressive spectrum, 10 log10 n
    order = min(_MAX_ORDER // 2, int(10.0 * np.log10(max(n, 10))))
    fast, slow, lowest, bands = _fitted(scaled, stretches, order)
    # white noise of this length would not show what the filter misses: half a unit of log likelihood
    whitener = levinson(slow.autocovariance(min(_LONGEST_FILTER, int(0.5 / lowest))), slack=1.0 / n_record)
    process = process_of(
        np.convolve(fast.coefficients, whitener.coefficients), fast.innovation_um2 * whitener.innovation_um2
    )
    frequency = frequency_grid(n_record)
    density = fast.density(frequency) * slow.density(frequency) / 2.0
    density = _continued(frequency, density, fast, slow, lowest)
    freedom = _degrees_of_freedom(frequency, density, bands, lowest)
    return NoiseSpectrum(frequency, density, lowest, freedom, process)


def _fitted(
    scaled: Sequence[Array], stretches: Sequence[NoiseStretch], max_order: int
) -> tuple[AutoregressiveFilter, OrnsteinUhlenbeckSum, float, Bands]:
    """Return the fast shape, what multiplies it, the lowest frequency seen, and the bands less the fast shape."""
    n = sum(s.size for s in scaled)
    may_be_walk = _may_be_walk(stretches)
    longest = burg([np.diff(s) for s in scaled] if may_be_walk else scaled, max_order)
    lowest = [s.lowest_frequency for s in stretches]
    # few coefficients are a noise's own; many may only bend to what a sum of slow parts describes better
    orders = sorted({0, 1, 2, 4, longest.order})
    shapes = [
        (order, AutoregressiveFilter(longest.reflection[:order], longest.variance_um2))
        for order in orders
        if order <= longest.order
    ]
    if may_be_walk:
        walk = np.array([1.0, -(1.0 - 1.0 / (_WALK_LENGTHS * n))])
        shapes = [(k, process_of(np.convolve(f.coefficients, walk), f.innovation_um2)) for k, f in shapes]
        shapes.append((0, burg(scaled, 0)))
    else:
        shapes = [(k, _without_drift_bias(f, stretches)) for k, f in shapes]
    best, found = np.inf, None
    for order, fast in shapes:
        bands = bands_of([fast.whiten(v) for v in scaled], lowest)
        slow, misfit = slow_part(bands)
        criterion = float(np.sum(bands.freedom)) * np.log(fast.innovation_um2) + misfit + order * np.log(n)
        if may_be_walk and fast.order == 0:
            n_drift = np.array([s.n_drift for s in stretches])
            criterion += _LIKELIER_WITHOUT_DRIFT * float(np.sum(n_drift) + 1.3 * np.sqrt(np.sum(n_drift**2)))
        if criterion < best:
            best, found = criterion, (fast, slow, float(bands.frequency[0]), bands)
    assert found is not None
    return found


def _drift_bias(stretches: Sequence[NoiseStretch], root: float, n: int) -> float:
    """Return by how much taking out slow functions makes the root of a first-order process come out smaller.

    For ``d`` functions in a stretch of n samples ``(d + (d + 2) r) / n`` in the mean (Marriott & Pope, "Bias in the
    estimation of autocorrelations", Biometrika 41 (1954), for a mean; one more ``(1 + r) / n`` for each further one).
    """
    return sum(s.n_drift + (s.n_drift + 2) * root for s in stretches) / n


def _may_be_walk(stretches: Sequence[NoiseStretch]) -> bool:
    """Return whether the slow part of the noise cannot be told from a random walk.

    On means of blocks, some 64 a stretch, a walk without its drift is a first-order process whose root lies at twice
    its bias from one, three times at most in 95 of 100 stretches (simulated, one to six functions taken out; Dickey &
    Fuller, "Distribution of the estimators for autoregressive time series with a unit root", JASA 74 (1979)).
    """
    product, power, n = 0.0, 0.0, 0
    for stretch in stretches:
        block = max(1, stretch.values_um.size // _N_BLOCKS)
        n_blocks = stretch.values_um.size // block
        means = stretch.values_um[: n_blocks * block].reshape(n_blocks, block).mean(axis=1)
        product += stretch.power_gain * float(np.dot(means[1:], means[:-1]))
        power += stretch.power_gain * float(np.dot(means, means))
        n += n_blocks
    root = product / power if power > 0.0 else 0.0
    spread = 2.0 + 1.0 / np.sqrt(len(stretches))
    return bool(root > 0.0 and 1.0 - root < spread * _drift_bias(stretches, root, n))


def _without_drift_bias(process: AutoregressiveFilter, stretches: Sequence[NoiseStretch]) -> AutoregressiveFilter:
    """Return the process with its slowest root, where that is real, put back by its bias."""
    if process.order == 0:
        return process
    roots = np.roots(process.coefficients)
    slowest = int(np.argmin(np.abs(1.0 - roots)))
    root = float(roots[slowest].real)
    if abs(roots[slowest].imag) > 1e-9 or root <= 0.0:
        return process
    n = sum(s.values_um.size for s in stretches)
    roots[slowest] = max(root, min(root + _drift_bias(stretches, root, n), 1.0 - 1.0 / (_WALK_LENGTHS * n)))
    return process_of(np.real(np.poly(roots)), process.innovation_um2)


def frequency_grid(n_record: int) -> Array:
    """Return frequencies a density is tabulated at: even in log frequency from one cycle per two records, and even."""
    n_points = max(2, int(_POINTS_PER_OCTAVE * np.log2(max(n_record, 4))))
    return np.union1d(np.geomspace(0.5 / max(n_record, 4), 0.5, n_points), np.linspace(0.0, 0.5, _N_LINEAR + 1)[1:])


def _slope(density: Array, frequency: Array) -> float:
    return float(np.polyfit(np.log(frequency), np.log(density), 1)[0])


def _continued(
    frequency: Array, density: Array, fast: AutoregressiveFilter, slow: OrnsteinUhlenbeckSum, lowest: float
) -> Array:
    """Return the density, below what is seen continued by a power law.

    Slow parts go on with the slope they have over the lowest three octaves, the fast shape as it is.
    """
    octaves = lowest * np.geomspace(1.0, 8.0, 7)
    octaves = octaves[octaves <= 0.5]
    if octaves.size < 2 or frequency[0] >= lowest:
        return density
    slope = float(np.clip(_slope(slow.density(octaves), octaves), -2.0, 0.0))
    at = slow.density(octaves[:1])[0] / 2.0
    law = at * (frequency / lowest) ** slope * fast.density(frequency)
    # no noise of a sensor rises faster towards zero than a random walk
    law = np.minimum(law, float(np.interp(lowest, frequency, density)) * (lowest / frequency) ** 2)
    return np.where(frequency < lowest, law, density)


def _degrees_of_freedom(frequency: Array, density: Array, bands: Bands, lowest: float) -> float:
    edges = np.sqrt(bands.frequency[1:] * bands.frequency[:-1])
    edges = np.concatenate(([lowest], edges, [0.5]))
    cumulative = np.concatenate(([0.0], np.cumsum(0.5 * (density[1:] + density[:-1]) * np.diff(frequency))))
    at_edges = np.interp(edges, frequency, cumulative)
    power = np.diff(at_edges)
    below = float(at_edges[0]) + float(density[0] * frequency[0])
    # what is continued and not measured is known to a factor: two degrees of freedom
    hidden = max(below, hidden_um2(float(np.interp(lowest, frequency, density)), lowest, 4.0 * frequency[0]))
    spread = float(np.sum(power**2 / bands.freedom)) + hidden**2 / 2.0
    total = float(np.sum(power)) + below
    return total**2 / spread if spread > 0.0 else 1.0
