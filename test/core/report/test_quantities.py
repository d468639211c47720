"""Numbers as people write them, and errors larger than their value."""

from __future__ import annotations

import math

import pytest

from fomrc_core.report.quantities import length, number, quantity


@pytest.mark.parametrize(
    ("value", "unit", "error", "shown"),
    [
        (41.237, "Hz", 0.12, "41.24 ± 0.12 Hz"),
        (2e-5, "s", None, "20 µs"),
        (3e-4, "um", 1e-5, "300 ± 10 pm"),
        (0.3, "um", None, "300 nm"),
        (-1.5, "um", 0.25, "−1.50 ± 0.25 µm"),
        (1234.0, "Hz", None, "1.234 kHz"),
        (math.pi / 4, "rad", 0.01, "45.00 ± 0.57°"),
        (0.0, "s", None, "0 s"),
        (1.2, "um/degC", None, "1.2 µm/°C"),
        (2.3e-7, "1/V^2", 1.2e-8, "(2.30 ± 0.12)·10⁻⁷ 1/V²"),
        (50.0, "Hz", 2e-6, "50.0000000 ± 0.0000020 Hz"),
        (2.3e-7, "1/V^2", 1.2e-13, "(2.3000000 ± 0.0000012)·10⁻⁷ 1/V²"),
        (0.015, "1", 0.002, "0.0150 ± 0.0020"),
        (5.0, "1", float("inf"), "5"),
        (2.0, "um", 3.0, "undetermined (2.0 ± 3.0 µm)"),
        (0.0, "um", 1e-3, "undetermined (0.0 ± 1.0 nm)"),
    ],
)
def test_a_quantity_reads_well(value: float, unit: str, error: float | None, shown: str) -> None:
    assert quantity(value, unit, error) == shown


def test_numbers_and_lengths() -> None:
    assert number(3e-9, 2) == "3·10⁻⁹"
    assert number(float("nan")) == "none"
    assert (length(0.002), length(1.5), length(float("nan"))) == ("2 nm", "1.5 µm", "none")
