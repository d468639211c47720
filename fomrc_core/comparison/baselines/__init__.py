"""Rival models, each from its own publication; for comparison only."""

from __future__ import annotations

from fomrc_core.comparison.baselines.cascade_rival import CascadeRival, CreepKind
from fomrc_core.comparison.baselines.goldfarb_celanovic import GoldfarbCelanovic
from fomrc_core.comparison.baselines.maxwell_slip import MaxwellSlip
from fomrc_core.comparison.baselines.mrc import MaxwellResistiveCapacitor
from fomrc_core.comparison.baselines.prandtl_ishlinskii import ModifiedPrandtlIshlinskii, PrandtlIshlinskii
from fomrc_core.comparison.baselines.preisach import Preisach
from fomrc_core.comparison.baselines.rival import FittedRival, Rival, TrainingRecord, training_error_um, training_record

_CREEPS: tuple[CreepKind, ...] = ("none", "logarithmic", "linear")


def all_rivals() -> tuple[Rival, ...]:
    """Return every rival the paper names, hysteresis operators with each kind of creep."""
    return (
        *(CascadeRival(Preisach(), creep) for creep in _CREEPS),
        *(CascadeRival(PrandtlIshlinskii(), creep) for creep in _CREEPS),
        *(ModifiedPrandtlIshlinskii(creep_kind=creep) for creep in _CREEPS),
        MaxwellResistiveCapacitor(),
        MaxwellSlip(),
        GoldfarbCelanovic(),
    )


__all__ = [
    "FittedRival",
    "Rival",
    "TrainingRecord",
    "all_rivals",
    "amplified",
    "fomrc",
    "rival",
    "training_error_um",
    "training_record",
]
