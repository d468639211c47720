"""The paper's Table 1 stands in one place; the model file that is shipped says the same."""

from __future__ import annotations

from pathlib import Path

import pytest

from fomrc_core.plants import paper_stage
from fomrc_core.storage import read_model

_CONFIG = Path(__file__).resolve().parents[3] / "config"


@pytest.mark.parametrize("name", ["pi_p753_table1.yaml", "tunable_filter.yaml"])
def test_the_shipped_model_file_is_table_1(name: str) -> None:
    model = read_model(_CONFIG / name)
    assert tuple(model.kappa_um_per_v) == paper_stage.KAPPA_UM_PER_V
    assert tuple(model.saturation_v) == paper_stage.SATURATION_V


def test_the_order_of_the_shipped_model_is_the_papers() -> None:
    assert read_model(_CONFIG / "pi_p753_table1.yaml").creep_order == paper_stage.CREEP_ORDER


def test_table_1_is_of_a_stage_that_moves_about_a_micrometre_per_volt() -> None:
    # the paper: 1.255 V/um at the origin
    assert sum(1.0 / kappa for kappa in paper_stage.KAPPA_UM_PER_V) == pytest.approx(1.255, abs=5e-4)
    assert len(paper_stage.KAPPA_UM_PER_V) == len(paper_stage.SATURATION_V) + 1 == 11
