"""What a late tick did to the memory is in the journal: what is resumed is the memory that was."""

from __future__ import annotations

import numpy as np
from small_model import compensator_of

from fomrc_core.control.actuator_memory import aging_steps
from fomrc_core.control.checkpoint import CheckpointWriter, read_checkpoint
from fomrc_core.control.compensation_loop import CompensationLoop, LoopSettings
from fomrc_core.control.voltage_limits import VoltageLimits

PERIOD_S = 2e-3
LATE_AT = (13, 40)


def test_resumed_after_late_ticks_it_is_the_memory_that_was(tmp_path):
    compensator = compensator_of()
    limits = VoltageLimits(-5.0, 5.0, 5000.0, 0.0, 10.0)
    loop = CompensationLoop(compensator, LoopSettings(limits, 0.0, True, PERIOD_S, 60.0))
    writer = CheckpointWriter(tmp_path / "memory", 3600.0)
    n_moves = []
    for k in range(60):
        loop.set_target(1.5 if k > 10 else 0.0)
        voltage_v = loop.tick(0.1 if k in LATE_AT else PERIOD_S)
        is_new, loop.is_discontinuous = loop.is_discontinuous, False
        writer.note(compensator, loop.memory, loop.moves, loop.followed_um, voltage_v, is_discontinuous=is_new)
        n_moves.append(len(loop.moves))
    writer.close()
    assert all(n_moves[k] > 1 for k in LATE_AT), "the voltage was held, then went on"
    assert sum(n_moves) == len(n_moves) + sum(n_moves[k] - 1 for k in LATE_AT)
    resumed = read_checkpoint(tmp_path / "memory", compensator, PERIOD_S)
    assert resumed is not None
    assert resumed.voltage_v == voltage_v
    # Both go on alike: the one that was not down ages by as much as the resumed one while the file was read.
    for step_s in aging_steps(resumed.down_time_s, PERIOD_S):
        loop.memory.advance(compensator, resumed.target_um, step_s)
    ahead = [memory.advance(compensator, 0.3, PERIOD_S) for memory in (resumed.memory, loop.memory)]
    print(f"apart by {abs(ahead[0] - ahead[1]):.1e} V after {resumed.down_time_s:.1e} s")
    np.testing.assert_allclose(ahead[0], ahead[1], rtol=0.0, atol=1e-6)
