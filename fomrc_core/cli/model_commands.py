"""``fomrc simulate`` and ``fomrc compensate``: a model forwards and backwards."""

from __future__ import annotations

from enum import Enum
from pathlib import Path
from typing import Annotated

import typer

from fomrc_core.cli.options import (
    Columns,
    Despike,
    DropNan,
    Rate,
    Reading,
    Resample,
    Sort,
    Topics,
    Units,
    say,
)

ModelFile = Annotated[Path, typer.Option("--model", "-m", metavar="M.yaml", help="Model file.")]


class InitialState(str, Enum):
    """How a record begins."""

    RELAXED = "relaxed"
    ESTIMATE = "estimate"


def simulate(
    model: ModelFile,
    recording: Annotated[Path, typer.Option("--input", "-i", metavar="REC", help="Recording with the voltage.")],
    output: Annotated[Path, typer.Option("--output", "-o", metavar="OUT.csv", help="Where to write.")],
    initial_state: Annotated[
        InitialState,
        typer.Option("--initial-state", help="Start relaxed, or from what explains the first samples best."),
    ] = InitialState.ESTIMATE,
    columns: Columns = None,
    rate: Rate = None,
    topics: Topics = None,
    units: Units = None,
    drop_nan: DropNan = False,
    sort: Sort = False,
    despike: Despike = False,
    resample: Resample = None,
) -> None:
    """Simulate the displacement a recorded voltage gives.

    Writes time_s, voltage_v, simulated_um and, where the recording has a displacement, displacement_um and
    residual_um (measured minus simulated). The offset of a measured displacement and the state at its first
    sample are not known: they are estimated from the first samples, and what was found is said.
    """
    import numpy as np

    from fomrc_core.model.record_start import estimate_start, relaxed_start, simulate_from
    from fomrc_core.records.residual import nrmse_percent, residual_um, rms
    from fomrc_core.storage import check_outputs, read_model, write_columns

    check_outputs({"--output": output}, [model, recording])
    actuator = read_model(model)
    reading = Reading(columns, rate, topics, units, drop_nan, sort, despike, resample)
    record = reading.read(recording, is_judged=False)
    choose = estimate_start if initial_state is InitialState.ESTIMATE else relaxed_start
    start = choose(actuator, record)
    simulated_um = simulate_from(actuator, record, start)
    results = {"time_s": record.time_s, "voltage_v": record.voltage_v, "simulated_um": simulated_um}
    if record.displacement_um is None:
        write_columns(results, output)
        say(f"initial state: {start.description}; no displacement to compare with")
        return
    results["displacement_um"] = record.displacement_um
    results["residual_um"] = residual_um(record.displacement_um, simulated_um)
    write_columns(results, output)
    how = "estimated" if initial_state is InitialState.ESTIMATE else "as told"
    say(
        f"initial state: {start.description} ({how}); offset {start.offset_um:.6g} um; "
        f"both from the first {start.n_samples} of {record.n_samples} samples"
    )
    if np.ptp(record.displacement_um) > 0.0:
        error_percent = nrmse_percent(record.displacement_um, simulated_um)
        say(f"NRMSE {error_percent:.4g} % (rms {1e3 * rms(results['residual_um']):.4g} nm)")


def compensate(
    model: ModelFile,
    target: Annotated[Path, typer.Option("--input", "-i", metavar="TARGET.csv", help="Columns time_s and desired_um.")],
    output: Annotated[Path, typer.Option("--output", "-o", metavar="V.csv", help="Where to write.")],
) -> None:
    """Find the voltage that makes an actuator, relaxed at first, follow a desired displacement.

    Writes time_s, voltage_v and desired_um. What a model holds beside hysteresis and creep is inverted where
    it can be; what is not is named, with the reason.
    """
    from fomrc_core.model.compensator import Compensator
    from fomrc_core.records.recording import Recording
    from fomrc_core.storage import check_outputs, read_model, read_target, write_columns

    check_outputs({"--output": output}, [model, target])
    compensator = Compensator(read_model(model))
    time_s, desired_um = read_target(target)
    # A recording only for its steps: the length of the first is a convention kept there.
    steps_s = Recording(time_s, desired_um, name=target.name).steps_s
    voltage_v = compensator.run(steps_s, desired_um)
    write_columns({"time_s": time_s, "voltage_v": voltage_v, "desired_um": desired_um}, output)
    for name, reason in compensator.not_inverted:
        say(f"{name}: {reason}" if reason.startswith("not inverted") else f"{name} is not inverted: {reason}")
    say(f"voltage between {voltage_v.min():.4g} and {voltage_v.max():.4g} V; the actuator is taken as relaxed at first")
