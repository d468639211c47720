"""A long record thinned for a search: readings averaged about what a first model leaves of them.

Averaging the readings of a bin would bend them wherever the motion bends: at every turn of the drive, and most where
hysteresis begins. Here a first fit F is run along the whole record, at its own rate, and only what it leaves is
averaged; the kept reading is F of the kept drive plus that mean. What the first fit gets right is then kept exactly,
and so is what a simulation loses on fewer samples, for it is in either; white noise stays white, smaller by the root of
the samples of a bin (a control variate; Boyle, "Options: a Monte Carlo approach", Journal of Financial Economics 4
(1977) 323). The drive keeps its turns and jumps.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from scipy.stats import chi2

from fomrc_core.compute.arrays import Array, Mask
from fomrc_core.compute.pulse import beat
from fomrc_core.effects import Covariates, Effect
from fomrc_core.errors import RecordingError
from fomrc_core.fitting.base_fit import choose_starts, fit_base, threshold_grid
from fomrc_core.fitting.fit_record import FitRecord
from fomrc_core.fitting.joint_fit import refit
from fomrc_core.fitting.play_columns import ColumnKinds
from fomrc_core.fitting.steady_tones import SteadyTone, steady_tones
from fomrc_core.fitting.trial_model import TrialModel, predict, relaxed_trial
from fomrc_core.model.simulation import run_chain, settle_chain
from fomrc_core.model.substeps import Substeps
from fomrc_core.records.drive_outline import DriveOutline, Index, drive_outline
from fomrc_core.records.recording import Recording

_N_THRESHOLDS = 48  # of the first fit: what it leaves is averaged, and bends by little
_N_CHUNK = 1 << 18  # samples run through at a time
_LEAST_IN_BIN = 3
_N_SPECTRUM = 1 << 13  # samples of a stretch whose spectrum is taken
_N_PERIODOGRAMS = 400  # averaged: more make lines no surer than hum is steady
_BENT_SIGNIFICANCE = 1e-4  # of the hypothesis that a bin holds noise alone
_MOST_BENT = 0.05  # of the bins: noise that is not the same everywhere is no bend
_N_LINEAR_FITS = 2  # beside effects: the columns are linear but for the creep order


@dataclass(frozen=True, eq=False)
class LeftSpectrum:
    """Spectrum of what a first fit leaves, averaged over stretches of a record.

    Attributes:
        frequency_hz: frequencies, shape (n_frequencies,).
        power_um2: mean square of a sine of each [um^2], half its amplitude squared, shape (n_frequencies,).
        n_averaged: stretches averaged.
    """

    frequency_hz: Array
    power_um2: Array
    n_averaged: int


@dataclass(frozen=True, eq=False)
class ThinnedRecord:
    """A record of fewer samples that says the same of anything slower than them.

    Attributes:
        recording: the kept samples; those that only follow the drive are not valid.
        whole: the record itself, without its steady tones.
        outline: which samples were kept, and which bin each stands for.
        n_averaged: readings in each bin that counted, shape (n_bins,).
        scatter_um: standard deviation of what the first fit leaves within each bin about a straight line [um], shape
            (n_bins,); nan where too few readings counted.
        n_bent: bins that do not count, for what the first fit leaves is more than noise within them: a mean of a bend
            is no reading.
        spectrum: of what the first fit leaves at the record's own rate.
        first_fit: the model whose residual was averaged, relaxed or rested before the record.
        substeps: how the kept steps are divided by whoever simulates them.
        tones: what was taken out of the readings.
    """

    recording: Recording
    whole: Recording
    outline: DriveOutline
    n_averaged: Array
    scatter_um: Array
    n_bent: int
    spectrum: LeftSpectrum
    first_fit: TrialModel
    substeps: Substeps
    tones: tuple[SteadyTone, ...] = ()

    def about(self, effects: tuple[Effect, ...]) -> ThinnedRecord:
        """Return the same thinned about a first fit beside effects, such as act in it.

        What acts within a bin, a lag after a jump, bends what a model without it leaves; with it, nothing is bent.
        """
        return replace(_thinned(self.whole, self.outline, effects, self.substeps), tones=self.tones)

    @property
    def is_mean(self) -> Mask:
        """Kept samples that carry the mean of a bin, shape (n_kept,)."""
        return np.asarray(self.outline.bin_of >= 0)

    @property
    def rate_hz(self) -> float:
        """Rate of the kept samples [Hz]."""
        return 1.0 / (self.outline.n_in_bin * self.whole.sample_period_s)

    @property
    def single_readings(self) -> Recording:
        """Return one reading of each bin, as it is."""
        return picked(self.whole, np.arange(self.outline.n_bins) * self.outline.n_in_bin)

    @property
    def noise_um(self) -> float:
        """Noise of single readings [um], from within the bins: of most of them, so that bends do not count."""
        counted = self.scatter_um[np.isfinite(self.scatter_um)]
        return _typical(counted, self.outline.n_in_bin) if counted.size else 0.0

    def bends(self, least_share: float) -> Index:
        """Return the samples of the whole record at which the drive turns or jumps, rising.

        Args:
            least_share: change of the drive's slope times a bin, of its range, from which it is a bend.
        """
        v, t = self.recording.voltage_v, self.recording.time_s
        slope = np.diff(v) / np.diff(t)
        is_bend = np.abs(np.diff(slope)) / self.rate_hz > least_share * float(np.ptp(v))
        return np.asarray(self.outline.samples[1:-1][is_bend])

    def after_bends(self, least_share: float, n_after: int) -> Mask:
        """Return the bins in which the drive turns or jumps, and some after each, shape (n_bins,).

        Args:
            least_share: change of the drive's slope times a bin, of its range, from which it is a bend.
            n_after: bins after it.
        """
        at = self.bends(least_share) // self.outline.n_in_bin
        found = np.zeros(self.outline.n_bins, dtype=np.bool_)
        for k in range(n_after + 1):
            found[np.minimum(at + k, found.size - 1)] = True
        return found

    @property
    def within_um(self) -> float:
        """What lies within the bins and was averaged away, rms [um]."""
        counted = np.isfinite(self.scatter_um)
        return float(np.sqrt(np.mean(self.scatter_um[counted] ** 2))) if np.any(counted) else 0.0


def thinned_records(
    recordings: tuple[Recording, ...], n_in_bin: int, substeps: Substeps = Substeps.NONE
) -> tuple[ThinnedRecord, ...]:
    """Return the records thinned, all by the same number.

    Args:
        recordings: with displacement; readings that are not valid are left out of the means, and steady tones.
            Both are what a mean would be bent by.
        n_in_bin: samples of a bin, odd.
        substeps: how the kept steps are divided by whoever simulates them.

    Raises:
        RecordingError: a voltage that is constant, or one that is too fast for bins as long.
    """
    found = []
    for recording in recordings:
        outline = drive_outline(recording.time_s, recording.voltage_v, n_in_bin)
        if outline is None:
            raise RecordingError(
                "drive is too fast to be thinned", where=recording.name, value=n_in_bin, allowed="fewer samples a bin"
            )
        tones = _tones(recording, outline) if n_in_bin > 1 else ()
        if tones:
            since_s = recording.time_s - recording.time_s[0]
            without_um = recording.measured_um - sum(tone.at(since_s) for tone in tones)
            recording = replace(recording, displacement_um=without_um)
        found.append(replace(_thinned(recording, outline, (), substeps), tones=tones))
    return tuple(found)


def _tones(whole: Recording, outline: DriveOutline) -> tuple[SteadyTone, ...]:
    """Return the steady tones in what a first fit leaves at the record's own rate."""
    n = outline.n_in_bin
    left_um = whole.measured_um.copy()
    for begin, moved_um in _run_along(_first_fit(whole, outline, ()), whole, n):
        left_um[begin : begin + moved_um.size] -= moved_um
    if whole.is_valid is not None and np.any(whole.is_valid):
        numbers = np.arange(left_um.size)
        left_um = np.interp(numbers, numbers[whole.is_valid], left_um[whole.is_valid])
    step_s = whole.sample_period_s
    # turns of the drive are slower than bins
    drive_v = whole.voltage_v[: outline.n_bins * n].reshape(outline.n_bins, n).mean(axis=1)
    return tuple(steady_tones(whole.name, left_um, step_s, drive_v, n * step_s))


def _thinned(whole: Recording, outline: DriveOutline, effects: tuple[Effect, ...], substeps: Substeps) -> ThinnedRecord:
    first = _first_fit(whole, outline, effects)
    n, n_bins = outline.n_in_bin, outline.n_bins
    mean_um, scatter_um, n_averaged = np.full(n_bins, np.nan), np.full(n_bins, np.nan), np.zeros(n_bins)
    periodogram = _Periodogram(1.0 / whole.sample_period_s)
    for begin, moved_um in _run_along(first, whole, n):
        part = slice(begin, begin + moved_um.size)
        n_here = moved_um.size // n
        left_um = whole.measured_um[part] - moved_um
        periodogram.add(left_um)
        left_um = left_um[: n_here * n].reshape(n_here, n)
        counts = None if whole.is_valid is None else whole.is_valid[part][: n_here * n].reshape(n_here, n)
        bins = slice(begin // n, begin // n + n_here)
        n_averaged[bins], mean_um[bins], scatter_um[bins] = _of_bins(left_um, counts)
    is_mean = outline.bin_of >= 0
    reading_um = np.full(outline.samples.size, np.nan)
    is_bent = _bent(scatter_um, n)
    reading_um[is_mean] = np.where(is_bent, np.nan, mean_um)[outline.bin_of[is_mean]]
    counts_here = np.isfinite(reading_um)
    where = np.flatnonzero(counts_here)
    if where.size < 2:
        raise RecordingError("no readings count", where=whole.name, allowed="readings that are valid")
    reading_um = np.interp(np.arange(reading_um.size), where, reading_um[where])
    at_kept_um = predict(first, FitRecord.of(picked(whole, outline.samples), substeps=substeps), 0)
    recording = Recording(
        whole.time_s[outline.samples],
        whole.voltage_v[outline.samples],
        at_kept_um + reading_um,
        is_valid=counts_here,
        name=whole.name,
        **{name: _means_of(getattr(whole, name), outline) for name in _BESIDE if getattr(whole, name) is not None},
    )
    return ThinnedRecord(
        recording, whole, outline, n_averaged, scatter_um, int(np.sum(is_bent)), periodogram.spectrum(), first, substeps
    )


def _bent(scatter_um: Array, n_in_bin: int) -> Mask:
    """Return the bins within which more is left than noise, the worst of them where they are many, (n_bins,)."""
    counted = np.isfinite(scatter_um)
    if n_in_bin <= 2 or not np.any(counted):
        return np.zeros(scatter_um.size, dtype=np.bool_)
    noise_um = _typical(scatter_um[counted], n_in_bin)
    level = float(chi2.isf(_BENT_SIGNIFICANCE, n_in_bin - 2)) / (n_in_bin - 2)
    worst = float(np.quantile(scatter_um[counted], 1.0 - _MOST_BENT))
    return np.asarray(np.nan_to_num(scatter_um) > max(np.sqrt(level) * noise_um, worst))


def _typical(scatter_um: Array, n_in_bin: int) -> float:
    # the median of a chi square of n degrees is n - 2/3, near enough
    share = max(1.0 - 2.0 / (3.0 * max(n_in_bin - 2, 1)), 0.5)
    return float(np.sqrt(np.median(scatter_um**2) / share))


class _Periodogram:
    """Averaged periodograms of stretches of a signal (Welch), their slow part taken out."""

    def __init__(self, rate_hz: float) -> None:
        self._window = np.hanning(_N_SPECTRUM)
        self._power = np.zeros(_N_SPECTRUM // 2 + 1)
        self._n_averaged = 0
        self._rate_hz = rate_hz

    def add(self, values: Array) -> None:
        """Take in another chunk [um]; what is left of it beyond whole stretches is left out."""
        if self._n_averaged >= _N_PERIODOGRAMS:
            return
        stretches = values[: values.size // _N_SPECTRUM * _N_SPECTRUM].reshape(-1, _N_SPECTRUM)
        for stretch in stretches:
            self._power += np.abs(np.fft.rfft((stretch - stretch.mean()) * self._window)) ** 2
        self._n_averaged += stretches.shape[0]

    def spectrum(self) -> LeftSpectrum:
        """Return the average so far."""
        frequency_hz = np.fft.rfftfreq(_N_SPECTRUM, 1.0 / self._rate_hz)
        scale = 2.0 / float(np.sum(self._window)) ** 2 / max(self._n_averaged, 1)
        return LeftSpectrum(np.asarray(frequency_hz, dtype=np.float64), self._power * scale, self._n_averaged)


_BESIDE = ("temperature_c", "cross_voltage_v", "cross_displacement_um")


def _means_of(values: Array, outline: DriveOutline) -> Array:
    """Return a signal beside the drive at the kept samples, averaged over each bin, shape (n_kept,)."""
    n = outline.n_in_bin
    means = values[: outline.n_bins * n].reshape(outline.n_bins, n).mean(axis=1)
    found = values[outline.samples].copy()
    is_mean = outline.bin_of >= 0
    found[is_mean] = means[outline.bin_of[is_mean]]
    return np.asarray(found)


def _first_fit(whole: Recording, outline: DriveOutline, effects: tuple[Effect, ...]) -> TrialModel:
    """Return hysteresis and creep, beside effects that are held, fitted to the readings at the kept samples."""
    readings = picked(whole, outline.samples)
    records = (FitRecord.of(readings),)
    columns = ColumnKinds.plays(threshold_grid(records, _N_THRESHOLDS))
    shortest_s = 0.5 * whole.sample_period_s
    trial = fit_base(records, columns, choose_starts(records), shortest_time_s=shortest_s)[0]
    if not effects:
        return trial
    for effect in effects:
        trial = trial.with_cause(effect)
    divided = (FitRecord.of(readings, substeps=Substeps.BENDS),)
    for _ in range(_N_LINEAR_FITS):
        trial = refit(trial, divided, n_iterations=1, free=()).model
    return trial


def picked(whole: Recording, samples: Index, counts: Mask | None = None) -> Recording:
    """Return some samples of a record, as they are.

    Args:
        whole: the record.
        samples: which, rising.
        counts: which of them count, beside those that are valid; all where not given.
    """
    valid = None if whole.is_valid is None else whole.is_valid[samples]
    if counts is not None:
        valid = counts if valid is None else counts & valid
    beside = {name: getattr(whole, name)[samples] for name in _BESIDE if getattr(whole, name) is not None}
    time_s, voltage_v, measured_um = whole.time_s[samples], whole.voltage_v[samples], whole.measured_um[samples]
    return Recording(time_s, voltage_v, measured_um, is_valid=valid, name=whole.name, **beside)


def _run_along(trial: TrialModel, whole: Recording, n_in_bin: int) -> Iterator[tuple[int, Array]]:
    """Yield where each chunk of a record begins and the displacement [um] of a model along it, offset not included."""
    effects = trial.effects_in(0)
    state, at_creep = relaxed_trial(trial, effects)
    start = trial.start_of(0)
    if start is not None:
        settle_chain(state, at_creep, effects, start.drive(), Substeps.NONE)
    steps_s, covariates = whole.steps_s, Covariates.of_recording(whole)
    n_chunk = max(_N_CHUNK // n_in_bin, 1) * n_in_bin
    for begin in range(0, whole.n_samples, n_chunk):
        part = slice(begin, begin + n_chunk)
        beat("chunks")
        beside = covariates.part(part)
        drive = (steps_s[part], whole.voltage_v[part])
        yield begin, run_chain(state, at_creep, effects, *drive, substeps=Substeps.NONE, covariates=beside)


def _of_bins(left_um: Array, counts: Mask | None) -> tuple[Array, Array, Array]:
    """Return how many readings of each bin count, their mean, and their scatter about a straight line, (n_bins,) each.

    Args:
        left_um: what a model leaves [um], shape (n_bins, n_in_bin).
        counts: readings that count, of the same shape; all of them where not given.
    """
    n_bins, n = left_um.shape
    weight = np.ones((n_bins, n)) if counts is None else counts.astype(np.float64)
    n_counted = weight.sum(axis=1)
    safe = np.maximum(n_counted, 1.0)
    mean_um = (left_um * weight).sum(axis=1) / safe
    off = (left_um - mean_um[:, None]) * weight
    since = np.arange(n) - 0.5 * (n - 1)
    since = (since - ((since * weight).sum(axis=1) / safe)[:, None]) * weight
    length = np.maximum((since**2).sum(axis=1), 1e-300)
    squares = (off**2).sum(axis=1) - (off * since).sum(axis=1) ** 2 / length
    scatter_um = np.sqrt(np.maximum(squares, 0.0) / np.maximum(n_counted - 2.0, 1.0))
    is_enough = n_counted >= min(max(_LEAST_IN_BIN, n // 2), n)
    return n_counted, np.where(is_enough, mean_um, np.nan), np.where(is_enough, scatter_um, np.nan)
