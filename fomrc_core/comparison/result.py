"""What a comparison of models says: a row for each model, and the rows as a table."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, fields
from typing import Any


@dataclass(frozen=True)
class InverseQuality:
    """How the inverse of a rival behaves on the held-out record.

    Attributes:
        round_trip_percent: rms of voltage(displacement(voltage)) less voltage, of the voltage range [%].
        noise_gain: rms of the voltage it makes of 1 nm noise, over the voltage that moves 1 nm [1].
        is_stable: finite, round trip within 1 %, noise gain below 100.
    """

    round_trip_percent: float
    noise_gain: float
    is_stable: bool


@dataclass(frozen=True)
class Row:
    """One rival's result.

    Attributes:
        name: of the rival.
        publication: where it comes from.
        amplifier_cutoff_hz: of the amplifier_bandwidth effect given to it; nan without.
        n_parameters: parameters fitted.
        train_rms_um: error on the training data [um].
        test_rms_um: error on the held-out data [um].
        test_nrmse_percent: the same of the measured range [%].
        time_per_sample_us: of a simulation, batch [us].
        fit_s: time of the fit [s].
        inverse: quality of the inverse; None where there is none.
        failure: why there is no result; empty where there is one.
    """

    name: str
    publication: str
    amplifier_cutoff_hz: float
    n_parameters: int
    train_rms_um: float
    test_rms_um: float
    test_nrmse_percent: float
    time_per_sample_us: float
    fit_s: float
    inverse: InverseQuality | None
    failure: str = ""

    def to_mapping(self) -> dict[str, Any]:
        """Return everything as plain numbers and strings, with None for what does not exist."""
        values = asdict(self)
        inverse = values.pop("inverse")
        return _without_nan(values) | {"inverse": None if inverse is None else _without_nan(inverse)}

    @classmethod
    def from_mapping(cls, mapping: Mapping[str, Any]) -> Row:
        """Return the row of ``to_mapping``; raises KeyError or TypeError for what is none."""
        inverse = mapping["inverse"]
        values = _with_nan({f.name: mapping[f.name] for f in fields(cls) if f.name != "inverse"})
        return cls(**values, inverse=None if inverse is None else InverseQuality(**_with_nan(inverse)))


def _without_nan(values: Mapping[str, Any]) -> dict[str, Any]:
    return {k: None if isinstance(v, float) and not math.isfinite(v) else v for k, v in values.items()}


def _with_nan(values: Mapping[str, Any]) -> dict[str, Any]:
    return {k: math.nan if v is None else v for k, v in values.items()}


@dataclass(frozen=True)
class Comparison:
    """All rows, the best on held-out data first.

    Attributes:
        rows: one per rival, with and without the amplifier effect.
        train_names: names of the training records.
        test_name: name of the held-out record.
        test_range_um: measured range of the held-out record [um].
    """

    rows: tuple[Row, ...]
    train_names: tuple[str, ...]
    test_name: str
    test_range_um: float

    def __str__(self) -> str:
        return self.table()

    def table(self) -> str:
        """Return the rows as a Markdown table."""
        lines = [
            "| model | amplifier | held-out rms [nm] | NRMSE [%] | training rms [nm] "
            "| parameters | us/sample | fit [s] | inverse |",
            "|---|---|---:|---:|---:|---:|---:|---:|---|",
        ]
        for row in self.rows:
            if row.failure:
                lines.append(f"| {row.name} | | | | | | | | failed: {row.failure} |")
                continue
            amplifier = "-" if math.isnan(row.amplifier_cutoff_hz) else f"{row.amplifier_cutoff_hz:.2f} Hz"
            lines.append(
                f"| {row.name} | {amplifier} | {1e3 * row.test_rms_um:.3g} | {row.test_nrmse_percent:.3f} "
                f"| {1e3 * row.train_rms_um:.3g} | {row.n_parameters} | {row.time_per_sample_us:.2g} "
                f"| {row.fit_s:.2g} | {_inverse_words(row.inverse)} |"
            )
        return "\n".join(lines)

    def to_mapping(self) -> dict[str, object]:
        """Return everything as plain numbers, with None for what does not exist."""
        return _without_nan(asdict(self)) | {"rows": [row.to_mapping() for row in self.rows]}


def _inverse_words(inverse: InverseQuality | None) -> str:
    if inverse is None:
        return "none"
    word = "stable" if inverse.is_stable else "not stable"
    return f"{word}, round trip {inverse.round_trip_percent:.2g} %, noise x{inverse.noise_gain:.2g}"
