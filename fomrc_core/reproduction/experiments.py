"""The paper's experiments, each run on the simulated rig: what was measured, and how far the model is from it.

Nothing measured by the paper is available, only what it printed (plants/paper_stage.py): every curve is from the
simulated plant.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from fomrc_core.model.compensator import Compensator
from fomrc_core.model.piezo_model import PiezoModel
from fomrc_core.plants import paper_stage
from fomrc_core.plants.simulated_rig import SimulatedRig
from fomrc_core.records import excitation
from fomrc_core.records.excitation import AMPLITUDE_V
from fomrc_core.records.recording import Recording
from fomrc_core.records.residual import nonlinearity_percent, nrmse_percent, rms

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Run:
    """One recording beside what the model says of it.

    Attributes:
        label: level [V] or slope [V/s].
        recording: measured on the rig.
        predicted_um: by the model [um].
        percent: NRMSE; for steps of the displacement at 60 s, else of the measured range [%].
        extended_percent: NRMSE with amplifier and resonance added [%]; nan where not asked for.
        diagnosed_percent: NRMSE with the effects a diagnosis named [%]; nan where not asked for.
    """

    label: float
    recording: Recording
    predicted_um: Array
    percent: float
    extended_percent: float = float("nan")
    diagnosed_percent: float = float("nan")

    @property
    def error_um(self) -> Array:
        """Measured less predicted [um]."""
        return self.recording.measured_um - self.predicted_um


@dataclass(frozen=True, eq=False)
class Tracking:
    """A desired displacement, followed with and without compensation.

    Attributes:
        desired_um: [um].
        plain: driven with the desired displacement over a constant gain.
        compensated: driven with the inverse model.
        plain_percent: NRMSE, or nonlinearity [%].
        compensated_percent: the same compensated [%].
    """

    desired_um: Array
    plain: Recording
    compensated: Recording
    plain_percent: float
    compensated_percent: float


def step_runs(rig: SimulatedRig, model: PiezoModel) -> list[Run]:
    """Figure 11 and Table 2: steps of six heights, 60 s each, each from the relaxed state."""
    runs = []
    for seed, level in enumerate(paper_stage.STEP_NRMSE_PERCENT):
        recording = rig.measure(excitation.steps([level], dwell_s=60.0, lead_in_s=0.0, rate_hz=200.0), seed=20 + seed)
        held = recording.window(0.0, 60.0 - 1e-9)
        predicted = model.simulate(held.steps_s, held.voltage_v)
        error = rms(held.measured_um - predicted)
        runs.append(Run(level, held, predicted, 100.0 * error / abs(float(held.measured_um[-1]))))
    return runs


def slope_runs(rig: SimulatedRig, model: PiezoModel, extended: PiezoModel, diagnosed: PiezoModel) -> list[Run]:
    """Figures 12, 13 and Table 3: triangles of ten slopes, 1 kHz, slower ones sampled in proportion."""
    runs = []
    for seed, slope in enumerate(paper_stage.SLOPE_NRMSE_PERCENT):
        rate = min(1000.0, 1000.0 * slope)
        recording = rig.measure(excitation.triangle(AMPLITUDE_V, slope_v_per_s=slope, rate_hz=rate), seed=40 + seed)
        predicted = model.simulate(recording.steps_s, recording.voltage_v)
        fast = extended.simulate(recording.steps_s, recording.voltage_v)
        found = diagnosed.simulate(recording.steps_s, recording.voltage_v)
        runs.append(
            Run(
                slope,
                recording,
                predicted,
                nrmse_percent(recording.measured_um, predicted),
                nrmse_percent(recording.measured_um, fast),
                nrmse_percent(recording.measured_um, found),
            )
        )
    return runs


def staircase_run(rig: SimulatedRig, model: PiezoModel) -> Run:
    """Figure 14: a staircase, other noise than the one identified on, 1 kHz."""
    recording = rig.measure(excitation.staircase(AMPLITUDE_V, n_cycles=1), seed=60)
    predicted = model.simulate(recording.steps_s, recording.voltage_v)
    return Run(0.25, recording, predicted, nrmse_percent(recording.measured_um, predicted))


def settled_error_um(run: Run, dwell_s: float = 3.0, left_out_s: float = 0.1) -> float:
    """Return the largest error of a staircase outside the transient of each step [um]."""
    in_step = np.mod(run.recording.time_s - run.recording.time_s[0], dwell_s)
    return float(np.abs(run.error_um[(in_step > left_out_s) & (in_step < dwell_s - 0.01)]).max())


def desired_path_um(peak_um: float = 2.4, rate_hz: float = 1000.0) -> tuple[Array, Array]:
    """Return (time_s, desired_um) of figure 15: sines of several heights, then holds."""
    time_s = np.arange(round(60.0 * rate_hz)) / rate_hz
    envelope = np.interp(time_s, [0, 4, 14, 24, 34, 40], [0.0, 1.0, 0.8, 0.5, 0.25, 0.0])
    sines = peak_um * envelope * np.sin(2.0 * np.pi * 0.25 * time_s)
    holds = peak_um * np.interp(
        time_s, [40, 41, 45, 46, 50, 51, 55, 56, 60], [0.0, 0.7, 0.7, -0.4, -0.4, 0.3, 0.3, 0.0, 0.0]
    )
    return time_s, np.where(time_s < 40.0, sines, holds)


def tracking_run(rig: SimulatedRig, model: PiezoModel) -> Tracking:
    """Figure 15: follow a desired displacement with and without the inverse model."""
    time_s, desired = desired_path_um()
    plain, compensated = _both(rig, model, time_s, desired, seed=70)
    return Tracking(
        desired,
        plain,
        compensated,
        nrmse_percent(desired, plain.measured_um),
        nrmse_percent(desired, compensated.measured_um),
    )


def linearity_run(rig: SimulatedRig, model: PiezoModel) -> Tracking:
    """Figure 16: input against output for a triangle of decreasing amplitude."""
    wave = excitation.triangle(AMPLITUDE_V, slope_v_per_s=1.0)  # read as um
    desired = np.asarray(wave.voltage_v)
    plain, compensated = _both(rig, model, np.asarray(wave.time_s), desired, seed=80)
    return Tracking(
        desired,
        plain,
        compensated,
        nonlinearity_percent(desired, plain.measured_um),
        nonlinearity_percent(desired, compensated.measured_um),
    )


def _both(
    rig: SimulatedRig, model: PiezoModel, time_s: Array, desired_um: Array, seed: int
) -> tuple[Recording, Recording]:
    steps = np.diff(time_s, prepend=2.0 * time_s[0] - time_s[1])
    inverse = Compensator(model).run(steps, desired_um)
    # Without compensation: the gain at which the desired and the compensated voltage have the same range.
    gain = float(np.ptp(desired_um)) / float(np.ptp(inverse))
    plain = excitation.Excitation(time_s, desired_um / gain, "without compensation")
    shaped = excitation.Excitation(time_s, inverse, "with compensation")
    return rig.measure(plain, seed, desired_um), rig.measure(shaped, seed + 1, desired_um)


def relaxation_runs(rig: SimulatedRig) -> tuple[tuple[Recording, Recording], tuple[Recording, Recording]]:
    """Figures 7 and 8: (zero input, loop) without and with the relaxation routine, after the same history.

    Displacement is counted from the relaxed stage, which only a simulation knows.
    """
    rate = 500.0
    history = excitation.Excitation(
        np.arange(round(8 * rate)) / rate,
        np.interp(np.arange(round(8 * rate)) / rate, [0, 2.5, 5, 7.9, 8], [0, 2.5, 2.5, 0.0, 0.0]),
        "history",
    )
    routine = excitation.relaxation(AMPLITUDE_V, rate_hz=rate)
    rest = excitation.Excitation(np.arange(round(60 * rate)) / rate, np.zeros(round(60 * rate)), "rest")
    loop = excitation.triangle(AMPLITUDE_V, n_cycles=2, rate_hz=rate)
    results = []
    for seed, before in ((100, [history]), (101, [history, routine])):
        pair = []
        for after in (rest, loop):
            whole = excitation.concatenate(*before, after)
            recording = rig.measure(whole, seed)
            start_s = float(whole.time_s[-1]) - after.duration_s
            cut = recording.window(start_s - 1e-9, float(whole.time_s[-1]) + 1.0)
            pair.append(replace(cut, time_s=cut.time_s - cut.time_s[0]))
        results.append((pair[0], pair[1]))
    return results[0], results[1]


def loop_runs(rig: SimulatedRig, model: PiezoModel) -> list[tuple[float, Array, Array, Array]]:
    """Figure 12: a major loop, then a minor one from 1 V to 0.3 V and back, for three slopes; no noise."""
    corners = np.array([0.0, 2.5, -2.5, 2.5, -2.5, 1.0, 0.3, 1.3])
    path = np.concatenate([[0.0], np.cumsum(np.abs(np.diff(corners)))])
    loops = []
    for slope in (0.2, 2.0, 20.0):
        distance = np.arange(1, round(path[-1] * 250) + 1) / 250.0
        voltage = np.interp(distance, path, corners)
        steps = np.full(voltage.size, 1.0 / (250.0 * slope))
        shown = distance >= path[2]
        plant, modelled = rig.displacement_um(steps, voltage), model.simulate(steps, voltage)
        loops.append((slope, voltage[shown], plant[shown], modelled[shown]))
    return loops
