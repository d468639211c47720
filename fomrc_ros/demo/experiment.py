"""An experiment of the demo: the target, how the stage answered, and whether that is as good as the paper's."""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import dataclass

from fomrc_core.plants import paper_stage
from fomrc_ros.demo.response import STALL_S, Response, Verdict
from fomrc_ros.demo.targets import Target


@dataclass(frozen=True)
class Merit:
    """A figure of merit, and what the paper prints of it without and with compensation [%]."""

    name: str
    percent_of: Callable[[Response], float]
    paper_percent: tuple[float, float]


@dataclass(frozen=True, eq=False)
class Experiment:
    """A target driven through the topics.

    Attributes:
        target: what was wanted.
        merit: what it is judged by.
        pair: how the stage answered with and without compensation.
    """

    target: Target
    merit: Merit
    pair: tuple[Response, Response]

    @property
    def verdict(self) -> Verdict:
        """Whether compensation reached what the paper prints."""
        compensated = self.pair[0]
        return compensated.verdict(self.merit.percent_of(compensated), self.merit.paper_percent[1])

    def machine_text(self) -> str:
        """Return how busy the machine was, and what that left to judge."""
        compensated = self.pair[0]
        load, n_processors = os.getloadavg()[0], os.cpu_count() or 1
        text = f"{self.target.name}: machine load {load:.1f} on {n_processors} processors"
        limit_ms = 1e3 * STALL_S
        if not compensated.stalled_s:
            return f"{text}; no process waited for more than {limit_ms:.0f} ms"
        return (
            f"{text}; for {compensated.stalled_s:.1f} of {compensated.duration_s:.0f} s some process waited for more "
            f"than {limit_ms:.0f} ms, at most {1e3 * compensated.longest_stall_s:.0f} ms: judged on the other "
            f"{100.0 * compensated.judged_share:.0f} % of the samples that arrived"
        )


TRACKING_MERIT = Merit("NRMSE", lambda response: response.nrmse_percent, paper_stage.TRACKING_NRMSE_PERCENT)
LINEARITY_MERIT = Merit(
    "non-linearity, of the largest displacement",
    lambda response: response.nonlinearity_percent,
    paper_stage.NONLINEARITY_PERCENT,
)
