"""The noise of records: from repeats and rests of the drive where there are any, else from fast changes alone."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from fomrc_core.compute.arrays import Array, Mask
from fomrc_core.compute.runs import runs_of
from fomrc_core.errors import RecordingError
from fomrc_core.records.noise_differences import difference_noise
from fomrc_core.records.noise_model import NoiseModel, NoiseSource
from fomrc_core.records.noise_parts import fit_sum
from fomrc_core.records.noise_spectrum import NoiseSpectrum, NoiseStretch, frequency_grid, spectrum_of
from fomrc_core.records.noise_stretches import (
    N_STRETCH_MIN,
    Rest,
    find_rests,
    stretches_of_repeats,
    stretches_of_rests,
)
from fomrc_core.records.recording import Recording
from fomrc_core.records.repeats import Repeat, find_repeats
from fomrc_core.records.sensor_step import sensor_step_um, unquantised_variance_um2
from fomrc_core.records.spectral_lines import without_lines
from fomrc_core.records.whitening import burg, levinson

_SAME_PERIOD = 0.01
# Flicker that hides below what is seen may change the rms by a quarter: that is 1 - 0.75^2 of the power.
_UNSEEN_SHARE = 1.0 - 0.75**2
_N_LAGS = 64
_N_LAGS_OF_STEP = 256
_GROWTH_LEVEL = 1e-4
_GROWTH_SEEN = 0.3  # of the stroke, as far as the centre is sought beyond what is seen
_N_PLACES = 24
_N_CENTRES = 33
_N_SIGMA_CLIPPED = 6.0


def estimate_noise(recordings: Sequence[Recording], is_usable: Sequence[Mask | None] | None = None) -> NoiseModel:
    """Return a model of the noise of the recordings.

    Args:
        recordings: measured records of one sensor. Those sampled at another period than the longest are left out.
        is_usable: for each record the samples to be used, None for all; see ``data_quality``.

    Raises:
        RecordingError: none given, or one without displacement.
    """
    if not recordings:
        raise RecordingError("no recording given", where="recordings", allowed="one or more")
    masks = list(is_usable) if is_usable is not None else [None] * len(recordings)
    longest = max(recordings, key=lambda r: r.n_samples)
    period_s = longest.sample_period_s
    chosen = [
        (r, m)
        for r, m in zip(recordings, masks, strict=True)
        if abs(r.sample_period_s - period_s) <= _SAME_PERIOD * period_s
    ]
    displacement = np.concatenate([r.measured_um for r, _ in chosen])
    # what stands in for readings left out is on no step
    step = sensor_step_um(np.concatenate([_read_um(r, m) for r, m in chosen]))
    repeats, rests = list[NoiseStretch](), list[NoiseStretch]()
    for recording, usable in chosen:
        found = find_repeats(recording.voltage_v)
        repeats += stretches_of_repeats(recording, found, usable)
        rests += stretches_of_rests(recording, _outside(find_rests(recording.voltage_v), found), usable)
    # at rest a sensor whose step hides its noise gives one code: that says nothing
    rests = [s for s in rests if not float(np.std(s.values_um)) < 0.5 * step]
    stretches = [*repeats, *rests]
    if not stretches:
        return _from_differences(chosen, longest.n_samples, period_s, step)
    source = NoiseSource.REPEATS_AND_RESTS if repeats and rests else NoiseSource.REPEATS
    source = source if repeats else NoiseSource.RESTS
    model = _from_stretches(stretches, longest.n_samples, period_s, source, displacement)
    return _with_step(model, step, displacement)


def _read_um(recording: Recording, usable: Mask | None) -> Array:
    read = recording.valid_samples if usable is None else recording.valid_samples & usable
    return recording.measured_um[read]


def noise_from_residual(
    residual_um: Array,
    sample_period_s: float,
    displacement_um: Array | None = None,
    is_usable: Mask | None = None,
    n_parameters: int = 0,
) -> NoiseModel:
    """Return the model of a residual as if it were noise: its colour, level and growth.

    Args:
        residual_um: what a fit has left [um], shape (n_samples,).
        sample_period_s: sample period [s].
        displacement_um: measured displacement [um], to see growth with it, shape (n_samples,).
        is_usable: samples to be used, shape (n_samples,); None for all.
        n_parameters: number of parameters that were fitted: the residual is smaller than the noise by these.
    """
    values = np.asarray(residual_um, dtype=np.float64)
    x = np.zeros(values.size) if displacement_um is None else np.asarray(displacement_um, dtype=np.float64)
    usable = np.ones(values.size, dtype=np.bool_) if is_usable is None else np.asarray(is_usable, dtype=np.bool_)
    n = int(np.count_nonzero(usable))
    if n < N_STRETCH_MIN:
        raise RecordingError("too few samples for a noise model", value=n, allowed=f"{N_STRETCH_MIN} or more")
    values = np.interp(np.arange(values.size), np.flatnonzero(usable), values[usable])
    gain = values.size / max(n - n_parameters, 1)
    stretch = NoiseStretch(values - np.mean(values), x, gain, 1)
    return _from_stretches([stretch], values.size, sample_period_s, NoiseSource.RESIDUAL, x)


def _from_stretches(
    stretches: Sequence[NoiseStretch], n_record: int, period_s: float, source: NoiseSource, displacement_um: Array
) -> NoiseModel:
    cleaned, lines = [], list[float]()
    for stretch in stretches:
        values, found = without_lines(stretch.values_um)
        cleaned.append(replace(stretch, values_um=_clipped(values)))
        lines += [f / period_s for f in found]
    slope, centre = growth_of(cleaned, _GROWTH_SEEN * float(np.ptp(displacement_um)))
    even = [
        replace(s, values_um=s.values_um / np.sqrt(1.0 + (slope * (s.displacement_um - centre)) ** 2)) for s in cleaned
    ]
    if not any(np.any(s.values_um) for s in even):
        spectrum = _silent(n_record)
    else:
        spectrum = spectrum_of(even, n_record)
    return NoiseModel(
        spectrum=spectrum,
        sample_period_s=period_s,
        n_record=n_record,
        source=source,
        n_samples=sum(s.values_um.size for s in even),
        sees_slow_noise=spectrum.unseen_share() <= _UNSEEN_SHARE,
        growth_per_um=slope,
        growth_centre_um=centre,
        mean_square_growth=float(np.mean(1.0 + (slope * (displacement_um - centre)) ** 2)),
        lines_hz=tuple(sorted(lines)),
    )


def _from_differences(
    chosen: Sequence[tuple[Recording, Mask | None]], n_record: int, period_s: float, step_um: float
) -> NoiseModel:
    pairs = []
    for recording, usable in chosen:
        if usable is None or bool(np.all(usable)):
            pairs.append((recording.voltage_v, recording.measured_um))
            continue
        # differences must not reach over a gap
        pairs += [
            (recording.voltage_v[a:b], recording.measured_um[a:b]) for a, b in runs_of(usable) if b - a >= N_STRETCH_MIN
        ]
    found = difference_noise(pairs)
    frequency = frequency_grid(n_record)
    process = levinson(found.parts.autocovariance(_N_LAGS))
    if process.variance_um2 <= 0.0:
        spectrum = _silent(n_record)
    else:
        density = found.parts.density(frequency)
        # four points a lag apart see half a cycle of what is 8 lags long
        spectrum = NoiseSpectrum(frequency, density, 0.125 / found.longest_lag, found.degrees_of_freedom, process)
    model = NoiseModel(spectrum, period_s, n_record, NoiseSource.DIFFERENCES, found.n_samples, sees_slow_noise=False)
    return _with_step(model, step_um, np.concatenate([r.measured_um for r, _ in chosen]))


def _with_step(model: NoiseModel, step_um: float, displacement_um: Array) -> NoiseModel:
    """Return the model with the whole error of the quantiser in it, as white noise."""
    if not np.isfinite(step_um):
        return model
    spectrum = model.spectrum
    seen = spectrum.variance_um2()
    total = unquantised_variance_um2(seen, step_um) + step_um**2 / 12.0
    more = max(0.0, total - seen)
    if more <= 0.0:
        return replace(model, step_um=step_um)
    # a reading that stays has one error: as many errors are independent as codes are read, weighed by how long
    changes = np.flatnonzero(np.abs(np.diff(displacement_um)) > 0.5 * step_um)
    dwell = np.diff(np.concatenate(([0], changes + 1, [displacement_um.size]))).astype(np.float64)
    n_codes = float(np.sum(dwell)) ** 2 / float(np.dot(dwell, dwell))
    freedom = (seen + more) ** 2 / (seen**2 / spectrum.degrees_of_freedom + more**2 / n_codes)
    autocovariance = spectrum.process.autocovariance(_N_LAGS)
    autocovariance[0] += more
    wider = replace(
        spectrum,
        density=spectrum.density + 2.0 * more,
        degrees_of_freedom=freedom,
        process=levinson(autocovariance),
    )
    return replace(model, spectrum=wider, step_um=step_um)


def _outside(rests: Sequence[Rest], repeats: Sequence[Repeat]) -> list[Rest]:
    """Return the rests without what repeats hold of them: no sample is to count twice."""
    left = list(rests)
    for repeat in repeats:
        start, stop = repeat.start, repeat.stop + repeat.period_samples
        cut = [(Rest(r.start, min(r.stop, start)), Rest(max(r.start, stop), r.stop)) for r in left]
        left = [part for both in cut for part in both if part.stop > part.start]
    return left


def _silent(n_record: int) -> NoiseSpectrum:
    """Return the spectrum of a sensor that shows no noise at all."""
    frequency = frequency_grid(n_record)
    # smaller than any reading can resolve, and not zero: whitening divides by it
    least = np.finfo(np.float64).tiny ** 0.25
    process = levinson(np.array([least]))
    return NoiseSpectrum(frequency, np.full(frequency.size, 2.0 * least), float(frequency[0]), 1.0, process)


def _clipped(values: Array) -> Array:
    """Return the values with those clipped that no Gaussian noise reaches: a spike that was not masked."""
    limit = _N_SIGMA_CLIPPED * 1.4826 * float(np.median(np.abs(values)))
    return np.clip(values, -limit, limit) if limit > 0.0 else values


def growth_of(stretches: Sequence[NoiseStretch], least_um: float) -> tuple[float, float]:
    """Return by how much noise grows with displacement [1/um] and from where [um]; zeros where it does not.

    Squares of the whitened noise, averaged over places, are fitted with ``a + b (x - c)^2``, a and b zero or more, the
    centre c tried over three times the range. The growth has to be likelier than none at one in ten thousand, and is
    not told from places nearer to each other than least_um: nobody knows how it goes on from there.
    """
    whitener = burg([s.values_um * np.sqrt(s.power_gain) for s in stretches], _N_LAGS // 2)
    if whitener.variance_um2 <= 0.0:
        return 0.0, 0.0
    square = np.concatenate([whitener.whiten(s.values_um) ** 2 for s in stretches])
    # where the actuator was, and not what the noise made of it: at rest that is all that is read
    x = np.concatenate([s.displacement_um - s.values_um for s in stretches])
    span = float(np.ptp(x))
    if span == 0.0 or span < least_um:
        return 0.0, 0.0
    place = np.minimum(((x - np.min(x)) * (_N_PLACES / span)).astype(np.int64), _N_PLACES - 1)
    count = np.bincount(place, minlength=_N_PLACES).astype(np.float64)
    used = count > 0
    count = count[used]
    power = np.maximum(np.bincount(place, square, _N_PLACES)[used] / count, 1e-12)
    at = np.bincount(place, x, _N_PLACES)[used] / count
    if at.size < 3:
        return 0.0, 0.0
    none = float(np.average(power, weights=count))
    flat = -0.5 * float(np.sum(count * (np.log(none) + power / none)))
    best, slope, centre = flat, 0.0, 0.0
    for c in np.linspace(np.min(x) - span, np.max(x) + span, _N_CENTRES):
        shapes = np.column_stack((np.ones(at.size), ((at - c) / span) ** 2))
        a, b = fit_sum(shapes, power, count)
        expected = shapes @ np.array([a, b])
        likelihood = -0.5 * float(np.sum(count * (np.log(expected) + power / expected)))
        if likelihood > best:
            best, slope, centre = likelihood, float(np.sqrt(b / a) / span), float(c)
    if 2.0 * (best - flat) < -2.0 * math.log(_GROWTH_LEVEL):  # of two degrees of freedom
        return 0.0, 0.0
    return slope, centre
