"""rosbag2 folders, sqlite3 and MCAP."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from fomrc_core.errors import InputError, StorageError
from fomrc_core.records.recording import Recording
from fomrc_core.storage import read_recording, write_bag

rosbag2 = pytest.importorskip("rosbags.rosbag2")
typesys = pytest.importorskip("rosbags.typesys")

_STORE = typesys.get_typestore(typesys.Stores.ROS2_JAZZY)
_PLUGINS = {"mcap": rosbag2.StoragePlugin.MCAP, "sqlite3": rosbag2.StoragePlugin.SQLITE3}


def _joint_state(position_m: float | None, stamp_ns: int) -> Any:
    types = _STORE.types
    stamp = types["builtin_interfaces/msg/Time"](sec=stamp_ns // 10**9, nanosec=stamp_ns % 10**9)
    header = types["std_msgs/msg/Header"](stamp=stamp, frame_id="")
    empty = np.zeros(0)
    position = empty if position_m is None else np.array([position_m])
    return types["sensor_msgs/msg/JointState"](
        header=header, name=["axis"], position=position, velocity=empty, effort=empty
    )


def _float64(value: float) -> Any:
    return _STORE.types["std_msgs/msg/Float64"](data=float(value))


def _write(path: Path, messages: list[tuple[str, int, Any]], storage: str = "mcap") -> Path:
    """Write (topic, received at [ns], message) to a bag."""
    with rosbag2.Writer(path, version=9, storage_plugin=_PLUGINS[storage]) as writer:
        types = {topic: message.__msgtype__ for topic, _, message in messages}
        connections = {t: writer.add_connection(t, kind, typestore=_STORE) for t, kind in types.items()}
        for topic, received_ns, message in messages:
            raw = _STORE.serialize_cdr(message, message.__msgtype__)
            writer.write(connections[topic], received_ns, raw)
    return path


def _axis(prefix: str = "", n: int = 5, start_ns: int = 1_700_000_000_000_000_000) -> list[tuple[str, int, Any]]:
    messages: list[tuple[str, int, Any]] = []
    for k in range(n):
        messages.append((f"{prefix}/voltage", start_ns + k * 1_000_000, _float64(k)))
        messages.append((f"{prefix}/displacement", start_ns + k * 1_000_000 + 300_000, _float64(k * 2e-6)))
    return messages


@pytest.mark.parametrize("storage", ["mcap", "sqlite3"])
def test_each_displacement_goes_with_the_voltage_received_before_it(tmp_path: Path, storage: str) -> None:
    recording = read_recording(_write(tmp_path / "run_7", _axis(), storage))
    np.testing.assert_allclose(recording.time_s, np.arange(5) * 1e-3, atol=1e-12)
    np.testing.assert_array_equal(recording.voltage_v, np.arange(5.0))
    np.testing.assert_allclose(recording.measured_um, 2.0 * np.arange(5), rtol=1e-15)
    assert recording.name == "run_7"


def test_samples_before_the_first_voltage_are_left_out(tmp_path: Path) -> None:
    bag = _write(tmp_path / "bag", [("/displacement", 1, _float64(9.0)), *_axis(start_ns=1000)])
    assert read_recording(bag).n_samples == 5


def test_stamps_count_before_the_time_of_receipt(tmp_path: Path) -> None:
    messages: list[tuple[str, int, Any]] = [("/axis/voltage", 0, _joint_state(1.0, 0))]
    late_ns = [5_700_000, 6_100_000, 9_000_000]
    messages += [
        ("/axis/displacement", late, _joint_state(k * 1e-6, k * 1_000_000)) for k, late in enumerate(late_ns, 1)
    ]
    recording = read_recording(_write(tmp_path / "bag", messages))
    np.testing.assert_allclose(recording.time_s, [0.0, 1e-3, 2e-3], atol=1e-12)
    np.testing.assert_allclose(recording.measured_um, [1.0, 2.0, 3.0], rtol=1e-15)


def test_two_axes_need_names_and_the_other_axis_may_be_the_cross_one(tmp_path: Path) -> None:
    messages = sorted(_axis("/x") + _axis("/y"), key=lambda message: message[1])
    bag = _write(tmp_path / "bag", messages)
    with pytest.raises(StorageError, match=r"several topics could be the voltage.*--topics voltage="):
        read_recording(bag)
    recording = read_recording(
        bag,
        topics={
            "voltage": "/x/voltage",
            "displacement": "/x/displacement",
            "cross_voltage": "/y/voltage",
            "cross_displacement": "/y/displacement",
        },
    )
    assert recording.cross_voltage_v is not None
    np.testing.assert_array_equal(recording.cross_voltage_v, np.arange(5.0))


@pytest.mark.parametrize("storage", ["mcap", "sqlite3"])
def test_written_bags_read_back(tmp_path: Path, storage: str) -> None:
    time_s = np.arange(20) * 5e-3
    written = Recording(time_s, np.sin(time_s), np.cos(time_s) * 7, time_s * 3, 20 + time_s)
    write_bag(written, tmp_path / "bag", storage=storage)
    read = read_recording(tmp_path / "bag")
    np.testing.assert_allclose(read.time_s, time_s, atol=1e-9)
    np.testing.assert_array_equal(read.voltage_v, written.voltage_v)
    np.testing.assert_allclose(read.measured_um, written.measured_um, rtol=1e-15)
    assert read.desired_um is not None
    assert read.temperature_c is not None
    np.testing.assert_allclose(read.desired_um, time_s * 3, rtol=1e-15)
    np.testing.assert_array_equal(read.temperature_c, 20 + time_s)
    with pytest.raises(StorageError, match="exists already"):
        write_bag(written, tmp_path / "bag")


@pytest.mark.parametrize(
    ("messages", "options", "expected"),
    [
        ([("/x", 1, _float64(1.0))], {}, "no topic for the voltage, got 'voltage' (allowed: /x)"),
        (_axis(), {"topics": {"displacement": "/none"}}, "no topic for the displacement, got '/none'"),
        (_axis(), {"topics": {"volts": "/voltage"}}, "unknown quantity in topics, got 'volts'"),
        (_axis(), {"columns": {"voltage": 0}}, "a rosbag2 has no columns or rate"),
        (_axis(n=1), {}, "too few displacement messages after the first voltage message, got 1"),
        (
            [("/voltage", 1, _STORE.types["std_msgs/msg/String"](data="1 V"))],
            {},
            "topic /voltage has another type, got 'std_msgs/msg/String'",
        ),
        ([("/voltage", 1, _joint_state(None, 1))], {}, "message 1 of /voltage has no position"),
        (
            [("/voltage", k, _joint_state(1.0, 10 - k)) for k in range(1, 4)],
            {},
            "stamps of the voltage go backwards",
        ),
        (
            [*_axis(), ("/voltage", 2 * 10**18, _float64(float("nan")))],
            {"topics": {"displacement": "/voltage"}},
            "voltage_v is not finite at sample 5",
        ),
    ],
)
def test_what_is_wrong_with_a_bag_is_told(tmp_path: Path, messages: list, options: dict, expected: str) -> None:
    bag = _write(tmp_path / "run_8", messages)
    with pytest.raises(InputError, match=re.escape(expected)) as caught:
        read_recording(bag, **options)
    assert "\n" not in str(caught.value)
    assert "run_8" in str(caught.value)


@pytest.mark.parametrize("storage", ["mcap", "sqlite3"])
def test_damaged_bags_are_refused(tmp_path: Path, storage: str) -> None:
    bag = _write(tmp_path / "bag", _axis(n=400), storage)
    data = next(path for path in bag.iterdir() if path.suffix in (".mcap", ".db3"))
    whole = data.read_bytes()
    for damaged in (b"", whole[: len(whole) // 2], b"junk" * 100):
        data.write_bytes(damaged)
        with pytest.raises(StorageError, match="cannot be read as a rosbag2"):
            read_recording(bag)
    (bag / "metadata.yaml").write_text("rosbag2_bagfile_information: [")
    with pytest.raises(StorageError, match="cannot be read as a rosbag2"):
        read_recording(bag)


def test_topics_are_for_bags_only(tmp_path: Path) -> None:
    path = tmp_path / "stage.csv"
    path.write_text("time_s,voltage_v\n0,1\n1,2\n")
    with pytest.raises(StorageError, match="topics are for rosbag2 folders"):
        read_recording(path, topics={"voltage": "/voltage"})
