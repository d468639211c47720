"""What can be wrong with the samples of a record, and how it is told."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

import numpy as np
from numpy.typing import NDArray

from fomrc_core.compute.arrays import Mask

_N_TIMES_TOLD = 3


class FaultKind(Enum):
    """What went wrong."""

    SPIKES = "spikes"
    DROPOUTS = "dropouts"
    STUCK = "stuck sensor"
    LOST = "lost samples"
    DOUBLED = "doubled samples"
    GAPS = "missing samples"
    UNEVEN_CLOCK = "uneven clock"
    NOISY_DRIVE = "noisy drive"


_WORDS = {
    FaultKind.SPIKES: "readings that leave their neighbours on both sides and come back, as no drive makes them",
    FaultKind.DROPOUTS: "readings that jump to one and the same value and back",
    FaultKind.STUCK: "readings that stay exactly the same while the stage goes on, and then jump to where it is",
    FaultKind.LOST: "readings that are a whole sample early from there on, as where a reader loses one",
    FaultKind.DOUBLED: "readings that are a whole sample late from there on, as where a reader keeps one twice",
    FaultKind.GAPS: "steps of the clock in which samples are missing",
    FaultKind.UNEVEN_CLOCK: "steps of the clock that are not all alike",
    FaultKind.NOISY_DRIVE: "fluctuations of the recorded drive of which the displacement shows nothing",
}

_IN_MICRONS = (FaultKind.SPIKES, FaultKind.DROPOUTS, FaultKind.STUCK)


@dataclass(frozen=True, eq=False)
class DataFault:
    """One kind of fault in one record.

    Attributes:
        kind: what went wrong.
        samples: samples concerned, rising, shape (n_bad,).
        times_s: their times [s], shape (n_bad,).
        size: of spikes and dropouts the largest jump, of a stuck sensor the largest jump at its release [um]; of
            missing samples the longest step, of an uneven clock the rms of the steps, in median steps [1]; of lost and
            doubled samples their number [1]; of the noise of a drive its rms [V].
        is_masked: whether the samples are left out of every fit and score.
        readings_um: what the sensor read there [um], shape (n_bad,); empty for a clock.
    """

    kind: FaultKind
    samples: NDArray[np.int64]
    times_s: NDArray[np.float64]
    size: float
    is_masked: bool
    readings_um: NDArray[np.float64]

    def __str__(self) -> str:
        times = ", ".join(f"{t:.6g}" for t in self.times_s[:_N_TIMES_TOLD])
        more = ", ..." if self.times_s.size > _N_TIMES_TOLD else ""
        unit = " um" if self.kind in _IN_MICRONS else " V rms" if self.kind is FaultKind.NOISY_DRIVE else ""
        done = "left out" if self.is_masked else "taken as they are"
        if self.kind in (FaultKind.LOST, FaultKind.DOUBLED):
            done = "those after them moved to where they belong"
        if self.kind is FaultKind.NOISY_DRIVE:
            done = "smoothed"
        return (
            f"{self.kind.value}: {self.samples.size} samples, at {times}{more} s, size {self.size:.4g}{unit}; {done} "
            f"({_WORDS[self.kind]})"
        )


@dataclass(frozen=True, eq=False)
class DataQuality:
    """What is wrong with the samples of one record.

    Attributes:
        name: of the record.
        n_samples: of the record.
        faults: what was found; empty where nothing is wrong.
        is_valid: samples that count, shape (n_samples,).
    """

    name: str
    n_samples: int
    faults: tuple[DataFault, ...]
    is_valid: Mask

    @property
    def n_masked(self) -> int:
        """Number of samples left out."""
        return int(np.count_nonzero(~self.is_valid))

    def __str__(self) -> str:
        return "\n".join(f"{self.name}: {fault}" for fault in self.faults)

    def joined(self, other: DataQuality) -> DataQuality:
        """Return what two looks at the same record found."""
        return DataQuality(self.name, self.n_samples, (*self.faults, *other.faults), self.is_valid & other.is_valid)
