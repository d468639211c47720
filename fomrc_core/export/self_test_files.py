"""The self-test of an exported model: a C program and the golden data it compares with."""

from __future__ import annotations

import re

from fomrc_core.export.c_files import banner, conditions
from fomrc_core.export.c_numbers import c_table
from fomrc_core.export.golden import GoldenData
from fomrc_core.export.options import Precision
from fomrc_core.export.plan import ExportPlan
from fomrc_core.export.template import read_template, render


def golden_header(plan: ExportPlan, golden: dict[str, GoldenData]) -> str:
    """Return the header that holds the golden data, by direction."""
    options = plan.options
    guard = f"{options.name.upper()}_GOLDEN_H"
    lines = [banner(plan), f"#ifndef {guard}", f"#define {guard}", "", f'#include "{options.name}.h"']
    real = f"{options.name}_real"
    for direction, data in golden.items():
        upper = direction.upper()
        lines += [
            "",
            f"#define {upper}_N_GOLDEN {data.inputs.size}",
            f"#define {upper}_N_FIXED {data.n_fixed}",
            c_table(real, f"{upper}_STEP_S", f"{upper}_N_GOLDEN", data.steps_s.tolist(), options.precision),
            c_table(real, f"{upper}_INPUT", f"{upper}_N_GOLDEN", data.inputs.tolist(), options.precision),
            *(
                c_table(real, f"{upper}_{covariate.upper()}", f"{upper}_N_GOLDEN", signal.tolist(), options.precision)
                for covariate, signal in data.covariates.items()
            ),
            c_table("double", f"{upper}_OUTPUT", f"{upper}_N_GOLDEN", data.outputs.tolist(), Precision.DOUBLE),
        ]
    return "\n".join([*lines, "#endif"]) + "\n"


def self_test_source(plan: ExportPlan) -> str:
    """Return the program that runs the golden data, and random steps as many as it is told."""
    name, holds = plan.options.name, conditions(plan)
    blocks = {"banner": banner(plan)}
    for direction in ("forward", "inverse"):
        covariates = sorted({part.covariate for part in plan.parts_of(direction == "inverse") if part.covariate})
        settings = [f"        {name}_DIRECTION_set_{c}(state, DIRECTION_{c.upper()}[k]);" for c in covariates]
        block = {"set_covariates": "\n".join(settings)}
        may_be_nan = ("can_fail" if direction == "inverse" else "forward_can_fail") in holds
        own = holds | ({"may_be_nan"} if may_be_nan else set())
        text = render(read_template("self_test_direction.c"), name, own, block)
        text = re.sub(r"DIRECTION_UPPER|DIRECTION(?=_[A-Z])", direction.upper(), text)
        blocks[f"{direction}_test"] = text.replace("DIRECTION", direction)
    return render(read_template("self_test.c"), name, holds, blocks)
