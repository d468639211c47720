"""A long record at its own rate where it tells most: about turns and jumps of its drive, outlined in between.

What acts faster than a thinned sample shows after turns and jumps. Windows about many of them say more of it than as
many readings in a row, and of more loops. Between the windows only the drive is kept, so that the memory of the
actuator is right; readings there do not count.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fomrc_core.fitting.thinned_record import ThinnedRecord, picked
from fomrc_core.records.drive_outline import Index, drive_outline
from fomrc_core.records.recording import Recording

_N_WINDOW = 256  # samples of a window where there are many: some periods of what rings at a tenth of the rate
_N_WINDOW_MOST = 4096
_BEFORE = 1.0 / 16.0  # of a window, before the bend
_SPAN = 0.6  # of the record at most: what is found is confirmed on the rest
_BENT = 0.003  # of the range of the drive, from one kept sample to the next
_N_BETWEEN = 4_000  # samples between the windows
_MOVES = 0.1  # of the range of the drive: less shows no loop to speak of


@dataclass(frozen=True, eq=False)
class BendWindows:
    """The windows as a record of their own.

    Attributes:
        recording: readings within the windows valid, those between them not.
        n_span: samples of the record they were taken from, from its beginning.
        n_windows: number of windows; 1 where the drive hardly turns and the beginning was taken.
    """

    recording: Recording
    n_span: int
    n_windows: int


def bend_windows(thinned: ThinnedRecord, n_samples: int) -> BendWindows | None:
    """Return windows of a record about turns and jumps of its drive; None where the drive hardly moves there.

    Args:
        thinned: the record, thinned.
        n_samples: readings in all windows.
    """
    whole = thinned.whole
    n_span = int(_SPAN * whole.n_samples)
    bends = thinned.bends(_BENT)
    bends = bends[bends < n_span]
    n_window = int(np.clip(n_samples // max(_apart(bends, _N_WINDOW).size, 1), _N_WINDOW, _N_WINDOW_MOST))
    kept = _apart(bends, n_window)[: n_samples // n_window]
    inside = np.zeros(n_span, dtype=np.bool_)
    if kept.size < 2:
        inside[:n_samples] = True
    for bend in kept:
        begin = max(int(bend) - int(_BEFORE * n_window), 0)
        inside[begin : begin + n_window] = True
    n_span = int(np.flatnonzero(inside)[-1]) + 1
    inside = inside[:n_span]
    inside[0] = True
    if float(np.ptp(whole.voltage_v[:n_span])) < _MOVES * float(np.ptp(whole.voltage_v)):
        return None
    samples = np.union1d(np.flatnonzero(inside), _between(thinned, n_span))
    record = picked(whole, samples, counts=inside[samples])
    return BendWindows(record, n_span, max(int(kept.size), 1))


def _apart(bends: Index, n_window: int) -> Index:
    """Return the bends that lie farther apart than a window, the first of each group."""
    found: list[int] = []
    for bend in bends:
        if not found or bend - found[-1] >= n_window:
            found.append(int(bend))
    return np.array(found, dtype=np.int64)


def _between(thinned: ThinnedRecord, n_span: int) -> Index:
    """Return samples that outline the drive from its beginning."""
    whole = thinned.whole
    n_in_bin = max(n_span // _N_BETWEEN, thinned.outline.n_in_bin)
    coarse = drive_outline(whole.time_s[:n_span], whole.voltage_v[:n_span], n_in_bin)
    found = thinned.outline.samples if coarse is None else coarse.samples
    return np.asarray(found[found < n_span])
