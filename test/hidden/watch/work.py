"""A day's work of a stage: scans, steps, corrections, rests, none of them the routine of a calibration."""

from __future__ import annotations

import numpy as np

_SAFE_SLOPE_V_PER_S = 40.0
# Steps are as steep as a slew limit lets them be.
_STEP_SLOPES_V_PER_S = (100.0, 500.0)


class Work:
    """Voltages under construction, one job after the other, each led in by a straight line.

    Args:
        largest_v: all voltages are within plus and minus this [V].
        rate_hz: rate of the samples [Hz].
        rng: source of all chance.
    """

    def __init__(self, largest_v: float, rate_hz: float, rng: np.random.Generator) -> None:
        self._largest_v, self._rate_hz, self._rng = largest_v, rate_hz, rng
        self._pieces: list[np.ndarray] = [np.zeros(1)]
        self.n_samples = 1

    @property
    def values_v(self) -> np.ndarray:
        """All samples [V]."""
        return np.concatenate(self._pieces)

    def _append(self, values_v: np.ndarray) -> None:
        self._pieces.append(np.asarray(values_v, dtype=np.float64))
        self.n_samples += values_v.size

    def _line(self, to_v: float, slope_v_per_s: float) -> None:
        now_v = float(self._pieces[-1][-1])
        n = max(1, round(abs(to_v - now_v) / slope_v_per_s * self._rate_hz))
        self._append(now_v + (to_v - now_v) * np.arange(1, n + 1) / n)

    def _hold(self, duration_s: float) -> None:
        self._append(np.full(max(1, round(duration_s * self._rate_hz)), self._pieces[-1][-1]))

    def _place(self, room_v: float = 0.0) -> float:
        reach = self._largest_v - room_v
        return float(self._rng.uniform(-reach, reach))

    def scan(self) -> None:
        """Go to and fro at a rate, over a part of the range."""
        amplitude_v = self._largest_v * float(np.exp(self._rng.uniform(np.log(0.05), 0.0)))
        centre_v = self._place(amplitude_v)
        rate = float(np.exp(self._rng.uniform(np.log(0.1), np.log(3.0))))
        slope = min(4.0 * amplitude_v * rate, _SAFE_SLOPE_V_PER_S)
        for _ in range(int(self._rng.integers(1, 4))):
            self._line(centre_v + amplitude_v, slope)
            self._line(centre_v - amplitude_v, slope)

    def steps(self) -> None:
        """Go from place to place, and stay a while at each."""
        reach_v = self._largest_v * float(np.exp(self._rng.uniform(np.log(0.05), 0.0)))
        centre_v = self._place(reach_v)
        slope = float(self._rng.uniform(*_STEP_SLOPES_V_PER_S))
        for _ in range(int(self._rng.integers(3, 8))):
            self._line(centre_v + float(self._rng.uniform(-reach_v, reach_v)), slope)
            self._hold(float(np.exp(self._rng.uniform(np.log(0.1), np.log(1.5)))))

    def track(self) -> None:
        """Follow something smooth."""
        n = round(float(self._rng.uniform(3.0, 6.0)) * self._rate_hz)
        t = np.arange(n) / self._rate_hz
        amplitude_v = self._largest_v * float(np.exp(self._rng.uniform(np.log(0.03), np.log(0.8))))
        centre_v = self._place(amplitude_v)
        shares = self._rng.dirichlet(np.ones(3))
        swing = np.zeros(n)
        for share in shares:
            rate = float(np.exp(self._rng.uniform(np.log(0.05), np.log(4.0))))
            swing += share * np.sin(2.0 * np.pi * (rate * t + self._rng.random()))
        self._line(centre_v + amplitude_v * swing[0], 10.0)
        self._append(centre_v + amplitude_v * swing)

    def correct(self) -> None:
        """Stay at one place, corrected by small amounts now and then."""
        place_v = self._place(0.1)
        self._line(place_v, 10.0)
        for _ in range(int(self._rng.integers(3, 8))):
            self._line(place_v + float(self._rng.uniform(-0.05, 0.05)), 1.0)
            self._hold(float(self._rng.uniform(0.2, 1.0)))

    def rest(self, duration_s: float) -> None:
        """Stay where it is."""
        self._hold(duration_s)


def motion(duration_s: float, largest_v: float, rate_hz: float, rng: np.random.Generator) -> np.ndarray:
    """Return work with short rests only [V]."""
    return _worked(duration_s, largest_v, rate_hz, rng, longest_rest_s=5.0, p_rest=0.15)


def day(duration_s: float, largest_v: float, rate_hz: float, rng: np.random.Generator) -> np.ndarray:
    """Return work as of a day: bursts of jobs, rests of seconds to an hour between them [V]."""
    return _worked(duration_s, largest_v, rate_hz, rng, longest_rest_s=3600.0, p_rest=0.15)


def _worked(
    duration_s: float,
    largest_v: float,
    rate_hz: float,
    rng: np.random.Generator,
    *,
    longest_rest_s: float,
    p_rest: float,
) -> np.ndarray:
    work = Work(largest_v, rate_hz, rng)
    n = round(duration_s * rate_hz)
    jobs = (work.scan, work.steps, work.track, work.correct)
    while work.n_samples < n:
        for k in rng.permutation(len(jobs)):
            jobs[k]()
            if rng.random() < p_rest:
                work.rest(float(np.exp(rng.uniform(0.0, np.log(longest_rest_s)))))
    return work.values_v[:n]


def calibration(largest_v: float, rate_hz: float) -> np.ndarray:
    """Return what a calibration drives: triangles, then a staircase, both shrinking [V]."""
    work = Work(largest_v, rate_hz, np.random.default_rng(0))
    for share in np.linspace(1.0, 0.1, 10):
        work._line(share * largest_v, 4.0)
        work._line(-share * largest_v, 4.0)
    for share in np.linspace(1.0, 0.2, 5):
        for part in (0.5, 1.0, 0.3, -0.5, -1.0, -0.3):
            work._line(part * share * largest_v, _SAFE_SLOPE_V_PER_S)
            work._hold(1.0)
    return work.values_v
