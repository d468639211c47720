"""What a challenge is made of: how many cases hide nothing, one cause, several, or what has no name."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from test.hidden.second.data_faults import FAULT_KINDS
from test.hidden.second.hidden_causes import DRAWS
from test.hidden.second.second_case import SecondCase, draw

UNKNOWN = "unknown"
"""The answer where what is wrong is none of the causes: hysteresis of another form than plays can have."""
CAUSES: tuple[str, ...] = (*DRAWS, UNKNOWN)
"""All names an answer may give a probability to."""

# Shares of the cases by what is hidden. A fifth hides nothing, so that a false alarm rate can be told.
_SHARES = {"nothing": 0.2, "one": 0.5, "two": 0.15, "three": 0.05, UNKNOWN: 0.1}
_FAULTY = 0.15  # share of records of any kind with faulty data
_LEAST_FORM_ERROR = 3.0  # over the noise, of what is to be detected as unknown
_N_ATTEMPTS = 20


@dataclass(frozen=True)
class CasePlan:
    """What one case is to be drawn from.

    Args:
        kind: "nothing", "one", "two", "three" or UNKNOWN.
        causes: to hide.
        faults: of the data of every record.
    """

    kind: str
    causes: tuple[str, ...]
    faults: tuple[str, ...]

    @property
    def answer(self) -> tuple[str, ...]:
        """Causes an answer should name."""
        return (UNKNOWN,) if self.kind == UNKNOWN else self.causes


@dataclass(frozen=True, eq=False)
class ComposedCase:
    """One case of a challenge: its records with their key, and the causes an answer should name."""

    name: str
    case: SecondCase
    causes: tuple[str, ...]


def plan(n_cases: int, seed: int) -> list[CasePlan]:
    """Return what each case of a challenge is to hide: cases of each kind, and every cause before any comes again.

    Args:
        n_cases: how many.
        seed: source of all chance.
    """
    rng = np.random.default_rng([seed, n_cases])
    edges = np.cumsum(list(_SHARES.values()))
    places = (np.arange(n_cases) + 0.5) / n_cases * edges[-1]
    kinds = rng.permutation([list(_SHARES)[int(np.searchsorted(edges, place))] for place in places])
    plans: list[CasePlan] = []
    bag: list[str] = []
    for kind in kinds.tolist():
        causes: list[str] = []
        for _ in range({"one": 1, "two": 2, "three": 3}.get(kind, 0)):
            if not set(bag) - set(causes):
                bag = rng.permutation(list(DRAWS)).tolist()
            causes.append(next(name for name in bag if name not in causes))
            bag.remove(causes[-1])
        faults = (FAULT_KINDS[int(rng.integers(len(FAULT_KINDS)))],) if rng.random() < _FAULTY else ()
        plans.append(CasePlan(kind, tuple(causes), faults))
    return plans


def compose(n_cases: int, seed: int, n_samples: tuple[int, int]) -> Iterator[ComposedCase]:
    """Draw the cases of a challenge one by one.

    Args:
        n_cases: how many.
        seed: source of all chance.
        n_samples: least and most samples of the training records.
    """
    for k, planned in enumerate(plan(n_cases, seed), start=1):
        case = _drawn(planned, np.random.default_rng([seed, n_cases, k]), n_samples)
        yield ComposedCase(f"case_{k:04d}", case, planned.answer)


def _drawn(planned: CasePlan, rng: np.random.Generator, n_samples: tuple[int, int]) -> SecondCase:
    form = "other" if planned.kind == UNKNOWN else "representable"
    for _ in range(_N_ATTEMPTS):
        seed = int(rng.integers(2**62))
        try:
            case = draw(seed, planned.causes, form=form, faults=planned.faults, n_samples=n_samples)
        except RuntimeError:
            continue  # causes that no bench of this seed shows together
        if planned.kind != UNKNOWN or case.form_error_um > _LEAST_FORM_ERROR * case.noise_um:
            return case
    raise RuntimeError(f"no case of {_N_ATTEMPTS} shows {planned}")
