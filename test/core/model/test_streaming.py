"""A stream in chunks is the batch, and holds no more than a chunk."""

from __future__ import annotations

import numpy as np
import pytest
from random_models import relative

from fomrc_core.effects.amplifier_bandwidth import AmplifierBandwidth
from fomrc_core.errors import InputError
from fomrc_core.model.compensator import Compensator
from fomrc_core.model.piezo_model import PiezoModel
from fomrc_core.model.streaming import Chunk, in_chunks, stream

MODEL = PiezoModel([10.0, 4.0, 7.0, 1.5], [0.02, 0.1, 0.3], 0.02)


@pytest.mark.parametrize("n_samples", [1, 7, 1000, 10**6])
@pytest.mark.parametrize("effects", [(), (AmplifierBandwidth(cutoff_hz=30.0),)])
def test_chunks_equal_the_batch(n_samples, effects):
    n = 300 if n_samples == 1 else 5000
    u, dt = np.sin(np.arange(n) / 90.0), np.full(n, 1e-3)
    model = MODEL.with_effects(*effects)
    for runner, whole in ((model, model.simulate(dt, u)), (Compensator(model), Compensator(model).run(dt, u))):
        parts = list(stream(runner, in_chunks(dt, u, n_samples=n_samples)))
        assert all(part.size <= n_samples for part in parts)
        assert relative(np.concatenate(parts), whole) <= 1e-12


def test_only_what_is_asked_for_is_read():
    asked = []

    def endless():
        k = 0
        while True:
            asked.append(k)
            yield Chunk(np.full(100, 1e-3), np.sin((np.arange(100) + 100 * k) / 90.0))
            k += 1

    outputs = stream(MODEL, endless())
    for _ in range(3):
        next(outputs)
    assert asked == [0, 1, 2]


def test_bad_chunks_are_named():
    with pytest.raises(InputError, match="n_samples"):
        next(in_chunks(np.ones(3), np.ones(3), n_samples=0))
    with pytest.raises(InputError, match="values"):
        next(in_chunks(np.ones(3), np.ones(4)))
    with pytest.raises(InputError, match="voltage_v"):
        next(stream(MODEL, [Chunk(np.ones(2), np.array([1.0, np.nan]))]))
