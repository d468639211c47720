"""Several axes moved by the inverse of their modes, delay, coupling, hysteresis and creep; what has none is refused."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.axes_inverse import N_SAMPLES, RATE_HZ, stage, targets
from fomrc_core.errors import ParameterError
from fomrc_core.model.axes import (
    AxesCompensator,
    AxesDynamicInverse,
    AxesModel,
    AxesModes,
    LevelLaw,
    RateRelay,
    axes_response,
)
from fomrc_core.model.known_target import KnownTarget, known_target
from fomrc_core.model.piezo_model import PiezoModel

_STEPS_S = np.full(N_SAMPLES, 1.0 / RATE_HZ)
_LINE = PiezoModel(np.array([1.0]), np.zeros(0), 0.0)


def _targets(n_axes: int, bandwidth_hz: float) -> tuple[KnownTarget, ...]:
    time_s = np.arange(N_SAMPLES) / RATE_HZ
    return tuple(known_target(time_s, column) for column in targets(n_axes, bandwidth_hz, 2.0).T)


def _off(model: AxesModel, voltage_v: np.ndarray, desired_um: np.ndarray) -> float:
    off = (model.simulate(_STEPS_S, voltage_v) - desired_um)[512:-512]
    return float(np.sqrt(np.mean(off**2) / np.mean(desired_um[512:-512] ** 2)))


@pytest.mark.parametrize("delay", [0.0, 0.4, 1.0, 2.3])
def test_the_response_is_that_of_the_steps(delay: float) -> None:
    model = replace(stage(2, 3), axes=(_LINE, _LINE), delay_s=delay / RATE_HZ)
    n = 32768
    impulses = np.zeros((2, n, 2))
    impulses[0, 0, 0] = impulses[1, 0, 1] = 1.0
    moved = [model.simulate(np.full(n, 1.0 / RATE_HZ), impulse) for impulse in impulses]
    found = np.stack([np.fft.rfft(columns, axis=0) for columns in moved], axis=2)
    hz = np.fft.rfftfreq(n, 1.0 / RATE_HZ)
    assert axes_response(model, hz, 1.0 / RATE_HZ) == pytest.approx(found, abs=1e-6)
    assert axes_response(model, hz[:1], 1.0 / RATE_HZ)[0].real == pytest.approx(model.static_gain(), abs=1e-12)


@pytest.mark.parametrize("n_axes", [2, 3])
def test_modes_and_delay_are_undone_where_the_static_inverse_rings(n_axes: int) -> None:
    model, wanted = stage(n_axes, 0), _targets(n_axes, 200.0)
    desired_um = np.stack([target.desired_um for target in wanted], axis=1)
    waveforms = AxesDynamicInverse(model).run(wanted)
    assert _off(model, AxesCompensator(model).run(_STEPS_S, desired_um), desired_um) > 0.2
    assert _off(model, np.stack([one.voltage_v for one in waveforms], axis=1), desired_um) < 1e-6
    assert all(one.error_um < 1e-4 for one in waveforms)


def test_joints_relay_and_level_are_met_by_rounds() -> None:
    model = stage(2, 1)
    assert model.modes is not None
    modes = replace(model.modes, softening=np.array([-0.01, -0.02, -0.01]), gain_change=np.full(3, 0.02))
    model = replace(
        model,
        modes=modes,
        level=LevelLaw(1.0, 0.7),
        joints=np.array([[0.01, 0.01, 0.02]]),
        rate_relay=RateRelay(500.0, np.full(2, 0.01), np.full(2, -0.01)),
    )
    wanted = _targets(2, 100.0)
    desired_um = np.stack([target.desired_um for target in wanted], axis=1)
    voltage_v = np.stack([one.voltage_v for one in AxesDynamicInverse(model).run(wanted)], axis=1)
    assert _off(model, voltage_v, desired_um) < 1e-3


def test_one_period_of_a_scan_closes() -> None:
    model = stage(2, 0)
    n = 640
    along = 2.0 * np.pi * np.arange(n) / n
    scan_um = np.stack([np.sin(along), 0.5 * np.cos(3.0 * along)], axis=1)
    time_s = np.arange(n) / RATE_HZ
    waveforms = AxesDynamicInverse(model).run(tuple(known_target(time_s, c, is_periodic=True) for c in scan_um.T))
    played = np.tile(np.stack([one.voltage_v for one in waveforms], axis=1), (14, 1))
    moved_um = model.simulate(np.full(len(played), 1.0 / RATE_HZ), played)[-n:]
    assert moved_um == pytest.approx(scan_um, abs=1e-4)


def test_what_has_no_inverse_is_refused_in_a_line() -> None:
    fewer = AxesModel((_LINE, _LINE), coupling=np.ones((3, 2)))
    with pytest.raises(ParameterError, match=r"model.axes: no inverse, got \(3, 2\)"):
        AxesDynamicInverse(fewer)
    alike = AxesModel((_LINE, _LINE), coupling=np.array([[1.0, 1.0], [1.0, 1.0 + 1e-12]]), delay_s=1e-4)
    with pytest.raises(ParameterError, match="cannot be told apart"):
        AxesDynamicInverse(alike)
    with pytest.raises(ParameterError, match="number of targets does not fit"):
        AxesDynamicInverse(stage(3, 0)).run(_targets(2, 50.0))
    # 1 - 1.2 / (1 + ...) of a slow mode: a zero that grows with 1.6 s, longer than a course goes on beyond its ends
    shape = np.array([[1.0 + 0.0j]])
    slow = AxesModel((_LINE,), AxesModes(np.array([1.0]), np.array([0.9]), -1.2 * shape, shape), np.ones((1, 1)))
    with pytest.raises(ParameterError, match=r"reaches further than the target, got .* % of it beyond 0\.32 s"):
        AxesDynamicInverse(slow).run(_targets(1, 50.0))
    fast = replace(slow, modes=AxesModes(np.array([40.0]), np.array([0.9]), -1.2 * shape, shape))
    wanted = _targets(1, 50.0)
    found = AxesDynamicInverse(fast).run(wanted)[0]
    assert _off(fast, found.voltage_v[:, None], wanted[0].desired_um[:, None]) < 1e-6
