"""Where an exported model starts that does not start relaxed: the exported steps, run through what went before."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from fomrc_core.export.options import Direction
from fomrc_core.export.parts import PartsOfSteps
from fomrc_core.export.plan import ExportPlan
from fomrc_core.export.python_file import python_file
from fomrc_core.model.simulation import before_record


def with_start(plan: ExportPlan) -> ExportPlan:
    """Return the plan with the forward direction starting where the model does; unchanged where that is relaxed."""
    start = plan.model.start
    if start is None or not plan.options.is_forward:
        return plan
    # As PiezoModel.settle: what starts with the record is left out.
    effects = before_record(plan.model.effects)
    lasting = {effect.name for effect in effects}
    past = replace(
        plan,
        options=replace(plan.options, direction=Direction.FORWARD),
        parts=tuple(part for part in plan.parts if part.name in lasting),
        steps=PartsOfSteps.of(effects, plan.model.substeps),
    )
    names: dict[str, Any] = {"__name__": "past"}
    exec(compile(python_file(past, {}), "past", "exec"), names)
    actuator = names["Forward"]()
    steps_s, voltage_v = start.drive()
    for step_s, value_v in zip(steps_s.tolist(), voltage_v.tolist(), strict=True):
        actuator.step(value_v, step_s)
    values: dict[tuple[str, str], tuple[float, ...]] = {}
    for owner, field in past.state_fields(is_inverse=False):
        value = getattr(getattr(actuator, owner) if owner else actuator, field.name)
        values[owner, field.name] = tuple(float(v) for v in value) if field.is_array else (float(value),)
    return replace(plan, forward_start=values)
