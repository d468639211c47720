"""Effects of other packages, found through their entry points in the group ``fomrc.effects``.

A package names its effect classes in its metadata, ``fomrc.effects`` -> ``name = package.module:Class``, and every part
of this one takes them for its own. What cannot be used is left out with one line in the log that says why.
"""

from __future__ import annotations

import logging
import re
from collections.abc import Collection, Iterable
from dataclasses import dataclass, fields, is_dataclass
from importlib.metadata import EntryPoint, entry_points
from typing import Any

from fomrc_core.effects.base.covariates import Covariate
from fomrc_core.effects.base.effect import Effect, Parameter, Stage

GROUP = "fomrc.effects"
# what a model file or a parameter of a node means by these is something else
_NOT_FREE = frozenset(
    ("kappa_um_per_v", "saturation_v", "creep_order", "effects", "initial_state", "substeps", "fit_rms_um")
)
_NAME = re.compile(r"[a-z][a-z0-9_]*")
_TEXTS = ("meaning", "signature", "experiment", "inverse_note")
_log = logging.getLogger(__name__)


@dataclass(frozen=True)
class ForeignEffects:
    """What other packages offer.

    Attributes:
        kinds: the effect classes that can be used.
        left_out: why each of the others is left out, by the name of its entry point.
    """

    kinds: tuple[type[Effect], ...]
    left_out: dict[str, str]


def foreign_effects(taken: Collection[str]) -> ForeignEffects:
    """Return the effects other packages offer; one that cannot be used is left out, and the log says why.

    Args:
        taken: names of effects there are already.
    """
    kinds: dict[str, type[Effect]] = {}
    left_out: dict[str, str] = {}
    for point in _points():
        try:
            offered = point.load()
            fault = fault_of(offered, point.name, (*taken, *kinds))
        except Exception as error:  # a stranger's module may raise anything: it must not take the rest along
            offered, fault = None, " ".join(f"cannot be loaded, {type(error).__name__}: {error}".split())
        if not fault:
            kinds[point.name] = offered
            continue
        package = point.dist.name if point.dist is not None else "an unknown package"
        left_out[point.name] = f"{point.value} of {package} {fault}"
        _log.warning("effect %s is left out: %s", point.name, left_out[point.name])
    return ForeignEffects(tuple(kinds.values()), left_out)


def _points() -> Iterable[EntryPoint]:
    # sorted, so that of two with one name the same is taken each time; a package found twice on the path counts once
    unique = {(point.name, point.value): point for point in entry_points(group=GROUP)}
    return [unique[key] for key in sorted(unique)]


def fault_of(offered: Any, name: str, taken: Collection[str]) -> str:
    """Return why an object cannot be used as the effect of this name, in words; empty where it can.

    Args:
        offered: what the entry point leads to.
        name: name of the entry point.
        taken: names of effects there are already.
    """
    if not (isinstance(offered, type) and issubclass(offered, Effect)):
        return "is not a subclass of fomrc_core.effects.Effect"
    lacking = [key for key in ("name", "stage", "order", "parameters", "main_parameter") if not hasattr(offered, key)]
    lacking += [key for key in _TEXTS if not isinstance(getattr(offered, key, None), str)]
    lacking += sorted(offered.__abstractmethods__)
    if lacking:
        return f"lacks {', '.join(lacking)}"
    if offered.name != name:
        return f"is called {offered.name!r} in its class; entry point and class must have one name"
    if not _NAME.fullmatch(name) or name in _NOT_FREE:
        return "has a name that cannot stand in a model file; allowed: small letters, digits, underscores"
    if name in taken:
        return "has the name of an effect there is already"
    return _fault_of_statements(offered)


def _fault_of_statements(kind: type[Effect]) -> str:
    """Return what an effect class states of itself that cannot be."""
    if not isinstance(kind.stage, Stage) or not isinstance(kind.order, (int, float)):
        return "states a stage that is no Stage, or an order that is no number"
    if not (kind.covariate is None or isinstance(kind.covariate, Covariate)):
        return "states a covariate that is no Covariate"
    if not (isinstance(kind.parameters, tuple) and all(isinstance(spec, Parameter) for spec in kind.parameters)):
        return "states parameters that are no tuple of Parameter"
    names = {spec.name for spec in kind.parameters}
    own = {field.name for field in fields(kind)} if is_dataclass(kind) else set()
    if names != own:
        return f"has fields {sorted(own)} but states parameters {sorted(names)}; it must be a dataclass of them"
    if kind.main_parameter not in names:
        return f"states a main parameter {kind.main_parameter!r} it has not"
    return ""
