"""What effects may look at, to propose trial instances of themselves, of a model under fit."""

from __future__ import annotations

from functools import partial

from fomrc_core.compute.arrays import Array
from fomrc_core.effects.base.evidence import Evidence, RecordEvidence
from fomrc_core.fitting.fit_record import FitRecord
from fomrc_core.fitting.step_response import step_response
from fomrc_core.fitting.trial_model import TrialModel, predict
from fomrc_core.records.quality import bridged
from fomrc_core.records.sensor_step import recurring_step_um, sensor_step_um


def legible(residual_um: Array, record: FitRecord) -> Array:
    """Return a residual [um] bridged where the readings are wrong, shape (n_samples,).

    A sensor that stuck or dropped out leaves a residual many times that of any cause, and effects look for theirs by
    sums and spectra over whole records.
    """
    return bridged(residual_um, record.recording.valid_samples)


def evidence_of(
    trial: TrialModel, records: tuple[FitRecord, ...], residuals_um: tuple[Array, ...], noise_um: float
) -> Evidence:
    """Return what the effects may look at.

    Args:
        trial: the present model.
        records: what it was fitted to.
        residuals_um: measured minus predicted, offset removed, per record [um].
        noise_um: noise floor [um].
    """
    return Evidence(
        tuple(
            RecordEvidence(
                record.time_s,
                record.steps_s,
                record.voltage_v,
                predict(trial, record, index, is_coarse=True),
                legible(residual_um, record),
                record.covariates,
                _sensor_step_um(record.measured_um[record.recording.valid_samples]),
                partial(step_response, trial, record),
            )
            for index, (record, residual_um) in enumerate(zip(records, residuals_um, strict=True))
        ),
        noise_um,
    )


def _sensor_step_um(readings_um: Array) -> float:
    """Return the step of a quantised sensor [um], nan where there is none; a few readings may be none of its own."""
    step_um = sensor_step_um(readings_um)
    return step_um if step_um > 0.0 else recurring_step_um(readings_um)
