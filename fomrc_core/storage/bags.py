"""Recordings in rosbag2 folders, sqlite3 or MCAP, without ROS."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from fomrc_core.compute.pulse import beat
from fomrc_core.errors import FomrcError, StorageError
from fomrc_core.records.recording import Recording

if TYPE_CHECKING:
    from rosbags.highlevel import AnyReader
    from rosbags.interfaces import Connection

_UM_PER_M = 1e6

# Last part of a topic's name, field of Recording, core units per message unit, by quantity.
_QUANTITIES: dict[str, tuple[str, str, float]] = {
    "voltage": ("voltage", "voltage_v", 1.0),
    "displacement": ("displacement", "displacement_um", _UM_PER_M),
    "desired": ("desired_position", "desired_um", _UM_PER_M),
    "temperature": ("temperature", "temperature_c", 1.0),
    "cross_voltage": ("cross_voltage", "cross_voltage_v", 1.0),
    "cross_displacement": ("cross_displacement", "cross_displacement_um", _UM_PER_M),
}
_VALUE_OF_TYPE: dict[str, Callable[[Any], float]] = {
    "std_msgs/msg/Float64": lambda message: message.data,
    "sensor_msgs/msg/JointState": lambda message: message.position[0],
    "sensor_msgs/msg/Temperature": lambda message: message.temperature,
}


def is_bag(path: str | os.PathLike[str]) -> bool:
    """Tell whether a path is a folder that holds a rosbag2 recording."""
    return (Path(path) / "metadata.yaml").is_file()


def read_bag(path: str | os.PathLike[str], *, topics: Mapping[str, str] | None = None) -> Recording:
    """Read a recording from a rosbag2 folder.

    One sample per displacement message (per voltage message where there is no displacement). Every other
    quantity is taken from its last message at that time: a stage has answered to the voltage it had
    received, not to the one on its way. Times are the stamps of the messages where they have one, and when
    the message was recorded where not.

    Args:
        path: folder with metadata.yaml.
        topics: topic by quantity (voltage, displacement, desired, temperature, cross_voltage,
            cross_displacement); without it the topics whose last name is voltage, displacement,
            desired_position and so on.

    Raises:
        StorageError: not readable as a bag, topic missing, of another type or ambiguous.
        RecordingError: what was read is not a usable recording.
    """
    where = os.fspath(path)
    with opened_bag(path) as reader:
        chosen = _choose_topics(reader, topics or {}, where)
        series = {quantity: _read_topic(reader, topic, where) for quantity, topic in chosen.items()}
    return _aligned(series, where)


@contextmanager
def opened_bag(path: str | os.PathLike[str]) -> Iterator[AnyReader]:
    """Open a rosbag2 folder; what goes wrong in it meanwhile is told in a line.

    Raises:
        StorageError: the package rosbags is not there, or the folder is not readable as a bag.
    """
    where = os.fspath(path)
    reader_class = _reader_class(where)
    try:
        with reader_class([Path(path)], default_typestore=_typestore()) as reader:
            yield reader
    except FomrcError:
        raise
    except Exception as error:
        # The readers below pass on whatever SQLite, YAML or a decompressor raises on a damaged file.
        raise StorageError(f"cannot be read as a rosbag2 ({_first_line(error)})", where=where) from None


def stamped_messages(reader: AnyReader, topic: str) -> Iterator[tuple[int, Any]]:
    """Yield each message of a topic with its stamp [ns], or with when it was recorded where it has none."""
    same_topic = [c for c in reader.connections if c.topic == topic]
    for of_message, recorded_ns, raw in reader.messages(connections=same_topic):
        beat("messages")
        message: Any = reader.deserialize(raw, of_message.msgtype)
        stamp = message.header.stamp if hasattr(message, "header") else None
        stamped_ns = stamp.sec * 1_000_000_000 + stamp.nanosec if stamp is not None else 0
        yield stamped_ns or recorded_ns, message


def write_bag(recording: Recording, path: str | os.PathLike[str], *, storage: str = "mcap") -> None:
    """Write a recording as a rosbag2 folder with topics /voltage [V], /displacement [m] and so on.

    Args:
        recording: what to write.
        path: folder to make.
        storage: ``"mcap"`` or ``"sqlite3"``.

    Raises:
        StorageError: the folder exists or cannot be made.
    """
    where = os.fspath(path)
    _reader_class(where)
    from rosbags.rosbag2 import StoragePlugin, Writer

    plugins = {"mcap": StoragePlugin.MCAP, "sqlite3": StoragePlugin.SQLITE3}
    if storage not in plugins:
        raise StorageError("unknown bag storage", where=where, value=storage, allowed="mcap or sqlite3")
    if Path(path).exists():
        raise StorageError("exists already", where=where, allowed="a new folder")
    store = _typestore()
    float64 = store.types["std_msgs/msg/Float64"]
    stamps_ns = np.round(recording.time_s * 1e9).astype(np.int64)
    try:
        with Writer(Path(path), version=9, storage_plugin=plugins[storage]) as writer:
            series = []
            for topic, field, scale in _QUANTITIES.values():
                values = getattr(recording, field)
                if values is not None:
                    connection = writer.add_connection(f"/{topic}", float64.__msgtype__, typestore=store)
                    series.append((connection, values / scale))
            for k, stamp_ns in enumerate(stamps_ns):
                for connection, values in series:
                    message = float64(data=float(values[k]))
                    writer.write(connection, int(stamp_ns), store.serialize_cdr(message, float64.__msgtype__))
    except OSError as error:
        raise StorageError(f"cannot be written ({error.strerror or error})", where=where) from None


def _reader_class(where: str) -> type[AnyReader]:
    try:
        from rosbags.highlevel import AnyReader
    except ImportError:
        raise StorageError(
            "rosbag2 folders need the package rosbags", where=where, allowed="pip install 'fomrc_ros[bags]'"
        ) from None
    reader_class: type[AnyReader] = AnyReader
    return reader_class


def _typestore() -> Any:
    from rosbags.typesys import Stores, get_typestore

    return get_typestore(Stores.ROS2_JAZZY)


def _choose_topics(reader: AnyReader, topics: Mapping[str, str], where: str) -> dict[str, Connection]:
    for quantity in topics:
        if quantity not in _QUANTITIES:
            raise StorageError(
                "unknown quantity in topics", where=where, value=quantity, allowed=", ".join(_QUANTITIES)
            )
    chosen: dict[str, Connection] = {}
    for quantity, (last_name, _, _) in _QUANTITIES.items():
        if quantity in topics:
            candidates = [c for c in reader.connections if c.topic == topics[quantity]]
        else:
            candidates = [c for c in reader.connections if c.topic.rpartition("/")[2] == last_name]
        names = sorted({connection.topic for connection in candidates})
        if len(names) > 1:
            raise StorageError(
                f"several topics could be the {quantity}",
                where=where,
                value=names,
                allowed=f"one, named by --topics {quantity}=...",
            )
        if not names and (quantity in topics or quantity == "voltage"):
            raise StorageError(
                f"no topic for the {quantity}",
                where=where,
                value=topics.get(quantity, last_name),
                allowed=", ".join(sorted({c.topic for c in reader.connections})) or "a bag with topics",
            )
        if names:
            if candidates[0].msgtype not in _VALUE_OF_TYPE:
                raise StorageError(
                    f"topic {names[0]} has another type",
                    where=where,
                    value=candidates[0].msgtype,
                    allowed=", ".join(_VALUE_OF_TYPE),
                )
            chosen[quantity] = candidates[0]
    return chosen


def _read_topic(reader: AnyReader, connection: Connection, where: str) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    value_of = _VALUE_OF_TYPE[connection.msgtype]
    stamps_ns, values = [], []
    for stamp_ns, message in stamped_messages(reader, connection.topic):
        try:
            values.append(float(value_of(message)))
        except IndexError:
            raise StorageError(
                f"message {len(values) + 1} of {connection.topic} has no position",
                where=where,
                allowed="JointState with at least one position",
            ) from None
        stamps_ns.append(stamp_ns)
    if not values:
        raise StorageError(f"topic {connection.topic} holds no messages", where=where, allowed="2 or more")
    return np.array(stamps_ns, dtype=np.int64), np.array(values)


def _aligned(series: dict[str, tuple[NDArray[np.int64], NDArray[np.float64]]], where: str) -> Recording:
    for quantity, (stamps_ns, _) in series.items():
        if np.any(np.diff(stamps_ns) < 0):
            raise StorageError(f"stamps of the {quantity} go backwards", where=where, allowed="increasing time")
    clock = "displacement" if "displacement" in series else "voltage"
    times_ns = series[clock][0]
    times_ns = times_ns[times_ns >= series["voltage"][0][0]]
    if times_ns.size < 2:
        raise StorageError(
            f"too few {clock} messages after the first voltage message",
            where=where,
            value=int(times_ns.size),
            allowed="2 or more",
        )
    fields: dict[str, Any] = {}
    for quantity, (stamps_ns, values) in series.items():
        last = np.searchsorted(stamps_ns, times_ns, side="right") - 1
        _, field, scale = _QUANTITIES[quantity]
        fields[field] = scale * values[np.maximum(last, 0)]
    # Seconds since 1970 would leave only 0.2 us to a float: time counts from the first sample.
    return Recording((times_ns - times_ns[0]) * 1e-9, **fields, name=Path(where).resolve().name)


def _first_line(error: Exception) -> str:
    return (str(error).splitlines() or [type(error).__name__])[0]
