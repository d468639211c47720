"""How often hidden causes of three axes are named: ``python -m test.hidden.study_axes [--seeds development]``.

Per seed a healthy stage is recorded and identified; each cause is then hidden in it, recorded anew, and diagnosed
against that model. The mode that is missing is in the stage all along, and its model was told too few modes.
Prints a row for each case and the shares named first; ``--output`` keeps them as CSV.
"""

from __future__ import annotations

import argparse
import time
from pathlib import Path

from fomrc_core.diagnosis.axes import AxesDiagnosis, AxesRecord, diagnose_axes
from fomrc_core.identification.axes import AxesIdentification, AxesOptions, identify_axes, periodic_record
from test.hidden.axes_causes import CAUSES, LEVELS_V, N_AXES, NAMES, RATE_HZ, TwoMassStage, healthy, hide, record

FIRST_SEED = {"development": 10_000, "reporting": 20_000}
_N_REALISATIONS = 2  # of each level, to identify from; one to diagnose


def identified(stage: TwoMassStage, seed: int) -> AxesIdentification:
    """Return a stage's model, from records of its own."""
    found = [record(stage, v, 1000 * seed + 10 * k + r) for k, v in enumerate(LEVELS_V) for r in range(_N_REALISATIONS)]
    records = tuple(periodic_record(u, y, RATE_HZ, name=f"r{k}") for k, (u, y) in enumerate(found))
    return identify_axes(records, AxesOptions(n_modes=2 * N_AXES, n_poles=9, n_joints=0))


def diagnosed(stage: TwoMassStage, base: AxesIdentification, seed: int) -> AxesDiagnosis:
    """Return the diagnosis of new records of a stage against a model."""
    found = [record(stage, v, 1000 * seed + 500 + k) for k, v in enumerate(LEVELS_V)]
    records = [AxesRecord.of(f"{v} V", RATE_HZ, u, y) for v, (u, y) in zip(LEVELS_V, found, strict=True)]
    return diagnose_axes(records, base.model, model_error=base.worst_error)


def is_right(diagnosis: AxesDiagnosis, cause: str) -> bool:
    """Return whether the first name is the hidden one, in its form; of nothing, whether nothing was named at all."""
    wanted = NAMES[cause]
    if wanted is None:
        return not diagnosis.findings and not any(axis.causes for axis in diagnosis.axes)
    if not diagnosis.findings:
        return False
    first = diagnosis.findings[0]
    return first.cause == wanted[0] and wanted[1] in (None, first.kind)


def main() -> None:
    """Run the cases and print what came of them."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", choices=list(FIRST_SEED), default="reporting")
    parser.add_argument("--first", type=int, help="first seed, where not that of the range")
    parser.add_argument("--n", type=int, default=5, help="seeds for each cause")
    parser.add_argument("--cause", nargs="+", choices=CAUSES, default=list(CAUSES))
    parser.add_argument("--output", type=Path, help="CSV of the cases")
    options = parser.parse_args()
    lines = ["seed,hidden,is_right,n_named,n_of_axes,status,probability,before,after,floor,cpu_s"]
    right: dict[str, list[bool]] = {cause: [] for cause in options.cause}
    print("| seed | hidden | named | probability | status | before | after | floor |\n" + "|---" * 8 + "|")
    first = FIRST_SEED[options.seeds] if options.first is None else options.first
    for seed in range(first, first + options.n):
        stage = healthy(seed)
        base = identified(stage, seed)
        for cause in options.cause:
            began = time.process_time()
            hidden = hide(stage, cause, seed)
            model = identified(hidden, seed) if cause == "missing_mode" else base
            found = diagnosed(hidden, model, seed)
            cpu_s = time.process_time() - began
            right[cause].append(is_right(found, cause))
            names = [" ".join(filter(None, (f.cause, f.kind))) for f in found.findings]
            names += [f"{name} (axis {axis.axis} by itself)" for axis in found.axes for name in axis.causes]
            sure = f"{found.findings[0].probability:.3f}" if found.findings else ""
            sizes = (found.percent_before, found.percent_after, found.percent_floor)
            shown = " | ".join(f"{size:.3g} %" for size in sizes)
            print(f"| {seed} | {cause} | {', '.join(names)} | {sure} | {found.status.value} | {shown} |", flush=True)
            n_of_axes = sum(len(axis.causes) for axis in found.axes)
            counts = f"{right[cause][-1]:d},{len(found.findings)},{n_of_axes}"
            told = ",".join(f"{size:.4g}" for size in sizes)
            lines.append(f"{seed},{cause},{counts},{found.status.value},{sure},{told},{cpu_s:.1f}")
    print("\n| hidden | named first, in its form |\n|---|---|")
    for cause, each in right.items():
        print(f"| {cause} | {sum(each)} of {len(each)} |")
    if options.output:
        options.output.write_text("\n".join(lines) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
