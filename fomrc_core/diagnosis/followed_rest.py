"""Whether terms without a name follow most of what the causes leave: then it is no noise, whatever else says so.

Slow noise that no repeat shows is told from what is left itself: what does not follow the drive. The tests of that are
asked of what is left as it is; terms are fitted beside plays and creep, which had bent to what they stand for.
"""

from __future__ import annotations

from dataclasses import replace

from fomrc_core.diagnosis.judgement import Judgement
from fomrc_core.diagnosis.unnamed_extension import UnnamedExtension

_MOST = 0.5  # of the power that is left: where it is noise, less than there is noise


def may_be_followed(left_um: float, floor_um: float) -> bool:
    """Return whether half of the power that is left may be more than the noise known apart from any model."""
    return (1.0 - _MOST) * left_um**2 > floor_um**2


def unless_followed(judgement: Judgement, found: UnnamedExtension | None) -> Judgement:
    """Return the judgement, what is left no noise where terms without a name follow most of it on quoted data."""
    if found is None or not judgement.is_noise:
        return judgement
    share = 1.0 - (found.rms_after_um / found.rms_before_um) ** 2
    if share < _MOST:
        return judgement
    reason = f"terms without a name follow {100.0 * share:.0f} % of its power (p {found.p_value:.1g})"
    return replace(judgement, is_noise=False, reasons=(*judgement.reasons, reason))
