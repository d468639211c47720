"""``fomrc compensate``: a target that is known as a whole, and the voltage that makes a stage follow it."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from fomrc_core.cli.compensate_axes import axes_columns, axes_waveforms
from fomrc_core.cli.progress import say as tell

if TYPE_CHECKING:
    from fomrc_core.compute.arrays import Array
    from fomrc_core.model.known_target import KnownTarget
    from fomrc_core.model.piezo_model import PiezoModel
    from fomrc_core.model.waveform import Waveform, WaveformLimits

ModelFile = Annotated[Path, typer.Option("--model", "-m", metavar="M.yaml", help="Model file.")]


def compensate(
    model: ModelFile,
    target: Annotated[
        Path,
        typer.Option(
            "--input",
            "-i",
            metavar="TARGET.csv",
            help="Columns time_s and desired_um; of several axes desired_1_um, ...",
        ),
    ],
    output: Annotated[Path, typer.Option("--output", "-o", metavar="V.csv", help="Where to write.")],
    bandwidth: Annotated[
        float | None,
        typer.Option(metavar="HZ", help="Ask nothing of the stage above this frequency; the target is not shifted."),
    ] = None,
    periodic: Annotated[
        bool, typer.Option("--periodic", help="The target is one period of an endless scan; so is the voltage.")
    ] = False,
    rate: Annotated[float | None, typer.Option(metavar="HZ", help="Sample rate of the voltage, for a converter.")] = (
        None
    ),
    capacitance: Annotated[
        float | None, typer.Option(metavar="FARAD", help="Of the actuator: the largest current is told.")
    ] = None,
    min_voltage: Annotated[float, typer.Option(metavar="V", help="Lowest voltage the amplifier gives.")] = -math.inf,
    max_voltage: Annotated[float, typer.Option(metavar="V", help="Highest voltage it gives.")] = math.inf,
    max_rate: Annotated[float, typer.Option(metavar="V/S", help="Fastest change of it.")] = math.inf,
    arrival_tolerance: Annotated[
        float | None,
        typer.Option(metavar="UM", help="Tell when the stage has come so near to the target's last value."),
    ] = None,
) -> None:
    """Find the voltage that makes an actuator, relaxed at first, follow a desired displacement.

    Writes time_s, voltage_v and desired_um; of a model of several axes voltage_1_v, ... desired_1_um, .... What a
    model holds beside hysteresis and creep is inverted where it can be; what is not is named, with the reason.
    Resonances, delays and lags take what is to come from the target. A voltage beyond a limit is not written.
    """
    from fomrc_core.records.arguments import positive
    from fomrc_core.storage import check_outputs, write_columns
    from fomrc_core.storage.axes_files import is_axes_model

    check_outputs({"--output": output}, [model, target])
    for name, value, unit in (
        ("--capacitance", capacitance, "F"),
        ("--arrival-tolerance", arrival_tolerance, "um"),
        ("--bandwidth", bandwidth, "Hz"),
        ("--rate", rate, "Hz"),
    ):
        if value is not None:
            positive(name, value, unit)
    limits = _limits(min_voltage, max_voltage, max_rate)
    if is_axes_model(model):
        waveforms = axes_waveforms(model, target, rate, bandwidth, periodic)
        columns = axes_columns(waveforms)
    else:
        waveforms = (_waveform(model, target, rate, bandwidth, periodic),)
        columns = {
            "time_s": waveforms[0].target.time_s,
            "voltage_v": waveforms[0].voltage_v,
            "desired_um": waveforms[0].target.desired_um,
        }
    for k, waveform in enumerate(waveforms, 1):
        _tell(waveform, capacitance, arrival_tolerance, f"axis {k}: " if len(waveforms) > 1 else "")
    for waveform in waveforms:
        waveform.require_within(limits)
    write_columns(columns, output)


def _waveform(
    model: Path, target: Path, rate_hz: float | None, bandwidth_hz: float | None, is_periodic: bool
) -> Waveform:
    """Return the voltage of an actuator of one axis."""
    from fomrc_core.model.dynamic_inverse import DynamicInverse
    from fomrc_core.model.known_target import known_target
    from fomrc_core.storage import read_model, read_target

    actuator = read_model(model)
    time_s, desired_um = read_target(target)
    dynamic = DynamicInverse(actuator)
    if not (dynamic.is_needed or is_periodic or rate_hz is not None or bandwidth_hz is not None):
        return _static_waveform(actuator, time_s, desired_um, target.name)
    return dynamic.run(
        known_target(time_s, desired_um, rate_hz=rate_hz, bandwidth_hz=bandwidth_hz, is_periodic=is_periodic)
    )


def _limits(min_voltage: float, max_voltage: float, max_rate: float) -> WaveformLimits:
    from fomrc_core.errors import ParameterError
    from fomrc_core.model.waveform import WaveformLimits

    if not min_voltage < max_voltage:
        allowed = f"above --min-voltage, {min_voltage:g} V"
        raise ParameterError("out of range", where="--max-voltage", value=max_voltage, allowed=allowed)
    if not max_rate > 0.0:
        raise ParameterError("out of range", where="--max-rate", value=max_rate, allowed="above 0 V/s")
    return WaveformLimits(min_voltage, max_voltage, max_rate)


def _static_waveform(actuator: PiezoModel, time_s: Array, desired_um: Array, name: str) -> Waveform:
    """Return the voltage of the inverse without a future, sample by sample, for a model that needs none."""
    import numpy as np

    from fomrc_core.model.compensator import Compensator
    from fomrc_core.model.known_target import KnownTarget
    from fomrc_core.model.waveform import Waveform
    from fomrc_core.records.recording import Recording

    compensator = Compensator(actuator)
    # A recording only for its steps: the length of the first is a convention kept there.
    steps_s = Recording(time_s, desired_um, name=name).steps_s
    voltage_v = compensator.run(steps_s, desired_um)
    target = KnownTarget(time_s, float(np.mean(steps_s)), desired_um)
    reached_um = actuator.with_start(None).simulate(steps_s, voltage_v)
    left = compensator.not_inverted
    return Waveform(target, voltage_v, reached_um, 0, np.zeros(0), voltage_v, left, ())


def _tell(waveform: Waveform, capacitance_f: float | None, tolerance_um: float | None, axis: str) -> None:
    """Say what the voltage asks for, and what is to be had by it, each line beginning with the axis."""

    def say(text: str) -> None:
        tell(axis + text)

    for name, reason in waveform.not_inverted:
        say(f"{name}: {reason}" if reason.startswith("not inverted") else f"{name} is not inverted: {reason}")
    for note in waveform.notes:
        say(note)
    for line in _target_lines(waveform.target):
        say(line)
    voltage_v = waveform.voltage_v
    say(f"voltage between {voltage_v.min():.4g} and {voltage_v.max():.4g} V; the actuator is taken as relaxed at first")
    asked = f"largest voltage {waveform.largest_v:.4g} V, largest rate {waveform.largest_rate_v_per_s:.4g} V/s"
    if capacitance_f is not None:
        asked += f", largest current {waveform.largest_current_a(capacitance_f):.4g} A into {capacitance_f:.4g} F"
    say(asked)
    if waveform.errors_um.size:
        say(str(waveform))
    if tolerance_um is not None:
        arrival_s = waveform.arrival_s(tolerance_um)
        at = "not within the target" if arrival_s is None else f"{arrival_s:.6g} s after its first sample"
        say(f"arrives within {tolerance_um:.4g} um of the target's last value: {at}")


def _target_lines(target: KnownTarget) -> list[str]:
    lines = []
    if target.taken_off_um > 0.0:
        lines.append(
            f"target less what is above the bandwidth: at most {target.taken_off_um:.4g} um off what was asked for"
        )
    if target.is_periodic:
        n_samples = target.desired_um.size
        lines.append(
            f"one period of {n_samples} samples, {n_samples * target.step_s:.6g} s, at {target.rate_hz:.8g} Hz"
        )
    if target.rests_at_seam:
        lines.append("the last row repeats the first, where the scan then rests for a sample: leave it out to go on")
    return lines
