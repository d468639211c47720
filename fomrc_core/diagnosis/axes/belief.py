"""How sure a name of several axes is.

Three things speak for a name: that it takes away most of what the model missed, that it is likelier than the next,
and how often names have been right. The last is the rule of succession (Laplace) on hidden causes of development
seeds, none of which was wrong; so that no name is surer than what has been tried.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

from fomrc_core.diagnosis.axes.findings import AxesFinding

# First names that were right, of those given: seeds 10000 to 10003 of python -m test.hidden.study_axes
_N_RIGHT, _N_NAMED = 35, 35
_MOST_MARGIN = 50.0  # beyond it a likelihood says no more


def axes_probabilities(findings: Sequence[AxesFinding], excess_before: float) -> tuple[AxesFinding, ...]:
    """Return findings with how sure each is.

    Args:
        findings: in order of acceptance.
        excess_before: mean square by which the base model missed held-out samples, the noise's taken off [1].
    """
    often = (_N_RIGHT + 1.0) / (_N_NAMED + 2.0)
    found = []
    for finding in findings:
        taken = 1e-4 * (finding.percent_before**2 - finding.percent_after**2)
        share = min(1.0, taken / excess_before) if excess_before > 0.0 else 0.0
        # of what was left when it was named a second cause may take all, and be sure for it
        likelier = 1.0 / (1.0 + math.exp(-min(max(finding.margin, 0.0), _MOST_MARGIN)))
        found.append(replace(finding, probability=often * max(share, min(1.0, finding.gain)) * likelier))
    return tuple(found)
