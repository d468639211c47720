"""Several axes from a rosbag2: a topic for each, or a JointState of all; a bag of one axis stays one."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from fomrc_core.errors import StorageError
from fomrc_core.storage.axes_files import is_axes_recording, read_axes_recording

rosbag2 = pytest.importorskip("rosbags.rosbag2")
typesys = pytest.importorskip("rosbags.typesys")

_STORE = typesys.get_typestore(typesys.Stores.ROS2_JAZZY)
_START_NS, _STEP_NS, _N = 1_700_000_000_000_000_000, 1_000_000, 40
_K = np.arange(_N)
_VOLTAGES = np.column_stack((np.sin(0.2 * _K), np.cos(0.3 * _K), 0.1 * _K))
_MOVED_UM = 2.0 * _VOLTAGES + 0.5


def _joint_state(positions: list[float], stamp_ns: int) -> Any:
    types = _STORE.types
    stamp = types["builtin_interfaces/msg/Time"](sec=stamp_ns // 10**9, nanosec=stamp_ns % 10**9)
    header, none = types["std_msgs/msg/Header"](stamp=stamp, frame_id=""), np.zeros(0)
    names = [f"axis_{k}" for k in range(len(positions))]
    return types["sensor_msgs/msg/JointState"](
        header=header, name=names, position=np.array(positions), velocity=none, effort=none
    )


def _write(path: Path, messages: list[tuple[str, int, Any]]) -> Path:
    with rosbag2.Writer(path, version=9) as writer:
        kinds = {topic: message.__msgtype__ for topic, _, message in messages}
        connections = {t: writer.add_connection(t, kind, typestore=_STORE) for t, kind in kinds.items()}
        for topic, received_ns, message in messages:
            writer.write(connections[topic], received_ns, _STORE.serialize_cdr(message, message.__msgtype__))
    return path


def _topics(names: list[str], jitter_ns: int = 0) -> list[tuple[str, int, Any]]:
    rng, float64 = np.random.default_rng(2), _STORE.types["std_msgs/msg/Float64"]
    messages = []
    for k in range(_N):
        at_ns = _START_NS + k * _STEP_NS
        for axis, name in enumerate(names):
            late_ns = 200_000 + int(rng.integers(-jitter_ns, jitter_ns + 1))
            messages.append((name.format("voltage"), at_ns, float64(data=float(_VOLTAGES[k, axis]))))
            moved_m = float(1e-6 * _MOVED_UM[k, axis])
            messages.append((name.format("displacement"), at_ns + late_ns, float64(data=moved_m)))
    return messages


@pytest.mark.parametrize("names", [["/a/{}", "/b/{}", "/c/{}"], ["/{}_1", "/{}_2", "/{}_3"]])
def test_a_topic_of_each_axis(tmp_path: Path, names: list[str]) -> None:
    bag = _write(tmp_path / "bag", _topics(names))
    assert is_axes_recording(bag)
    found = read_axes_recording(bag, 2)
    assert found.rate_hz == pytest.approx(1000.0)
    assert found.voltage_v.shape == found.displacement_um.shape == (_N // 2, 3, 2)
    np.testing.assert_allclose(found.voltage_v.transpose(2, 0, 1).reshape(_N, 3), _VOLTAGES, atol=1e-12)
    np.testing.assert_allclose(found.displacement_um.transpose(2, 0, 1).reshape(_N, 3), _MOVED_UM, atol=1e-9)


def test_stamps_that_jitter_are_put_on_one_rate(tmp_path: Path) -> None:
    found = read_axes_recording(_write(tmp_path / "bag", _topics(["/a/{}", "/b/{}"], 50_000)), 1)
    n = found.voltage_v.shape[0]
    assert n >= _N - 2
    # 0.1 ms of a motion of at most 0.6 um a sample
    assert np.max(np.abs(found.displacement_um[1:-1, :, 0] - _MOVED_UM[1 : n - 1, :2])) < 0.08


def test_a_joint_state_of_all_axes(tmp_path: Path) -> None:
    messages = []
    for k in range(_N):
        at_ns = _START_NS + k * _STEP_NS
        messages.append(("/voltage", at_ns, _joint_state(list(_VOLTAGES[k]), at_ns)))
        messages.append(("/displacement", at_ns, _joint_state(list(1e-6 * _MOVED_UM[k]), at_ns)))
    bag = _write(tmp_path / "bag", messages)
    assert is_axes_recording(bag)
    found = read_axes_recording(bag, 1)
    np.testing.assert_allclose(found.voltage_v[:, :, 0], _VOLTAGES, atol=1e-12)
    np.testing.assert_allclose(found.displacement_um[:, :, 0], _MOVED_UM, atol=1e-9)


def test_a_bag_of_one_axis_is_no_record_of_several(tmp_path: Path) -> None:
    assert not is_axes_recording(_write(tmp_path / "bag", _topics(["/a/{}"])))
    assert not is_axes_recording(tmp_path)


def test_bad_bags_are_refused_in_a_line(tmp_path: Path) -> None:
    changing = [("/displacement", _START_NS + k, _joint_state([0.0] * (1 + k % 2), _START_NS + k)) for k in range(9)]
    float64 = _STORE.types["std_msgs/msg/Float64"]
    moved = [m for m in _topics(["/a/{}", "/b/{}"]) if "displacement" in m[0]]
    text = _STORE.types["std_msgs/msg/String"](data="1 V")
    late = [("/voltage_1", _START_NS + 2 * _N * _STEP_NS, float64(data=1.0))]
    bad = {
        "no topic for the voltage": moved,
        "has another type": [*moved, ("/a/voltage", _START_NS, text)],
        "have no or changing positions": [("/voltage", _START_NS, float64(data=1.0)), *changing],
        "too few messages in which all axes have begun": [*moved, *late],
    }
    for k, (said, messages) in enumerate(bad.items()):
        with pytest.raises(StorageError, match=said) as told:
            read_axes_recording(_write(tmp_path / f"bag_{k}", messages), 1)
        assert "\n" not in str(told.value)
