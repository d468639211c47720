"""Whether what was averaged away is noise: tested where the drive turns and jumps, and for lines.

Noise is the same wherever the drive is; what acts faster than a bin (a mass that rings, a lag, a delay) shows after
turns and jumps of the drive, and a hum as a line of the spectrum.
"""

from __future__ import annotations

import numpy as np
from scipy.stats import chi2, wilcoxon

from fomrc_core.compute.arrays import Array
from fomrc_core.fitting.thinned_record import ThinnedRecord

_SIGNIFICANCE = 1e-4  # of the hypothesis that all is noise, for each of the two tests
_SURE = 3.7  # standard errors of that significance, one-sided
# Of the noise's power about turns and jumps: it raises an rms there by 5 %, about what a noise floor is known to.
_NEGLIGIBLE_SHARE = 0.1
_BENT = 0.003  # of the range of the drive, from one kept sample to the next: a jump, or a turn of a fast motion
_N_AFTER = 3  # bins after a bend in which its consequences are looked for
_MOST_SHARE = 0.5  # of the bins: where all is in motion there is no quiet to compare with
_N_EVENTS_MIN = 8
_N_AROUND = 40  # frequencies on either side that say what the noise is there
_LINE_POWER = 1.5  # times the noise at its frequency, at least


def structure_within(thinned: ThinnedRecord) -> tuple[str, ...]:
    """Return what lies within the bins of a thinned record that is not noise, a sentence each."""
    found = []
    share = _after_bends(thinned)
    above = f"above {0.5 * thinned.rate_hz:.4g} Hz"
    if share is not None:
        found.append(
            f"{thinned.whole.name}: {above}, turns and jumps of the drive leave {1e3 * share:.3g} nm rms beside noise"
        )
    for frequency_hz, amplitude_um in _lines(thinned):
        found.append(
            f"{thinned.whole.name}: {above}, a line at {frequency_hz:.5g} Hz of {1e3 * amplitude_um:.3g} nm is left"
        )
    return tuple(found)


def _after_bends(thinned: ThinnedRecord) -> float | None:
    """Return by how much the rms about turns and jumps of the drive exceeds that elsewhere [um]; None for noise."""
    counted = np.isfinite(thinned.scatter_um)
    is_event = thinned.after_bends(_BENT, _N_AFTER)
    events, quiet = thinned.scatter_um[is_event & counted] ** 2, thinned.scatter_um[~is_event & counted] ** 2
    if events.size < _N_EVENTS_MIN or events.size > _MOST_SHARE * counted.size:
        return None
    excess = float(np.mean(events) - np.mean(quiet))
    spread = float(np.std(quiet)) / np.sqrt(events.size)
    if excess < _SURE * spread or excess < _NEGLIGIBLE_SHARE * float(np.mean(quiet)):
        return None
    return float(np.sqrt(excess))


def _lines(thinned: ThinnedRecord) -> list[tuple[float, float]]:
    """Return frequency [Hz] and amplitude [um] of the lines too fast for the kept samples, the largest first."""
    spectrum = thinned.spectrum
    if spectrum.n_averaged < 2:
        return []
    power, frequency_hz = spectrum.power_um2, spectrum.frequency_hz
    around = _medians_around(power)
    n_degrees = 2.0 * spectrum.n_averaged
    level = float(chi2.isf(_SIGNIFICANCE / power.size, n_degrees)) / n_degrees
    is_line = (power > max(level, _LINE_POWER) * around) & (frequency_hz > 0.5 * thinned.rate_hz)
    found: list[tuple[float, float]] = []
    for k in sorted(np.flatnonzero(is_line), key=lambda k: -power[k]):
        if all(abs(frequency_hz[k] - f) > 4.0 * frequency_hz[1] for f, _ in found):
            found.append((float(frequency_hz[k]), float(np.sqrt(2.0 * (power[k] - around[k])))))
    return found[:3]


def _medians_around(power: Array) -> Array:
    from scipy.ndimage import median_filter  # slow to import; a model that is only run needs none

    return np.asarray(median_filter(power, 2 * _N_AROUND + 1, mode="nearest"))


def is_calmer(before: tuple[ThinnedRecord, ...], after: tuple[ThinnedRecord, ...], beyond: int) -> bool:
    """Return whether less is left within the bins after than before, beyond the first samples of the first record.

    Args:
        before: records, thinned about a smaller first fit.
        after: the same about a larger one.
        beyond: samples of the first record that do not count, for the larger fit was learned there.
    """
    gains, of_bends = [], []
    for number, (b, a) in enumerate(zip(before, after, strict=True)):
        first = -(-beyond // b.outline.n_in_bin) if number == 0 else 0
        gain = np.nan_to_num(b.scatter_um**2 - a.scatter_um**2)
        gains.append(gain[first:])
        starts = np.unique(b.bends(_BENT) // b.outline.n_in_bin)
        starts = starts[(starts >= first) & (starts < gain.size)]
        if starts.size:
            of_bends.append(np.add.reduceat(np.where(b.after_bends(_BENT, _N_AFTER), gain, 0.0), starts))
    gain = np.concatenate(gains)
    # a few jumps may hold nearly all of it: their ranks tell what their mean does not
    of_bends_um2 = np.concatenate(of_bends) if of_bends else np.zeros(0)
    is_many = of_bends_um2.size >= _N_EVENTS_MIN and bool(np.any(of_bends_um2))
    if is_many and float(wilcoxon(of_bends_um2, alternative="greater").pvalue) < _SIGNIFICANCE:
        return float(np.sum(of_bends_um2)) > 0.0
    if gain.size < _N_EVENTS_MIN:
        return False
    return bool(np.mean(gain) > _SURE * np.std(gain) / np.sqrt(gain.size))
