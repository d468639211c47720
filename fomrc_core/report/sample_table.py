"""The samples a page shows: few enough to be light, the extremes of every stretch among them, and their spectra."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fomrc_core.compute.arrays import Array
from fomrc_core.report.residual_views import amplitude_density, extreme_samples, loop_phase_deg, rate_v_per_s

_N_SHOWN_MAX = 8000  # samples of all records together: what a telephone still draws at once
_N_STRETCHES, _N_IN_STRETCH_MIN = 16, 256
_N_FREQUENCIES = 160
_N_RECORDS_MAX = 20


@dataclass(frozen=True, eq=False)
class SampledRecord:
    """What is known of every sample of one record.

    Attributes:
        name: of the record.
        time_s: time [s].
        voltage_v: drive [V].
        displacement_um: displacement [um]; None where there is none.
        curves_um: what is looked at, by name: residuals, displacements [um].
        is_shown: samples worth showing; None for all.
        beside_um: further columns by name [um], which are never scaled and have no spectrum.
    """

    name: str
    time_s: Array
    voltage_v: Array
    displacement_um: Array | None
    curves_um: Mapping[str, Array]
    is_shown: NDArray[np.bool_] | None = None
    beside_um: Mapping[str, Array] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class SampleTable:
    """Samples of all records in columns of one length, with the spectra of the stretches they lie in.

    Attributes:
        columns: by name, shape (n_shown,): time, voltage, rate, displacement, phase, each curve, record, stretch.
        names: of the records, in the order of their numbers.
        spectra: per record the frequencies and, per curve, the power density of each stretch.
        n_samples: how many samples there are.
    """

    columns: Mapping[str, Array]
    names: tuple[str, ...]
    spectra: tuple[Mapping[str, Any], ...]
    n_samples: int

    @property
    def n_shown(self) -> int:
        """Number of samples in the columns."""
        return int(self.columns["time"].size)

    @property
    def thinning(self) -> str:
        """What was left out, in a sentence."""
        if self.n_shown == self.n_samples:
            return f"All {self.n_samples} samples are shown."
        return (
            f"Of {self.n_samples} samples {self.n_shown} are shown: the least and greatest of every curve in many "
            "short stretches of time, so that no extreme is lost. Spectra and numbers are of all samples."
        )


def sample_table(records: Sequence[SampledRecord], scale: float = 1.0) -> SampleTable:
    """Return the samples to be shown of some records, those beyond the first 20 left out.

    Args:
        records: one or more, all with the same curves.
        scale: factor of the curves, such as 1e3 from um to nm.
    """
    shown = records[:_N_RECORDS_MAX]
    sizes = [record.time_s.size for record in shown]
    parts: list[dict[str, Array]] = []
    spectra = []
    for index, record in enumerate(shown):
        n_points = max(200, _N_SHOWN_MAX * record.time_s.size // sum(sizes))
        columns, spectrum = _of_record(record, n_points, scale)
        columns["record"] = np.full(columns["time"].size, float(index))
        parts.append(columns)
        spectra.append(spectrum)
    merged = {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}
    n_samples = sum(r.time_s.size if r.is_shown is None else int(np.count_nonzero(r.is_shown)) for r in shown)
    return SampleTable(merged, tuple(record.name for record in shown), tuple(spectra), n_samples)


def _of_record(record: SampledRecord, n_points: int, scale: float) -> tuple[dict[str, Array], dict[str, Any]]:
    n = record.time_s.size
    shown = np.ones(n, dtype=np.bool_) if record.is_shown is None else record.is_shown
    places = np.flatnonzero(shown)
    if places.size == 0:
        places = np.arange(n)
    curves = {name: scale * values for name, values in record.curves_um.items()}
    kept = places[extreme_samples([values[places] for values in curves.values()], n_points)]
    n_stretches = int(np.clip(n // _N_IN_STRETCH_MIN, 1, _N_STRETCHES))
    n_each = n // n_stretches
    columns = {
        "time": record.time_s[kept],
        "voltage": record.voltage_v[kept],
        "rate": rate_v_per_s(record.time_s, record.voltage_v)[kept],
        "displacement": np.full(kept.size, np.nan) if record.displacement_um is None else record.displacement_um[kept],
        "phase": loop_phase_deg(record.voltage_v)[kept],
        "stretch": np.minimum(kept // n_each, n_stretches - 1).astype(np.float64),
    }
    columns |= {name: values[kept] for name, values in (*curves.items(), *record.beside_um.items())}
    spectrum: dict[str, Any] = {"frequency": [], "power": {name: [] for name in curves}}
    if n_each < 4:
        return columns, spectrum
    for k in range(n_stretches):
        part = slice(k * n_each, (k + 1) * n_each)
        for name, values in curves.items():
            frequency_hz, density = amplitude_density(record.time_s[part], values[part])
            places_hz, power = _in_bands(frequency_hz, density**2)
            spectrum["frequency"] = spectrum["frequency"] or [float(f"{f:.5g}") for f in places_hz]
            if places_hz.size != len(spectrum["frequency"]):  # of unequal steps: stretches differ in their rate
                power = np.interp(spectrum["frequency"], places_hz, power)
            spectrum["power"][name].append([float(f"{p:.4g}") for p in power])
    return columns, spectrum


def _in_bands(frequency_hz: Array, power: Array) -> tuple[Array, Array]:
    """Return frequencies and power in bands of equal ratio, those between two lines left out."""
    if frequency_hz.size <= _N_FREQUENCIES:
        return frequency_hz, power
    edges = np.geomspace(frequency_hz[0], frequency_hz[-1] * (1.0 + 1e-9), _N_FREQUENCIES + 1)
    band = np.clip(np.searchsorted(edges, frequency_hz, side="right") - 1, 0, _N_FREQUENCIES - 1)
    counts = np.bincount(band, minlength=_N_FREQUENCIES)
    there = counts > 0
    sums = [np.bincount(band, values, _N_FREQUENCIES)[there] for values in (frequency_hz, power)]
    return sums[0] / counts[there], sums[1] / counts[there]
