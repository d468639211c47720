"""How many of many like cases run: some in ``make test``, all in ``make study``."""

from __future__ import annotations

import os
from collections.abc import Sequence
from typing import TypeVar

_Case = TypeVar("_Case")


def some_of(cases: Sequence[_Case], every: int) -> tuple[_Case, ...]:
    """Return every so manieth case, or all of them where FOMRC_ALL_CASES is set, as ``make study`` does."""
    return tuple(cases) if os.environ.get("FOMRC_ALL_CASES") else tuple(cases[::every])
