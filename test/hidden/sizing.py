"""Turning each drawn effect to a size that is neither lost in the noise nor blatant."""

from __future__ import annotations

from typing import Any

import numpy as np

from test.hidden.bench import Setup, chance, with_effects
from test.hidden.effects import DRAWS, Draft, Stage, log_uniform
from test.hidden.visibility import absorbable, raw_and_visible_um

_N_DRAWS = 3
_N_RESIZES = 5


class Sizing:
    """Turns the size of each drawn effect until it is neither lost in the noise nor blatant."""

    def __init__(self, setup: Setup, commands: list[np.ndarray]) -> None:
        self.setup, self.commands = setup, commands
        self.plain = [self._clean(k, {}) for k in range(len(commands))]
        self.basis = absorbable(commands, setup.rate_hz, setup.world.creep_order)

    def _clean(self, which: int, effects: dict[str, dict[str, Any]]) -> np.ndarray:
        name = f"train {which + 1}"
        clean = with_effects(self.setup, effects).clean_um(self.commands[which], "train", name)
        return clean - self.setup.circumstance(2, "train", name).offset_um

    def raw_and_visible(self, cause: str, parameters: dict[str, Any]) -> tuple[float, float]:
        """Return the rms [um] of one effect with the given parameters."""
        changed = [self._clean(k, {cause: parameters}) - self.plain[k] for k in range(len(self.commands))]
        return raw_and_visible_um(changed, self.basis)

    def fit(self, cause: str) -> dict[str, Any]:
        """Draw a cause and turn its size into the window of fair cases; the nearest of all tries is taken."""
        rng = chance(self.setup.seed, f"cause {cause}")
        stage = Stage(
            self.setup.low_v,
            self.setup.high_v,
            self.setup.world.hysteresis,
            self.commands[0].size / self.setup.rate_hz,
        )
        nearest: tuple[float, dict[str, Any]] | None = None
        for _ in range(_N_DRAWS):
            draft = DRAWS[cause](stage, rng)
            size, target_um = draft.size, log_uniform(rng, *draft.window_um)
            for _ in range(_N_RESIZES):
                parameters = draft.build(size)
                _, visible_um = self.raw_and_visible(cause, parameters)
                miss = _miss(visible_um, draft)
                if nearest is None or miss < nearest[0]:
                    nearest = (miss, parameters)
                if miss == 0.0:
                    return parameters
                turned = size * (target_um / max(visible_um, 1e-6)) ** (1.0 / draft.power)
                turned = min(draft.largest, max(draft.smallest, turned))
                if turned == size:
                    break
                size = turned
        assert nearest is not None
        return nearest[1]


def _miss(visible_um: float, draft: Draft) -> float:
    low, high = draft.window_um
    if low <= visible_um <= high:
        return 0.0
    return abs(np.log(max(visible_um, 1e-9) / (low if visible_um < low else high)))
