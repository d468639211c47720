"""What an effect may look at to propose trial instances of itself: the records and what the model left over."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.signal import find_peaks

Array = NDArray[np.float64]

_LEAST_TURN = 0.02  # of the range: less may be noise of a measured voltage
_N_CELLS = 8
MANY_LOOPS = 10  # a sine makes up to 4 kinds, triangles, steps and a multisine together 15 to 26


@dataclass(frozen=True, eq=False)
class RecordEvidence:
    """One record with the residual of the present model, all arrays of shape (n_samples,).

    Attributes:
        time_s: sample times from the record's start [s].
        steps_s: step that leads to each sample [s].
        voltage_v: drive [V].
        predicted_um: displacement the present model gives [um].
        residual_um: measured minus predicted [um], offset removed.
        has_temperature: whether the temperature was recorded.
        has_second_axis: whether a second axis was recorded.
    """

    time_s: Array
    steps_s: Array
    voltage_v: Array
    predicted_um: Array
    residual_um: Array
    has_temperature: bool = False
    has_second_axis: bool = False


@dataclass(frozen=True, eq=False)
class Evidence:
    """All records a diagnosis learns from."""

    records: tuple[RecordEvidence, ...]
    noise_um: float

    @property
    def sample_period_s(self) -> float:
        """Median step of the first record [s]."""
        return float(np.median(self.records[0].steps_s))

    @property
    def duration_s(self) -> float:
        """Length of the longest record [s]."""
        return max(float(record.time_s[-1]) for record in self.records)

    @property
    def largest_v(self) -> float:
        """Largest voltage of any record [V]."""
        return max(float(np.max(record.voltage_v)) for record in self.records)

    @property
    def smallest_v(self) -> float:
        """Smallest voltage of any record [V]."""
        return min(float(np.min(record.voltage_v)) for record in self.records)

    @property
    def fastest_v_per_s(self) -> float:
        """Largest rate of the drive [V/s]."""
        return max(float(np.max(np.abs(np.diff(r.voltage_v) / r.steps_s[1:]))) for r in self.records)

    @property
    def n_loop_kinds(self) -> int:
        """Number of kinds of loops of the drive."""
        return n_loop_kinds([record.voltage_v for record in self.records])

    @property
    def stroke_um(self) -> float:
        """Range of the predicted displacement [um]."""
        return max(float(np.ptp(record.predicted_um)) for record in self.records)


def n_loop_kinds(voltages_v: Sequence[Array]) -> int:
    """Return the number of kinds of sweeps between turning points of drives [V], told apart by width and mean."""
    low, high = min(float(np.min(v)) for v in voltages_v), max(float(np.max(v)) for v in voltages_v)
    if not high > low:
        return 0
    kinds: set[tuple[int, int]] = set()
    for voltage_v in voltages_v:
        share = (voltage_v - low) / (high - low)
        turns = [find_peaks(way, prominence=_LEAST_TURN)[0] for way in (share, -share)]
        ends = share[np.unique(np.concatenate(([0, share.size - 1], *turns)))]
        width, mean = np.abs(np.diff(ends)), 0.5 * (ends[1:] + ends[:-1])
        cells = np.minimum((_N_CELLS * np.column_stack((width, mean))).astype(int), _N_CELLS - 1)
        kinds.update((int(w), int(m)) for w, m in cells)
    return len(kinds)
