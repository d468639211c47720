"""Parameters that held-out data alone ask for are those that were learned, where it is the cause that acts."""

from __future__ import annotations

import math

import numpy as np
import pytest

from fomrc_core.diagnosis.constancy import Constancy, constancy, unless_inconstant
from fomrc_core.diagnosis.data_split import split_data
from fomrc_core.diagnosis.judgement import Judgement
from fomrc_core.effects.amplifier_bandwidth import AmplifierBandwidth
from fomrc_core.effects.transport_delay import TransportDelay
from fomrc_core.fitting.joint_fit import refit
from fomrc_core.fitting.play_columns import ColumnKinds
from fomrc_core.fitting.trial_model import TrialModel
from fomrc_core.records.recording import Recording

_RATE_HZ, _NOISE_UM, _ORDER = 1000.0, 1e-3, 0.02
_NOISE = Judgement(_NOISE_UM, True, 0.0, (), ())


def _drive_v(kind: str) -> np.ndarray:
    time_s = np.arange(6000) / _RATE_HZ
    if kind == "slow":
        way_v = (0.8 - 0.1 * time_s) * np.sin(2.0 * np.pi * 1.1 * time_s) + 0.2 * np.sin(2.0 * np.pi * 4.3 * time_s)
    else:
        way_v = 0.5 * np.sin(2.0 * np.pi * 9.0 * time_s) * np.sin(2.0 * np.pi * 0.3 * time_s)
        way_v = way_v + 0.5 * np.sin(2.0 * np.pi * 30.0 * time_s) * np.sin(2.0 * np.pi * 0.2 * time_s)
    return way_v


def _lagging_um(drive_v: np.ndarray, cutoff_hz: float, delay_s: float, seed: int) -> np.ndarray:
    """Three plays behind a lag or a delay, each stepped twenty times a sample, creep behind them, and white noise."""
    at = np.arange(20 * drive_v.size) / 20.0 - delay_s * _RATE_HZ
    fine = np.interp(at, np.arange(drive_v.size), drive_v)
    late = fine.copy()
    share = 1.0 - np.exp(-2.0 * np.pi * cutoff_hz / (20.0 * _RATE_HZ)) if np.isfinite(cutoff_hz) else 1.0
    for k in range(1, fine.size):
        late[k] = late[k - 1] + share * (fine[k] - late[k - 1])
    moved = 1.5 * (late - late[0])
    for width, weight in ((0.1, 0.3), (0.25, 0.2), (0.6, 0.2)):
        held = late[0]
        play = np.empty(late.size)
        for k, value in enumerate(late):
            held = min(max(held, value - width), value + width)
            play[k] = held
        moved = moved + weight * (play - play[0])
    # each sample's step, a ramp, has come to t^order / Gamma(1 + order) of itself in the mean
    n = np.arange(drive_v.size)
    crept = (n + 1.0) ** (1.0 + _ORDER) - n ** (1.0 + _ORDER)
    crept = crept * _RATE_HZ**-_ORDER / math.gamma(2.0 + _ORDER)
    steps_um = np.diff(moved[::20], prepend=0.0)
    noise_um = np.random.default_rng(seed).normal(0.0, _NOISE_UM, drive_v.size)
    return np.convolve(steps_um, crept)[: drive_v.size] + noise_um


def _constancy(
    cause: AmplifierBandwidth | TransportDelay, train: tuple[float, float], test: tuple[float, float]
) -> Constancy:
    records = []
    for kind, (cutoff_hz, delay_s), seed in (("slow", train, 1), ("fast", test, 2)):
        drive_v = _drive_v(kind)
        time_s = np.arange(drive_v.size) / _RATE_HZ
        records.append(Recording(time_s, drive_v, _lagging_um(drive_v, cutoff_hz, delay_s, seed)))
    split = split_data((records[0],), records[1], None, _NOISE_UM)
    plain = TrialModel(
        ColumnKinds.plays(np.array([0.0, 0.1, 0.25, 0.6])), np.array([1.5, 0.3, 0.2, 0.2]), 0.0, (), ((), ())
    )
    final = refit(plain.with_cause(cause), split.train)
    return constancy(final.model, final, split)


def test_a_cause_that_acts_is_the_same_under_another_drive():
    found = _constancy(AmplifierBandwidth(20.0), (25.0, 0.0), (25.0, 0.0))
    (cutoff,) = found.of_cause("amplifier_bandwidth")
    assert cutoff.learned == pytest.approx(25.0, rel=0.03)
    assert cutoff.held_out == pytest.approx(25.0, rel=0.03)
    assert cutoff.relative_error < 0.05, "both records know it"
    assert not found.is_broken
    assert unless_inconstant(_NOISE, found) is _NOISE


def test_a_cause_that_has_changed_is_told_with_both_values():
    found = _constancy(AmplifierBandwidth(20.0), (25.0, 0.0), (40.0, 0.0))
    assert found.is_broken
    judgement = unless_inconstant(_NOISE, found)
    assert not judgement.is_noise
    (reason,) = judgement.reasons
    assert "amplifier_bandwidth asks for another cutoff_hz in held-out data" in reason
    (cutoff,) = found.of_cause("amplifier_bandwidth")
    assert f"{cutoff.held_out:.4g} where {cutoff.learned:.4g}" in reason
    assert cutoff.learned == pytest.approx(25.0, rel=0.03)
    assert cutoff.held_out == pytest.approx(40.0, rel=0.03)


def test_what_stands_in_for_a_lag_needs_another_size_under_another_drive():
    """A delay in the place of a lag: at a frequency of its cutoff and far below it the same lag delays differently."""
    found = _constancy(TransportDelay(0.01), (12.0, 0.0), (12.0, 0.0))
    assert found.is_broken
    assert found.of_cause("amplifier_bandwidth") == ()


def test_nothing_is_compared_where_nothing_was_found():
    drive_v = _drive_v("slow")
    time_s = np.arange(drive_v.size) / _RATE_HZ
    record = Recording(time_s, drive_v, _lagging_um(drive_v, np.inf, 0.0, 3))
    split = split_data((record,), record, None, _NOISE_UM)
    plain = TrialModel(ColumnKinds.plays(np.array([0.0, 0.25])), np.array([1.5, 0.5]), _ORDER, (), ((), ()))
    assert constancy(plain, refit(plain, split.train), split) == Constancy(0.0, ())
