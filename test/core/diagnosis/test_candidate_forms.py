"""Of the forms of one cause that is taken which earns its parameters, wherever its fit began."""

from __future__ import annotations

import numpy as np
import pytest

from fomrc_core.diagnosis.candidate import Candidate, candidates_for
from fomrc_core.diagnosis.data_split import DataSplit, split_data
from fomrc_core.diagnosis.present_model import PresentModel
from fomrc_core.diagnosis.screening import held_view, screen
from fomrc_core.effects.asymmetric_hysteresis import AsymmetricHysteresis
from fomrc_core.effects.creep_law import CreepLaw
from fomrc_core.fitting.base_fit import rebased, threshold_grid
from fomrc_core.fitting.fit_record import FitRecord
from fomrc_core.fitting.joint_fit import fit_until_still
from fomrc_core.fitting.play_columns import ColumnKinds
from fomrc_core.fitting.trial_model import TrialModel, predict
from fomrc_core.records.excitation import triangle
from fomrc_core.records.recording import Recording
from test.core.driven_plays import states_of_plays, sum_of_lines

_NOISE_UM = 2e-3
_PLAIN = TrialModel(ColumnKinds.plays(np.linspace(0.0, 1.8, 10)), np.linspace(1.0, 0.1, 10), 0.02, (), ((), ()))
_TWO_CLOSE = CreepLaw(first_share=0.02, first_s=0.8, second_share=0.02, second_s=2.4)
_TWO_FAR = CreepLaw(first_share=0.1, first_s=0.1, second_share=0.1, second_s=6.0)
_THREE_FAR = CreepLaw(first_share=0.1, first_s=0.1, second_share=0.1, second_s=0.8, third_share=0.1, third_s=6.0)


def _recorded(law: CreepLaw, seed: int, slope_v_per_s: float) -> Recording:
    drive = triangle(2.0, slope_v_per_s=slope_v_per_s, n_cycles=6, rate_hz=50.0)
    blank = Recording(drive.time_s, drive.voltage_v, drive.voltage_v)
    moved_um = predict(_PLAIN.with_cause(law), FitRecord.of(blank), 0)
    return Recording(
        drive.time_s, drive.voltage_v, moved_um + np.random.default_rng(seed).normal(0.0, _NOISE_UM, drive.time_s.size)
    )


def _found(law: CreepLaw) -> tuple[DataSplit, dict[str, Candidate]]:
    split = split_data((_recorded(law, 1, 4.0),), _recorded(law, 2, 9.0), None, _NOISE_UM)
    base = fit_until_still(rebased(_PLAIN, split.train), split.train).model
    present = PresentModel.of(base, split)
    screened = screen(present, ("creep_law", "slow_relaxation"), held_view(base, split))
    return split, {candidate.cause: candidate for candidate in candidates_for(present, split, screened, None)}


def _law_of(candidate: Candidate) -> CreepLaw:
    (law,) = (effect for effect in candidate.fitted.model.effects if isinstance(effect, CreepLaw))
    return law


def test_two_relaxations_close_together_are_found_and_no_third() -> None:
    split, found = _found(_TWO_CLOSE)
    best = found["creep_law"]
    law = _law_of(best)
    assert best.is_plausible
    assert law.third_share == 0.0, "a third does not earn its parameters"
    assert sorted((law.first_s, law.second_s)) == pytest.approx([0.8, 2.4], rel=0.5)
    assert best.fitted.squared_error < 1.1 * _NOISE_UM**2 * split.n_used
    assert best.fitted.squared_error < found["slow_relaxation"].fitted.squared_error


def test_three_relaxations_far_apart_are_found() -> None:
    split, found = _found(_THREE_FAR)
    law = _law_of(found["creep_law"])
    assert sorted((law.first_s, law.second_s, law.third_s)) == pytest.approx([0.1, 0.8, 6.0], rel=0.3)
    assert found["creep_law"].fitted.squared_error < 1.1 * _NOISE_UM**2 * split.n_used


@pytest.mark.parametrize("order", [0.01, 0.1])
def test_what_takes_the_place_of_the_power_law_creeps_as_it_does(order: float) -> None:
    time_s = np.geomspace(0.02, 60.0, 200)
    wanted = time_s**order / 0.02**order
    laws = CreepLaw.in_place_of_creep(order, 0.02, 60.0)
    assert [law.form() for law in laws] == [law.form() for law in (CreepLaw(per_decade=0.1), _TWO_FAR, _THREE_FAR)]
    for law in laws:
        steps_s = np.diff(time_s, prepend=0.0)
        crept = law.run(law.initial_state(), np.ones(time_s.size), steps_s)
        assert np.max(np.abs(crept - wanted)) < 0.12 * (wanted[-1] - 1.0)
    assert CreepLaw.in_place_of_creep(0.0, 0.02, 60.0) == []


def test_a_logarithm_that_begins_late_is_told_from_relaxations() -> None:
    law = CreepLaw(per_decade=0.17, onset_s=0.4)
    split, found = _found(law)
    assert _law_of(found["creep_law"]).form() == law.form()
    assert _law_of(found["creep_law"]).onset_s == pytest.approx(law.onset_s, rel=0.1)
    assert found["creep_law"].fitted.squared_error < 1.1 * _NOISE_UM**2 * split.n_used


def _bent(seed: int) -> Recording:
    """Return a stage whose amplifier bends the drive before symmetric plays see it, made with numpy alone."""
    rng = np.random.default_rng(seed)
    time_s = np.arange(3000) / 200.0
    drive_v = 0.35 * np.minimum(time_s, 1.0) * sum_of_lines(rng, time_s, 0.2, 2.0)
    widths_v = np.array([0.0, 0.13, 0.29, 0.41, 0.67])
    moved_um = states_of_plays(widths_v, drive_v * (1.0 + 0.12 * drive_v)) @ np.array([1.2, 0.2, 0.2, 0.2, 0.2])
    return Recording(time_s, drive_v, moved_um + rng.normal(0.0, _NOISE_UM, time_s.size))


def test_a_bend_of_the_drive_is_no_family_of_plays() -> None:
    split = split_data((_bent(1),), _bent(2), None, _NOISE_UM)
    plays = ColumnKinds.plays(threshold_grid(split.train, 40))
    start = TrialModel(plays, np.ones(40), 0.0, (), ((), ()), grid_v=plays.thresholds_v)
    base = fit_until_still(start, split.train).model
    present = PresentModel.of(base, split)
    screened = screen(present, ("asymmetric_hysteresis",), held_view(base, split))
    (found,) = candidates_for(present, split, screened, None)
    assert not found.brings_plays
    (bend,) = found.fitted.model.effects
    assert isinstance(bend, AsymmetricHysteresis)
    assert bend.warp_per_v == pytest.approx(0.12, rel=0.02)
    assert found.fitted.squared_error < 1.2 * _NOISE_UM**2 * split.n_used
