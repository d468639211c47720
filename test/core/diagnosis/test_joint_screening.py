"""Two causes of which neither is the likeliest alone are told from their signatures together."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from fomrc_core.diagnosis.joint_screening import LikelyPair, likely_pairs
from fomrc_core.diagnosis.screening import Screened
from fomrc_core.effects.external_load import ExternalLoad
from fomrc_core.effects.intermittent_contact import IntermittentContact
from fomrc_core.effects.sensor_nonlinearity import SensorNonlinearity
from fomrc_core.effects.slow_relaxation import SlowRelaxation
from fomrc_core.effects.thermal_drift import ThermalDrift
from fomrc_core.effects.transport_delay import TransportDelay

N = 4000


def _directions(n: int, seed: int) -> NDArray[np.float64]:
    """Return orthonormal directions, shape (n, N)."""
    rows = np.random.default_rng(seed).normal(size=(N, n))
    return np.asarray(np.linalg.qr(rows)[0].T)


def _trial(name: str, shape: NDArray[np.float64], left_um: NDArray[np.float64], index: int | None = None) -> Screened:
    causes = {
        "slow_relaxation": SlowRelaxation(0.1, 1.0),
        "transport_delay": TransportDelay(1e-3),
        "sensor_nonlinearity": SensorNonlinearity(0.1),
        "thermal_drift": ThermalDrift(0.1, 10.0),
    }
    power, moment = float(shape @ shape), float(shape @ left_um)
    cause = causes[name]
    explained = moment**2 / power if cause.takes_either_sign() or moment > 0.0 else 0.0
    return Screened(cause, index, explained, power, moment / power, sketch=shape.astype(np.float32))


def _explained(pair: LikelyPair) -> NDArray[np.float64]:
    trials = (*pair.one, *pair.other)
    return np.sum([t.amplitude * t.sketch.astype(float) for t in trials if t.sketch is not None], axis=0)


def _told(
    shapes: Mapping[str, NDArray[np.float64]], left_um: NDArray[np.float64], n: int = 3
) -> tuple[LikelyPair, ...]:
    return likely_pairs([_trial(name, s, left_um) for name, s in shapes.items()], left_um.astype(np.float32), n)


def test_the_likeliest_alone_is_not_of_the_pair_that_leaves_least() -> None:
    u, v, w = _directions(3, 0)
    left_um = 3.0 * u + 2.0 * v
    shapes = {"transport_delay": 0.1 * u, "sensor_nonlinearity": 7.0 * v, "slow_relaxation": left_um + 2.0 * w}
    alone = {name: _trial(name, s, left_um).explained for name, s in shapes.items()}
    assert max(alone, key=lambda name: alone[name]) == "slow_relaxation"
    best, *others = _told(shapes, left_um)
    assert best.names == {"transport_delay", "sensor_nonlinearity"}
    assert best.left == pytest.approx(0.0, abs=1e-5)
    # each is as large as it is beside the other
    assert _explained(best) == pytest.approx(left_um, abs=1e-4)
    assert all(other.left > 0.05 for other in others)


def test_each_is_sized_beside_the_other_and_not_alone() -> None:
    u, v = _directions(2, 1)
    slanted = 0.8 * u + 0.6 * v
    left_um = 2.0 * u - 0.5 * slanted
    (best,) = _told({"sensor_nonlinearity": u, "slow_relaxation": slanted}, left_um)
    amplitudes = {t.name: t.amplitude for t in (*best.one, *best.other)}
    assert amplitudes["sensor_nonlinearity"] == pytest.approx(2.0, rel=1e-4)
    assert amplitudes["slow_relaxation"] == pytest.approx(-0.5, rel=1e-4)


def test_what_acts_in_one_direction_only_is_not_turned_round() -> None:
    assert not TransportDelay(1e-3).takes_either_sign()
    u, v = _directions(2, 2)
    assert _told({"sensor_nonlinearity": u, "transport_delay": -v}, 3.0 * u + v) == ()
    # alone it looks turned round, beside the other it is not
    slanted = 0.9 * u + np.sqrt(1.0 - 0.81) * v
    left_um = -2.0 * u + slanted
    assert float(slanted @ left_um) < 0.0
    (best,) = _told({"sensor_nonlinearity": u, "transport_delay": slanted}, left_um)
    assert _explained(best) == pytest.approx(left_um, abs=1e-4)


def test_pairs_that_explain_the_same_are_alike_and_told_as_one() -> None:
    u, v, w = _directions(3, 3)
    left_um = 3.0 * u + 2.0 * v + 0.5 * w
    kin = {"slow_relaxation": v, "thermal_drift": v + 0.05 * w}
    pairs = _told({"sensor_nonlinearity": u, **kin}, left_um)
    assert len(pairs) == 1 or {"slow_relaxation", "thermal_drift"} == pairs[1].names
    assert pairs[0].names == {"sensor_nonlinearity", "thermal_drift"}
    assert [pair.names for pair in pairs[0].alike] == [{"sensor_nonlinearity", "slow_relaxation"}]


def test_what_belongs_to_single_records_acts_in_each_by_its_own_size() -> None:
    u, v = _directions(2, 4)
    first, second = v.copy(), v.copy()
    first[N // 2 :], second[: N // 2] = 0.0, 0.0
    left_um = u + 2.0 * first - 3.0 * second
    trials = [
        _trial("sensor_nonlinearity", u, left_um),
        _trial("thermal_drift", first, left_um, 0),
        _trial("thermal_drift", second, left_um, 1),
    ]
    (best,) = likely_pairs(trials, left_um.astype(np.float32), 3)
    drift = best.one if best.one[0].name == "thermal_drift" else best.other
    assert {trial.index: pytest.approx(trial.amplitude, rel=0.1) for trial in drift} == {0: 2.0, 1: -3.0}
    assert best.left < 0.01


def test_no_pair_is_of_two_that_were_given_up_and_one_may_be_asked_for_with_another() -> None:
    u, v, w = _directions(3, 6)
    left_um = 3.0 * u + 2.0 * v + w
    shapes = {"transport_delay": u, "sensor_nonlinearity": v, "slow_relaxation": w}
    trials = [_trial(name, s, left_um) for name, s in shapes.items()]
    given_up = frozenset(("transport_delay", "sensor_nonlinearity"))
    pairs = likely_pairs(trials, left_um.astype(np.float32), 3, given_up=given_up)
    assert [pair.names for pair in pairs] == [
        {"transport_delay", "slow_relaxation"},
        {"sensor_nonlinearity", "slow_relaxation"},
    ]
    (beside,) = likely_pairs(trials, left_um.astype(np.float32), 1, with_cause="sensor_nonlinearity", given_up=given_up)
    assert beside.names == {"sensor_nonlinearity", "slow_relaxation"}


def test_no_pair_is_of_two_that_come_and_go_at_times_no_fit_moves() -> None:
    u, v, w = _directions(3, 8)
    left_um = 3.0 * u + 2.0 * v + w
    load, opening = (replace(_trial("thermal_drift", s, left_um), index=0) for s in (u, v))
    trials = [
        replace(load, cause=ExternalLoad(0.1, 1.0)),
        replace(opening, cause=IntermittentContact(opens_s=(1.0,), closes_s=(2.0,))),
        _trial("sensor_nonlinearity", w, left_um),
    ]
    pairs = likely_pairs(trials, left_um.astype(np.float32), 3)
    assert [pair.names for pair in pairs] == [
        {"external_load", "sensor_nonlinearity"},
        {"intermittent_contact", "sensor_nonlinearity"},
    ]


def test_the_same_two_in_another_form_are_no_other_pair() -> None:
    u, v, w = _directions(3, 7)
    left_um = 3.0 * u + 2.0 * v
    swelling = _trial("thermal_drift", v, left_um)
    trials = [
        _trial("sensor_nonlinearity", u, left_um),
        replace(swelling, cause=ThermalDrift(um_per_s=0.1)),
        replace(swelling, cause=ThermalDrift(warm_up_um=0.1), sketch=(v + 0.5 * w).astype(np.float32)),
    ]
    (pair,) = likely_pairs(trials, left_um.astype(np.float32), 3)
    assert pair.left < 1e-4
    (other,) = pair.other_forms
    assert {t.cause.form() for t in other.one + other.other} != {t.cause.form() for t in pair.one + pair.other}
    assert other.names == pair.names


def test_nothing_is_told_of_one_cause_or_of_what_has_no_signature() -> None:
    (u,) = _directions(1, 5)
    assert _told({"sensor_nonlinearity": u}, u) == ()
    silent = Screened(SlowRelaxation(0.1, 1.0), None, 0.0, 1.0, 1.0)
    assert likely_pairs([_trial("sensor_nonlinearity", u, u), silent], u.astype(np.float32), 3) == ()
    assert _told({"sensor_nonlinearity": u, "slow_relaxation": 2.0 * u}, 0.0 * u) == ()
