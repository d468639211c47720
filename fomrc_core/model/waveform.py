"""A voltage prepared for a whole target, and what it asks of amplifier and stage."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fomrc_core.compute.arrays import Array
from fomrc_core.errors import ParameterError
from fomrc_core.model.known_target import KnownTarget

# Of the swing that slow motion takes, where nobody says what the amplifier bears. A target below a resonance takes less
# than that; one that takes thrice goes far beyond it.
WILD = 3.0


@dataclass(frozen=True)
class WaveformLimits:
    """What an amplifier and a stage bear.

    Args:
        minimum_v: lowest voltage [V].
        maximum_v: highest voltage [V], above the lowest.
        rate_v_per_s: fastest change [V/s].

    Raises:
        ParameterError: a maximum that is not above the minimum, a rate that is not positive, NaN.
    """

    minimum_v: float = -np.inf
    maximum_v: float = np.inf
    rate_v_per_s: float = np.inf

    def __post_init__(self) -> None:
        if not self.minimum_v < self.maximum_v:
            raise ParameterError(
                "not above the lowest", where="maximum_v", value=self.maximum_v, allowed=f"above {self.minimum_v:g} V"
            )
        if not self.rate_v_per_s > 0.0:
            raise ParameterError("out of range", where="rate_v_per_s", value=self.rate_v_per_s, allowed="above 0 V/s")


@dataclass(frozen=True, eq=False)
class Waveform:
    """A voltage on even samples, what was desired, and what the model says the stage then does.

    Attributes:
        target: what was asked for, on even samples.
        voltage_v: voltage [V], straight between samples, shape (n_samples,).
        reached_um: displacement the model gives [um], shape (n_samples,); of the 14th period where periodic.
        n_first: samples at the start in which the target cannot be reached: the stage answers late.
        errors_um: error after each round of the search [um rms], shape (n_rounds,).
        slow_v: voltage that infinitely slow motion would take [V], shape (n_samples,).
        not_inverted: name and reason of what the model holds and is left as it is.
        notes: what else is to be known, in a line each.
    """

    target: KnownTarget
    voltage_v: Array
    reached_um: Array
    n_first: int
    errors_um: Array
    slow_v: Array
    not_inverted: tuple[tuple[str, str], ...]
    notes: tuple[str, ...]

    def __str__(self) -> str:
        return (
            f"{self.voltage_v.size} samples at {self.target.rate_hz:.6g} Hz: largest error by the model "
            f"{self.error_um:.3g} um ({self.error_percent:.2g} % of the range) after {self.errors_um.size} rounds"
        )

    @property
    def error_um(self) -> float:
        """Largest error by the model [um], from the moment on in which the target can be reached."""
        return float(np.max(np.abs(self.reached_um - self.target.desired_um)[self.n_first :]))

    @property
    def error_percent(self) -> float:
        """The same of the range of what was desired [%]; nan where that rests."""
        range_um = float(np.ptp(self.target.desired_um))
        return 100.0 * self.error_um / range_um if range_um > 0.0 else float("nan")

    @property
    def largest_v(self) -> float:
        """Largest voltage of either sign [V]."""
        return float(np.max(np.abs(self.voltage_v)))

    @property
    def rates_v_per_s(self) -> Array:
        """Rate of change on the way to each sample [V/s], shape (n_samples,); to the first from 0 V, or the last."""
        before = self.voltage_v[-1] if self.target.is_periodic else 0.0
        return np.diff(self.voltage_v, prepend=before) / self.target.steps_s

    @property
    def largest_rate_v_per_s(self) -> float:
        """Largest rate of change of either sign [V/s]."""
        return float(np.max(np.abs(self.rates_v_per_s)))

    def largest_current_a(self, capacitance_f: float) -> float:
        """Return the largest current of either sign [A] into a capacitance [F]."""
        return capacitance_f * self.largest_rate_v_per_s

    def require_within(self, limits: WaveformLimits) -> None:
        """Raise ParameterError that names the first sample at which a limit is broken, where one is.

        Where no voltage limit is told, a voltage far beyond what slow motion takes is refused.
        """
        has_limits = np.isfinite(limits.minimum_v) or np.isfinite(limits.maximum_v)
        low_v, high_v = float(np.min(self.slow_v)), float(np.max(self.slow_v))
        middle_v, reach_v = 0.5 * (low_v + high_v), 0.5 * WILD * (high_v - low_v)
        found = [
            (self.voltage_v < limits.minimum_v, self.voltage_v, f"{limits.minimum_v:g} V or more"),
            (self.voltage_v > limits.maximum_v, self.voltage_v, f"{limits.maximum_v:g} V or less"),
            (
                np.abs(self.rates_v_per_s) > limits.rate_v_per_s,
                self.rates_v_per_s,
                f"up to {limits.rate_v_per_s:g} V/s",
            ),
        ]
        if not has_limits and reach_v > 0.0:
            is_wild = np.abs(self.voltage_v - middle_v) > reach_v
            allowed = (
                f"{WILD:g} times the {high_v - low_v:.3g} V of slow motion, or what --max-voltage and "
                "--min-voltage tell"
            )
            found.append((is_wild, self.voltage_v, allowed))
        broken = [(int(np.argmax(is_broken)), values, text) for is_broken, values, text in found if np.any(is_broken)]
        if broken:
            k, values, text = min(broken, key=lambda one: one[0])
            unit = "V/s" if values is not self.voltage_v else "V"
            raise ParameterError(
                f"sample {k} (at {self.target.time_s[k]:.6g} s) asks for more than the limit",
                where="voltage_v" if unit == "V" else "rate of voltage_v",
                value=float(f"{values[k]:.6g}"),
                allowed=f"{text}; --bandwidth HZ asks for less",
            )

    def arrival_s(self, tolerance_um: float) -> float | None:
        """Return when the stage has come to the target's last value, by the model; None where it has not.

        Args:
            tolerance_um: how near it stays from then on [um].

        Returns:
            time after the first sample [s], of a sample.
        """
        away = np.flatnonzero(np.abs(self.reached_um - self.target.desired_um[-1]) > tolerance_um)
        if away.size == 0:
            return 0.0
        return (
            None
            if away[-1] == self.voltage_v.size - 1
            else float(self.target.time_s[away[-1] + 1] - self.target.time_s[0])
        )
