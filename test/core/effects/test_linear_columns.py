"""What many inputs at once give is what each gives alone."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fomrc_core.effects import Effect, effect_classes

EFFECTS: list[tuple[str, dict[str, float]]] = [
    ("slow_relaxation", {"amplitude": 0.1, "time_constant_s": 0.03}),
    ("creep_law", {"per_decade": 0.02, "onset_s": 0.002, "first_share": 0.1, "first_s": 0.05}),
    ("sensor_bandwidth", {"cutoff_hz": 60.0}),
    ("sensor_bandwidth", {"cutoff_hz": 60.0, "n_poles": 3.0}),
    ("sensor_bandwidth", {"cutoff_hz": 60.0, "n_poles": 4.0, "in_stages": 1.0}),
    ("mechanical_resonance", {"frequency_hz": 90.0, "damping_ratio": 0.02}),
    ("mechanical_resonance", {"frequency_hz": 90.0, "damping_ratio": 0.999}),
    ("second_mode", {"frequency_hz": 70.0, "damping_ratio": 0.05, "participation": 0.1, "rate_share": 0.01}),
    ("transport_delay", {"delay_s": 0.0}),
    ("transport_delay", {"delay_s": 1e-20}),
    ("transport_delay", {"delay_s": 0.0003}),
    ("transport_delay", {"delay_s": 0.0213}),
    ("transport_delay", {"delay_s": 1.0}),
    ("clock_skew", {"ppm": 300.0}),
    ("clock_skew", {"ppm": -40000.0}),
]


def _effect(name: str, parameters: dict[str, float]) -> Effect:
    return effect_classes()[name].from_mapping(parameters, where=name)


@pytest.mark.parametrize(("name", "parameters"), EFFECTS, ids=lambda value: value if isinstance(value, str) else "")
@given(steps=st.lists(st.sampled_from([1e-3, 2e-3, 0.7e-3]), min_size=2, max_size=60), seed=st.integers(0, 1000))
def test_columns_pass_side_by_side_as_each_alone(
    name: str, parameters: dict[str, float], steps: list[float], seed: int
) -> None:
    effect, steps_s = _effect(name, parameters), np.array(steps)
    columns = np.random.default_rng(seed).standard_normal((steps_s.size, 3))
    found = effect.linearized(columns, steps_s)
    for column, own in zip(found.T, columns.T, strict=True):
        alone = effect.run(effect.initial_state(), np.ascontiguousarray(own), steps_s)
        np.testing.assert_allclose(column, alone, rtol=1e-9, atol=1e-11)


def test_a_drive_that_rings_leaves_changes_of_the_displacement_as_they_are() -> None:
    effect = _effect("drive_resonance", {"frequency_hz": 90.0, "damping_ratio": 0.02})
    columns = np.random.default_rng(1).standard_normal((50, 2))
    assert effect.linearized(columns, np.full(50, 1e-3)) is columns
