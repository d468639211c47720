"""How far the literal model (20)-(22) and the simplified one (26) are apart, as a table.

python benchmarks/literal_or_simplified.py
"""

from __future__ import annotations

import time

import numpy as np

from fomrc_core.model.literal_model import LiteralModel
from fomrc_core.model.piezo_model import PiezoModel
from fomrc_core.plants.paper_stage import CREEP_ORDER, KAPPA_UM_PER_V, SATURATION_V
from fomrc_core.records import excitation

KAPPA = np.array(KAPPA_UM_PER_V)
SATURATION = np.array(SATURATION_V)


def signals() -> dict[str, excitation.Excitation]:
    slopes = {
        f"triangle, {slope:g} V/s": excitation.triangle(2.5, slope_v_per_s=slope, rate_hz=min(1000.0, 1000.0 * slope))
        for slope in (0.1, 1.0, 10.0, 200.0)
    }
    return {
        "staircase 0.25 V, 3 s": excitation.staircase(2.5, n_cycles=1),
        **slopes,
        "step 2.5 V, 60 s": excitation.steps([2.5], lead_in_s=0.0),
        "step 0.5 V, 60 s": excitation.steps([0.5], lead_in_s=0.0),
        "back to 0 V after 2.5 V, 60 s": excitation.steps([2.5, 0.0], lead_in_s=0.0),
    }


def main() -> None:
    literal, simplified = LiteralModel(KAPPA, SATURATION, CREEP_ORDER), PiezoModel(KAPPA, SATURATION, CREEP_ORDER)
    literal.simulate(np.ones(2), np.ones(2))
    simplified.simulate(np.ones(2), np.ones(2))
    print("| excitation | rms apart [nm] | of the range [%] | largest [nm] | literal / simplified time |")
    print("|---|---:|---:|---:|---:|")
    for name, wave in signals().items():
        steps = np.diff(wave.time_s, prepend=wave.time_s[0] - (wave.time_s[1] - wave.time_s[0]))
        begun = time.perf_counter()
        first = literal.simulate(steps, wave.voltage_v)
        middle = time.perf_counter()
        second = simplified.simulate(steps, wave.voltage_v)
        ended = time.perf_counter()
        apart = first - second
        rms = float(np.sqrt(np.mean(apart**2)))
        print(
            f"| {name} | {1e3 * rms:.2f} | {100 * rms / np.ptp(first):.3f} | {1e3 * np.abs(apart).max():.1f} "
            f"| {(middle - begun) / (ended - middle):.0f} |"
        )


if __name__ == "__main__":
    main()
