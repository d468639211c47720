"""What a diagnosis was asked, beside the records."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace

from fomrc_core.errors import ParameterError
from fomrc_core.model.causes import cause_classes
from fomrc_core.model.piezo_model import PiezoModel


@dataclass(frozen=True, eq=False)
class Asked:
    """Causes not to try, a base model whose structure is questioned, what works side by side, and how long to ask."""

    excluded_causes: tuple[str, ...]
    model: PiezoModel | None
    executor: ThreadPoolExecutor | None
    is_thorough: bool = False

    def check(self) -> None:
        """Raise ParameterError for a cause that there is not."""
        for name in self.excluded_causes:
            if name not in cause_classes():
                raise ParameterError(
                    "unknown cause", where="excluded_causes", value=name, allowed=", ".join(cause_classes())
                )

    def without(self, names: Sequence[str]) -> Asked:
        """Return the same with more causes not to try."""
        return replace(self, excluded_causes=(*self.excluded_causes, *names))
