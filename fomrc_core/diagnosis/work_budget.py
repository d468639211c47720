"""How much work a search may be, counted in operations of simulations: what is left out is told in the answer.

A search asks as long as something is left, and each question costs more the more has been found. Where a record holds
what no cause in the library explains, that would never be answered, and yet the dearest questions are asked of it: two
causes at once, time and again. So they end first, and later the search does. The work is counted and not timed, so
that the answer is the same on every machine.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

from fomrc_core.diagnosis.data_split import DataSplit
from fomrc_core.diagnosis.judgement import Status

# Operations of simulations [1], see work_of_run.py: 1e9 are a second of a processor of 2020, and half as much again
# goes into what is fitted to them, so that a search is mostly done within a minute. What was found is compared
# where no more could be sought: a name that is sure is worth more than one more.
_FOR_PAIRS = 1.2e10
_FOR_FIRST_PAIRS = 2.4e10  # where nothing has been found a pair is the last that may be
_FOR_CAUSES = 2.4e10
_FOR_NAMES = 3.2e10
# Samples of all records up to which that holds. A question costs in proportion to the samples, and of longer records
# it would be one cause and no more: as many are asked of them as of these, which takes the longer.
_SAMPLES = 40_000
# Times as much where the search is asked to be thorough: an end is told then as well, in minutes.
_THOROUGH = 10.0
# The same of one that goes over records once more, some of their readings where they belong: most of what it asks has
# been asked before, and what hid the answer is gone.
_ONCE_MORE = 0.5

PAIRS = "two causes at once were not sought to the end"
CAUSES = "no further causes were sought"
COMPARED = "names were not compared again beside what was found since"


def cut_short(left_out: Sequence[str]) -> tuple[str, ...]:
    """Return the sentence that tells what was left out; none where nothing was."""
    if not left_out:
        return ()
    return (f"the search was cut short, for it would have been too much work: {'; '.join(left_out)}",)


def unless_uncompared(status: Status, left_out: Sequence[str]) -> Status:
    """Return the status, but for names that explain all where they were not compared in the end."""
    return Status.SUSPECT if status is Status.EXPLAINED and COMPARED in left_out else status


@dataclass(frozen=True, eq=False)
class WorkBudget:
    """What a search has left.

    Attributes:
        n_done: returns the operations since it began [1].
        size: of what is allowed, in that of records of up to 40 000 samples [1].
        left_out: what was not done, in words, each once; the one thing here that changes.
    """

    n_done: Callable[[], float]
    size: float = 1.0
    left_out: list[str] = field(default_factory=list)

    @classmethod
    def of(cls, split: DataSplit, is_thorough: bool = False, *, is_once_more: bool = False) -> WorkBudget:
        """Return the budget of a search that begins now.

        Ten times as much of one that is asked to be thorough, half of one that was made before of the records as read.
        """
        records = {id(r.tally): r for r in (*split.train, *(h.record for h in (*split.held, *split.report)))}.values()
        n_before = sum(record.tally.n_done for record in records)
        times = (_THOROUGH if is_thorough else 1.0) * (_ONCE_MORE if is_once_more else 1.0)
        size = max(1.0, sum(record.time_s.size for record in records) / _SAMPLES) * times
        return cls(lambda: sum(record.tally.n_done for record in records) - n_before, size)

    @classmethod
    def unlimited(cls) -> WorkBudget:
        """Return a budget that is never used up."""
        return cls(lambda: 0.0)

    def allows(self, what: str, *, has_found: bool = True) -> bool:
        """Return whether something may still be done; where not it is told as left out.

        Args:
            what: PAIRS, CAUSES or COMPARED.
            has_found: whether the search has found anything: without a pair it would come to nothing.
        """
        most = {PAIRS: _FOR_PAIRS if has_found else _FOR_FIRST_PAIRS, CAUSES: _FOR_CAUSES, COMPARED: _FOR_NAMES}
        is_allowed = self.n_done() < self.size * most[what]
        if not is_allowed and what not in self.left_out:
            self.left_out.append(what)
        return is_allowed
