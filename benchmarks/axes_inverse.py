"""What a stage of several axes is off its target, with modes undone and without: ``python -m benchmarks.axes_inverse``.

Targets are random in a band and rest at both ends; errors are of the stage's own model, 0.08 s and more from either
end, in per cent of the targets' rms. Without ``--model``: stages of seeds, each with one mode more than axes (300 to
900 Hz, damping 1.2 %), a delay of 136 us, coupling of 15 %, complex shapes, hysteresis and creep of each input.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from fomrc_core.model.axes import AxesCompensator, AxesDynamicInverse, AxesModel, AxesModes
from fomrc_core.model.known_target import known_target
from fomrc_core.model.piezo_model import PiezoModel
from fomrc_core.storage.axes_files import read_axes_model

Array = NDArray[np.float64]

RATE_HZ, N_SAMPLES = 6400.0, 4096
_N_RISE, _N_END = 400, 512


def main() -> None:
    """Print a row for each stage and bandwidth."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--model", type=Path, help="model file of several axes instead")
    parser.add_argument("--size-um", type=float, default=2.0, help="largest displacement")
    parser.add_argument("--axes", type=int, nargs="+", default=[2, 3])
    parser.add_argument("--seeds", type=int, default=2)
    parser.add_argument("--bandwidths", type=float, nargs="+", default=[50.0, 100.0, 200.0, 400.0])
    arguments = parser.parse_args()
    if arguments.model is not None:
        stages = {str(arguments.model): read_axes_model(arguments.model)}
    else:
        stages = {f"{n} axes, seed {s}": stage(n, s) for n in arguments.axes for s in range(arguments.seeds)}
    print("| stage | target up to | static inverse | modes and delay undone | largest voltage, of slow motion's |")
    print("|---|---|---|---|---|")
    for name, model in stages.items():
        for bandwidth_hz in arguments.bandwidths:
            print(f"| {name} | {bandwidth_hz:g} Hz | {row(model, bandwidth_hz, arguments.size_um)} |", flush=True)


def stage(n_axes: int, seed: int) -> AxesModel:
    """Return a random stage."""
    rng = np.random.default_rng(seed)
    axes = tuple(PiezoModel(rng.uniform(4.0, 9.0, 4), rng.uniform(0.05, 0.8, 3), 0.015) for _ in range(n_axes))
    n_modes = n_axes + 1
    shapes = [np.eye(n_modes, n_axes) + 0.15 * rng.normal(size=(n_modes, n_axes)) for _ in range(2)]
    hz = np.linspace(300.0, 900.0, n_modes)
    modes = AxesModes(hz, np.full(n_modes, 0.012), shapes[0] * (1.0 + 0.02j), shapes[1].astype(complex))
    return AxesModel(axes, modes, 0.03 * rng.normal(size=(n_axes, n_axes)), 136e-6)


def targets(n_axes: int, bandwidth_hz: float, size_um: float, seed: int = 0) -> Array:
    """Return random displacements below a frequency, (N_SAMPLES, n_axes) [um]."""
    rng = np.random.default_rng(seed)
    hz = np.fft.rfftfreq(N_SAMPLES, 1.0 / RATE_HZ)
    inside = (hz > 0.0) & (hz < bandwidth_hz)
    spectra = np.where(inside[:, None], np.exp(2j * np.pi * rng.random((hz.size, n_axes))), 0.0)
    moved = np.fft.irfft(spectra, N_SAMPLES, axis=0)
    away = np.minimum(np.arange(N_SAMPLES), np.arange(N_SAMPLES)[::-1])
    rising = np.clip(away / _N_RISE, 0.0, 1.0)
    return np.asarray(size_um * moved / np.abs(moved).max(axis=0) * (rising**2 * (3.0 - 2.0 * rising))[:, None])


def row(model: AxesModel, bandwidth_hz: float, size_um: float) -> str:
    """Return errors and voltages of one stage and bandwidth."""
    desired_um = targets(model.n_outputs, bandwidth_hz, size_um)
    time_s, steps_s = np.arange(N_SAMPLES) / RATE_HZ, np.full(N_SAMPLES, 1.0 / RATE_HZ)
    static_um = model.simulate(steps_s, AxesCompensator(model).run(steps_s, desired_um))
    waveforms = AxesDynamicInverse(model).run(tuple(known_target(time_s, column) for column in desired_um.T))
    voltage_v = np.stack([waveform.voltage_v for waveform in waveforms], axis=1)
    slow_v = np.stack([waveform.slow_v for waveform in waveforms], axis=1)
    dynamic_um = model.simulate(steps_s, voltage_v)
    inner = slice(_N_END, -_N_END)
    whole = float(np.sqrt(np.mean(desired_um[inner] ** 2)))
    static, dynamic = (
        100.0 * float(np.sqrt(np.mean((moved - desired_um)[inner] ** 2))) / whole for moved in (static_um, dynamic_um)
    )
    return f"{static:.3g} % | {dynamic:.2g} % | {np.abs(voltage_v).max() / np.abs(slow_v).max():.2f}"


if __name__ == "__main__":
    main()
