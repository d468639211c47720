"""How many samples of a set of records a fit or a search may hold at once, within a bound of memory and of time."""

from __future__ import annotations

from dataclasses import dataclass

from fomrc_core.errors import ParameterError
from fomrc_core.model.substeps import N_PARTS_LARGE, Substeps

MAX_MEMORY_GB = 2.0
_BYTES_PROGRAM = 0.5e9  # the interpreter, its libraries and compiled kernels
# Of each sample of a record: time, voltage, displacement and their copies while they are read and looked over.
_BYTES_READ = 100.0
_KEPT_MIN = 4_000  # fewer samples tell too little of loops and creep
_KEPT_MOST = 100_000  # more cost minutes and hardly tell more
_FEWEST_PARTS = 2.0  # a part costs memory, and so does a sample of which nothing is divided
_WHOLE_PER_KEPT = 100  # samples each kept one may stand for, as long as memory allows


@dataclass(frozen=True)
class Work:
    """What a work costs.

    Attributes:
        bytes_per_sample: memory for each sample it holds at once [B], measured by ``benchmarks/large_recordings.py``,
            where steps are divided of a drive that jumps with each.
        n_whole_max: most samples it is done with as they are; records with more are thinned.
        n_kept: samples a longer record is thinned to, or more where it is very long.
        substeps: how it divides the steps of a record.
    """

    bytes_per_sample: float
    n_whole_max: int
    n_kept: int
    substeps: Substeps


# Columns of 48 plays with their slopes, and of 112 plays with what the causes of a diagnosis make of them.
IDENTIFYING = Work(2_100.0, 250_000, 50_000, Substeps.NONE)
DIAGNOSING = Work(9_200.0, 250_000, 24_000, Substeps.BENDS)


def kept_samples(n_samples: int, work: Work, max_memory_gb: float, n_parts: float = N_PARTS_LARGE) -> int | None:
    """Return to how many samples records are to be thinned; None where they are taken as they are.

    Args:
        n_samples: of all records together.
        work: what is to be done with them.
        max_memory_gb: bound of memory [GB].
        n_parts: into how many parts their steps are divided, on average, where the work divides steps.

    Raises:
        ParameterError: a bound in which the records cannot even be read and thinned.
    """
    free = 1e9 * max_memory_gb - _BYTES_PROGRAM - _BYTES_READ * n_samples
    n_held = int(free / work.bytes_per_sample)
    share = 1.0 if work.substeps is Substeps.NONE else max(n_parts, _FEWEST_PARTS) / N_PARTS_LARGE
    if n_samples <= min(n_held / share, work.n_whole_max):
        return None
    if n_held < _KEPT_MIN:
        least = (_BYTES_PROGRAM + _BYTES_READ * n_samples + _KEPT_MIN * work.bytes_per_sample) / 1e9
        raise ParameterError(
            f"too little memory for {n_samples} samples",
            where="max_memory_gb",
            value=max_memory_gb,
            allowed=f"{least + 0.005:.2f} GB or more",
        )
    return min(max(work.n_kept, n_samples // _WHOLE_PER_KEPT), n_held, _KEPT_MOST)
