"""Runs of a mask are where it holds, each once, and nowhere else."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from fomrc_core.compute.runs import runs_of


@given(st.lists(st.booleans(), max_size=40))
def test_runs_are_where_the_mask_holds_and_none_touches_the_next(mask: list[bool]) -> None:
    runs = runs_of(mask)
    again = np.zeros(len(mask), dtype=np.bool_)
    for start, stop in runs:
        again[start:stop] = True
    assert again.tolist() == mask
    assert np.all(runs[:, 0] < runs[:, 1])
    assert np.all(runs[1:, 0] > runs[:-1, 1])
