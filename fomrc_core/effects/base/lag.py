"""How long a lag must be for samples to know of it."""

from __future__ import annotations

# Of a sample. What the drive does between two samples nobody has read: whether it is held or goes straight is half a
# sample of lag, a converter's settling or the skew of two channels some hundredths of one. What is less says nothing of
# a stage: it mends a little of what another form gets wrong with the rate.
_LEAST_SAMPLES = 0.05


def is_seen(lag_s: float, step_s: float) -> bool:
    """Return whether a lag [s] is more than what samples so far apart [s] leave open."""
    return lag_s >= _LEAST_SAMPLES * step_s
