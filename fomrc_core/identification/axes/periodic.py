"""Periodic records of several axes: spectra over the excited lines, noise from periods, records that are broken."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from fomrc_core.errors import RecordingError

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]

# Periods differ by noise, some records by twice the noise of others; those of a broken record by many times that.
_BROKEN = 4.0
_EXCITED = 1e-3  # of the strongest line: what a drive has below it is noise of the drive


@dataclass(frozen=True, eq=False)
class PeriodicRecord:
    """The mean period of one record in steady state.

    Attributes:
        name: to tell it by.
        rate_hz: sample rate [Hz].
        frequency_hz: of the lines kept [Hz], (K,).
        lines: their numbers, (K,).
        n_samples: of a period.
        voltage: spectrum of the voltages [V], (I, K), scaled so that the squares' sum is the mean square.
        displacement: spectrum of the displacements [um], (O, K).
        voltage_v: the mean period itself, (I, n_samples).
        rms_um: of each displacement without its mean [um], (O,).
        noise_um: of the mean period, from the differences of periods [um rms], (O,).
    """

    name: str
    rate_hz: float
    frequency_hz: Array
    lines: NDArray[np.int64]
    n_samples: int
    voltage: ComplexArray
    displacement: ComplexArray
    voltage_v: Array
    rms_um: Array
    noise_um: Array

    @property
    def level_v(self) -> float:
        """Root mean square of all voltages [V]."""
        return float(np.sqrt(np.mean(self.voltage_v**2)))

    @property
    def difference(self) -> float:
        """Periods' difference as a share of the displacement, mean of the outputs: noise, unless it is broken."""
        return float(np.mean(self.noise_um / self.rms_um))

    def thinned(self, n: int) -> PeriodicRecord:
        """Return the record with every n-th line, its rms what these lines have: for fits that may be coarse."""
        rms = self.rms_um / np.sqrt(n)
        kept = slice(None, None, n)
        return replace(
            self,
            frequency_hz=self.frequency_hz[kept],
            lines=self.lines[kept],
            voltage=self.voltage[:, kept],
            displacement=self.displacement[:, kept],
            rms_um=rms,
        )

    def spectrum_of(self, series: Array) -> ComplexArray:
        """Return the kept lines of series, (n, n_samples) -> (n, K)."""
        return np.asarray(np.fft.rfft(series, axis=-1)[..., self.lines] * (np.sqrt(2.0) / self.n_samples))

    def time_series(self, spectrum: ComplexArray) -> Array:
        """Return series of kept lines, (n, K) -> (n, n_samples)."""
        whole = np.zeros((*spectrum.shape[:-1], self.n_samples // 2 + 1), dtype=np.complex128)
        whole[..., self.lines] = spectrum * (self.n_samples / np.sqrt(2.0))
        return np.asarray(np.fft.irfft(whole, n=self.n_samples, axis=-1))


def excited_lines(voltage_v: Array) -> NDArray[np.int64]:
    """Return the lines a drive excites, of voltages (n_samples, I): from the first to the last strong one."""
    power = np.abs(np.fft.rfft(voltage_v, axis=0)).max(axis=1)
    power[0] = 0.0
    strong = np.flatnonzero(power > _EXCITED * power.max())
    return np.arange(strong[0], strong[-1] + 1)


def periodic_record(
    voltage_v: Array, displacement_um: Array, rate_hz: float, *, name: str, lines: NDArray[np.int64] | None = None
) -> PeriodicRecord:
    """Return the mean of a record's periods.

    Args:
        voltage_v: shape (n_samples, I, n_periods) [V].
        displacement_um: shape (n_samples, O, n_periods) [um].
        rate_hz: sample rate [Hz].
        name: to tell the record by.
        lines: which to keep; those excited if left out.

    Raises:
        RecordingError: one period only, not finite, or an axis that does not move.
    """
    if voltage_v.shape[2] < 2:
        raise RecordingError("one period only", where=name, value=voltage_v.shape[2], allowed="2 or more")
    for what, array in (("voltage", voltage_v), ("displacement", displacement_um)):
        if not np.all(np.isfinite(array)):
            raise RecordingError(f"{what} is not finite", where=name, value="nan or inf", allowed="numbers")
        spread = array.std(axis=(0, 2))
        if np.any(spread <= 1e-9 * max(float(spread.max()), 1e-300)):
            raise RecordingError(
                f"dead axis: its {what} does not change", where=f"{name}, axis {np.argmin(spread) + 1}"
            )
    u, y = voltage_v.mean(axis=2), displacement_um.mean(axis=2)
    kept = excited_lines(u) if lines is None else lines
    n, n_periods = u.shape[0], voltage_v.shape[2]
    deviation = displacement_um - displacement_um.mean(axis=0) - (y - y.mean(axis=0))[:, :, None]
    noise = np.sqrt((deviation**2).sum(axis=2).mean(axis=0) / (n_periods - 1) / n_periods)
    scale = np.sqrt(2.0) / n

    def spectrum(series: Array) -> ComplexArray:
        return np.asarray(np.fft.rfft(series, axis=0)[kept].T * scale)

    return PeriodicRecord(
        name, rate_hz, kept * (rate_hz / n), kept, n, spectrum(u), spectrum(y), u.T.copy(), y.std(axis=0), noise
    )


def broken_records(records: tuple[PeriodicRecord, ...]) -> tuple[PeriodicRecord, ...]:
    """Return the records whose periods differ by more than four times what they do in the median record."""
    usual = float(np.median([record.difference for record in records]))
    return tuple(record for record in records if record.difference > _BROKEN * usual)
