"""The paper's Table 3 as data: the lag it implies, and why the table alone cannot say what lags."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import yaml
from scipy.optimize import least_squares

from test.hidden.creep import fractional_integral
from test.hidden.dynamics import first_order, mass_spring_damper
from test.hidden.excitation import Drive
from test.hidden.hysteresis import MaxwellChain

_ROOT = Path(__file__).resolve().parents[2]
SLOPES_V_PER_S = np.array([0.1, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0, 200.0])
NRMSE_PERCENT = np.array([0.25, 0.25, 0.29, 0.32, 0.33, 0.40, 0.54, 0.95, 1.64, 3.03])
_N_PER_VOLT = 4000  # fine steps along a volt of drive


def _response(slope_v_per_s: float) -> tuple[np.ndarray, float]:
    """Return the displacement [um] of Table 1 under a triangle of decreasing amplitude, and its step [s]."""
    text = (_ROOT / "config" / "pi_p753_table1.yaml").read_text(encoding="utf-8")
    model = yaml.safe_load(text)["/**"]["ros__parameters"]["model"]
    stiffness = 1.0 / np.array(model["kappa_um_per_v"])
    chain = MaxwellChain(stiffness[:-1], np.array(model["saturation_v"]), float(stiffness[-1]))
    drive = Drive(-2.5, 2.5, _N_PER_VOLT * slope_v_per_s)
    for amplitude_v in (2.5, 2.0, 1.5, 1.0, 0.5):
        drive.line(amplitude_v, slope_v_per_s)
        drive.line(-amplitude_v, slope_v_per_s)
    step_s = 1.0 / (_N_PER_VOLT * slope_v_per_s)
    return fractional_integral(chain.run(drive.values()), float(model["creep_order"]), step_s), step_s


def _delayed(x: np.ndarray, step_s: float, lag_s: float) -> np.ndarray:
    time_s = np.arange(x.size) * step_s
    return np.interp(time_s - lag_s, time_s, x)


def _low_passed(x: np.ndarray, step_s: float, lag_s: float) -> np.ndarray:
    return first_order(x, 1.0 / lag_s, step_s)


def _resonant(x: np.ndarray, step_s: float, lag_s: float) -> np.ndarray:
    # The lag of slow motion is 2 d / w; a damping of 0.3 keeps the ringing small.
    return mass_spring_damper(x, 0.3 / lag_s / np.pi, 0.3, step_s)


_LAGS = {
    "transport_delay": (_delayed, lambda lag_s: f"{lag_s * 1e3:.3f} ms delay"),
    "amplifier_bandwidth": (_low_passed, lambda lag_s: f"{1.0 / (2.0 * np.pi * lag_s):.0f} Hz cutoff"),
    "mechanical_resonance (damping 0.3)": (
        _resonant,
        lambda lag_s: f"{0.6 / lag_s / (2 * np.pi):.0f} Hz resonance",
    ),
}

_Rule = Callable[[float, np.ndarray], np.ndarray]
_RULES: dict[str, _Rule] = {"in quadrature": np.hypot, "plainly": np.add}


def study() -> str:
    """Fit each cause of a lag to the ten numbers and return the page that says what follows."""
    responses = [_response(float(s)) for s in SLOPES_V_PER_S]

    def missed_percent(kind: str, lag_s: float) -> np.ndarray:
        missed = []
        for x, step_s in responses:
            # Where the triangle is so slow that a step outlasts the lag, every lag is the same lag.
            lagging = _LAGS[kind][0] if step_s < 0.3 * lag_s else _delayed
            missed.append(100.0 * np.sqrt(np.mean((lagging(x, step_s, lag_s) - x) ** 2)) / np.ptp(x))
        return np.array(missed)

    fits: dict[tuple[str, str], tuple[float, float, np.ndarray]] = {}
    for rule, add in _RULES.items():
        for kind in _LAGS:

            def misfit(p: np.ndarray, kind: str = kind, add: _Rule = add) -> np.ndarray:
                return np.log(add(np.exp(p[0]), missed_percent(kind, float(np.exp(p[1])))) / NRMSE_PERCENT)

            fit = least_squares(misfit, [np.log(0.3), np.log(4e-4)], x_scale=0.1)
            floor_percent, lag_s = np.exp(fit.x)
            predicted = add(floor_percent, missed_percent(kind, float(lag_s)))
            fits[rule, kind] = (float(floor_percent), float(lag_s), predicted)
    rows = []
    for (rule, kind), (floor_percent, lag_s, predicted) in fits.items():
        scatter = 100.0 * float(np.sqrt(np.mean(np.log(predicted / NRMSE_PERCENT) ** 2)))
        taken = f"{_LAGS[kind][1](lag_s)} | {lag_s * 1e3:.3f}"
        rows.append(f"| {rule} | {kind} | {taken} | {floor_percent:.2f} | {scatter:.1f} |")
    plain = {kind: fits["plainly", kind][2] for kind in _LAGS}
    table = ["| slope [V/s] | paper [%] | " + " | ".join(f"{kind} [%]" for kind in plain) + " |"]
    table += ["|---" * (2 + len(plain)) + "|"]
    for i, slope in enumerate(SLOPES_V_PER_S):
        cells = " | ".join(f"{predicted[i]:.3f}" for predicted in plain.values())
        table.append(f"| {slope:g} | {NRMSE_PERCENT[i]:.2f} | {cells} |")
    lags_ms = [fits["plainly", kind][1] * 1e3 for kind in _LAGS]
    two = plain["transport_delay"], plain["amplifier_bandwidth"]
    return _PAGE.format(
        rows="\n".join(rows),
        table="\n".join(table),
        low=min(lags_ms),
        high=max(lags_ms),
        half=0.5 * fits["plainly", "transport_delay"][1] * 1e3,
        apart=float(np.max(np.abs(two[0] - two[1]))),
        off=max(float(np.max(np.abs(predicted - NRMSE_PERCENT))) for predicted in two),
    )


_PAGE = """\
# Table 3 of the paper, read as data

Made by `python test/hidden/study.py --part table3`. The table gives the error of the paper's model
under triangles of decreasing amplitude at ten slopes. Its model has neither amplifier nor resonance
nor delay, so an error that grows in proportion to the slope is a lag the model leaves out. The
number and heights of the paper's triangles are not printed; here they fall from 2.5 V to 0.5 V in
five.

Each cause of a lag is put behind the model of Table 1 and fitted together with an error e0 that
does not depend on the slope. The two errors add in quadrature where they have nothing to do with
one another, and plainly where they have the same shape:

| they add | cause | what it takes | lag [ms] | e0 [%] | rms misfit [% of the value] |
|---|---|---|---|---|---|
{rows}

Added plainly:

{table}

## What the table says
- A lag of {low:.2f} to {high:.2f} ms, if the error was divided by the whole swing of the
  displacement. The paper does not say by what it divided; by the amplitude, it is half of that:
  {half:.2f} ms.
- The errors add plainly, not in quadrature. So the error that is there at rest has the shape of a
  lag as well: of one sign while the voltage rises, of the other while it falls. The paper's loop is
  a little too narrow or too wide, besides what lags.

## What it cannot say
Which. Delay and amplifier part by at most {apart:.3f} percentage points at any slope, while each
misses the table by up to {off:.3f}, before asking what the unknown triangles and the unknown
divisor are worth. Along a straight line of drive a delay, a first-order filter and a damped mass
all lag by one constant time. They part only within about that time after a corner, which an error
averaged over whole triangles does not show, and slope is the only thing the table varies.

What would tell: a multisine of some hundred hertz, or steps sampled well inside a millisecond. A
delay keeps the gain and turns the phase in proportion to frequency, a filter loses gain, a
resonance rings. A slew limit alone is excluded: below its rate it does nothing, so no error in
proportion to the slope comes of it.
"""
