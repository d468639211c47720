"""Everything a model file may name beside elements and creep order, and a diagnosis may find: effects, and the past."""

from __future__ import annotations

from functools import cache

from fomrc_core.effects import effect_classes, why_left_out
from fomrc_core.effects.base.cause import Cause
from fomrc_core.effects.base.effect import Effect, Stage
from fomrc_core.errors import ParameterError
from fomrc_core.model.prehistory import Prehistory

# the past acts through hysteresis and creep: it stands behind the one and before what comes after the other
_LAST_BEFORE_PAST = Stage.HYSTERESIS


@cache
def cause_classes() -> dict[str, type[Cause]]:
    """Return the class of every cause by its name, in the order of the chain."""
    effects = effect_classes()
    before = {name: kind for name, kind in effects.items() if kind.stage <= _LAST_BEFORE_PAST}
    return {**before, Prehistory.name: Prehistory, **effects}


def cause_class(name: object, where: str) -> type[Cause]:
    """Return the class of the cause of this name; raises ParameterError naming those there are."""
    kinds = cause_classes()
    if not isinstance(name, str) or name not in kinds:
        what = "unknown effect" + (f" ({why_left_out()[name]})" if name in why_left_out() else "")
        raise ParameterError(what, where=where, value=name, allowed=", ".join(kinds))
    return kinds[name]


def named_order(effects: tuple[Effect, ...], start: Prehistory | None) -> tuple[Cause, ...]:
    """Return effects, already in the order of the chain, and the past of a model as files name them."""
    if start is None:
        return effects
    n_before = sum(effect.stage <= _LAST_BEFORE_PAST for effect in effects)
    return (*effects[:n_before], start, *effects[n_before:])
