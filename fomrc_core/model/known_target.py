"""A target that is known as a whole: resampled for a converter, and limited in bandwidth without a shift in time."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline

from fomrc_core.compute.arrays import Array
from fomrc_core.effects.base.course import FLAT, GONE, Course, low_pass
from fomrc_core.errors import ParameterError
from fomrc_core.records.arguments import positive

_UNEVEN = 0.01  # of a step: times written with few digits
_N_SAMPLES_MAX = 50_000_000
_PASSES = 0.5  # of the bandwidth: up to here a target is left as it is


@dataclass(frozen=True, eq=False)
class KnownTarget:
    """Even samples of a target.

    Attributes:
        time_s: time of each sample [s], shape (n_samples,).
        step_s: their distance [s].
        desired_um: what is desired of the stage [um], shape (n_samples,).
        is_periodic: whether the sample after the last is the first.
        taken_off_um: largest departure from what was asked for, by the bandwidth [um].
    """

    time_s: Array
    step_s: float
    desired_um: Array
    is_periodic: bool = False
    taken_off_um: float = 0.0

    @property
    def rate_hz(self) -> float:
        """Sample rate [Hz]."""
        return 1.0 / self.step_s

    @property
    def steps_s(self) -> Array:
        """Step that leads to each sample [s], shape (n_samples,); equal where times are so but for rounding."""
        steps_s = np.diff(self.time_s, prepend=self.time_s[0] - self.step_s)
        is_even = float(np.max(np.abs(steps_s - self.step_s))) <= _UNEVEN * self.step_s
        return np.full(steps_s.size, self.step_s) if is_even else steps_s

    @property
    def rests_at_seam(self) -> bool:
        """Whether the last sample repeats the first while the target moves: a period with one too many."""
        values = self.desired_um
        moves = values.size > 2 and values[1] != values[0] and values[-2] != values[-1]
        return bool(self.is_periodic and moves and values[-1] == values[0])

    def limited(self, bandwidth_hz: float) -> KnownTarget:
        """Return the target less what is above a bandwidth: whole up to half of it, nothing above, no shift in time.

        Args:
            bandwidth_hz: above 0, at most a fifth of the sample rate [Hz].

        Raises:
            ParameterError: it is not.
        """
        at_most = FLAT * self.rate_hz
        band_hz = positive("bandwidth_hz", bandwidth_hz, f"Hz, {FLAT:g} of the sample rate", at_most=at_most)
        return self._limited(_PASSES * band_hz, band_hz)

    def resampled(self, rate_hz: float) -> KnownTarget:
        """Return the target at another rate, by cubic splines; what the new rate does not hold is left out.

        Of a periodic target the rate is that nearest one of which the period has a whole number of samples.

        Raises:
            ParameterError: a rate that is not positive, or one of more than 50 million samples.
        """
        n_old = self.desired_um.size
        span_s = self.step_s * (n_old if self.is_periodic else n_old - 1)
        at_most = _N_SAMPLES_MAX / span_s
        rate_hz = positive("rate_hz", rate_hz, "Hz", at_least=2.0 / span_s, at_most=at_most)
        coarse = rate_hz < self.rate_hz
        source = self._limited(FLAT * rate_hz, GONE * rate_hz) if coarse else self
        knots_s = self.step_s * np.arange(n_old)
        if self.is_periodic:
            n_new = round(span_s * rate_hz)
            step_s = span_s / n_new
            closed_um = np.append(source.desired_um, source.desired_um[0])
            spline = CubicSpline(np.append(knots_s, span_s), closed_um, bc_type="periodic")
        else:
            n_new = int(np.floor(span_s * rate_hz * (1.0 + 1e-12))) + 1
            step_s = 1.0 / rate_hz
            spline = CubicSpline(knots_s, source.desired_um)
        since_s = step_s * np.arange(n_new)
        values = np.ascontiguousarray(spline(since_s), dtype=np.float64)
        return KnownTarget(self.time_s[0] + since_s, step_s, values, self.is_periodic, source.taken_off_um)

    def _limited(self, flat_hz: float, gone_hz: float) -> KnownTarget:
        course = Course(self.desired_um.size, self.step_s, self.is_periodic)
        values = course.filtered(self.desired_um, lambda f: low_pass(f, flat_hz, gone_hz).astype(np.complex128))
        off_um = max(float(np.max(np.abs(values - self.desired_um))), self.taken_off_um)
        return KnownTarget(self.time_s, self.step_s, values, self.is_periodic, off_um)


def known_target(
    time_s: Array,
    desired_um: Array,
    *,
    rate_hz: float | None = None,
    bandwidth_hz: float | None = None,
    is_periodic: bool = False,
) -> KnownTarget:
    """Return a target on even samples.

    Args:
        time_s: times [s], rising, shape (n_samples,), 2 or more; need not be even where a rate is given.
        desired_um: desired displacement [um], shape (n_samples,).
        rate_hz: rate it is wanted at [Hz]; None as it is.
        bandwidth_hz: what is asked of the stage at most [Hz]; None for all that samples hold.
        is_periodic: whether the samples are one period, the one after the last being the first.

    Raises:
        ParameterError: uneven samples without a rate, or in a period; a rate or bandwidth out of range.
    """
    steps_s = np.diff(time_s)
    step_s = float(np.mean(steps_s))
    off = np.abs(steps_s - step_s)
    if np.max(off) > _UNEVEN * step_s:
        k = int(np.argmax(off))
        allowed = f"{step_s:.6g} s, or --rate HZ to have it resampled"
        if is_periodic:
            allowed = f"{step_s:.6g} s in a period of a scan"
        if rate_hz is None or is_periodic:
            raise ParameterError(
                f"samples are not evenly spaced: after sample {k}",
                where="time_s",
                value=float(f"{steps_s[k]:.6g}"),
                allowed=allowed,
            )
        step_s = float(np.min(steps_s))
        even_s = np.arange(time_s[0], time_s[-1] + 0.5 * step_s, step_s)
        desired_um = np.ascontiguousarray(CubicSpline(time_s, desired_um)(np.minimum(even_s, time_s[-1])))
        time_s = even_s
    target = KnownTarget(time_s, step_s, np.ascontiguousarray(desired_um, dtype=np.float64), is_periodic)
    if rate_hz is not None and rate_hz != target.rate_hz:
        target = target.resampled(rate_hz)
    return target if bandwidth_hz is None else target.limited(bandwidth_hz)
