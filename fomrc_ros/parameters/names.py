"""Which parameter names any node of the package has: one file may serve several nodes, a misspelt name none."""

from __future__ import annotations

import functools

from fomrc_ros.node.model_parameters import effect_spec, parameters_of_effects
from fomrc_ros.node.parameters import FurtherNames
from fomrc_ros.parameters.compensator import compensator_specs
from fomrc_ros.parameters.gap import AXES_MODEL_SPEC, AXES_SPEC, GEOMETRY_SPEC, RATE_SPEC, STALE_SPEC
from fomrc_ros.parameters.identification import identification_specs
from fomrc_ros.parameters.simulated_stage import SPECS as STAGE_SPECS
from fomrc_ros.parameters.watch import watch_specs


@functools.cache
def names_of_package() -> frozenset[str]:
    """Return the names of all parameters of all nodes, those of effects aside."""
    specs = (
        *compensator_specs(),
        *identification_specs(),
        *STAGE_SPECS,
        *watch_specs(),
        GEOMETRY_SPEC,
        AXES_SPEC,
        AXES_MODEL_SPEC,
        RATE_SPEC,
        STALE_SPEC,
    )
    return frozenset(spec.name for spec in specs)


def is_name_of_package(name: str) -> bool:
    """Tell whether some node of the package has a parameter of this name."""
    return name in names_of_package() or effect_spec(name) is not None


# For nodes with a model, which may bring effects, and for those without.
WITH_EFFECTS = FurtherNames(effect_spec, parameters_of_effects, is_name_of_package)
WITHOUT_EFFECTS = FurtherNames(is_elsewhere=is_name_of_package)
