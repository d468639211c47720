"""A case of the second world: an actuator with effects hidden in it, three records of it, and the key.

draw(seed, ("backlash",), noise="flicker") -> SecondCase
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from test.hidden.second.actuator import Circumstance, Effects
from test.hidden.second.bench import PARTS, draw_bench
from test.hidden.second.coarse_model import CoarseModel
from test.hidden.second.data_faults import FAULT_KINDS, DataFault, apply_fault, draw_fault
from test.hidden.second.hidden_causes import DRAWS, MISSING
from test.hidden.second.hysteresis_forms import REPRESENTABLE
from test.hidden.second.rivals import Rival, nearest_rival
from test.hidden.second.scale import Scale, chance
from test.hidden.second.sensor_noise import NOISE_KINDS, draw_noise
from test.hidden.second.sizing import Sized, Sizing
from test.hidden.second.surrogate import Trace

# A short record seldom shows what rings slowly; a seed comes to the same bench however many may follow.
_N_ATTEMPTS = 60
_DEFAULT_LENGTH = (2000, 20_000)


@dataclass(frozen=True, eq=False)
class Record:
    """One record as a file would hold it, arrays of shape (n_samples,).

    Args:
        name: "train", "test" or "report".
        time_s: time from the start [s].
        voltage_v: commanded voltage [V].
        measured_um: what the sensor read [um].
        temperature_c: of the room [degC], where it was recorded.
        cross_voltage_v: of the second axis [V], where it was recorded.
        cross_displacement_um: of the second axis [um], where it was recorded.
        clean_um: what a sensor without noise and faults would have read [um]; part of the key.
        faults: what went wrong between sensor and file; part of the key.
    """

    name: str
    time_s: np.ndarray
    voltage_v: np.ndarray
    measured_um: np.ndarray
    temperature_c: np.ndarray | None
    cross_voltage_v: np.ndarray | None
    cross_displacement_um: np.ndarray | None
    clean_um: np.ndarray = field(repr=False)
    faults: tuple[DataFault, ...]


@dataclass(frozen=True, eq=False)
class SecondCase:
    """Three records and the key to them.

    Args:
        train, test, report: the records; other kinds of drive, and mostly other rates, in each.
        causes: what is hidden, in no order.
        parameters: true parameters of each cause.
        visible_um: for each cause what a base of plays and creep leaves of it, rms in train and in test [um].
        scale: of the bench.
        noise_kind: of the sensor.
        noise_um: its rms [um].
        hysteresis_form, creep_order: of the actuator.
        form_error_um: rms in the test or report record, the larger, of what the best base, fitted to the noiseless
            training record with nothing hidden, gets wrong [um]; as good as nothing for a form that plays can be.
        drive_kinds: of each record.
        coarse: a model with too few plays to hand over, where that is the cause; None otherwise.
        sizing: the bench without noise, to ask further questions of.
        seed: what it was drawn from.
        n_attempts: how many benches were drawn until one showed every cause.
    """

    train: Record
    test: Record
    report: Record
    causes: tuple[str, ...]
    parameters: dict[str, dict[str, Any]]
    visible_um: dict[str, tuple[float, float]]
    scale: Scale
    noise_kind: str
    noise_um: float
    hysteresis_form: str
    creep_order: float
    form_error_um: float
    drive_kinds: dict[str, tuple[str, ...]]
    coarse: CoarseModel | None
    sizing: Sizing = field(repr=False)
    seed: int
    n_attempts: int

    @property
    def records(self) -> tuple[Record, Record, Record]:
        """All records."""
        return (self.train, self.test, self.report)

    @property
    def is_representable(self) -> bool:
        """Whether plays and power-law creep could be this actuator but for what is hidden."""
        return self.hysteresis_form in REPRESENTABLE

    def nearest_rival(self, cause: str) -> Rival:
        """Return the other cause that comes nearest to one that is hidden, on these drives."""
        rng = chance(self.seed, f"rivals {cause}")
        return nearest_rival(self.sizing, cause, self.parameters[cause], self.noise_um, rng)


def draw(
    seed: int,
    causes: tuple[str, ...] = (),
    *,
    form: str = "representable",
    noise: str | None = None,
    faults: tuple[str, ...] = (),
    n_samples: tuple[int, int] = _DEFAULT_LENGTH,
    extent: str = "any",
) -> SecondCase:
    """Draw an actuator with effects hidden in it, and measure it.

    Args:
        seed: source of all chance.
        causes: names of what to hide; () for nothing.
        form: "representable" (plays can be it), "other" (they cannot), or a form's own name.
        noise: kind of noise, one of NOISE_KINDS; at random where None.
        faults: what goes wrong with the data of every record, of FAULT_KINDS.
        n_samples: least and most samples of the training record.
        extent: of the scales: "any", or "usual" for a stage as most are.

    Raises:
        ValueError: a name that is not known.
        RuntimeError: no bench shows the causes.
    """
    _check(causes, noise, faults)
    for attempt in range(_N_ATTEMPTS):
        sizing = _sizing(seed, attempt, causes, form, n_samples, extent)
        found = sizing.fit_all(causes, chance(seed, f"sizes {attempt}"))
        if found is not None:
            return _measure(seed, attempt + 1, sizing, found, noise, faults)
    raise RuntimeError(f"seed {seed}: no bench of {_N_ATTEMPTS} shows {causes}")


def _sizing(
    seed: int, attempt: int, causes: tuple[str, ...], form: str, n_samples: tuple[int, int], extent: str
) -> Sizing:
    bench = draw_bench(chance(seed, f"bench {attempt}"), causes, form, n_samples, extent)
    return Sizing(bench, int(chance(seed, f"circumstances {attempt}").integers(2**31)))


def _check(causes: tuple[str, ...], noise: str | None, faults: tuple[str, ...]) -> None:
    unknown = [name for name in causes if name not in DRAWS and name != MISSING]
    if unknown or len(set(causes)) < len(causes):
        raise ValueError(f"causes {causes}: each once, of {(*DRAWS, MISSING)}")
    if noise is not None and noise not in NOISE_KINDS:
        raise ValueError(f"noise {noise!r}, one of {NOISE_KINDS}")
    if any(kind not in FAULT_KINDS for kind in faults):
        raise ValueError(f"faults {faults}, of {FAULT_KINDS}")


def _measure(
    seed: int, n_attempts: int, sizing: Sizing, found: Sized, noise: str | None, faults: tuple[str, ...]
) -> SecondCase:
    bench, rng = sizing.bench, chance(seed, "noise")
    kind = noise or NOISE_KINDS[int(rng.integers(len(NOISE_KINDS)))]
    reach_um = bench.scale.stroke_um
    sensor = draw_noise(kind, found.noise_um, bench.scale.n_samples, reach_um, rng)
    actuator = bench.actuator.having(found.parameters)
    records = []
    for which, part in enumerate(PARTS):
        trace, circumstance = bench.traces[which], sizing.circumstance(which, found.parameters)
        rng = chance(seed, f"noise {part}")
        clean_um = actuator.true_um(trace.command_v, trace.step_s, circumstance)
        # The zero of a sensor is arbitrary: what grows with displacement grows from the relaxed actuator's.
        measured_um = sensor.read(clean_um - circumstance.offset_um, rng) + circumstance.offset_um
        happened = tuple(draw_fault(name, measured_um.size, measured_um, rng) for name in faults)
        for fault in happened:
            measured_um = apply_fault(fault, measured_um, clean_um, rng)
        records.append(_record(part, trace, measured_um, clean_um, circumstance, found.parameters, happened, rng))
    return SecondCase(
        *records,
        causes=found.causes,
        parameters=found.parameters,
        visible_um=found.visible_um,
        scale=bench.scale,
        noise_kind=kind,
        noise_um=found.noise_um,
        hysteresis_form=bench.form,
        creep_order=bench.creep_order,
        form_error_um=sizing.form_error_um,
        drive_kinds=bench.kinds,
        coarse=found.coarse,
        sizing=sizing,
        seed=seed,
        n_attempts=n_attempts,
    )


def _record(
    part: str,
    trace: Trace,
    measured_um: np.ndarray,
    clean_um: np.ndarray,
    circumstance: Circumstance,
    effects: Effects,
    faults: tuple[DataFault, ...],
    rng: np.random.Generator,
) -> Record:
    """Put a file's columns together; the many arguments are the columns."""
    n, room, cross = trace.command_v.size, circumstance.temperature_c, circumstance.cross
    kind = effects.get("cross_axis", {"kind": "none"})["kind"]
    if room is not None:
        room = 22.0 + room + 1e-3 * rng.standard_normal(n)
    if cross is not None:
        cross = cross + 1e-4 * np.ptp(cross) * rng.standard_normal(n)
    return Record(
        name=part,
        time_s=np.arange(n) * trace.step_s,
        voltage_v=trace.command_v,
        measured_um=measured_um,
        temperature_c=room,
        cross_voltage_v=cross if kind == "voltage" else None,
        cross_displacement_um=cross if kind == "displacement" else None,
        clean_um=clean_um,
        faults=faults,
    )
