"""A lead that opens: the charge stays, the stage stands, and jumps when it closes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from fomrc_core.diagnosis.data_split import DataSplit, HeldOut
from fomrc_core.diagnosis.diagnosis import diagnose
from fomrc_core.diagnosis.moved_times import with_times_moved
from fomrc_core.diagnosis.record_effects import follow_held
from fomrc_core.effects.base.contact_times import open_times
from fomrc_core.effects.base.evidence import RecordEvidence
from fomrc_core.effects.intermittent_contact import IntermittentContact
from fomrc_core.errors import ParameterError
from fomrc_core.fitting.fit_record import FitRecord
from fomrc_core.fitting.play_columns import ColumnKinds
from fomrc_core.fitting.trial_model import TrialModel, predict
from fomrc_core.model.piezo_model import PiezoModel
from fomrc_core.records.drive import learned_blocks
from fomrc_core.records.recording import Recording

STEP_S = 0.01
STAGE = PiezoModel(np.array([8.0, 3.0, 5.0, 2.0, 1.2]), np.array([0.4, 1.5, 4.0, 9.0]), 0.02)


def sweeps(n: int, seed: int) -> np.ndarray:
    """Return a drive of some slow sines, from zero on [V], shape (n,)."""
    rng = np.random.default_rng(seed)
    time_s = STEP_S * np.arange(n)
    sines = sum(np.sin(2 * np.pi * f * time_s + rng.uniform(0, 6)) for f in (0.11, 0.23, 0.37, 0.71))
    return 6.0 * np.minimum(time_s / 0.5, 1.0) * np.asarray(sines)


def held(drive_v: np.ndarray, openings: list[tuple[int, int]]) -> np.ndarray:
    """Return the voltage at the ceramic where the lead is open from the first sample of each pair to the second."""
    behind = drive_v.copy()
    for first, last in openings:
        behind[first:last] = drive_v[first]
    return behind


def test_the_voltage_stays_while_the_lead_is_open() -> None:
    drive_v, steps_s = sweeps(600, 1), np.full(600, STEP_S)
    lead = IntermittentContact(opens_s=(1.0, 3.0), closes_s=(1.2, 3.555))
    state = lead.initial_state()
    parts = [lead.run(state, drive_v[a:b], steps_s[a:b]) for a, b in ((0, 1), (1, 104), (104, 310), (310, 600))]
    np.testing.assert_allclose(np.concatenate(parts), held(drive_v, [(100, 120), (300, 356)]), atol=1e-9)


def test_between_samples_it_opens_where_the_drive_then_is() -> None:
    lead = IntermittentContact(opens_s=(0.0525,), closes_s=(0.085,))
    out = lead.run(lead.initial_state(), np.arange(12.0), np.full(12, STEP_S))
    np.testing.assert_allclose(out, [0, 1, 2, 3, 4, 5, 5.25, 5.25, 5.25, 9, 10, 11], atol=1e-9)


@pytest.mark.parametrize(
    ("changes", "where"),
    [
        ({"opens_s": (1.0, 2.0), "closes_s": (1.5,)}, "closes_s"),
        ({"opens_s": (1.0, 1.2), "closes_s": (1.5, 2.0)}, "closes_s"),
        ({"opens_s": (2.0,), "closes_s": (1.0,)}, "closes_s"),
        ({"opens_s": (1.0,), "closes_s": (2.0,), "stiffness_share": 0.1}, "stiffness_share"),
    ],
)
def test_times_that_cannot_be_are_refused(changes, where) -> None:
    with pytest.raises(ParameterError, match=where):
        IntermittentContact(**changes)


def test_a_diagnosis_finds_the_openings_of_each_record() -> None:
    openings = ([(410, 460), (1333, 1380)], [(700, 745)])
    records = []
    for seed, (n, pairs) in enumerate(zip((2400, 1500), openings, strict=True)):
        drive_v, rng = sweeps(n, seed + 5), np.random.default_rng(seed)
        moved_um = STAGE.simulate(np.full(n, STEP_S), held(drive_v, pairs))
        records.append(Recording(STEP_S * np.arange(n), drive_v, moved_um + rng.normal(0.0, 2e-3, n)))
    found = diagnose(records[0], test=records[1])
    assert [finding.cause for finding in found.findings] == ["intermittent_contact"]
    lead = found.findings[0].parameters
    np.testing.assert_allclose(lead["opens_s"], [4.1, 13.33], atol=2 * STEP_S)
    np.testing.assert_allclose(lead["closes_s"], [4.595, 13.795], atol=STEP_S)


def _plain_with(lead: IntermittentContact) -> TrialModel:
    columns = ColumnKinds.plays(np.array([0.0, 2.0, 6.0]))
    return TrialModel(columns, np.array([0.2, 0.05, 0.05]), 0.02, (), ((),)).with_cause(lead, 0)


def test_openings_move_to_where_they_leave_least_and_go_where_they_explain_nothing() -> None:
    n = 1200
    blank = Recording(STEP_S * np.arange(n), sweeps(n, 3), sweeps(n, 3))
    true = IntermittentContact(opens_s=(2.0, 8.0), closes_s=(2.4, 8.3))
    moved_um = predict(_plain_with(true), FitRecord.of(blank), 0)
    record = FitRecord.of(Recording(blank.time_s, blank.voltage_v, moved_um))
    unseen = record.using(record.time_s < 7.0)
    begun = IntermittentContact(opens_s=(1.96, 4.0, 8.1), closes_s=(2.43, 4.5, 8.25))

    def found(seen: FitRecord) -> IntermittentContact:
        (lead,) = with_times_moved(_plain_with(begun), seen, 0).record_effects[0]
        assert isinstance(lead, IntermittentContact)
        return lead

    np.testing.assert_allclose(
        [found(record).opens_s, found(record).closes_s], [true.opens_s, true.closes_s], atol=0.01
    )
    # where nobody looks nothing holds a time: it stays where it was
    half = found(unseen)
    np.testing.assert_allclose([half.opens_s, half.closes_s], [[2.0, 8.1], [2.4, 8.25]], atol=0.01)


def test_a_stage_that_creeps_on_while_the_lead_is_open_stands() -> None:
    n = 600
    drive_v = sweeps(n, 1)
    shown_um = held(drive_v, [(300, 345)])
    # a fifth of what the drive does meanwhile
    shown_um[300:345] += 0.2 * (drive_v[300:345] - drive_v[300])
    time_s, steps_s = STEP_S * np.arange(n), np.full(n, STEP_S)
    record = RecordEvidence(time_s, steps_s, drive_v, drive_v, shown_um - drive_v)
    opens_s, closes_s = open_times(record, 1e-3)
    np.testing.assert_allclose([opens_s, closes_s], [[3.0], [3.45]], atol=1.5 * STEP_S)


def test_an_opening_is_seen_whose_last_reading_is_off() -> None:
    n, noise_um = 600, 0.05
    drive_v = sweeps(n, 1)
    # it closes where the drive turns: how far that has gone says nothing of the last two readings there
    turns = np.flatnonzero(np.diff(np.sign(np.diff(drive_v)))) + 2
    last = int(next(k for k in turns if k > 200 and abs(drive_v[k] - drive_v[k - 40]) > 1.0))
    shown_um = held(drive_v, [(last - 40, last)])
    # by more than a reading may be from the mean of many, and less than two readings may be apart
    shown_um[last - 1] += 4.8 * noise_um
    record = RecordEvidence(STEP_S * np.arange(n), np.full(n, STEP_S), drive_v, drive_v, shown_um - drive_v)
    opens_s, closes_s = open_times(record, noise_um)
    np.testing.assert_allclose([opens_s, closes_s], [[STEP_S * (last - 40)], [STEP_S * last]], atol=2.5 * STEP_S)


def test_an_opening_begins_where_the_model_is_left_and_not_where_a_ramp_comes_near_its_level() -> None:
    n, first, last = 600, 348, 480
    drive_v = np.interp(np.arange(n), [0, 50, 400, 550, n], [0.0, -6.0, 1.0, -2.0, -2.0])
    shown_um = held(drive_v, [(first, last)])
    record = RecordEvidence(STEP_S * np.arange(n), np.full(n, STEP_S), drive_v, drive_v, shown_um - drive_v)
    opens_s, closes_s = open_times(record, 5e-3)
    # counted from where the ramp came near, the drive would have gone twice as far as what comes back
    np.testing.assert_allclose([opens_s, closes_s], [[STEP_S * first], [STEP_S * last]], atol=1.5 * STEP_S)


@pytest.mark.parametrize("seed", range(6))
def test_an_opening_on_a_plateau_is_seen_by_the_step_that_is_missed(seed: int) -> None:
    n, stepped, last = 600, 330, 352
    drive_v = np.repeat([0.0, 2.0, 5.0, 3.0, 4.0], [100, 120, 110, 130, 140]).astype(np.float64)
    # the stage creeps on each plateau, so that the model is followed until the step, and a level kept from it on
    since = np.concatenate([np.arange(size) for size in (100, 120, 110, 130, 140)])
    moved_um = drive_v - 0.3 * np.exp(-since / 60.0)
    shown_um = moved_um.copy()
    shown_um[stepped:last] = moved_um[stepped - 1]  # it opens just before, and closes before the drive has moved on
    left_um = shown_um - moved_um + np.random.default_rng(seed).normal(0.0, 2e-3, n)
    record = RecordEvidence(STEP_S * np.arange(n), np.full(n, STEP_S), drive_v, moved_um, left_um)
    opens_s, closes_s = open_times(record, 2e-3)
    np.testing.assert_allclose(opens_s, [STEP_S * stepped], atol=2.5 * STEP_S)
    np.testing.assert_allclose(closes_s, [STEP_S * last], atol=1.5 * STEP_S)


def test_openings_are_seen_beside_what_stands_and_jumps_in_its_own_way() -> None:
    n, step_v = 2400, 0.4
    drive_v = sweeps(n, 1)
    firsts = [k for k in range(200, n - 100) if abs(drive_v[k + 45] - drive_v[k]) > 6.0]
    openings = [(k, k + 45) for k in (firsts[0], next(k for k in firsts if k > firsts[0] + 800))]
    # a coarse converter stands at each level while the drive moves on, dozens of times
    shown_um = step_v * np.round(held(drive_v, openings) / step_v)
    record = RecordEvidence(STEP_S * np.arange(n), np.full(n, STEP_S), drive_v, drive_v, shown_um - drive_v)
    opens_s, closes_s = open_times(record, 1e-3)
    # it is seen to open where the level began at which it stands
    begins = [max(k for k in range(first) if shown_um[k] != shown_um[first]) + 1 for first, _ in openings]
    np.testing.assert_allclose(opens_s, STEP_S * np.array(begins), atol=1.5 * STEP_S)
    np.testing.assert_allclose(closes_s, STEP_S * np.array([last for _, last in openings]), atol=1.5 * STEP_S)
    none = RecordEvidence(
        record.time_s, record.steps_s, drive_v, drive_v, step_v * np.round(drive_v / step_v) - drive_v
    )
    assert open_times(none, 1e-3) == ((), ())


def test_an_opening_of_a_held_out_record_is_followed_in_whichever_block_it_is() -> None:
    n = 2400
    drive_v, time_s = sweeps(n, 3), STEP_S * np.arange(n)
    inside = np.flatnonzero(~learned_blocks(n))
    first = int(inside[np.flatnonzero(np.diff(inside, prepend=-2) != 1)[2]]) + 5
    assert not np.any(learned_blocks(n)[first : first + 35])
    opens_s, closes_s = float(time_s[first]) + 0.3 * STEP_S, float(time_s[first + 30]) + 0.4 * STEP_S
    true = IntermittentContact(opens_s=(opens_s,), closes_s=(closes_s,))
    learned = FitRecord.of(Recording(time_s, drive_v, drive_v))
    model = _plain_with(IntermittentContact(opens_s=(2.0,), closes_s=(2.4,)))
    model = replace(model, record_effects=(*model.record_effects, ()))
    moved_um = predict(_plain_with(true), learned, 0) + np.random.default_rng(1).normal(0.0, 1e-3, n)
    held_out = HeldOut(FitRecord.of(Recording(time_s, drive_v, moved_um)), 1)
    followed = follow_held(model, DataSplit((learned,), (held_out,), (held_out,), 1e-3))
    (lead,) = followed.record_effects[1]
    assert isinstance(lead, IntermittentContact)
    np.testing.assert_allclose([lead.opens_s, lead.closes_s], [[opens_s], [closes_s]], atol=0.15 * STEP_S)


def test_an_opening_is_seen_that_ends_where_the_drive_comes_by_its_level() -> None:
    n, noise_um = 600, 0.01
    drive_v = 5.0 * np.sin(2 * np.pi * np.arange(n) / 40.3) * np.minimum(np.arange(n) / 100.0, 1.0)
    # a period later the drive is nearly where it was, the lead closes, and the rest is made up for slowly
    first = 306
    last = first + 41
    shown_um = held(drive_v, [(first, last)])
    since = np.maximum(np.arange(n) - last, 0)
    shown_um[last:] += (shown_um[last - 1] - drive_v[last - 1]) * np.exp(-since[last:] / 30.0)
    left_um = shown_um - drive_v + np.random.default_rng(3).normal(0.0, noise_um, n)
    assert abs(left_um[last] - left_um[last - 1]) < 4.0 * noise_um, "nothing jumps"
    record = RecordEvidence(STEP_S * np.arange(n), np.full(n, STEP_S), drive_v, drive_v, left_um)
    opens_s, closes_s = open_times(record, noise_um)
    np.testing.assert_allclose([opens_s, closes_s], [[STEP_S * first], [STEP_S * last]], atol=2.5 * STEP_S)


@pytest.mark.parametrize("seed", range(5))
def test_openings_within_plateaus_are_seen_beside_noise_that_wanders(seed: int) -> None:
    rng, size = np.random.default_rng(seed), 100
    drive_v = np.repeat([0.0, 1.0, 2.0, 3.0, 2.0, 1.0, 0.0], size)
    since = np.tile(np.arange(size), 7)
    moved_um = drive_v - 0.05 * np.exp(-since / 30.0)
    shown_um = moved_um.copy()
    for first, last in ((195, 240), (395, 470)):
        shown_um[first:last] = moved_um[first]
    wander_um = np.zeros(drive_v.size)
    for k in range(1, drive_v.size):
        wander_um[k] = 0.95 * wander_um[k - 1] + 2e-3 * rng.standard_normal()
    left_um = shown_um + wander_um - moved_um
    record = RecordEvidence(STEP_S * np.arange(drive_v.size), np.full(drive_v.size, STEP_S), drive_v, moved_um, left_um)
    opens_s, closes_s = open_times(record, 1e-3)
    np.testing.assert_allclose(closes_s, [2.395, 4.695], atol=1.5 * STEP_S)
    # when it opened in a plateau nothing shows before the step
    assert np.all(np.array(opens_s) > [1.0 - STEP_S, 3.0 - STEP_S])
    assert np.all(np.array(opens_s) < [2.0, 4.0])


def test_an_opening_does_not_move_into_another_valley() -> None:
    n = 1200
    time_s = STEP_S * np.arange(n)
    # a drive that comes by one voltage every ten samples
    drive_v = np.minimum(time_s, 1.0) * (np.sin(2 * np.pi * time_s / 0.1) + 0.4 * np.sin(2 * np.pi * time_s / 0.73))
    true = IntermittentContact(opens_s=(5.013,), closes_s=(5.165,))
    moved_um = predict(_plain_with(true), FitRecord.of(Recording(time_s, drive_v, drive_v)), 0)
    record = FitRecord.of(Recording(time_s, drive_v, moved_um))
    for off in (-1.3, -0.7, 1.0, 1.3):
        begun = IntermittentContact(opens_s=(5.013 + off * STEP_S,), closes_s=(5.165,))
        (lead,) = with_times_moved(_plain_with(begun), record, 0).record_effects[0]
        assert isinstance(lead, IntermittentContact)
        np.testing.assert_allclose([lead.opens_s, lead.closes_s], [[5.013], [5.165]], atol=0.5 * STEP_S)


def test_places_where_nothing_is_left_any_more_do_not_outvote_the_opening_that_is_there() -> None:
    drive_v = sweeps(1500, 3)
    time_s = STEP_S * np.arange(drive_v.size)
    noise_um = np.random.default_rng(4).normal(0.0, 2e-3, drive_v.size)
    left_um = 2.0 * (held(drive_v, [(700, 745)]) - drive_v) + noise_um
    # three more were plateaus of a limit that has been found since
    opens_s, closes_s = (2.0, 4.0, 5.0, 7.0), (2.3, 4.3, 5.3, 7.45)
    assert IntermittentContact(opens_s=opens_s, closes_s=closes_s).is_confirmed(time_s, drive_v, left_um)
    assert not IntermittentContact(opens_s=opens_s, closes_s=closes_s).is_confirmed(time_s, drive_v, noise_um)
    # what the stage does there in another way, and more of it than at the one, speaks against a lead
    turned_um = left_um + np.where((time_s >= 2.0) & (time_s < 2.3), 80.0 * np.sin(40.0 * time_s), 0.0)
    assert not IntermittentContact(opens_s=opens_s, closes_s=closes_s).is_confirmed(time_s, drive_v, turned_um)


def test_an_opening_on_a_plateau_is_seen_where_the_stage_creeps_on_by_many_times_the_noise() -> None:
    n, stepped, last, noise_um = 600, 330, 352, 2e-4
    sizes = (100, 120, 110, 130, 140)
    drive_v = np.repeat([0.0, 2.0, 5.0, 3.0, 4.0], sizes).astype(np.float64)
    since = np.concatenate([np.arange(size) for size in sizes])
    moved_um = drive_v - 0.3 * np.exp(-since / 60.0)
    shown_um = moved_um.copy()
    # the voltage that stays goes on to creep, by some hundredths of the step that is missed
    shown_um[stepped:last] = moved_um[stepped - 1] - 0.08 * (1.0 - np.exp(-np.arange(last - stepped) / 8.0))
    left_um = shown_um - moved_um + np.random.default_rng(5).normal(0.0, noise_um, n)
    record = RecordEvidence(STEP_S * np.arange(n), np.full(n, STEP_S), drive_v, moved_um, left_um)
    opens_s, closes_s = open_times(record, noise_um)
    np.testing.assert_allclose(opens_s, [STEP_S * stepped], atol=1.5 * STEP_S)
    np.testing.assert_allclose(closes_s, [STEP_S * last], atol=1.5 * STEP_S)


def test_an_opening_within_a_step_of_the_drive_is_told_to_a_hundredth_of_a_sample() -> None:
    n = 1200
    time_s = STEP_S * np.arange(n)
    drive_v = np.repeat([0.0, 2.0, 5.0, 3.0], 300).astype(np.float64)
    # by how much it opens after the step began the stage has gone by as much of it
    opens_s, closes_s = STEP_S * (599.0 + 0.43), STEP_S * 640.3
    true = IntermittentContact(opens_s=(opens_s,), closes_s=(closes_s,))
    moved_um = predict(_plain_with(true), FitRecord.of(Recording(time_s, drive_v, drive_v)), 0)
    record = FitRecord.of(Recording(time_s, drive_v, moved_um))
    begun = IntermittentContact(opens_s=(STEP_S * 599.0,), closes_s=(closes_s,))
    (lead,) = with_times_moved(_plain_with(begun), record, 0).record_effects[0]
    assert isinstance(lead, IntermittentContact)
    assert lead.opens_s[0] == pytest.approx(opens_s, abs=0.01 * STEP_S)
