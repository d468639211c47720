"""The last look at a search: beside all that was found since, is there a cause that does as well as one found early?

A cause is accepted while others are still hidden, and what those hide of one candidate they need not hide of another.
"""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import Executor
from dataclasses import replace

from fomrc_core.diagnosis.candidate import candidates_for, held_view
from fomrc_core.diagnosis.data_split import DataSplit, held_residuals
from fomrc_core.diagnosis.decision import margin_of, ties_of
from fomrc_core.diagnosis.present_model import PresentModel
from fomrc_core.diagnosis.screening import screen
from fomrc_core.diagnosis.step import Step
from fomrc_core.fitting.joint_fit import Refit, refit
from fomrc_core.model.causes import cause_classes


def looked_at_last(
    steps: Sequence[Step], final: Refit, split: DataSplit, causes: Sequence[str], executor: Executor | None
) -> tuple[Step, ...]:
    """Return the acceptances, each but the last with the causes that do as well in its place at the end.

    Args:
        steps: acceptances that stand, in order.
        final: the last joint refit, with all of them.
        split: records.
        causes: names to try.
        executor: runs refits side by side where given.
    """
    return (*(_looked_at(step, steps, final, split, causes, executor) for step in steps[:-1]), *steps[-1:])


def _looked_at(
    step: Step,
    steps: Sequence[Step],
    final: Refit,
    split: DataSplit,
    causes: Sequence[str],
    executor: Executor | None,
) -> Step:
    name = step.accepted.cause
    if step.accepted.is_bound or not cause_classes()[name].is_exchangeable or not final.model.has(name):
        return step
    found = {other.accepted.cause for other in steps}
    lesser = refit(final.model.without(name), split.train, n_iterations=2, executor=executor).model
    present = PresentModel.of(lesser, split)
    wanted = tuple(cause for cause in causes if cause not in found)
    screened = screen(present, wanted, held_view(lesser, split), executor)
    candidates = candidates_for(present, split, screened, executor)
    own = replace(step.accepted, fitted=final, held=tuple(held_residuals(final.model, split.held)))
    found_again = step.tied_with(ties_of(own, candidates, split))
    return replace(found_again, margin=margin_of(own, candidates, split))
