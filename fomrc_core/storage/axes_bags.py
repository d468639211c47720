"""Recordings of several axes in rosbag2 folders: a topic for each axis, or a JointState of all of them."""

from __future__ import annotations

import os
import re
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from fomrc_core.errors import StorageError
from fomrc_core.storage.bags import is_bag, opened_bag, stamped_messages

if TYPE_CHECKING:
    from rosbags.highlevel import AnyReader

Array = NDArray[np.float64]

_UNITS = {"voltage": ("v", 1.0), "displacement": ("um", 1e6)}  # of a column, and that many in a unit of the message
_JOINT_STATE, _FLOAT64 = "sensor_msgs/msg/JointState", "std_msgs/msg/Float64"
_Series = tuple[NDArray[np.int64], Array]  # stamps [ns], (n,); values, (n, n_axes)


def is_axes_bag(path: str | os.PathLike[str]) -> bool:
    """Return whether a folder is a bag with the displacements of several axes; False for what cannot be read."""
    if not is_bag(path):
        return False
    try:
        with opened_bag(path) as reader:
            topics = _topics(reader, "displacement")
            if len(topics) == 1 and topics[0][1] == _JOINT_STATE:
                return any(len(message.position) > 1 for _, message in stamped_messages(reader, topics[0][0]))
            return len(topics) > 1
    except StorageError:
        return False


def axes_columns_of_bag(path: str | os.PathLike[str]) -> dict[str, Array]:
    """Return the columns ``time_s, voltage_1_v, ..., displacement_1_um, ...`` of a bag, at one rate.

    Axes are counted in the order of their topics' names (``/x/voltage``, ``/y/voltage``; or ``voltage_1``,
    ``voltage_2``), or as in a JointState. A voltage is the last one sent by a time; displacements are straight between
    their messages, whose stamps jitter.

    Raises:
        StorageError: no such topics, of another type, or whose axes come and go.
    """
    where = os.fspath(path)
    with opened_bag(path) as reader:
        series = {what: _series(reader, what, where) for what in _UNITS}
    begin_ns = max(stamps_ns[0] for each in series.values() for stamps_ns, _ in each)
    end_ns = min(stamps_ns[-1] for stamps_ns, _ in series["displacement"])
    clock_ns = series["displacement"][0][0]
    clock_ns = clock_ns[(clock_ns >= begin_ns) & (clock_ns <= end_ns)]
    if clock_ns.size < 4:
        raise StorageError("too few messages in which all axes have begun", where=where, allowed="4 or more")
    n_steps = clock_ns.size - 1
    time_s = (clock_ns[-1] - clock_ns[0]) * 1e-9 * np.arange(n_steps + 1) / n_steps
    columns = {"time_s": time_s}
    for what, each in series.items():
        unit, scale = _UNITS[what]
        found = [scale * _at(stamps_ns - clock_ns[0], value, time_s, what) for stamps_ns, v in each for value in v.T]
        columns |= {f"{what}_{k}_{unit}": values for k, values in enumerate(found, 1)}
    return columns


def _at(stamps_ns: NDArray[np.int64], values: Array, time_s: Array, what: str) -> Array:
    if what == "displacement":
        return np.interp(time_s, stamps_ns * 1e-9, values)
    # a stage has answered to the voltage it had received; half a nanosecond is the stamps' own
    last = np.searchsorted(stamps_ns, time_s * 1e9 + 0.5, side="right") - 1
    return np.asarray(values[np.maximum(last, 0)])


def _topics(reader: AnyReader, what: str) -> list[tuple[str, str]]:
    """Return name and type of the topics of a quantity, in the order of the axes."""
    name = re.compile(rf"{what}(_?(\d+))?$")
    found = {c.topic: c.msgtype for c in reader.connections if name.fullmatch(c.topic.rpartition("/")[2])}

    def order(topic: str) -> tuple[str, int]:
        match = name.fullmatch(topic.rpartition("/")[2])
        return topic.rpartition("/")[0], int(match[2] or 0) if match else 0

    return [(topic, found[topic]) for topic in sorted(found, key=order)]


def _series(reader: AnyReader, what: str, where: str) -> list[_Series]:
    topics = _topics(reader, what)
    if not topics:
        raise StorageError(f"no topic for the {what} of an axis", where=where, allowed=f"/x/{what}, /y/{what}, ...")
    found = []
    for topic, kind in topics:
        if kind not in (_FLOAT64, _JOINT_STATE):
            allowed = f"{_FLOAT64}, {_JOINT_STATE}"
            raise StorageError(f"topic {topic} has another type", where=where, value=kind, allowed=allowed)
        messages = list(stamped_messages(reader, topic))
        rows: list[Any] = [m.position if kind == _JOINT_STATE else [m.data] for _, m in messages]
        widths = {len(row) for row in rows}
        if len(widths) != 1 or widths == {0}:
            value = sorted(widths)
            raise StorageError(f"messages of {topic} have no or changing positions", where=where, value=value)
        stamps_ns = np.array([stamp_ns for stamp_ns, _ in messages], dtype=np.int64)
        if np.any(np.diff(stamps_ns) < 0):
            raise StorageError(f"stamps of {topic} go backwards", where=where, allowed="increasing time")
        found.append((stamps_ns, np.array(rows, dtype=np.float64)))
    return found
