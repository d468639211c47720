"""One sine and nothing held out: many causes fit one loop, and none may be blamed for sure that was not hidden."""

from __future__ import annotations

import pytest

from fomrc_core.diagnosis.diagnosis import diagnose
from test.hidden.all_cases import some_of
from test.hidden.truth import draw_case


@pytest.mark.parametrize("seed", some_of((9100, 9105), 2))
def test_a_lag_under_one_sine_is_left_open_beside_what_fits_alike(seed: int) -> None:
    case = draw_case(seed, ("amplifier_bandwidth",), excitation="single_sine")
    found = diagnose(case.recordings)
    open_names = {finding.cause for finding in found.findings} | set(found.ambiguous_with)
    assert not open_names or "amplifier_bandwidth" in open_names or found.status.value != "explained"
