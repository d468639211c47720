"""The joint refit: from wherever it starts it ends with a model, not with an arithmetic error."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from fomrc_core.effects import Effect
from fomrc_core.effects.amplifier_bandwidth import AmplifierBandwidth
from fomrc_core.effects.dead_zone import DeadZone
from fomrc_core.effects.drive_resonance import DriveResonance
from fomrc_core.effects.mechanical_resonance import MechanicalResonance
from fomrc_core.effects.rate_dependent_hysteresis import RateDependentHysteresis
from fomrc_core.effects.transport_delay import TransportDelay
from fomrc_core.effects.unequal_lag import UnequalLag
from fomrc_core.fitting.base_fit import fit_base, threshold_grid
from fomrc_core.fitting.fit_record import FitRecord
from fomrc_core.fitting.joint_fit import refit
from fomrc_core.fitting.linear_part import record_columns, residuals, squared_error
from fomrc_core.fitting.play_columns import ColumnKinds
from fomrc_core.fitting.trial_model import TrialModel, predict
from fomrc_core.model.piezo_model import PiezoModel
from fomrc_core.model.substeps import Substeps
from fomrc_core.records.excitation import triangle
from fomrc_core.records.recording import Recording


def test_a_start_under_which_nothing_moves_is_gone_on_from() -> None:
    model = PiezoModel([10.0, 4.0, 7.0, 1.5], [0.02, 0.1, 0.3], 0.02)  # type: ignore[arg-type]
    drive = triangle(1.0, slope_v_per_s=2.0, n_cycles=2, rate_hz=200.0)
    moved_um = model.simulate(np.full(drive.n_samples, 1.0 / 200.0), drive.voltage_v)
    # binary fractions, and as many: their mean is exact, and what is predicted is one value to the last bit
    time_s, voltage_v, moved_um = drive.time_s[:512], drive.voltage_v[:512], np.round(moved_um[:512] * 256.0) / 256.0
    records = (FitRecord.of(Recording(time_s, voltage_v, moved_um)),)
    base, _, _ = fit_base(records, ColumnKinds.plays(threshold_grid(records, 12)))
    # a dead zone wider than the drive: every direction is flat, and the prediction is one value
    still = replace(base, effects=(DeadZone(half_width_v=1e3),))
    found = refit(still, records, n_iterations=3)
    assert np.isfinite(found.squared_error)
    assert found.squared_error <= float(np.sum((moved_um - np.mean(moved_um)) ** 2)) * (1.0 + 1e-9)


@pytest.mark.parametrize("frequency_hz", [40.0, 120.0, 260.0])
def test_a_fit_rests_where_its_error_is_least_though_its_directions_are_coarse(frequency_hz: float) -> None:
    """Directions are simulated in fewer parts of each step than the residual, whose least is what counts."""
    rng = np.random.default_rng(3)
    levels_v = np.repeat(rng.uniform(-1.0, 1.0, 60), 25)
    slow_v = 0.8 * np.sin(2.0 * np.pi * 2.0 * np.arange(1500) * 1e-3)
    voltage_v = np.concatenate((np.zeros(20), levels_v, slow_v))
    effects: tuple[Effect, ...] = (
        AmplifierBandwidth(150.0),
        DriveResonance(frequency_hz, 0.3),
        MechanicalResonance(1.3 * frequency_hz, 0.05),
        TransportDelay(0.7e-3),
    )
    plays = ColumnKinds.plays(np.array([0.0, 0.1, 0.4, 1.0]))
    truth = TrialModel(plays, np.array([1.5, 0.3, 0.4, 0.3]), 0.02, effects, ((),))
    recording = Recording(1e-3 * np.arange(voltage_v.size), voltage_v, np.zeros(voltage_v.size))
    silent = FitRecord.of(recording, substeps=Substeps.BENDS)
    moved_um = -residuals(truth, (silent,))[0]
    noise_um = 1e-3 * float(np.ptp(moved_um))
    measured = replace(recording, displacement_um=moved_um + noise_um * rng.standard_normal(moved_um.size))
    records = (FitRecord.of(measured, substeps=Substeps.BENDS),)
    start = truth
    for effect in effects:
        parameter = effect.main_parameter
        start = start.with_cause(replace(effect, **{parameter: 1.1 * getattr(effect, parameter)}))
    found = refit(start, records, n_iterations=30)
    assert found.is_converged
    for free in found.free:
        at = free.coordinate(free.get(found.model))
        step = 0.5 * found.standard_errors(records, 1.0)[free.cause, free.index, free.spec.name]
        step = step / abs(free.get(found.model)) if free.spec.is_log else step / free.scale
        here, less, more = (
            squared_error(records, residuals(free.set(found.model, free.value(at + move)), records))
            for move in (0.0, -step, step)
        )
        bend = more + less - 2.0 * here  # of a parabola, whose lowest point is what this parameter would still gain
        gain = (less - more) ** 2 / (8.0 * bend)
        assert gain < 0.1 * here / moved_um.size, f"{free.spec.name}: noise gains one part of its variance with each"


def test_directions_behind_a_lag_know_the_rate_by_which_thresholds_widen() -> None:
    """After a jump the voltage moves on, ever slower, and each part of a step has thresholds of its own."""
    rng = np.random.default_rng(5)
    voltage_v = np.concatenate((np.zeros(20), np.repeat(rng.uniform(-1.0, 1.0, 40), 12)))
    lag, widening = UnequalLag(2e-3, 6e-3), RateDependentHysteresis(0.02)
    plays = ColumnKinds.plays(np.array([0.0, 0.1, 0.4, 1.0]))
    recording = Recording(1e-3 * np.arange(voltage_v.size), voltage_v, voltage_v)
    record = FitRecord.of(recording, substeps=Substeps.BENDS)

    def missed(*effects: Effect) -> float:
        model = TrialModel(plays, np.array([1.5, 0.3, 0.4, 0.3]), 0.02, effects, ((),))
        told_um = record_columns(model, record, 0) @ model.weights
        return float(np.std(told_um - predict(model, record, 0)) / np.ptp(told_um))

    assert missed(widening, lag) < 1e-6
    assert missed(lag) < 1e-4, "without it fewer parts will do"
