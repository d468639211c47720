"""From a command to what a sensor reads."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from test.hidden.third.arrays import Array
from test.hidden.third.effect import Hidden
from test.hidden.third.frame import Frame


def readings_um(frame: Frame, hidden: Sequence[Hidden] = ()) -> Array:
    """Return what is read at the record's samples, without noise [um].

    Args:
        frame: of the record.
        hidden: effects that act.
    """
    for one in hidden:
        if one.effect.before is not None:
            frame = one.effect.before(frame, one.values)
    command_v = _changed("command", frame.command_v, hidden, frame)
    fine_s = frame.fine_time_s
    duration_s = float(fine_s[-1] - fine_s[0])
    if _acts("path", hidden):
        path_v = _changed("path", command_v, hidden, frame)
    else:
        path_v = np.interp(fine_s, frame.time_s, command_v)
    drive_v = _changed("drive", path_v, hidden, frame)
    if _acts("hysteresis", hidden):
        strain_um = _changed("hysteresis", drive_v, hidden, frame)
    else:
        strain_um = frame.bench.hysteresis_um(drive_v)
    strain_um = _changed("strain", strain_um, hidden, frame)
    if _acts("creep", hidden):
        motion_um = _changed("creep", strain_um, hidden, frame)
    else:
        motion_um = frame.bench.creep(frame.step_s, duration_s).respond(strain_um, frame.step_s)
    for one in hidden:
        if "late" in one.effect.acts:
            motion_um = motion_um + one.effect.acts["late"](strain_um, one.values, frame)
    motion_um = _changed("motion", motion_um, hidden, frame)
    # Effects on the clock change the moment at which a reading is taken.
    moments_s = _changed("clock", frame.time_s, hidden, frame)[frame.recorded]
    return _changed("reading", np.interp(moments_s, fine_s, motion_um), hidden, frame)


def _acts(stage: str, hidden: Sequence[Hidden]) -> bool:
    return any(stage in one.effect.acts for one in hidden)


def _changed(stage: str, signal: Array, hidden: Sequence[Hidden], frame: Frame) -> Array:
    for one in hidden:
        if stage in one.effect.acts:
            signal = one.effect.acts[stage](signal, one.values, frame)
    return signal
