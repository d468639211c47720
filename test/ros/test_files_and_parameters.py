"""Files that must not be lost, parameters that must not be overheard: each sentence of what was seen, as a test."""

from __future__ import annotations

import os
import time
from pathlib import Path

import numpy as np
import pytest
import yaml
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from harness import clean, model_file
from node_server import REPOSITORY
from node_under_test import PATIENCE_S
from rcl_interfaces.srv import DescribeParameters, GetParameters, ListParameters
from rclpy.parameter import parameter_value_to_python
from sensor_msgs.msg import JointState
from small_model import MODEL, compensator_of
from std_msgs.msg import Float64
from std_srvs.srv import Trigger

from fomrc_core.control.actuator_memory import ActuatorMemory
from fomrc_core.control.checkpoint import CheckpointWriter, read_checkpoint
from fomrc_core.control.loop_account import Move

EFFECTS = MODEL | {"effects": ["amplifier_bandwidth"], "amplifier_bandwidth": {"cutoff_hz": 100.0}}
RECORD = "time_s,voltage_v,displacement_um\n" + "".join(f"{0.01 * k},{0.01 * k},{0.02 * k}\n" for k in range(200))


def dumped(probe, node) -> str:
    """Return what ``ros2 param dump`` writes: it asks the same services and nests the names the same way."""
    names = sorted(probe.call(ListParameters, f"{node.name}/list_parameters", ListParameters.Request()).result.names)
    answer = probe.call(GetParameters, f"{node.name}/get_parameters", GetParameters.Request(names=names))
    parameters: dict = {}
    for name, value in zip(names, answer.values, strict=True):
        *path, last = name.split(".")
        block = parameters
        for part in path:
            block = block.setdefault(part, {})
        plain = parameter_value_to_python(value)
        block[last] = list(plain) if hasattr(plain, "tolist") else plain
    return yaml.safe_dump({node.name: {"ros__parameters": parameters}}, default_flow_style=False)


@pytest.mark.parametrize("what", ["a model file", "a text", "a folder", "the working folder", "a link to a model file"])
def test_a_file_that_is_no_checkpoint_is_left_alone(tmp_path, probe, start, what):
    file = model_file(tmp_path / "model.yaml")
    precious = model_file(tmp_path / "precious.yaml")
    path: Path | str = precious
    if what == "a text":
        precious.write_text("notes of a long day\n")
    elif what == "a folder":
        path = tmp_path / "folder"
        path.mkdir()
        (path / "inside").write_text("kept")
    elif what == "the working folder":
        path = "."
    elif what == "a link to a model file":
        path = tmp_path / "link"
        path.symlink_to(precious)
    before = {entry: entry.read_bytes() for entry in tmp_path.rglob("*") if entry.is_file() and entry.suffix != ".log"}
    node = start("compensator", file, checkpoint_file=path, rate_hz=200.0)
    probe.until(lambda: "no checkpoint" in probe.messages.get(node.name, ""), "the refusal in diagnostics")
    assert probe.levels[node.name] == DiagnosticStatus.ERROR
    assert probe.state(node.name) == "unconfigured"
    assert node.stop() == 0
    after = {entry: entry.read_bytes() for entry in tmp_path.rglob("*") if entry.is_file() and entry.suffix != ".log"}
    assert after == before


@pytest.mark.parametrize("through", ["same name", "link", "test recording"])
def test_an_output_that_is_an_input_is_refused(tmp_path, probe, start, through):
    record = tmp_path / "record.csv"
    record.write_text(RECORD)
    node = start("identification")
    output = record
    if through == "link":
        output = tmp_path / "other.csv"
        os.link(record, output)
    assert probe.set_one(node.name, "recordings", [str(record)]).successful
    if through == "test recording":
        other = tmp_path / "test.csv"
        other.write_text(RECORD)
        assert probe.set_one(node.name, "test_recording", str(other)).successful
        output = other
    assert probe.set_one(node.name, "output_file", str(output)).successful
    answer = probe.trigger(f"{node.name}/identify")
    assert not answer.success
    assert "is one of the inputs" in answer.message
    assert record.read_text() == output.read_text() == RECORD


def test_a_pipe_or_a_device_as_a_recording_is_refused(tmp_path, probe, start):
    os.mkfifo(tmp_path / "pipe.csv")
    node = start("identification", allowed_folders=f"[{tmp_path}, /dev]")
    for path in (str(tmp_path / "pipe.csv"), "/dev/zero"):
        assert probe.set_one(node.name, "recordings", [path]).successful
        answer = probe.trigger(f"{node.name}/identify")
        assert not answer.success
        assert "pipe or a device" in answer.message


def test_a_reloaded_model_replaces_the_model_with_its_effects(tmp_path, probe, start):
    file = model_file(tmp_path / "model.yaml", EFFECTS)
    node = start("compensator", file, rate_hz=200.0)
    assert probe.get(node.name, "model.effects") == ["amplifier_bandwidth"]
    model_file(file, {name: MODEL[name] for name in ("kappa_um_per_v", "saturation_v")})
    answer = probe.trigger(f"{node.name}/reload_parameters")
    assert answer.success, answer.message
    assert list(probe.get(node.name, "model.effects")) == []
    assert probe.get(node.name, "model.creep_order") == 0.0


def test_a_file_given_at_start_may_be_reloaded_wherever_it_lies(tmp_path, probe, start):
    elsewhere = tmp_path / "elsewhere"
    elsewhere.mkdir()
    inside = tmp_path / "inside"
    inside.mkdir()
    file = model_file(elsewhere / "model.yaml")
    node = start("compensator", file, rate_hz=200.0, allowed_folders=f"[{inside}]")
    model_file(file, MODEL | {"creep_order": 0.02})
    answer = probe.trigger(f"{node.name}/reload_parameters")
    assert answer.success, answer.message
    assert probe.get(node.name, "model.creep_order") == 0.02
    other = model_file(elsewhere / "other.yaml")
    assert probe.set_one(node.name, "parameters_file", str(other)).successful
    assert "outside of the allowed folders" in probe.trigger(f"{node.name}/reload_parameters").message


@pytest.mark.parametrize(
    "kind", ["compensator", "simulated_pea", "identification", "watch", "gap_command", "gap_monitor"]
)
def test_a_dump_has_every_parameter_and_starts_the_same_node_again(tmp_path, probe, start, kind):
    files = [model_file(tmp_path / "model.yaml", EFFECTS)] if kind in ("compensator", "simulated_pea", "watch") else []
    node = start(kind, *files)
    first = dumped(probe, node)
    values = yaml.safe_load(first)[node.name]["ros__parameters"]
    assert "None" not in first
    assert "null" not in first
    if kind == "identification":
        assert values["recordings"] == []
    assert node.stop() == 0
    file = tmp_path / "dump.yaml"
    file.write_text(first)
    again = start(kind, file)
    assert dumped(probe, again) == first
    assert clean(again.output()) == []


def test_a_dump_without_a_model_has_its_empty_lists(tmp_path, probe, start):
    node = start("compensator")
    first = dumped(probe, node)
    model = yaml.safe_load(first)[node.name]["ros__parameters"]["model"]
    assert model["kappa_um_per_v"] == model["saturation_v"] == model["effects"] == []
    assert node.stop() == 0
    file = tmp_path / "dump.yaml"
    file.write_text(first)
    again = start("compensator", file)
    assert dumped(probe, again) == first


def test_a_large_file_is_read_without_stopping_the_voltage(tmp_path, probe, start):
    file = model_file(tmp_path / "model.yaml")
    node = start("compensator", file, rate_hz=200.0)
    heard = probe.record("voltage")
    publisher = probe.publisher("desired_position")
    probe.drive_until(publisher, 0.5e-6, lambda: heard, "a voltage")
    # 960 kB that take YAML seconds to read, how many is the machine's; the names in it are none, so that it is refused
    # in the end.
    names = "".join(f"    name_{k}: {k}.5\n" for k in range(40_500))
    file.write_text("/**:\n  ros__parameters:\n" + names)
    assert 900_000 < file.stat().st_size < 1_000_000
    heard.clear()
    began_s = time.monotonic()
    answer = probe.ask(Trigger, f"{node.name}/reload_parameters", Trigger.Request())
    probe.until(answer.done, "the answer")
    took_s = time.monotonic() - began_s
    assert not answer.result().success
    assert "no such parameter" in answer.result().message
    gaps_s = np.diff([received_s for received_s, _ in heard])
    print(f"read in {took_s:.1f} s, longest gap of the voltage {1e3 * gaps_s.max():.0f} ms")
    assert took_s > 100.0 / 200.0, "a hundred ticks: long enough to be noticed"
    assert gaps_s.max() < 0.25 * took_s
    assert len(heard) > 0.5 * 200.0 * took_s


@pytest.mark.parametrize(
    "kind", ["compensator", "simulated_pea", "identification", "watch", "gap_command", "gap_monitor"]
)
def test_a_misspelt_name_is_refused_at_start(tmp_path, start, kind):
    file = model_file(tmp_path / "model.yaml", maximun_voltage_v=1.0)
    node = start(kind, file, is_fresh=True)
    assert node.wait_for_exit() == 2
    lines = clean(node.output())
    assert len(lines) == 1, lines
    assert "maximun_voltage_v" in lines[0]
    if kind in ("compensator", "identification"):
        assert "did you mean maximum_voltage_v?" in lines[0]


def test_one_file_may_serve_several_nodes(tmp_path, probe, start):
    file = model_file(tmp_path / "all.yaml", plant="fomrc", axes=["a", "b", "c"], n_elements=5, stop_policy="hold")
    nodes = [start(kind, file) for kind in ("compensator", "simulated_pea", "identification", "gap_command")]
    for node in nodes:
        probe.until(lambda node=node: node.name in probe.messages, f"{node.name} running")
    answer = probe.trigger("/compensator/reload_parameters")
    assert answer.success, answer.message


def test_n_elements_advertises_what_the_fit_takes(probe, start):
    node = start("identification")
    request = DescribeParameters.Request(names=["n_elements"])
    described = probe.call(DescribeParameters, f"{node.name}/describe_parameters", request).descriptors[0]
    assert (described.integer_range[0].from_value, described.integer_range[0].to_value) == (0, 60)
    assert probe.set_one(node.name, "n_elements", 60).successful
    assert not probe.set_one(node.name, "n_elements", 61).successful


def test_a_journal_is_read_back_whatever_its_name(tmp_path):
    path = tmp_path / "axis[1]*"
    compensator = compensator_of()
    memory = ActuatorMemory.relaxed(compensator)
    writer = CheckpointWriter(path, 3600.0)
    for k in range(20):
        voltage_v = memory.advance(compensator, 0.05 * k, 0.01)
        writer.note(
            compensator,
            memory,
            [Move(0.01, 0.05 * k, float("nan"), voltage_v)],
            0.05 * k,
            voltage_v,
            is_discontinuous=k == 0,
        )
    writer.close()
    resumed = read_checkpoint(path, compensator, 0.01)
    assert resumed is not None
    assert resumed.voltage_v == voltage_v
    assert resumed.target_um == 0.05 * 19


def test_a_full_disk_gets_no_new_file_each_second(tmp_path, monkeypatch):
    path = tmp_path / "memory"
    compensator = compensator_of()
    memory = ActuatorMemory.relaxed(compensator)
    writer = CheckpointWriter(path, 1e-3)

    def drive(n: int, start: int, *, is_discontinuous: bool = False) -> float:
        for k in range(start, start + n):
            target_um = 0.5 * np.sin(0.1 * k)
            voltage_v = memory.advance(compensator, target_um, 0.01)
            moves = [Move(0.01, target_um, float("nan"), voltage_v)]
            writer.note(compensator, memory, moves, target_um, voltage_v, is_discontinuous=is_discontinuous)
            time.sleep(2e-3)
        return voltage_v

    drive(19, 0)
    drive(1, 19, is_discontinuous=True)  # on disk, and nothing under way: the next snapshot gets the last new journal
    from fomrc_core.control import checkpoint as module
    from fomrc_core.errors import StorageError

    def full(content: bytes, path: Path) -> None:
        raise StorageError("cannot be written (No space left on device)", where=str(path))

    with monkeypatch.context() as patched:
        patched.setattr(module, "write_bytes", full)
        drive(10, 20)
        deadline_s = time.monotonic() + PATIENCE_S
        while not writer.failure and time.monotonic() < deadline_s:
            time.sleep(2e-3)  # the thread that writes comes when a busy machine lets it
        assert "No space left" in writer.failure
        n_files = len(list(tmp_path.iterdir()))
        last_v = drive(50, 30)
        assert len(list(tmp_path.iterdir())) == n_files
    # The journal went on: nothing is lost.
    resumed = read_checkpoint(path, compensator, 0.01)
    assert resumed is not None
    assert resumed.voltage_v == last_v
    drive(50, 80)
    assert writer.failure == ""
    writer.close()
    assert len(list(tmp_path.iterdir())) <= 3


def test_a_journal_with_a_gap_is_refused(tmp_path, monkeypatch):
    path = tmp_path / "memory"
    compensator = compensator_of()
    memory = ActuatorMemory.relaxed(compensator)
    writer = CheckpointWriter(path, 3600.0)
    memory.advance(compensator, 0.1, 0.01)
    writer.note(compensator, memory, [Move(0.01, 0.1, float("nan"), 0.1)], 0.1, 0.1, is_discontinuous=True)
    writer.note(compensator, memory, [Move(0.01, 0.1, float("nan"), 0.1)], 0.1, 0.1)

    def full(descriptor: int, content: bytes) -> int:
        raise OSError(28, "No space left on device")

    with monkeypatch.context() as patched:
        patched.setattr(os, "write", full)
        writer.note(compensator, memory, [Move(0.01, 0.2, float("nan"), 0.2)], 0.2, 0.2)
    assert "No space left" in writer.failure
    writer.note(compensator, memory, [Move(0.01, 0.3, float("nan"), 0.3)], 0.3, 0.3)
    writer.close()
    with pytest.raises(Exception, match="damaged"):
        read_checkpoint(path, compensator, 0.01)


@pytest.mark.parametrize(
    ("name", "value", "said"),
    [
        ("model.kappa_um_per_v", [20.0, 12.0, 1e308, 1.4], "at most 1e+12 um/V"),
        ("model.kappa_um_per_v", [20.0, 12.0, 9.0, 1e308], "1e-05 to 20000 um/V"),
        ("model.creep_order", 1.0, "0.01 to 0.1"),
        ("model.saturation_v", [0.02, 0.07, 1e9], "at most 10000 V"),
    ],
)
def test_an_implausible_model_is_refused_with_what_is_plausible(tmp_path, probe, start, name, value, said):
    node = start("compensator", model_file(tmp_path / "model.yaml"), rate_hz=200.0)
    result = probe.set_one(node.name, name, value)
    assert not result.successful
    assert "implausible" in result.reason
    assert said in result.reason
    short = name.removeprefix("model.")
    refused = start("compensator", model_file(tmp_path / "bad.yaml", MODEL | {short: value}), namespace="/bad")
    assert refused.wait_for_exit() == 2
    assert "implausible" in refused.output()


def test_a_plant_on_the_command_line_wins_over_the_shipped_file(tmp_path, probe, start):
    shipped = REPOSITORY / "config" / "compensator.yaml"
    node = start("simulated_pea", model_file(tmp_path / "model.yaml"), shipped, plant="fomrc")
    assert probe.get(node.name, "plant") == "fomrc"


def test_axes_named_in_one_string_reach_the_gap_nodes(probe, start):
    # As the launch file hands them on: in a list the client library would take y for a truth value.
    command, monitor = start("gap_command", axes="x,y,z"), start("gap_monitor", axes="x, y, z")
    for axis in "xyz":
        probe.until(lambda axis=axis: probe.node.count_publishers(f"/{axis}/desired_position"), "the command's axes")
        probe.until(lambda axis=axis: probe.node.count_subscribers(f"/{axis}/displacement"), "the monitor's axes")
    for node in (command, monitor):
        assert list(probe.get(node.name, "axes")) == ["x", "y", "z"]


def test_the_gap_is_stale_where_an_axis_is_dead(probe, start):
    node = start("gap_monitor", stale_after_s=0.5)
    gaps = probe.record("gap", JointState)
    publishers = [probe.publisher(f"axis{k}/displacement") for k in (1, 2, 3)]

    def is_monitored() -> bool:
        for publisher in publishers:
            publisher.publish(Float64(data=1e-6))
        return bool(gaps)

    probe.until(is_monitored, "the gap")
    # The second axis dies; the others go on.
    for _ in range(40):
        publishers[0].publish(Float64(data=1e-6))
        publishers[2].publish(Float64(data=1e-6))
        probe.spin_for(0.05)
    n = len(gaps)
    probe.spin_for(0.5)
    assert len(gaps) == n, "no old data stamped anew"
    probe.until(lambda: "axis2: stale" in probe.messages.get(node.name, ""), "the warning")
    assert probe.levels[node.name] == DiagnosticStatus.WARN


def test_each_axis_has_a_hardware_id_of_its_own(tmp_path, probe, start):
    file = model_file(tmp_path / "model.yaml")
    ids: dict[str, str] = {}

    def note(received_s: float, message: DiagnosticArray) -> None:
        ids.update({status.name: status.hardware_id for status in message.status})

    probe.subscribe(DiagnosticArray, "/diagnostics", note, 50)
    for axis in ("/axis1", "/axis2"):
        start("compensator", file, namespace=axis, rate_hz=100.0)
    probe.until(lambda: {"axis1/compensator", "axis2/compensator"} <= set(ids), "both")
    assert (ids["axis1/compensator"], ids["axis2/compensator"]) == ("axis1/piezo", "axis2/piezo")


def test_progress_after_a_failure_shows_the_new_job(tmp_path, probe, start):
    record = tmp_path / "record.csv"
    rng = np.random.default_rng(1)
    voltage = np.concatenate([np.linspace(0.0, a, 2000) for a in (1.0, -0.5, 0.8, -0.2, 0.5)])
    rows = np.column_stack(
        (0.002 * np.arange(voltage.size), voltage, 2.0 * voltage + 1e-3 * rng.normal(size=voltage.size))
    )
    np.savetxt(record, rows, delimiter=",", header="time_s,voltage_v,displacement_um", comments="")
    node = start("identification", n_elements=0)
    assert probe.set_one(node.name, "recordings", ["missing.csv"]).successful
    assert not probe.trigger(f"{node.name}/identify").success
    probe.until(lambda: "missing.csv" in probe.messages.get(node.name, ""), "the failure")
    assert probe.set_one(node.name, "recordings", [str(record)] * 3).successful
    probe.ask(Trigger, f"{node.name}/identify", Trigger.Request())
    probe.until(lambda: probe.diagnostics[node.name].get("activity") == "identify", "the new job")
    assert probe.messages[node.name].startswith("identify: ")
    assert "%" in probe.messages[node.name]
    assert "missing.csv" not in probe.messages[node.name]
    assert "missing.csv" in probe.diagnostics[node.name]["last"], "the failure is still told, but not in its place"
