"""Whether a recording can teach anything: refused where it cannot, each reason in one line."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from fomrc_core.compute.arrays import Array, Mask
from fomrc_core.errors import RecordingError
from fomrc_core.records.direction import falls_with_voltage
from fomrc_core.records.noise import difference_noise_um
from fomrc_core.records.quality import noisy_end
from fomrc_core.records.recording import Recording

N_SAMPLES_MIN = 100
LONGEST_GAP_STEPS = 20.0
SAMPLE_PERIOD_S = (1e-7, 100.0)
# From below a shear plate of lithium niobate, 2e-5 um/V, to above a stage of 20 mm at 1 V either way that creeps and
# drifts. Metres taken for micrometres are beyond it; what is nearer and still odd is asked about where a command is
# given it (``plausibility``).
GAIN_UM_PER_V = (1e-5, 2e4)

# A sensor at the end of its range gives one reading for a stretch of samples while the voltage goes on.
_N_CLIPPED_MIN = 20
_CLIPPED_RUN = 5
_CLIPPED_SHARE = 0.01
_N_SIGMA = 4.0  # of the noise about one reading
_N_ALIKE_MIN = 4  # runs of one reading inside of the range from which on they are how the record is


def check_usable(recordings: Sequence[Recording]) -> None:
    """Raise RecordingError for the first record nothing can be learnt from.

    Args:
        recordings: records to learn from or to be judged by.

    Raises:
        RecordingError: none given; too short; a gap in time; a sample period, a voltage, a
            displacement or a gain that no piezo actuator has; a displacement that falls where the voltage rises;
            a sensor that was clipped.
    """
    if not recordings:
        raise RecordingError("no recording given", where="recordings", allowed="one or more")
    for record in recordings:
        check_clock(record)
        _check_moves(record)
        _check_units(record)
        _check_direction(record)
        _check_not_clipped(record)


def check_clock(record: Recording) -> None:
    """Raise RecordingError for a record that is too short, has a gap, or a sample period that no actuator has."""
    if record.n_samples < N_SAMPLES_MIN:
        raise RecordingError(
            "record is too short", where=record.name, value=record.n_samples, allowed=f"{N_SAMPLES_MIN} samples or more"
        )
    period_s = record.sample_period_s
    if not SAMPLE_PERIOD_S[0] <= period_s <= SAMPLE_PERIOD_S[1]:
        raise RecordingError(
            "time is in other units than seconds, by its median step",
            where=f"{record.name}: time_s",
            value=period_s,
            allowed=f"{SAMPLE_PERIOD_S[0]:g} to {SAMPLE_PERIOD_S[1]:g} s",
        )
    steps = np.diff(record.time_s)
    longest, longest_allowed_s = int(np.argmax(steps)), LONGEST_GAP_STEPS * period_s
    if steps[longest] > longest_allowed_s:
        raise RecordingError(
            f"gap after sample {longest}, at {record.time_s[longest]:.6g} s: what the drive did in it is not known",
            where=f"{record.name}: time_s",
            value=float(f"{steps[longest]:.6g}"),
            allowed=f"steps up to {LONGEST_GAP_STEPS:g} times the median, {longest_allowed_s:.4g} s; "
            "give the parts as records of their own",
        )


def _check_moves(record: Recording) -> None:
    for column, values in (("voltage_v", record.voltage_v), ("displacement_um", record.measured_um)):
        quantity = column.partition("_")[0]
        if float(np.ptp(values)) == 0.0:
            raise RecordingError(
                f"{quantity} is constant",
                where=f"{record.name}: {column}",
                value=float(values[0]),
                allowed=f"a {quantity} that moves",
            )


def _check_units(record: Recording) -> None:
    gain = float(np.ptp(record.measured_um)) / float(np.ptp(record.voltage_v))
    low, high = GAIN_UM_PER_V
    if not low <= gain <= high:
        likely = "metres given as um, or uV as V" if gain < low else "pm given as um, or MV as V"
        raise RecordingError(
            f"displacement range over voltage range is no piezo actuator's: {likely}?",
            where=f"{record.name}: displacement_um",
            value=gain,
            allowed=f"{low:g} to {high:g} um/V",
        )


def _check_direction(record: Recording) -> None:
    if falls_with_voltage(record.voltage_v, record.measured_um):
        raise RecordingError(
            "displacement falls where the voltage rises: the sign of one is reversed",
            where=f"{record.name}: displacement_um",
            allowed="voltage and displacement counted so that they rise together: --units displacement=-1um",
        )


def _check_not_clipped(record: Recording) -> None:
    x = record.measured_um
    levels = np.unique(x)
    resolution_um = float(np.min(np.diff(levels)))
    # Where the sensor's steps hide its noise, a reading that stays the same says nothing.
    noise_um = difference_noise_um(record)
    if noise_um < 0.5 * resolution_um:
        return
    least_v = _CLIPPED_SHARE * float(np.ptp(record.voltage_v))
    for name, end_um in (("highest", float(levels[-1])), ("lowest", float(levels[0]))):
        starts, stops = _runs(x, x == end_um)
        moved = _drive_in_runs(record, x == end_um)
        n_clipped, n_moved = int(np.sum(stops - starts)), int(np.count_nonzero(moved > least_v))
        if n_clipped < _N_CLIPPED_MIN or n_moved == 0:
            continue
        # a drive of coarse steps holds the reading everywhere, but for noise, and a sensor at its end only there
        moved_inside = _drive_where_it_stands(record, (levels[0], levels[-1]), resolution_um + _N_SIGMA * noise_um)
        n_alike = int(np.count_nonzero(moved_inside > 0.5 * max(moved)))
        if n_alike < max(_N_ALIKE_MIN, n_moved):
            raise RecordingError(
                f"sensor is clipped: {n_clipped} samples, the first at {record.time_s[starts[0]]:.6g} s, "
                f"stand at exactly the {name} reading while the voltage moves",
                where=f"{record.name}: displacement_um",
                value=end_um,
                allowed="a sensor inside of its range",
            )
    end = noisy_end(record)
    if end is not None:
        raise RecordingError(
            f"sensor is clipped: {end.n_samples} samples, the first at {end.first_s:.6g} s, lie flat at the "
            f"{end.name} reading but for noise, without creep, while the voltage moves on",
            where=f"{record.name}: displacement_um",
            value=end.level_um,
            allowed="a sensor inside of its range",
        )


def _runs(values: Array, chosen: Mask) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return where runs of one value begin and end among the chosen samples, those of a few samples left out."""
    edges = np.flatnonzero((values[1:] != values[:-1]) | (chosen[1:] != chosen[:-1])) + 1
    starts, stops = np.concatenate(([0], edges)), np.concatenate((edges, [values.size]))
    kept = (stops - starts >= _CLIPPED_RUN) & chosen[starts]
    return starts[kept], stops[kept]


def _drive_in_runs(record: Recording, chosen: Mask) -> Array:
    """Return by how much the drive moves in each run of one reading among the chosen samples [V], shape (n_runs,)."""
    starts, stops = _runs(record.measured_um, chosen)
    return np.array([float(np.ptp(record.voltage_v[a:b])) for a, b in zip(starts, stops, strict=True)])


def _drive_where_it_stands(record: Recording, ends_um: tuple[float, float], reach_um: float) -> Array:
    """Return by how much the drive moves while the reading stays where it is, inside of the range [V], (n_stands,)."""
    x, v = record.measured_um, record.voltage_v
    moved: list[float] = []
    first, low_v, high_v = 0, float(v[0]), float(v[0])
    for k in range(1, x.size + 1):
        if k < x.size and abs(x[k] - x[first]) <= reach_um:
            low_v, high_v = min(low_v, float(v[k])), max(high_v, float(v[k]))
            continue
        if k - first >= _CLIPPED_RUN and ends_um[0] < x[first] < ends_um[1]:
            moved.append(high_v - low_v)
        if k < x.size:
            first, low_v, high_v = k, float(v[k]), float(v[k])
    return np.array(moved)
