"""The paper, table by table and figure by figure, against a plant that is not the fitted model.

Every number of the paper's was measured on its stage (PI P-753.1CD, E-625) and is quoted from its text.
Every number of ours comes from the simulated rig. The two columns stand beside each other; they are not the
same actuator.
"""

from __future__ import annotations

import json
import math
import time
from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path

from matplotlib.figure import Figure

from fomrc_core.compute.pulse import beat
from fomrc_core.plants import paper_stage
from fomrc_core.plants.simulated_rig import SimulatedRig
from fomrc_core.reproduction import experiments, figures
from fomrc_core.reproduction.claims import (
    compensation_claims,
    drift_claims,
    start_claims,
    table1_claims,
    table2_claims,
    table3_claims,
)
from fomrc_core.reproduction.identified_models import Identified, StartStudy, identification_runs, start_study
from fomrc_core.reproduction.page import page
from fomrc_core.reproduction.result import Reproduction
from fomrc_core.storage import make_directory


def reproduce(
    output_directory: str | Path,
    progress: Callable[[float, str], None] | None = None,
    *,
    n_starts: int = 20,
) -> Reproduction:
    """Run the paper's experiments and write tables, figures (PNG, SVG), JSON and one HTML page.

    Args:
        output_directory: made where it does not exist.
        progress: called with the share done and what is being done.
        n_starts: random starts of the study of (34).
    """
    directory = make_directory(Path(output_directory))
    begun = time.perf_counter()
    tell = progress or (lambda share, text: None)

    def within(low: float, high: float) -> Callable[[float, str], None]:
        return lambda share, text: tell(low + share * (high - low), text)

    tell(0.0, "recording what section 3 records")
    rig = SimulatedRig()
    found = identification_runs(rig, within(0.0, 0.4))
    tell(0.4, "steps")
    steps = experiments.step_runs(rig, found.convex.model)
    tell(0.45, "triangles of ten slopes")
    slopes = experiments.slope_runs(rig, found.convex.model, found.fast_model, found.diagnosed_model)
    tell(0.5, "staircase")
    staircase = experiments.staircase_run(rig, found.convex.model)
    tell(0.51, "tracking")
    tracking = experiments.tracking_run(rig, found.both_model)
    tell(0.52, "linearity")
    linearity = experiments.linearity_run(rig, found.both_model)
    tell(0.53, "relaxation routine and loops")
    without, with_routine = experiments.relaxation_runs(rig)
    loops = experiments.loop_runs(rig, found.convex.model)
    study = start_study(rig, within(0.55, 0.85), n_starts)
    tell(0.85, "figures")
    drawn = {
        "figure06_normalised_steps": figures.figure6(steps),
        "figure07_relaxation_drift": figures.figure7(without[0], with_routine[0]),
        "figure08_relaxation_loops": figures.figure8(without[1], with_routine[1]),
        "figure09_identification_data": figures.figure9(found),
        "identification_starts": figures.start_figure(study),
        "figure11_steps": figures.figure11(steps),
        "figure12_loop_shapes": figures.figure12(loops),
        "figure13_errors": figures.figure13(slopes),
        "table3_slopes": figures.slope_figure(slopes, paper_stage.SLOPE_NRMSE_PERCENT),
        "figure14_staircase": figures.figure14(staircase),
        "figure15_tracking": figures.figure15(tracking),
        "figure16_linearity": figures.figure16(linearity),
    }
    claims = (
        *table1_claims(found),
        *start_claims(found, study),
        *drift_claims(without, with_routine),
        *table2_claims(steps),
        *table3_claims(slopes, found.diagnosed_model),
        *compensation_claims(staircase, tracking, linearity),
    )
    _save(drawn, directory)
    reproduction = Reproduction(claims, tuple(drawn), time.perf_counter() - begun)
    (directory / "reproduction.json").write_text(_json(reproduction, found, study), encoding="utf-8")
    (directory / "reproduction.md").write_text(reproduction.table() + "\n", encoding="utf-8")
    (directory / "reproduction.html").write_text(page(reproduction, directory), encoding="utf-8")
    tell(1.0, "done")
    return reproduction


def _save(drawn: dict[str, Figure], directory: Path) -> None:
    for name, figure in drawn.items():
        for kind in ("png", "svg"):
            figure.savefig(directory / f"{name}.{kind}", dpi=130)
            beat("pictures")


def _json(reproduction: Reproduction, found: Identified, study: StartStudy) -> str:
    claims = [
        {
            key: (None if isinstance(value, float) and not math.isfinite(value) else value)
            for key, value in {
                **asdict(claim),
                "is_met": claim.is_met,
                "paper_source": "measured",
                "value_source": "simulated plant",
            }.items()
        }
        for claim in reproduction.claims
    ]
    content = {
        "duration_s": reproduction.duration_s,
        "claims": claims,
        "model_convex": found.convex.model.to_mapping(),
        "model_both_recordings": found.both_model.to_mapping(),
        "model_with_fast_effects": found.fast_model.to_mapping(),
        "model_diagnosed": found.diagnosed_model.to_mapping(),
        "model_paper_route": found.paper.model.to_mapping(),
        "random_starts": {
            "start_rms_um": study.start_rms_um.tolist(),
            "paper_rms_um": study.paper_rms_um.tolist(),
            "paper_s": study.paper_s.tolist(),
            "convex_rms_um": study.convex_rms_um,
            "convex_s": study.convex_s,
        },
    }
    return json.dumps(content, indent=2, allow_nan=False) + "\n"
