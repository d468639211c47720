"""The physical effects measured data may show beside hysteresis and creep, one file each.

Adding a cause is adding one file: every module of this folder that defines an ``Effect`` subclass is found here, and
so is every effect another package offers through its entry points (base/discovery.py).
"""

from __future__ import annotations

import importlib
import pkgutil
from functools import cache

from fomrc_core.effects.base.covariates import Covariate, Covariates
from fomrc_core.effects.base.discovery import ForeignEffects, foreign_effects
from fomrc_core.effects.base.effect import Effect, Parameter, Stage, in_chain_order

__all__ = [
    "Covariate",
    "Covariates",
    "Effect",
    "Parameter",
    "Stage",
    "base",
    "effect_classes",
    "in_chain_order",
    "is_foreign",
    "why_left_out",
]


@cache
def effect_classes() -> dict[str, type[Effect]]:
    """Return every effect class by its name, in the order of the chain."""
    found = [*_own().values(), *_foreign().kinds]
    return {kind.name: kind for kind in sorted(found, key=lambda kind: (kind.stage, kind.order, kind.name))}


def is_foreign(name: str) -> bool:
    """Return whether the effect of this name comes from another package."""
    return any(kind.name == name for kind in _foreign().kinds)


def why_left_out() -> dict[str, str]:
    """Return why effects of other packages cannot be used, by name; empty where all can."""
    return dict(_foreign().left_out)


@cache
def _own() -> dict[str, type[Effect]]:
    found: dict[str, type[Effect]] = {}
    for module_info in pkgutil.iter_modules(__path__):
        if module_info.ispkg:
            continue
        module = importlib.import_module(f"{__name__}.{module_info.name}")
        for value in vars(module).values():
            if isinstance(value, type) and issubclass(value, Effect) and value.__module__ == module.__name__:
                found[value.name] = value
    return found


@cache
def _foreign() -> ForeignEffects:
    return foreign_effects(_own())
