"""Records too long for a fit or a search, thinned together, and what that loses in words."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from fomrc_core.compute.arrays import Array
from fomrc_core.effects import Effect
from fomrc_core.fitting.memory_plan import Work, kept_samples
from fomrc_core.fitting.steady_tones import SteadyTone
from fomrc_core.fitting.structure_within import structure_within
from fomrc_core.fitting.thinned_record import ThinnedRecord, thinned_records
from fomrc_core.model.substeps import Substeps, parts_of_steps
from fomrc_core.records.drive_outline import drive_outline
from fomrc_core.records.quality import DataQuality, examine_long
from fomrc_core.records.recording import Recording
from fomrc_core.records.usability import check_clock, check_usable

Tell = Callable[[float, str], None]


@dataclass(frozen=True)
class Thinning:
    """How long records were thinned for a search, and what that loses.

    Attributes:
        n_samples: of all records.
        n_kept: samples searched.
        n_in_bin: readings averaged into one.
        rate_hz: rate of the samples searched [Hz].
        whole_rate_hz: rate of the records [Hz].
        searched_share: share of the records that was searched, from their beginning; 1 is all.
        tolerance_v: furthest the drive is from what was searched [V].
        noise_um: noise of single readings [um], where the drive is quiet.
        within_um: what was averaged away, rms [um].
        rms_um: what the result leaves of the records at their own rate, rms [um].
        looked_at_s: stretch of the first record that was searched at its own rate as well [s]; None where none was.
        n_windows: windows about turns and jumps of the drive in that stretch whose readings counted.
        found_at_whole_rate: causes named there, and confirmed on all records at their own rate.
        not_looked_for: causes that live in single samples and could not be looked for in all of the records.
        left_within: what is left within the bins that is not noise, in sentences; empty where it is noise.
        tones: steady tones that were taken out of the readings; no cause is named for them.
        doubted: causes that were named, and are likelier wrong than right.
    """

    n_samples: int
    n_kept: int
    n_in_bin: int
    rate_hz: float
    whole_rate_hz: float
    searched_share: float
    tolerance_v: float
    noise_um: float
    within_um: float
    rms_um: float
    looked_at_s: tuple[float, float] | None = None
    n_windows: int = 0
    found_at_whole_rate: tuple[str, ...] = ()
    not_looked_for: tuple[str, ...] = ()
    left_within: tuple[str, ...] = ()
    tones: tuple[SteadyTone, ...] = ()
    doubted: tuple[str, ...] = ()

    def __str__(self) -> str:
        return "; ".join(self.sentences())

    def sentences(self) -> tuple[str, ...]:
        """Return how the records were thinned and what that loses, a sentence each."""
        found = [
            f"thinned: {self.n_samples} samples to {self.n_kept}, from {self.whole_rate_hz:.4g} to "
            f"{self.rate_hz:.4g} Hz, {self.n_in_bin} readings averaged into one; turns and jumps of the drive are kept "
            f"to {1e3 * self.tolerance_v:.3g} mV",
            f"on all readings: {1e3 * self.rms_um:.4g} nm rms is left, their noise is {1e3 * self.noise_um:.4g} nm",
        ]
        if self.searched_share < 1.0:
            found.append(f"only the first {100.0 * self.searched_share:.3g} % was searched: the drive is too fast")
        fast = f"above {0.5 * self.rate_hz:.4g} Hz"
        if self.looked_at_s is not None:
            begin, end = self.looked_at_s
            names = ", ".join(self.found_at_whole_rate) or "none"
            found.append(
                f"causes {fast} were looked for at the full rate in {self.n_windows} windows about turns and jumps of "
                f"the drive from {begin:.4g} to {end:.4g} s: {names} found"
            )
        elif self.n_in_bin > 1:
            found.append(f"what lives {fast} was not looked for")
        if self.not_looked_for:
            found.append(f"not looked for, for it lives in single samples: {', '.join(self.not_looked_for)}")
        if self.n_in_bin > 1 and not self.tones:
            found.append("steady tones were looked for at the full rate: none found")
        return (*found, *self.unnamed)

    @property
    def unnamed(self) -> tuple[str, ...]:
        """What has no name, or one that is not to be believed, in sentences: nothing is explained beside it."""
        doubts = []
        if self.doubted:
            doubts.append(
                f"likelier wrong than right, and not to be believed of thinned records: {', '.join(self.doubted)}; "
                "diagnose a part that need not be thinned"
            )
        return (*(tone.sentence() for tone in self.tones), *self.left_within, *doubts)


@dataclass(frozen=True, eq=False)
class LongRecords:
    """Long records, each thinned, in the order given.

    Attributes:
        thinned: each thinned.
        quality: what is wrong with the readings of each at its own rate.
        searched_share: share of each that is searched, from its beginning; 1 is all.
        n_given: samples of all records.
    """

    thinned: tuple[ThinnedRecord, ...]
    quality: tuple[DataQuality, ...]
    searched_share: float
    n_given: int

    @classmethod
    def of(
        cls, recordings: Sequence[Recording], work: Work, max_memory_gb: float, tell: Tell | None = None
    ) -> LongRecords | None:
        """Return the records thinned; None where they are short enough to be taken as they are.

        Args:
            recordings: records, with displacement.
            work: what is to be done with them.
            max_memory_gb: bound of memory [GB].
            tell: progress.

        Raises:
            ParameterError: a bound that is too small.
            RecordingError: a record whose readings cannot be used.
        """
        n_given = sum(r.n_samples for r in recordings)
        n_kept = kept_samples(n_given, work, max_memory_gb, _mean_parts(recordings))
        if n_kept is None:
            return None
        tell = tell or (lambda _share, _text: None)
        tell(0.0, f"looking over {n_given} samples")
        looked = [examine_long(record) for record in recordings]
        given = [e.recording for e in looked]
        n_in_bin, share, given = _short_enough(given, n_kept)
        tell(0.01, "first fit, and what it leaves averaged")
        return cls(
            thinned_records(tuple(given), n_in_bin, work.substeps), tuple(e.quality for e in looked), share, n_given
        )

    @property
    def recordings(self) -> tuple[Recording, ...]:
        """The thinned records."""
        return tuple(t.recording for t in self.thinned)

    def about(self, effects: Sequence[Effect]) -> LongRecords:
        """Return the same thinned about a first fit beside effects of the actuator.

        What belongs to one record is taken along where there is one only: of several nobody says here whose it is.
        """
        is_alone = len(self.thinned) == 1
        own = tuple(effect for effect in effects if is_alone or not effect.belongs_to_record())
        return replace(self, thinned=tuple(t.about(own) for t in self.thinned))

    def check_usable(self) -> None:
        """Raise RecordingError for the first record nothing can be learnt from."""
        for thinned in self.thinned:
            check_clock(thinned.whole)
        check_usable([thinned.single_readings for thinned in self.thinned])

    def thinning(self, left_um: Sequence[Array]) -> Thinning:
        """Return how they were thinned, and what is left at their own rate.

        Args:
            left_um: what a model leaves of the thinned records, of the first of them at least [um], (n_kept,) each.
        """
        power, n_readings = 0.0, 0.0
        for thinned, left in zip(self.thinned, left_um, strict=False):
            counted = np.isfinite(thinned.scatter_um)
            at_bins = np.empty(thinned.outline.n_bins)
            at_bins[thinned.outline.bin_of[thinned.is_mean]] = left[thinned.is_mean]
            n = thinned.n_averaged[counted]
            # the mean of each bin is counted apart
            within = np.maximum(n - 1.0, 0.0) * thinned.scatter_um[counted] ** 2
            power += float(np.sum(n * at_bins[counted] ** 2 + within))
            n_readings += float(np.sum(n))
        first = self.thinned[0]
        within_um = [t.within_um for t in self.thinned]
        return Thinning(
            n_samples=self.n_given,
            n_kept=sum(r.n_samples for r in self.recordings),
            n_in_bin=first.outline.n_in_bin,
            rate_hz=first.rate_hz,
            whole_rate_hz=first.rate_hz * first.outline.n_in_bin,
            searched_share=self.searched_share,
            tolerance_v=max(t.outline.tolerance_v for t in self.thinned),
            noise_um=float(np.median([t.noise_um for t in self.thinned])),
            within_um=float(np.sqrt(np.mean(np.square(within_um)))),
            rms_um=float(np.sqrt(power / n_readings)),
            left_within=tuple(s for t in self.thinned for s in structure_within(t)),
            tones=tuple(tone for t in self.thinned for tone in t.tones),
        )


_NEARLY_ALL = 0.9


def _mean_parts(recordings: Sequence[Recording]) -> float:
    """Return into how many parts a fit that divides steps divides them, on average."""
    parts = 0
    for recording in recordings:
        change_v = np.diff(recording.voltage_v, prepend=recording.voltage_v[:1])
        parts += int(np.sum(parts_of_steps(change_v, 0.5 * float(np.ptp(recording.voltage_v)), 1, Substeps.BENDS)[0]))
    return parts / sum(r.n_samples for r in recordings)


def _odd(number: int) -> int:
    return number + 1 - number % 2


def _short_enough(given: list[Recording], n_kept: int) -> tuple[int, float, list[Recording]]:
    """Return samples of a bin, the share of the records that is kept, and their beginnings.

    Bins are as long as the drives allow, of the records and of what is kept of them: an outline allows for some turns
    a bin, and the beginning of a record may have more of them than the whole.
    """
    n_given = sum(r.n_samples for r in given)
    n_in_bin = _odd(-(-n_given // n_kept))
    while True:
        share = min(1.0, n_in_bin * n_kept / n_given)
        # rounding to odd numbers is no reason to leave any out
        share = 1.0 if share > _NEARLY_ALL else share
        kept = given if share == 1.0 else [_beginning(r, max(int(share * r.n_samples), 2)) for r in given]
        tried = [*given, *kept] if share < 1.0 else given
        if n_in_bin == 1 or all(drive_outline(r.time_s, r.voltage_v, n_in_bin) is not None for r in tried):
            return n_in_bin, share, kept
        n_in_bin = _odd(n_in_bin // 2 - 1) if n_in_bin > 3 else 1


def _beginning(recording: Recording, n: int) -> Recording:
    names = ("time_s", "voltage_v", "displacement_um", "temperature_c", "cross_voltage_v", "cross_displacement_um")
    held = {name: getattr(recording, name) for name in names}
    cut = {name: values[:n] for name, values in held.items() if values is not None}
    return Recording(
        **cut, is_valid=None if recording.is_valid is None else recording.is_valid[:n], name=recording.name
    )
