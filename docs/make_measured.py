"""Diagnose every measured recording there is, and write docs/measured.md: python docs/make_measured.py.

The recordings are those of others; FOMRC_DATA names their folder (docs/explanation/scope.md says where they come from).
"""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
from numpy.typing import NDArray

from fomrc_core.diagnosis.diagnosis import Diagnosis, diagnose
from fomrc_core.records.recording import Recording
from fomrc_core.storage import read_recording

Array = NDArray[np.float64]

_DOCS = Path(__file__).resolve().parent
_FIGURE = _DOCS / "figures" / "measured.png"
_DATA = Path(os.environ.get("FOMRC_DATA", _DOCS.parents[1] / "shared" / "data"))
_MIRROR_RATE_HZ, _SLOW_HZ, _SLOW_RATE_HZ = 6400.0, 60.0, 400.0
_UM_PER_M = 1e6


@dataclass(frozen=True)
class Measured:
    """One measured case: records to learn from, to accept on and to report on, and what is known of them."""

    name: str
    train: tuple[Recording, ...]
    test: Recording
    report: Recording | None
    published: str


def stack() -> Measured:
    """Return the measured stack: a fit to one drive, judged on another."""
    columns = {"voltage": 0, "displacement": 4}
    train, test = (
        read_recording(_DATA / "pea_1hz" / name, columns=columns, rate_hz=200.0)
        for name in ("model.dat", "test_first_25s.dat")
    )
    published = "the authors' operator of 50 parameters, run on these files: 0.70 um rms, 1.56 % of the range"
    return Measured("pea_1hz, a stack at 1 Hz", (train,), test.window(0.5, np.inf), None, published)


def mirror(axis: int, level_mv: int) -> Measured:
    """Return one axis of the measured mirror below its resonances, what the other two move of it taken out.

    Their part is linear to a few percent: the frequency response of all inputs, line by line, from all realisations.
    Its records are periodic, so that a band of them is cut out exactly, without a filter's start.
    """
    u, y = (np.load(_DATA / "fsm" / f"{kind}_{level_mv}mV_train.npy") for kind in "uy")
    inputs, outputs = (np.fft.rfft(np.mean(values, axis=3), axis=0) for values in (u, y))
    transposed = np.conj(np.swapaxes(inputs, 1, 2))
    response = outputs @ transposed @ np.linalg.pinv(inputs @ transposed)
    response[:, :, axis] = 0.0
    others = np.fft.irfft(response @ inputs, u.shape[0], axis=0)[:, axis, :]
    own = y[:, axis] - others[:, :, None]
    records = []
    for realisation in range(4):
        drive = slow_band(u[:, axis, realisation, :])
        moved = slow_band(own[:, realisation, :]) * _UM_PER_M
        moved *= np.sign(np.sum(drive * moved))  # counted the way its own voltage moves it
        time_s = np.arange(drive.size) / _SLOW_RATE_HZ
        name = f"axis {axis + 1}, {level_mv} mV, realisation {realisation + 1}"
        records.append(Recording(time_s, drive, moved, name=name))
    published = "no one-axis figure; the best published model of all axes and frequencies leaves 4.2 % to 6.4 %"
    name = f"fsm, axis {axis + 1} of the mirror below {_SLOW_HZ:.0f} Hz, {level_mv} mV"
    return Measured(name, tuple(records[:2]), records[2], records[3], published)


def slow_band(periods: Array) -> Array:
    """Return what lies below the slow band's edge, the periods one after the other, at the lower rate.

    Args:
        periods: shape (n_samples, n_periods), one period each.
    """
    whole = periods.T.ravel()
    n_slow = round(whole.size * _SLOW_RATE_HZ / _MIRROR_RATE_HZ)
    spectrum = np.fft.rfft(whole)
    spectrum[np.fft.rfftfreq(whole.size, 1.0 / _MIRROR_RATE_HZ) > _SLOW_HZ] = 0.0
    return np.fft.irfft(spectrum[: n_slow // 2 + 1], n_slow) * (n_slow / whole.size)


def cases() -> Iterator[Measured]:
    """Yield the measured cases."""
    yield stack()
    for axis in range(3):
        yield mirror(axis, 300)


def row(case: Measured, found: Diagnosis) -> str:
    """Return the row of the table."""
    names = "; ".join(f"`{f.cause}` ({100.0 * f.probability:.0f} %)" for f in found.findings) or "none"
    quoted = next(view for view in found.records if view.name == found.quoted_on)
    swing_nm = 10.0 * float(np.ptp(quoted.measured_um[quoted.is_scored]))
    before, after = found.baseline_test_percent * swing_nm, found.final_test_percent * swing_nm
    left = f"{after / (1e3 * found.noise_floor_um):.1f}"
    gain = f"{before:.3g} -> {after:.3g} nm ({found.final_test_percent:.3g} %)"
    return f"| {case.name} | {found.status.value} | {names} | {gain} | {1e3 * found.noise_floor_um:.3g} nm | {left} |"


def section(case: Measured, found: Diagnosis) -> list[str]:
    """Return what the diagnosis printed, and what is published."""
    return [f"## {case.name}", "", "```text", *str(found).splitlines(), "```", "", f"Published: {case.published}.", ""]


def draw(answers: list[tuple[Measured, Diagnosis]]) -> None:
    """Draw what is left of each case's quoted record, before and after."""
    figure, axes = plt.subplots(len(answers), 1, figsize=(8.0, 2.0 * len(answers)), layout="constrained")
    for axis, (case, found) in zip(axes, answers, strict=True):
        view = next(view for view in found.records if view.name == found.quoted_on)
        axis.plot(view.time_s, 1e3 * view.residual_before_um, lw=0.7, label="hysteresis and creep", color="C1")
        axis.plot(view.time_s, 1e3 * view.residual_after_um, lw=0.7, label="with what was found", color="C0")
        axis.set_title(f"{case.name}: {found.status.value}", fontsize=9, loc="left")
        axis.set_ylabel("residual [nm]")
        axis.margins(x=0.0)
        # a start that depends on what came before the record would hide the rest
        shown_nm = 1e3 * view.residual_before_um[view.is_scored]
        low_nm, high_nm = np.percentile(shown_nm, (0.5, 99.5))
        axis.set_ylim(low_nm - 0.2 * (high_nm - low_nm), high_nm + 0.2 * (high_nm - low_nm))
    axes[0].legend(loc="upper right", fontsize=8, ncols=2)
    axes[-1].set_xlabel("time [s]")
    figure.savefig(_FIGURE, dpi=110)


def main() -> None:
    """Diagnose all of them and write the page and its figure."""
    if not _DATA.is_dir():
        sys.exit(f"{_DATA}: no measured data there (allowed: a folder with pea_1hz and fsm, named by FOMRC_DATA)")
    answers = []
    for case in cases():
        print(case.name, file=sys.stderr)
        answers.append((case, diagnose(case.train, test=case.test, report=case.report)))
    draw(answers)
    lines = [
        "# Measured recordings: what a simulation of them gets wrong",
        "",
        "Made by `python docs/make_measured.py`. Everything here was measured by others; what was published on it",
        "stands beside. Accepted on a second record, quoted on a third where there is one. Noise is what repeats and",
        "rests show, or what follows from nothing the drive did.",
        "",
        "| recording | status | named (probability) | left before and after | noise | times the noise |",
        "|---|---|---|---|---|---|",
        *(row(case, found) for case, found in answers),
        "",
        "![What is left of each recording, before and after its diagnosis](figures/measured.png)",
        "",
        *(line for case, found in answers for line in section(case, found)),
    ]
    (_DOCS / "measured.md").write_text("\n".join(lines).rstrip() + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
