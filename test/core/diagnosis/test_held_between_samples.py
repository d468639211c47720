"""A converter keeps each sample until the next, in records of different rates."""

from __future__ import annotations

import numpy as np

from fomrc_core import Recording, diagnose

_PLAYS = ((0.0, 0.6), (2.0, 0.1), (5.0, 0.15), (11.0, 0.12), (21.0, 0.05))  # half widths [V], weights [um/V]
_NOISE_UM = 2e-3
_N_PARTS = 8
_CYCLE_S = 1.0


def read_from_stairs(levels_v: np.ndarray, n_late: int = 0) -> np.ndarray:
    """Return the mean over each sample, half before it and half after, of a sum of plays behind a staircase [um].

    The staircase arrives so many parts of a sample late.
    """
    path_v = np.concatenate((np.zeros(n_late), np.repeat(levels_v, _N_PARTS)))[: levels_v.size * _N_PARTS]
    moved_um = np.zeros(path_v.size)
    for half_width_v, weight in _PLAYS:
        at_v = 0.0
        for k, v in enumerate(path_v):
            at_v = min(max(at_v, v - half_width_v), v + half_width_v)
            moved_um[k] += weight * at_v
    half = _N_PARTS // 2
    padded = np.concatenate((np.zeros(half), moved_um))
    return padded[: moved_um.size].reshape(-1, _N_PARTS)[:, :half].sum(axis=1) / _N_PARTS + (
        moved_um.reshape(-1, _N_PARTS)[:, :half].sum(axis=1) / _N_PARTS
    )


def record(rate_hz: float, amplitudes_v: tuple[float, ...], seed: int, delay_s: float = 0.0) -> Recording:
    """Return sines of these amplitudes, held from sample to sample, late by a whole number of parts."""
    time_s = np.arange(round(len(amplitudes_v) * _CYCLE_S * rate_hz)) / rate_hz
    cycle = np.minimum((time_s / _CYCLE_S).astype(int), len(amplitudes_v) - 1)
    drive_v = np.array(amplitudes_v)[cycle] * np.sin(2.0 * np.pi * time_s / _CYCLE_S)
    noise_um = _NOISE_UM * np.random.default_rng(seed).standard_normal(time_s.size)
    moved_um = read_from_stairs(drive_v, round(delay_s * rate_hz * _N_PARTS))
    return Recording(time_s, drive_v, moved_um + noise_um, name=f"at {rate_hz:g} Hz")


def test_each_sample_is_held_whatever_the_rate_of_a_record() -> None:
    train = record(400.0, (30.0, 22.0, 15.0, 9.0, 26.0, 5.0), 1)
    test, report = record(800.0, (28.0, 12.0, 19.0), 2), record(200.0, (24.0, 29.0, 8.0, 17.0), 3)
    found = diagnose([train], test=test, report=report)
    names = [finding.cause for finding in found.findings]
    assert names == ["zero_order_hold"]
    assert found.records[2].residual_after_um.std() < 1.2 * _NOISE_UM


def test_beside_a_delay_that_took_its_time_another_rate_tells_it() -> None:
    """Training at one rate cannot tell half a sample of hold from a delay: the hold has nothing to teach there."""
    delay_s = 1.25e-3
    train = record(400.0, (30.0, 22.0, 15.0, 9.0, 26.0, 5.0), 1, delay_s)
    test = record(800.0, (28.0, 12.0, 19.0), 2, delay_s)
    report = record(200.0, (24.0, 29.0, 8.0, 17.0), 3, delay_s)
    found = diagnose([train], test=test, report=report)
    assert sorted(finding.cause for finding in found.findings) == ["transport_delay", "zero_order_hold"], str(found)
    (delay,) = (finding for finding in found.findings if finding.cause == "transport_delay")
    assert abs(delay.parameters["delay_s"] - delay_s) < 0.05 * delay_s
    assert found.records[2].residual_after_um.std() < 1.2 * _NOISE_UM
