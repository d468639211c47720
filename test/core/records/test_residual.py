"""The figures of merit: of the measured range, and of the largest displacement."""

from __future__ import annotations

import numpy as np
import pytest

from fomrc_core.errors import RecordingError
from fomrc_core.records.residual import nonlinearity_percent, normalised_percent, nrmse_percent


def test_nonlinearity_of_a_known_loop() -> None:
    desired = np.concatenate([np.linspace(0, 1, 50), np.linspace(1, -1, 100), np.linspace(-1, 0, 50)])
    loop = desired + 0.1 * np.sign(np.gradient(desired))
    assert nonlinearity_percent(desired, 3.0 * desired + 0.7) == pytest.approx(0.0, abs=1e-9)
    # Branches 0.2 apart; the line also tilts a little.
    assert nonlinearity_percent(desired, loop) == pytest.approx(10.0, rel=0.15)


def test_nonlinearity_counts_from_the_relaxed_state_and_not_over_the_range() -> None:
    desired = np.linspace(-1.0, 1.0, 201)
    bent = desired + 0.1 * (np.abs(desired) < 1e-9)
    # a single point 0.1 off the line, of a largest displacement of 1: twice what it is of the range of 2
    assert nonlinearity_percent(desired, bent) == pytest.approx(10.0, rel=0.01)


def test_errors_are_of_the_widest_range_of_a_record_whatever_its_offset() -> None:
    wave = np.linspace(0.0, 2.0, 11)
    assert nrmse_percent(wave, wave + 0.02) == pytest.approx(1.0)
    assert normalised_percent(0.02, [100.0 + wave, 0.5 * wave]) == pytest.approx(1.0)


def test_what_does_not_move_has_no_figure_of_merit() -> None:
    still = np.full(5, 3.0)
    with pytest.raises(RecordingError, match="constant"):
        nrmse_percent(still, still)
    with pytest.raises(RecordingError, match="zero"):
        nonlinearity_percent(np.linspace(0.0, 1.0, 5), np.zeros(5))
