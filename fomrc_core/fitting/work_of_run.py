"""How much work a simulation is, counted in what takes a processor of 2020 about a nanosecond.

Of 126 000 runs in six searches of the second world 1e9 took 0.9 to 1.5 s, and 2.1 s in one of a creep that depends on
the amplitude, each of whose elements creeps by itself. The work is counted and not timed: answers are the same on every
machine.
"""

from __future__ import annotations

from collections.abc import Sequence

from fomrc_core.effects.base.effect import Effect, Stage

_OF_EFFECT = 8  # a part of a step, of an effect that is run
_AT_ONCE = 4  # plays or modes that are done in one operation
_OF_PART = 8  # what follows the plays and modes of one
_OF_SAMPLE = 6  # what is read of the parts
_OF_RUN = 80_000  # beside: of a short record, or of its sensor alone, that is most
_OF_EACH = 20_000  # beside, of an effect
_OF_START = 300_000  # of what went before a record
_OF_COLUMN = 2  # operations in which two modes of a column are done


def operations_of_run(
    effects: Sequence[Effect], since: Stage, n_samples: int, n_parts: int, n_in_elements: int, *, is_begun: bool
) -> int:
    """Return the operations of one run of a chain over a record [1].

    Args:
        effects: of the chain.
        since: stage from which it was run, the stages before taken from another run.
        n_samples: of the record.
        n_parts: its steps are divided into.
        n_in_elements: plays and modes of the elements.
        is_begun: whether what went before the record was run.
    """
    # Many arguments: what a run was.
    beside = _OF_RUN + _OF_EACH * len(effects) + _OF_START * is_begun + _OF_SAMPLE * n_samples
    n_run = sum(effect.stage >= since for effect in effects)
    of_elements = (_OF_PART + n_in_elements // _AT_ONCE) if since <= Stage.HYSTERESIS else 0
    return beside + n_parts * of_elements + _OF_EFFECT * n_run * (n_parts if since <= Stage.MECHANICAL else n_samples)


def operations_of_columns(n_values: int, n_modes: int, n_effects: int) -> int:
    """Return the operations of the columns of a record's linear part [1].

    Args:
        n_values: samples times columns.
        n_modes: of creep.
        n_effects: of the chain.
    """
    return n_values * (n_modes + _OF_EFFECT * n_effects) // _OF_COLUMN
