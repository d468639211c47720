"""What a reproduction of the paper says: its claims beside the figures of this project, as a table."""

from __future__ import annotations

import math
from dataclasses import dataclass

from fomrc_core.reproduction.claims import OUR_SOURCE, PAPER_SOURCE, Claim


@dataclass(frozen=True)
class Reproduction:
    """Everything reproduced.

    Attributes:
        claims: numbers, in the order of the paper.
        figure_names: file names without ending, in the order of the paper.
        duration_s: how long it took [s].
    """

    claims: tuple[Claim, ...]
    figure_names: tuple[str, ...]
    duration_s: float

    def __str__(self) -> str:
        return self.table()

    def table(self) -> str:
        """Return the claims as a Markdown table."""
        lines = [
            f"| where | what | {PAPER_SOURCE} | {OUR_SOURCE} | bar | met |",
            "|---|---|---:|---:|---:|---|",
        ]
        for claim in self.claims:
            met = {None: "", True: "yes", False: "NO"}[claim.is_met]
            lines.append(
                f"| {claim.where} | {claim.what} [{claim.unit}] | {_number(claim.paper)} "
                f"| {_number(claim.value)} | {_number(claim.bar)} | {met} |"
            )
        return "\n".join(lines)


def _number(value: float) -> str:
    return "" if math.isnan(value) else f"{value:.3g}"
