"""A state that was saved, copied or moved goes on bit for bit, wherever it lies in memory."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest

from fomrc_core.model.compensator import Compensator
from fomrc_core.model.piezo_model import ModelState, PiezoModel
from fomrc_core.operators.creep import creep_block, creep_modes
from fomrc_core.operators.creep_batch import differentiate, integrate

_STEP_S = 1e-3
_LINE = 8  # numbers in 64 bytes, the widest a processor loads at once


class _Heap:
    """Memory as a long run leaves it: pieces of the size of a state's parts, some in use and some free."""

    def __init__(self, seed: int) -> None:
        self._rng = np.random.default_rng(seed)
        self._pieces: list[np.ndarray] = []

    def stir(self) -> None:
        self._pieces += [np.empty(int(size)) for size in self._rng.integers(1, 60, size=6)]
        for _ in range(4):
            self._pieces.pop(int(self._rng.integers(len(self._pieces))))


def _placed(state: ModelState) -> Iterator[ModelState]:
    """Yield the state with its arrays at every place within two lines, then as copies the heap finds a place for."""
    room = np.zeros(state.packed.size + 3 * _LINE)
    first = -room.ctypes.data // room.itemsize % _LINE
    for offset in range(2 * _LINE):
        packed = room[first + offset : first + offset + state.packed.size]
        packed[:] = state.packed
        yield ModelState(packed, {name: values.copy() for name, values in state.effects.items()}, state.last_input)
    heap = _Heap(0)
    for _ in range(2 * _LINE):
        heap.stir()
        yield state.copy()


@pytest.mark.parametrize("order", [0.0, 0.015, 0.2])
@pytest.mark.parametrize("n_elements", [0, 1, 7, 10, 40])
@pytest.mark.parametrize("n_samples", [1, 7, 9, 300])
def test_a_model_and_its_inverse_go_on_bit_for_bit_at_every_offset(
    order: float, n_elements: int, n_samples: int
) -> None:
    rng = np.random.default_rng(n_elements)
    model = PiezoModel(rng.uniform(1.0, 60.0, n_elements + 1), rng.uniform(0.01, 0.3, n_elements), order)
    compensator = Compensator(model)
    drive = np.cumsum(rng.standard_normal(n_samples + 20))
    steps_s = np.full(drive.size, _STEP_S)
    for run, state in ((model.simulate, model.initial_state()), (compensator.run, compensator.initial_state())):
        run(steps_s[:20], drive[:20], state)
        onward = [run(steps_s[20:], drive[20:], placed).tobytes() for placed in _placed(state)]
        assert len(set(onward)) == 1


@pytest.mark.parametrize("step", ["advance", "batch"])
def test_steps_and_batches_each_go_on_bit_for_bit(step: str) -> None:
    model = PiezoModel([10.0, 20.0, 30.0, 1.3], [0.05, 0.04, 0.1], 0.015)
    state = model.initial_state()
    model.simulate(np.full(20, _STEP_S), np.linspace(0.0, 1.0, 20), state)
    drive = np.sin(np.arange(30.0))
    onward = set()
    for placed in _placed(state):
        if step == "batch":
            onward.add(model.simulate(np.full(30, _STEP_S), drive, placed).tobytes())
        else:
            onward.add(np.array([model.advance(placed, value, _STEP_S) for value in drive]).tobytes())
    assert len(onward) == 1


def test_the_workspace_of_a_batch_may_lie_anywhere() -> None:
    # It is allocated anew in each batch: what else is in use decides where, and how far from the state.
    heap = _Heap(1)
    rng = np.random.default_rng(1)
    n_different = 0
    for run in (integrate, differentiate):
        for number in range(200):
            block = creep_block(creep_modes((0.015, 0.2)[number % 2]))
            values = np.cumsum(rng.standard_normal(10))
            run(block, 0, values, np.full(10, _STEP_S), np.empty(10))
            onward = set()
            for _ in range(20):
                heap.stir()
                out = np.empty(10)
                run(block.copy(), 0, values, np.full(10, _STEP_S), out)
                onward.add(out.tobytes())
            n_different += len(onward) > 1
    assert n_different == 0
