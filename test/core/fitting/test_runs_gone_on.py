"""A chain that differs from another in a late stage goes on from its run and gives the same as from the beginning."""

from __future__ import annotations

import numpy as np
import pytest

from fomrc_core.effects import Effect
from fomrc_core.effects.amplifier_bandwidth import AmplifierBandwidth
from fomrc_core.effects.dac_quantization import DacQuantization
from fomrc_core.effects.mechanical_resonance import MechanicalResonance
from fomrc_core.effects.rate_dependent_hysteresis import RateDependentHysteresis
from fomrc_core.effects.sensor_bandwidth import SensorBandwidth
from fomrc_core.effects.transport_delay import TransportDelay
from fomrc_core.fitting.fit_record import FitRecord
from fomrc_core.fitting.play_columns import ColumnKinds
from fomrc_core.fitting.trial_model import TrialModel, predict, predict_passing
from fomrc_core.model.prehistory import Prehistory
from fomrc_core.model.simulation import Before
from fomrc_core.model.substeps import Substeps
from fomrc_core.records.recording import Recording

EFFECTS = (
    DacQuantization(0.02),
    AmplifierBandwidth(60.0),
    RateDependentHysteresis(0.002),
    MechanicalResonance(80.0, 0.05),
    SensorBandwidth(150.0, 2.0),
)
OTHERS = (
    DacQuantization(0.03),
    AmplifierBandwidth(70.0),
    RateDependentHysteresis(0.003),
    MechanicalResonance(90.0, 0.06),
    SensorBandwidth(160.0, 2.0),
    TransportDelay(0.004),  # asks for more parts of each step: nothing of the run before is of use
)


STARTS = (None, Prehistory.long_rest(0.6))


@pytest.mark.parametrize("start", STARTS, ids=["relaxed", "past"])
@pytest.mark.parametrize("other", OTHERS, ids=lambda effect: effect.name)
@pytest.mark.parametrize("substeps", [Substeps.NONE, Substeps.BENDS])
def test_going_on_gives_the_same_bits(other: Effect, substeps: Substeps, start: Prehistory | None) -> None:
    steps = np.random.default_rng(2).normal(0.0, 0.1, 400)
    voltage_v = np.sin(0.05 * np.arange(400)) + np.cumsum(np.where(np.arange(400) % 40, 0.0, steps))
    recording = Recording(2e-3 * np.arange(400), voltage_v, np.zeros(400))
    record = FitRecord.of(recording, substeps=substeps)
    plays = ColumnKinds.plays(np.array([0.0, 0.1, 0.4, 1.0]))
    trial = TrialModel(plays, np.array([1.5, 0.3, 0.4, 0.3]), 0.02, EFFECTS, ((),), (start,))
    _, passage = predict_passing(trial, record, 0)
    changed = trial.with_cause(other)
    gone_on, _ = predict_passing(changed, record, 0, before=Before(passage, other.stage))
    np.testing.assert_array_equal(gone_on, predict(changed, record, 0))
    assert np.max(np.abs(gone_on - predict(trial, record, 0))) > 1e-6, "the models must differ to mean anything"
