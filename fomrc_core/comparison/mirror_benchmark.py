"""The benchmark of a measured mirror: train on its training sets, score on records held out, or on its test sets.

Data: CubeSpec fine steering mirror, (c) 2025 Merijn Floren, KU Leuven, CC BY 4.0; Floren et al., ISMA-USD 2024,
2042-2052. The published rows: Zenodo 10.5281/zenodo.19591136.
"""

from __future__ import annotations

import re
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from fomrc_core.compute.pulse import beat
from fomrc_core.errors import StorageError
from fomrc_core.identification.axes import AxesIdentification, AxesOptions, identify_axes, periodic_record
from fomrc_core.model.axes import AxesModel

Array = NDArray[np.float64]
Progress = Callable[[float, str], None]

RATE_HZ = 6400.0
N_LEARNT = 5  # realisations of each level to learn from and to choose on; those after are reported
_UNSCORED_S = 0.1  # of a record simulated from rest
_UM_PER_M = 1e6
_NAME = re.compile(r"u_(\d+)mV_(train|test)\.npy$")

# Per-level error on the test sets at 100, 200 and 300 mV [%], number of parameters.
PUBLISHED = (
    ("neural NL-LFR, 28 states, all levels (published)", 7473, (6.37, 4.84, 4.19)),
    ("linear, 28 states, one for each level (published)", None, (8.38, 7.95, 5.63)),
    ("modes, plays and a level schedule (earlier prototype)", 439, (4.98, 3.71, 3.90)),
)


@dataclass(frozen=True, eq=False)
class MirrorSet:
    """Records of one level: voltages [V] and displacements [um], (n_samples, 3, n_realisations, n_periods)."""

    level_mv: int
    voltage_v: Array
    displacement_um: Array


@dataclass(frozen=True, eq=False)
class MirrorScore:
    """Errors of one level in percent: of the steady state with the level told, and causal from rest."""

    level_mv: int
    told: float
    causal: float
    is_test: bool
    is_learnt: bool

    def __str__(self) -> str:
        which = "test set" if self.is_test else "held-out realisation"
        note = "" if self.is_learnt else ", level not learnt from"
        return f"{self.level_mv} mV, {which}: {self.told:.2f} % (causal from rest: {self.causal:.2f} %{note})"


@dataclass(frozen=True, eq=False)
class MirrorBenchmark:
    """What the benchmark found.

    Attributes:
        identification: the model.
        scores: one for each level.
        training_s: time it took [s].
        us_per_sample: time of a simulated sample [us].
        spectra: by level, amplitudes [um] of displacement, error and noise of the first record scored.
    """

    identification: AxesIdentification
    scores: tuple[MirrorScore, ...]
    training_s: float
    us_per_sample: float
    spectra: dict[int, tuple[Array, Array, Array]]

    def __str__(self) -> str:
        found = self.identification
        lines = []
        if found.broken:
            lines.append("left out, their periods disagree: " + ", ".join(found.broken))
        n_modes = found.model.modes.n_modes if found.model.modes else 0
        lines.append(
            f"{found.n_parameters} parameters, {n_modes} modes; trained in {self.training_s:.0f} s; "
            f"{self.us_per_sample:.2f} us a simulated sample"
        )
        return "\n".join([*lines, *map(str, self.scores)])


def read_sets(folder: Path, kind: str) -> tuple[MirrorSet, ...]:
    """Read all levels' ``u_<level>mV_<kind>.npy`` and ``y_...`` of a folder.

    Raises:
        StorageError: a file missing, of another shape than the others, or not of finite numbers.
    """
    if not folder.is_dir():
        raise StorageError("no such folder", where=str(folder))
    levels = sorted(int(m[1]) for path in folder.iterdir() if (m := _NAME.match(path.name)) and m[2] == kind)
    if not levels:
        raise StorageError(f"no {kind} sets", where=str(folder), allowed=f"u_100mV_{kind}.npy and so on")
    sets: list[MirrorSet] = []
    for level in levels:
        u, y = (_array(folder / f"{quantity}_{level}mV_{kind}.npy") for quantity in "uy")
        if u.shape != y.shape:
            where = str(folder / f"y_{level}mV_{kind}.npy")
            raise StorageError(
                "shape differs from that of its voltages", where=where, value=y.shape, allowed=str(u.shape)
            )
        if sets and u.shape[:2] != sets[0].voltage_v.shape[:2]:
            where = str(folder / f"u_{level}mV_{kind}.npy")
            allowed = f"{sets[0].voltage_v.shape[:2]} and any realisations and periods"
            raise StorageError(
                "shape differs from that of the other levels", where=where, value=u.shape, allowed=allowed
            )
        sets.append(MirrorSet(level, u, y * _UM_PER_M))
    return tuple(sets)


def _array(path: Path) -> Array:
    try:
        found = np.load(path, allow_pickle=False)
    except FileNotFoundError:
        raise StorageError("file is missing", where=str(path)) from None
    except (OSError, ValueError, EOFError) as error:
        raise StorageError(f"not a readable npy file ({error})", where=str(path)) from None
    if not isinstance(found, np.ndarray) or found.ndim != 4 or min(found.shape) < 1:
        shape = getattr(found, "shape", None)
        allowed = "(samples, axes, realisations, periods)"
        raise StorageError("not four-dimensional", where=str(path), value=shape, allowed=allowed)
    if found.dtype.kind not in "fiu" or not np.all(np.isfinite(found)):
        raise StorageError("not finite numbers", where=str(path), value=str(found.dtype), allowed="finite real numbers")
    return np.asarray(found, dtype=np.float64)


def _heard(score: Callable[..., float], model: AxesModel, pair: tuple[Array, Array]) -> float:
    beat("scores")
    return score(model, *pair)


def score_steady(model: AxesModel, voltage_v: Array, displacement_um: Array) -> float:
    """Return the mean relative error [1] of one record's periods, after a run-in of one period, level told.

    Args:
        model: to simulate.
        voltage_v: (n_samples, n_inputs, n_periods) [V].
        displacement_um: (n_samples, n_outputs, n_periods) [um].
    """
    return _relative_error(steady_state(model, voltage_v)[:, :, None], displacement_um)


def steady_state(model: AxesModel, voltage_v: Array) -> Array:
    """Return the displacement of the mean period after a run-in of one period, (n_samples, n_outputs) [um]."""
    drive = voltage_v.mean(axis=2)
    n = drive.shape[0]
    state = model.initial_state(float(np.sqrt(np.mean(drive**2))))
    return model.simulate(np.full(2 * n, 1.0 / RATE_HZ), np.tile(drive, (2, 1)), state)[n:]


def score_causal(model: AxesModel, voltage_v: Array, displacement_um: Array) -> float:
    """Return the same for all periods in a row, from rest, the level found by the model; 0.1 s not scored."""
    drive = np.concatenate(list(np.moveaxis(voltage_v, 2, 0)))
    moved = np.concatenate(list(np.moveaxis(displacement_um, 2, 0)))
    simulated = model.simulate(np.full(len(drive), 1.0 / RATE_HZ), drive)
    first = int(_UNSCORED_S * RATE_HZ)
    return _relative_error(simulated[first:, :, None], moved[first:, :, None])


def _relative_error(simulated: Array, measured: Array) -> float:
    # Sensors have no zero of their own: what stands still is no error, as it is no displacement.
    return float(np.mean((measured - simulated).std(axis=0) / measured.std(axis=0)))


def run_benchmark(
    train: Path,
    test: Path | None,
    progress: Progress,
    *,
    levels_mv: tuple[int, ...] = (),
    options: AxesOptions | None = None,
) -> MirrorBenchmark:
    """Train on the training sets and score.

    Args:
        train: folder of the training sets.
        test: folder of the test sets; the realisations after the fifth of the training sets if left out.
        progress: told share and text.
        levels_mv: train on these levels only; all if left out.
        options: of the identification.

    Raises:
        StorageError: files that are missing or do not fit.
        RecordingError: records that cannot be learnt from.
    """
    sets = read_sets(train, "train")
    tests = read_sets(test, "test") if test is not None else ()
    learnt = [s for s in sets if not levels_mv or s.level_mv in levels_mv]
    if len(learnt) < max(len(levels_mv), 1):
        raise StorageError("no such level", where=str(train), value=levels_mv, allowed=str([s.level_mv for s in sets]))
    for other in tests:
        if other.voltage_v.shape[1] != sets[0].voltage_v.shape[1]:
            where = f"{test}, {other.level_mv} mV"
            raise StorageError("axes differ from the training sets'", where=where, value=other.voltage_v.shape)
    lines = None
    records = []
    for one in learnt:
        for r in range(min(N_LEARNT, one.voltage_v.shape[2])):
            name = f"{one.level_mv} mV realisation {r}"
            u, y = one.voltage_v[:, :, r], one.displacement_um[:, :, r]
            records.append(periodic_record(u, y, RATE_HZ, name=name, lines=lines))
            lines = records[-1].lines
    started = time.perf_counter()
    found = identify_axes(tuple(records), options, progress)
    training_s = time.perf_counter() - started
    scores, spectra = [], {}
    for one in tests or sets:
        chosen = range(one.voltage_v.shape[2]) if tests else range(N_LEARNT, one.voltage_v.shape[2])
        pairs = [(one.voltage_v[:, :, r], one.displacement_um[:, :, r]) for r in chosen]
        if not pairs:
            raise StorageError("no realisation to report", where=f"{train}, {one.level_mv} mV", allowed="6 or more")
        told, causal = (
            100.0 * float(np.mean([_heard(score, found.model, pair) for pair in pairs]))
            for score in (score_steady, score_causal)
        )
        spectra[one.level_mv] = _amplitudes(found.model, *pairs[0])
        is_learnt = one.level_mv in [other.level_mv for other in learnt]
        scores.append(MirrorScore(one.level_mv, told, causal, bool(tests), is_learnt))
    drive = np.ascontiguousarray(sets[0].voltage_v[:, :, 0, 0])
    return MirrorBenchmark(found, tuple(scores), training_s, _us_per_sample(found.model, drive), spectra)


def _amplitudes(model: AxesModel, voltage_v: Array, displacement_um: Array) -> tuple[Array, Array, Array]:
    """Return amplitudes [um] of displacement, error and noise of the mean period, each (n_lines, n_outputs)."""
    moved = displacement_um.mean(axis=2)
    noise = (displacement_um[:, :, 0] - displacement_um[:, :, -1]) / 2.0
    error = moved - steady_state(model, voltage_v)
    scale = np.sqrt(2.0) / len(moved)
    found = [np.abs(np.fft.rfft(values - values.mean(axis=0), axis=0)) * scale for values in (moved, error, noise)]
    return found[0], found[1], found[2]


def _us_per_sample(model: AxesModel, drive: Array) -> float:
    steps = np.full(len(drive), 1.0 / RATE_HZ)
    times = []
    for _ in range(7):
        started = time.perf_counter()
        model.simulate(steps, drive)
        times.append(time.perf_counter() - started)
    return 1e6 * min(times) / len(drive)


def page(benchmark: MirrorBenchmark) -> str:
    """Return the page: what is published beside ours, in Markdown."""
    found = benchmark.identification
    levels = [score.level_mv for score in benchmark.scores]
    which = "test sets" if benchmark.scores[0].is_test else "realisation 5 of the training sets, held out"
    lines = [
        "# The mirror benchmark",
        "",
        "CubeSpec fine steering mirror, (c) 2025 Merijn Floren, KU Leuven, CC BY 4.0. Error in time over the "
        f"displacement without its mean; ours on the {which}, the others on the test sets.",
        "",
        "| model | parameters | " + " | ".join(f"{level} mV" for level in levels) + " |",
        "|---|---|" + "---|" * len(levels),
    ]
    for name, count, errors in PUBLISHED:
        by_level = dict(zip((100, 200, 300), errors, strict=True))
        cells = " | ".join(f"{by_level[level]:.2f} %" if level in by_level else "-" for level in levels)
        lines.append(f"| {name} | {count or '-'} | {cells} |")
    for kind, label in (("told", "steady state, level told"), ("causal", "causal, from rest")):
        cells = " | ".join(f"**{getattr(score, kind):.2f} %**" for score in benchmark.scores)
        lines.append(f"| this library, {label} | {found.n_parameters} | {cells} |")
    lines += [
        "",
        f"Trained in {benchmark.training_s:.0f} s, {benchmark.us_per_sample:.2f} us a simulated sample. Left out, "
        f"because their periods disagree: {', '.join(found.broken) or 'none'}.",
        "",
        "```",
        str(found),
        "```",
        "",
    ]
    return "\n".join(lines)
