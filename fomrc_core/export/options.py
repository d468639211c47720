"""What is to be exported, and how."""

from __future__ import annotations

import keyword
import re
from dataclasses import dataclass, field
from enum import Enum
from typing import TypeVar

from fomrc_core.control.voltage_limits import VoltageLimits
from fomrc_core.errors import ParameterError

SHORTEST_STEP_S, LONGEST_STEP_S = 1e-9, 1e6
LARGEST_INPUT = 1e6


class Language(str, Enum):
    """Language of the files."""

    C = "c"
    PYTHON = "python"


class Precision(str, Enum):
    """Precision of the numbers of exported C."""

    DOUBLE = "double"
    FLOAT = "float"


class Direction(str, Enum):
    """Which way the model is exported."""

    FORWARD = "forward"
    INVERSE = "inverse"
    BOTH = "both"


Choice = TypeVar("Choice", Language, Precision, Direction)


def choice(kind: type[Choice], text: str, where: str) -> Choice:
    """Return the member of a kind that a text names; raises ParameterError naming those there are."""
    allowed = [member.value for member in kind]
    if text not in allowed:
        raise ParameterError(f"unknown {kind.__name__.lower()}", where=where, value=text, allowed=", ".join(allowed))
    return kind(text)


# The defaults of the compensator node.
_NODE_LIMITS = VoltageLimits(minimum_v=-2.5, maximum_v=2.5, slew_v_per_s=500.0, safe_v=0.0, safe_ramp_v_per_s=10.0)
_IDENTIFIER = re.compile(r"[a-z][a-z0-9_]{0,39}")
_N_ELEMENTS_MAX = 60
# What Python would take for something else; every name in the C files has something behind it but the file's own.
_RESERVED = frozenset(keyword.kwlist) | {"self_test", "readme", "cmakelists"}


@dataclass(frozen=True)
class ExportOptions:
    """How a model is exported.

    Args:
        name: name of the files, and what every name in them begins with: a letter, then letters, digits and _.
        language: C or one Python file.
        precision: of exported C.
        direction: forward, inverse or both.
        sample_period_s: step of ``step_fixed`` [s].
        n_elements: join elements until so many are left; None keeps all.
        is_dropping: leave out effects that cannot be exported, and say so at the top of the file.
        limits: voltage limits written into the files.

    Raises:
        ParameterError: a name that is no identifier, a period or a number of elements out of range.
    """

    name: str
    language: Language = Language.C
    precision: Precision = Precision.DOUBLE
    direction: Direction = Direction.BOTH
    sample_period_s: float = 1e-4
    n_elements: int | None = None
    is_dropping: bool = False
    limits: VoltageLimits = field(default_factory=lambda: _NODE_LIMITS)

    def __post_init__(self) -> None:
        if not _IDENTIFIER.fullmatch(self.name) or self.name in _RESERVED:
            raise ParameterError(
                "not a name for files and functions",
                where="name",
                value=self.name,
                allowed="a lower-case letter, then up to 39 of a-z, 0-9 and _, no word of the language",
            )
        if not SHORTEST_STEP_S <= self.sample_period_s <= LONGEST_STEP_S:
            raise ParameterError(
                "sample period out of range",
                where="sample_period_s",
                value=self.sample_period_s,
                allowed=f"{SHORTEST_STEP_S:g} to {LONGEST_STEP_S:g} s",
            )
        if self.n_elements is not None and not 1 <= self.n_elements <= _N_ELEMENTS_MAX:
            raise ParameterError(
                "number of elements out of range",
                where="n_elements",
                value=self.n_elements,
                allowed=f"1 to {_N_ELEMENTS_MAX}",
            )

    @property
    def is_forward(self) -> bool:
        """Whether the way from voltage to displacement is asked for."""
        return self.direction is not Direction.INVERSE

    @property
    def is_inverse(self) -> bool:
        """Whether the way from displacement to voltage is asked for."""
        return self.direction is not Direction.FORWARD


def name_from(text: str) -> str:
    """Return a name for files and functions made of any text, such as the name of a model file."""
    name = re.sub(r"[^a-z0-9]+", "_", text.lower()).strip("_")[:40].rstrip("_")
    if not name[:1].isalpha() or name in _RESERVED:
        name = f"model_{name}"[:40].rstrip("_")
    return name
