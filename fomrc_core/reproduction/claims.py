"""Every number of the paper's beside ours, with the bar it has to meet."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from fomrc_core.model.piezo_model import PiezoModel
from fomrc_core.plants import paper_stage
from fomrc_core.records.recording import Recording
from fomrc_core.reproduction import experiments
from fomrc_core.reproduction.identified_models import Identified, StartStudy

PAPER_SOURCE, OUR_SOURCE = "paper: measured stage", "here: simulated plant"
FASTEST_ALONE_V_PER_S = 5.0
EXTENDED_BAR_PERCENT = 0.40


@dataclass(frozen=True)
class Claim:
    """One number of the paper's beside ours.

    Attributes:
        where: table or figure.
        what: what is measured.
        unit: of both values.
        paper: printed in the paper, from its measured stage; nan where it prints none.
        value: ours, from the simulated plant.
        bar: at or below which ours should be; nan where there is none.
    """

    where: str
    what: str
    unit: str
    paper: float
    value: float
    bar: float = math.nan

    @property
    def is_met(self) -> bool | None:
        """Whether the bar is met; None where there is none."""
        return None if math.isnan(self.bar) else self.value <= self.bar


def table1_claims(found: Identified) -> list[Claim]:
    """Return what Table 1 can be compared by: the elements themselves are another plant's."""
    model = found.convex.model
    return [
        Claim("Table 1", "creep order", "1", paper_stage.CREEP_ORDER, model.creep_order),
        Claim(
            "Table 1",
            "slope at the origin, sum of 1/kappa",
            "V/um",
            sum(1.0 / kappa for kappa in paper_stage.KAPPA_UM_PER_V),
            float(np.sum(1 / model.kappa_um_per_v)),
        ),
        Claim(
            "Table 1",
            "slope at the end, 1/kappa_11",
            "V/um",
            1 / paper_stage.KAPPA_UM_PER_V[-1],
            float(1 / model.kappa_um_per_v[-1]),
        ),
        Claim(
            "Table 1",
            "sum of saturation voltages",
            "V",
            sum(paper_stage.SATURATION_V),
            float(np.sum(model.saturation_v)),
        ),
    ]


def start_claims(found: Identified, study: StartStudy) -> list[Claim]:
    """Return the two routes of identification beside each other."""
    best, worst = float(study.paper_rms_um.min()), float(study.paper_rms_um.max())
    return [
        Claim("section 3.2", "paper's route: error on its staircase", "nm", math.nan, 1e3 * found.paper.rms_um),
        Claim("section 3.2", "convex route: error on its staircase", "nm", math.nan, 1e3 * found.convex.rms_um),
        Claim("section 3.2", "paper's route: time", "s", math.nan, found.paper_s),
        Claim("section 3.2", "convex route: time, two passes", "s", math.nan, found.convex_s),
        Claim(
            "section 3.2",
            f"(34) from {study.paper_rms_um.size} random starts: best",
            "nm",
            math.nan,
            1e3 * best,
        ),
        Claim(
            "section 3.2",
            f"(34) from {study.paper_rms_um.size} random starts: worst",
            "nm",
            math.nan,
            1e3 * worst,
        ),
        Claim(
            "section 3.2",
            "convex route, same recording, not worse than the best of (34)",
            "nm",
            math.nan,
            1e3 * study.convex_rms_um,
            1e3 * best,
        ),
    ]


def drift_claims(without: tuple[Recording, Recording], with_routine: tuple[Recording, Recording]) -> list[Claim]:
    """Return what the relaxation routine changes, figures 7 and 8."""

    def drift_nm(recording: Recording) -> float:
        measured = recording.measured_um
        return 1e3 * abs(float(measured[-500:].mean() - measured[:20].mean()))

    plain = drift_nm(without[0])
    away = 1e3 * abs(float(without[1].measured_um[0]))
    return [
        Claim("figure 7", "drift in 60 s at zero input, without the routine", "nm", math.nan, plain),
        Claim("figure 7", "the same with the routine", "nm", math.nan, drift_nm(with_routine[0]), 0.1 * plain),
        Claim("figure 8", "loop begins away from the origin, without", "nm", math.nan, away),
        Claim(
            "figure 8",
            "the same with the routine",
            "nm",
            math.nan,
            1e3 * abs(float(with_routine[1].measured_um[0])),
            0.05 * away,
        ),
    ]


def table2_claims(steps: list[experiments.Run]) -> list[Claim]:
    """Return Table 2, steps of six heights."""
    return [
        Claim(
            "Table 2",
            f"step {run.label:+.1f} V, RMSE / displacement at 60 s",
            "%",
            paper_stage.STEP_NRMSE_PERCENT[run.label],
            run.percent,
            paper_stage.STEP_NRMSE_PERCENT[run.label],
        )
        for run in steps
    ]


def table3_claims(slopes: list[experiments.Run], diagnosed: PiezoModel) -> list[Claim]:
    """Return Table 3, triangles of ten slopes."""
    names = ", ".join(effect.name for effect in diagnosed.effects) or "nothing"
    claims = []
    for run in slopes:
        paper = paper_stage.SLOPE_NRMSE_PERCENT[run.label]
        is_slow = run.label <= FASTEST_ALONE_V_PER_S
        claims.append(
            Claim(
                "Table 3",
                f"{run.label:g} V/s, FOMRC alone",
                "%",
                paper,
                run.percent,
                paper if is_slow else math.nan,
            )
        )
        claims.append(
            Claim(
                "Table 3",
                f"{run.label:g} V/s, with amplifier and resonance",
                "%",
                math.nan,
                run.extended_percent,
                EXTENDED_BAR_PERCENT,
            )
        )
        if not is_slow:
            claims.append(
                Claim(
                    "Table 3",
                    f"{run.label:g} V/s, with what a diagnosis named ({names})",
                    "%",
                    math.nan,
                    run.diagnosed_percent,
                    EXTENDED_BAR_PERCENT,
                )
            )
    return claims


def compensation_claims(
    staircase: experiments.Run, tracking: experiments.Tracking, linearity: experiments.Tracking
) -> list[Claim]:
    """Return figures 14 to 16."""
    tracking_paper, linearity_paper = (
        paper_stage.TRACKING_NRMSE_PERCENT,
        paper_stage.NONLINEARITY_PERCENT,
    )
    return [
        Claim(
            "figure 14",
            "staircase, NRMSE",
            "%",
            paper_stage.STAIRCASE_NRMSE_PERCENT,
            staircase.percent,
            paper_stage.STAIRCASE_NRMSE_PERCENT,
        ),
        Claim(
            "figure 14",
            "largest error 0.1 s after each step",
            "um",
            paper_stage.STAIRCASE_LARGEST_ERROR_UM,
            experiments.settled_error_um(staircase),
            paper_stage.STAIRCASE_LARGEST_ERROR_UM,
        ),
        Claim(
            "figure 15",
            "tracking without compensation, NRMSE",
            "%",
            tracking_paper[0],
            tracking.plain_percent,
        ),
        Claim(
            "figure 15",
            "tracking with compensation (goal 0.10)",
            "%",
            tracking_paper[1],
            tracking.compensated_percent,
            tracking_paper[1],
        ),
        Claim("figure 16", "nonlinearity without compensation", "%", linearity_paper[0], linearity.plain_percent),
        Claim(
            "figure 16",
            "nonlinearity with compensation (goal 0.20)",
            "%",
            linearity_paper[1],
            linearity.compensated_percent,
            linearity_paper[1],
        ),
    ]
