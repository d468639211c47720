"""The physical effects measured data may show beside hysteresis and creep, one file each.

Adding a cause is adding one file: every module of this folder that defines an ``Effect`` subclass is found here.
"""

from __future__ import annotations

import importlib
import pkgutil
from functools import cache

from fomrc_core.effects.base.effect import Effect, Parameter, Place, Stage
from fomrc_core.errors import ParameterError

__all__ = ["Effect", "Parameter", "Place", "Stage", "base", "effect_class", "effect_classes"]


@cache
def effect_classes() -> dict[str, type[Effect]]:
    """Return every effect class by its name, in the order of the chain."""
    found: list[type[Effect]] = []
    for module_info in pkgutil.iter_modules(__path__):
        if module_info.ispkg:
            continue
        module = importlib.import_module(f"{__name__}.{module_info.name}")
        for value in vars(module).values():
            if isinstance(value, type) and issubclass(value, Effect) and value.__module__ == module.__name__:
                found.append(value)
    return {kind.name: kind for kind in sorted(found, key=lambda kind: kind.place)}


def effect_class(name: str, where: str = "effects") -> type[Effect]:
    """Return the effect class of this name; raises ParameterError naming those there are."""
    kinds = effect_classes()
    if not isinstance(name, str) or name not in kinds:
        raise ParameterError("unknown effect", where=where, value=name, allowed=", ".join(kinds))
    return kinds[name]
