"""``fomrc compensate`` for a model of several axes: a column of the target and of the voltage for each."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from fomrc_core.compute.arrays import Array
    from fomrc_core.model.axes import AxesCompensator
    from fomrc_core.model.waveform import Waveform


def axes_waveforms(
    model: Path, target: Path, rate_hz: float | None, bandwidth_hz: float | None, is_periodic: bool
) -> tuple[Waveform, ...]:
    """Return the voltage of each input of the model in a file, for the targets in another.

    Args:
        model: model file.
        target: CSV with columns time_s, desired_1_um, ...
        rate_hz: rate it is wanted at [Hz]; None as it is.
        bandwidth_hz: what is asked of the stage at most [Hz]; None for all that samples hold.
        is_periodic: whether the target is one period of an endless scan.
    """
    from fomrc_core.model.axes import AxesCompensator, AxesDynamicInverse
    from fomrc_core.model.known_target import known_target
    from fomrc_core.storage.axes_files import read_axes_model, read_axes_target

    stage = read_axes_model(model)
    compensator, dynamic = AxesCompensator(stage), AxesDynamicInverse(stage)
    time_s, desired_um = read_axes_target(target, stage.n_outputs)
    if not (dynamic.is_needed or is_periodic or rate_hz is not None or bandwidth_hz is not None):
        return _static(compensator, time_s, desired_um)
    return dynamic.run(
        tuple(
            known_target(time_s, column, rate_hz=rate_hz, bandwidth_hz=bandwidth_hz, is_periodic=is_periodic)
            for column in desired_um.T
        )
    )


def axes_columns(waveforms: tuple[Waveform, ...]) -> dict[str, Array]:
    """Return the columns of the file of voltages."""
    columns = {"time_s": waveforms[0].target.time_s}
    columns |= {f"voltage_{k}_v": waveform.voltage_v for k, waveform in enumerate(waveforms, 1)}
    return columns | {f"desired_{k}_um": waveform.target.desired_um for k, waveform in enumerate(waveforms, 1)}


def _static(compensator: AxesCompensator, time_s: Array, desired_um: Array) -> tuple[Waveform, ...]:
    import numpy as np

    from fomrc_core.model.known_target import KnownTarget
    from fomrc_core.model.waveform import Waveform

    steps_s = np.diff(time_s, prepend=time_s[0] - (time_s[1] - time_s[0]))
    voltage_v = compensator.run(steps_s, desired_um)
    reached_um = compensator.model.simulate(steps_s, voltage_v)
    found = []
    for k, left in enumerate(compensator.not_inverted):
        target = KnownTarget(time_s, float(np.mean(steps_s)), np.ascontiguousarray(desired_um[:, k]))
        found.append(Waveform(target, voltage_v[:, k], reached_um[:, k], 0, np.zeros(0), voltage_v[:, k], left, ()))
    return tuple(found)
