"""``fomrc simulate``: a model forwards."""

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
)
from fomrc_core.cli.progress import say

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
