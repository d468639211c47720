"""What the compensator followed: the recent past sample by sample, what lies before it in outline.

A model whose creep order or effects changed cannot take the old memory over; it replays what was followed. Creep
forgets detail long before it forgets levels, and hysteresis remembers nothing but extremes, so that of the older past
the end and both extremes of each block of samples are enough.
"""

from __future__ import annotations

import time
from collections import deque
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fomrc_core.control.actuator_memory import ActuatorMemory, carried
from fomrc_core.errors import FomrcError
from fomrc_core.model.compensator import Compensator

Array = NDArray[np.float64]

N_OUTLINED_QUARTERS = 120  # thirty times what is kept sample by sample
_BLOCK = 32
_FIRST_CHUNK = 16


@dataclass(frozen=True, eq=False)
class Outline:
    """A part of the older past.

    Attributes:
        compensator: the one that ran when it began.
        memory: its memory at that moment.
        steps_s: steps [s], shape (n,).
        desired_um: where each step ended [um], shape (n,); on a straight line in between.
        cross: second axis, shape (n,).
    """

    compensator: Compensator
    memory: ActuatorMemory
    steps_s: Array
    desired_um: Array
    cross: Array


def outline(steps_s: Array, desired_um: Array, cross: Array) -> tuple[Array, Array, Array]:
    """Return the end and both extremes of each block of samples, the steps between them added up."""
    n = desired_um.size
    kept = set(range(_BLOCK - 1, n, _BLOCK)) | {n - 1}
    for start in range(0, n, _BLOCK):
        block = desired_um[start : start + _BLOCK]
        kept |= {start + int(np.argmin(block)), start + int(np.argmax(block))}
    index = np.array(sorted(kept))
    ends_s = np.cumsum(steps_s)[index]
    return np.diff(ends_s, prepend=0.0), desired_um[index].copy(), cross[index].copy()


class TargetHistory:
    """What was followed since an anchor, bounded in size.

    Args:
        compensator: the one that ran when the history began.
        memory: its memory at that moment.
        capacity: most samples kept one by one; where it is full the oldest quarter is kept in outline.
    """

    def __init__(self, compensator: Compensator, memory: ActuatorMemory, capacity: int) -> None:
        self._quarter = max(capacity // 4, 1)
        self._steps_s = np.empty(4 * self._quarter)
        self._desired_um = np.empty(4 * self._quarter)
        self._cross = np.empty(4 * self._quarter)
        # Memories at the beginning of each quarter that is in use.
        self._anchors: list[tuple[Compensator, ActuatorMemory]] = [(compensator, memory.copy())]
        self._outlines: deque[Outline] = deque(maxlen=N_OUTLINED_QUARTERS)
        self.n_samples = 0
        self.n_dropped = 0

    def append(self, step_s: float, desired_um: float, cross: float = np.nan) -> None:
        """Add a sample; ``cross`` is where the second axis was, not a number where there is none."""
        self._steps_s[self.n_samples] = step_s
        self._desired_um[self.n_samples] = desired_um
        self._cross[self.n_samples] = cross
        self.n_samples += 1

    def mark(self, compensator: Compensator, memory: ActuatorMemory) -> None:
        """Note the memory after the last sample where a quarter ends; call it after every ``append``."""
        if self.n_samples % self._quarter:
            return
        self._anchors.append((compensator, memory.copy()))
        if self.n_samples == self._steps_s.size:
            keep = 3 * self._quarter
            self._outlines.append(Outline(*self._anchors.pop(0), *outline(*self.part(0, self._quarter))))
            self._steps_s[:keep] = self._steps_s[self._quarter :]
            self._desired_um[:keep] = self._desired_um[self._quarter :]
            self._cross[:keep] = self._cross[self._quarter :]
            self.n_samples = keep
            self.n_dropped += self._quarter

    @property
    def anchor(self) -> tuple[Compensator, ActuatorMemory]:
        """The compensator and its memory where the history begins, its outlined part included."""
        if self._outlines:
            return self._outlines[0].compensator, self._outlines[0].memory
        return self._anchors[0]

    @property
    def outlines(self) -> tuple[Outline, ...]:
        """The older past, in order."""
        return tuple(self._outlines)

    def part(self, start: int, stop: int) -> tuple[Array, Array, Array]:
        """Return steps [s], displacements [um] and second axis of samples ``start`` to ``stop``."""
        return self._steps_s[start:stop], self._desired_um[start:stop], self._cross[start:stop]


class MemoryReplay:
    """Bring a changed model to where it would stand had it been running, some samples at a time.

    Args:
        history: what was followed; it may grow meanwhile.
        new: the changed model's compensator.
    """

    def __init__(self, history: TargetHistory, new: Compensator) -> None:
        self.compensator = new
        self._history = history
        anchor_compensator, anchor = history.anchor
        self.memory = carried(anchor_compensator, new, anchor)
        outlines = history.outlines
        self._outline = tuple(
            np.concatenate([getattr(o, name) for o in outlines]) if outlines else np.empty(0)
            for name in ("steps_s", "desired_um", "cross")
        )
        self._next_outlined = 0
        self._next = history.n_dropped
        self._chunk = _FIRST_CHUNK
        self.last_voltage_v = 0.0

    def work(self, budget_s: float) -> bool:
        """Replay for about this long [s]; return whether the replay has caught up.

        Raises:
            FomrcError: the history has moved on beyond what was still to be replayed.
        """
        deadline = time.perf_counter() + budget_s
        while True:
            part = self._next_part()
            if part[0].size == 0:
                return True
            began = time.perf_counter()
            self._replay(*part)
            now = time.perf_counter()
            # Chunks that take about a fifth of the budget, on any machine, with or without compiled kernels.
            if now - began < 0.1 * budget_s:
                self._chunk = min(2 * self._chunk, 4096)
            elif now - began > 0.3 * budget_s:
                self._chunk = max(self._chunk // 2, 1)
            if now >= deadline:
                return self._next - self._history.n_dropped >= self._history.n_samples

    def _next_part(self) -> tuple[Array, Array, Array]:
        if self._next_outlined < self._outline[0].size:
            taken = slice(self._next_outlined, self._next_outlined + self._chunk)
            self._next_outlined = min(taken.stop, self._outline[0].size)
            steps_s, desired_um, cross = (values[taken] for values in self._outline)
            return steps_s, desired_um, cross
        start = self._next - self._history.n_dropped
        if start < 0:
            raise FomrcError("the model could not be brought up to date: history_s is too short")
        stop = min(start + self._chunk, self._history.n_samples)
        self._next += max(stop - start, 0)
        return self._history.part(start, stop)

    def _replay(self, steps_s: Array, desired_um: Array, cross: Array) -> None:
        compensator, memory = self.compensator, self.memory
        # Turning points need the hysteresis input of every sample, so this goes step by step.
        for step_s, desired, beside in zip(steps_s.tolist(), desired_um.tolist(), cross.tolist(), strict=True):
            self.last_voltage_v = memory.advance(compensator, desired, step_s, beside)
