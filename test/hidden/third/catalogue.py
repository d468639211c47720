"""All effects by name, and which of them can act together."""

from __future__ import annotations

from test.hidden.third.causes_of_drive import CAUSES_OF_DRIVE
from test.hidden.third.causes_of_material import CAUSES_OF_MATERIAL, MISSING
from test.hidden.third.causes_of_reading import CAUSES_OF_READING
from test.hidden.third.causes_of_stage import CAUSES_OF_STAGE
from test.hidden.third.effect import REPLACED, Effect
from test.hidden.third.unlisted_effects import UNLISTED

_LISTED = (*CAUSES_OF_DRIVE, *CAUSES_OF_MATERIAL, *CAUSES_OF_STAGE, *CAUSES_OF_READING)
EFFECTS: dict[str, Effect] = {effect.name: effect for effect in (*_LISTED, *UNLISTED)}
KNOWN_NAMES = tuple(effect.name for effect in _LISTED)
UNLISTED_NAMES = tuple(effect.name for effect in UNLISTED)


def can_act_together(first: str, second: str) -> bool:
    """Return whether two causes can be hidden at once.

    A lack of a model's elements is no effect among effects; two that replace one part of the chain exclude each other.
    """
    if first == second or MISSING in (first, second):
        return False
    return not EFFECTS[first].acts.keys() & EFFECTS[second].acts.keys() & REPLACED
