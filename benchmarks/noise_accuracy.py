"""How well the noise model knows the noise: ``python -m benchmarks.noise_accuracy [n_seeds]`` prints the table.

The truth shares nothing with the package: a play-type stack on a grid of its own, creep as a spectrum of relaxations,
noise of six colours. The rms of the noise is taken after a constant, a line, a parabola and a cubic have been taken
out of the whole record, as in ``NoiseModel.expected_rms_um``.
"""

from __future__ import annotations

import sys
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from fomrc_core.records.noise_estimate import estimate_noise
from fomrc_core.records.recording import Recording

Array = NDArray[np.float64]
Draw = Callable[[int, np.random.Generator], Array]

RATE_HZ = 1000.0
_LEVEL_UM = 1e-3


def displacement_um(drive_v: Array) -> Array:
    """Return about 10 um of motion for a drive of 1 V: plays, then creep of some 10 % over all decades."""
    thresholds = np.linspace(0.02, 0.8, 24)
    weights = 3.0 * np.exp(-3.0 * thresholds) / thresholds.size * 4.0
    state = np.zeros(thresholds.size)
    moved = np.empty(drive_v.size)
    for k, v in enumerate(drive_v):
        state = np.minimum(np.maximum(state, v - thresholds), v + thresholds)
        moved[k] = 6.0 * v + np.dot(weights, state)
    crept = moved.copy()
    for length in np.geomspace(3.0, 3e4, 12):
        crept += 0.01 * lfilter([1.0 - np.exp(-1.0 / length)], [1.0, -np.exp(-1.0 / length)], moved)
    return crept


def first_order(rho: float) -> Draw:
    """Return first-order autoregressive noise of unit variance."""
    return lambda n, rng: lfilter([np.sqrt(1.0 - rho**2)], [1.0, -rho], rng.standard_normal(n + 1000))[1000:]


def power_law(exponent: float) -> Draw:
    """Return noise whose density falls with a power of frequency, of unit rms less a cubic."""

    def draw(n: int, rng: np.random.Generator) -> Array:
        spectrum = np.fft.rfft(rng.standard_normal(4 * n))
        spectrum[0] = 0.0
        spectrum[1:] *= np.arange(1, spectrum.size) ** (-0.5 * exponent)
        values = np.fft.irfft(spectrum, 4 * n)[:n]
        return values / rms_less_cubic(values)

    return draw


def rms_less_cubic(values: Array) -> float:
    """Return the rms of what a cubic polynomial of time leaves."""
    t = np.linspace(-1.0, 1.0, values.size)
    return float(np.std(values - np.polynomial.polynomial.polyval(t, np.polynomial.polynomial.polyfit(t, values, 3))))


def _mixed(n: int, rng: np.random.Generator) -> Array:
    return 0.8 * rng.standard_normal(n) + 0.6 * power_law(2.0)(n, rng)


NOISES: dict[str, Draw] = {
    "white": lambda n, rng: rng.standard_normal(n),
    "AR(1) 0.3": first_order(0.3),
    "AR(1) 0.6": first_order(0.6),
    "AR(1) 0.9": first_order(0.9),
    "AR(1) 0.95": first_order(0.95),
    "flicker": power_law(1.0),
    "walk": power_law(2.0),
    "white + walk": _mixed,
}


def _multisine(rng: np.random.Generator, n: int, top: int) -> Array:
    spectrum = np.zeros(n // 2 + 1, dtype=complex)
    spectrum[1:top] = np.exp(2j * np.pi * rng.random(top - 1)) / np.sqrt(np.arange(1, top))
    wave = np.fft.irfft(spectrum, n)
    return wave / np.max(np.abs(wave))


def _line(*points: tuple[float, int]) -> Array:
    now, parts = 0.0, []
    for value, n in points:
        parts.append(np.linspace(now, value, n + 1)[1:])
        now = value
    return np.concatenate(parts)


def four_periods(rng: np.random.Generator) -> Array:
    wave = _multisine(rng, 2000, 40)
    return np.concatenate((np.zeros(500), _line((wave[0], 300)), np.tile(wave, 4), np.full(1000, wave[0])))


def two_periods_in_rests(rng: np.random.Generator) -> Array:
    wave = _multisine(rng, 2000, 40)
    start = wave[0]
    return np.concatenate((_line((start, 300)), np.full(3000, start), wave, wave, _line((0.0, 300))[::-1] * 0 + start))


def two_bursts_apart(rng: np.random.Generator) -> Array:
    wave = np.concatenate((_line((0.9, 700), (-0.8, 1200), (0.7, 1000)), 0.7 * _line((-1.0, 700), (0.0, 400)) + 0.7))
    return np.concatenate((np.zeros(700), wave, _line((0.3, 350), (0.1, 200))[::-1] * 0.0 + wave[-1], wave))


def triangles_with_holds(rng: np.random.Generator) -> Array:
    one = np.concatenate((_line((0.9, 400)), np.full(100, 0.9), 0.9 - _line((1.8, 800)), -0.9 + _line((0.9, 400))))
    return np.concatenate((np.zeros(300), np.tile(one, 6)))


def staircase(rng: np.random.Generator) -> Array:
    levels = np.concatenate((np.arange(0, 11), np.arange(9, -1, -1))) / 10.0
    return np.repeat(levels * rng.uniform(0.8, 1.0), 400)


def long_rest(rng: np.random.Generator) -> Array:
    sweeps = _line(*[(a * (-1) ** k, int(600 * a) + 50) for k, a in enumerate(np.linspace(1.0, 0.2, 9))])
    return np.concatenate((sweeps, np.full(3000, sweeps[-1])))


def fading_triangles(rng: np.random.Generator) -> Array:
    return _line(*[(a * (-1) ** k, int(900 * a) + 50) for k, a in enumerate(rng.uniform(0.2, 1.0, 14))])


def band_limited(rng: np.random.Generator) -> Array:
    return _multisine(rng, 8000, 60)


DRIVES: dict[str, Callable[[np.random.Generator], Array]] = {
    "four periods": four_periods,
    "two periods in rests": two_periods_in_rests,
    "two bursts apart": two_bursts_apart,
    "triangles with holds": triangles_with_holds,
    "staircase": staircase,
    "one long rest": long_rest,
    "fading triangles": fading_triangles,
    "band-limited": band_limited,
}


def row(drive: str, noise: str, n_seeds: int, step_um: float = 0.0) -> str:
    """Return one line of the table."""
    ratios, inside, slow, consistent, white, source = [], 0, 0, 0, 0, ""
    for seed in range(n_seeds):
        rng = np.random.default_rng([seed, len(drive), len(noise)])
        drive_v = DRIVES[drive](rng)
        clean = displacement_um(drive_v)
        noisy = clean + _LEVEL_UM * NOISES[noise](drive_v.size, rng)
        measured = np.round(noisy / step_um) * step_um if step_um else noisy
        error = measured - clean
        model = estimate_noise([Recording(np.arange(drive_v.size) / RATE_HZ, drive_v, measured)])
        truth = rms_less_cubic(error)
        t = np.linspace(-1.0, 1.0, error.size)
        left = error - np.polynomial.polynomial.polyval(t, np.polynomial.polynomial.polyfit(t, error, 3))
        ratios.append(model.rms_um / truth)
        low, high = model.rms_interval_um
        inside += low <= truth <= high
        slow += model.sees_slow_noise
        consistent += model.consistency_p_value(left) > 0.05
        white += model.is_white(left)
        source = model.source.value
    low, middle, high = np.quantile(ratios, [0.05, 0.5, 0.95])
    share = 100.0 / n_seeds
    return (
        f"| {drive} | {noise} | {source} | {middle:.2f} ({low:.2f} to {high:.2f}) | {share * inside:.0f} | "
        f"{share * slow:.0f} | {share * consistent:.0f} | {share * white:.0f} |"
    )


def main(n_seeds: int) -> None:
    """Print the table."""
    print("| drive | noise | source | rms over truth: median (5 to 95 %) | truth within the interval, % | ", end="")
    print("sees slow noise, % | p of rms > 0.05, % | p of whiteness > 0.01, % |")
    print("|---|---|---|---|---|---|---|---|")
    for drive in DRIVES:
        for noise in NOISES:
            print(row(drive, noise, n_seeds), flush=True)
    for step_um in (1e-3, 5e-3):
        for drive in ("four periods", "staircase", "fading triangles"):
            print(row(drive, "white", n_seeds, step_um).replace("white", f"white, step {1e3 * step_um:g} nm"))


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 20)
