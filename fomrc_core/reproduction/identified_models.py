"""Both routes of identification on the simulated rig, and the minimiser of (34) from many starts."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import product

import numpy as np
from numpy.typing import NDArray

from fomrc_core.diagnosis.diagnosis import diagnose
from fomrc_core.effects import Effect, Stage, effect_classes
from fomrc_core.fitting.evidence import evidence_of
from fomrc_core.fitting.fit_record import FitRecord
from fomrc_core.fitting.joint_fit import refit
from fomrc_core.fitting.linear_part import Tangent, residuals, squared_error
from fomrc_core.fitting.trial_model import TrialModel
from fomrc_core.identification.convex import identify
from fomrc_core.identification.fit import Fit
from fomrc_core.identification.paper import PaperFit, identify_paper
from fomrc_core.model.piezo_model import PiezoModel
from fomrc_core.model.substeps import Substeps
from fomrc_core.plants.paper_stage import N_ELEMENTS
from fomrc_core.plants.simulated_rig import SimulatedRig
from fomrc_core.records import excitation
from fomrc_core.records.excitation import AMPLITUDE_V
from fomrc_core.records.recording import Recording

Array = NDArray[np.float64]
Tell = Callable[[float, str], None]

_LEFT_OUT_BY_PAPER = "4.4"  # the section that names what lags beside the model: amplifier and mechanics
_N_STARTS, _N_ITERATIONS = 3, 30


@dataclass(frozen=True, eq=False)
class Identified:
    """What both routes made of the same recordings.

    Attributes:
        triangle: 1 V/s, for (29) [figure 9(a)].
        staircase: 0.25 V, 3 s [figure 9(b)].
        step: 2.5 V, for (33).
        convex: the convex route on the staircase, which is what the paper's (34) uses.
        paper: the paper's route.
        both_model: the convex route on staircase and triangle, for compensation.
        fast_model: the convex model with amplifier and resonance fitted on a fast recording.
        diagnosed_model: the convex model with the effects a diagnosis named.
        convex_s: time of the convex route [s].
        paper_s: time of the paper's route [s].
    """

    triangle: Recording
    staircase: Recording
    step: Recording
    convex: Fit
    paper: PaperFit
    both_model: PiezoModel
    fast_model: PiezoModel
    diagnosed_model: PiezoModel
    convex_s: float
    paper_s: float


def identification_runs(rig: SimulatedRig, tell: Tell) -> Identified:
    """Record what section 3 records, and identify by both routes."""
    triangle = rig.measure(excitation.triangle(AMPLITUDE_V, slope_v_per_s=1.0), seed=1)
    staircase = rig.measure(excitation.staircase(AMPLITUDE_V, rate_hz=200.0), seed=2)
    step = rig.measure(excitation.steps([AMPLITUDE_V], dwell_s=60.0, rate_hz=100.0), seed=3)
    tell(0.1, "convex identification")
    start = time.perf_counter()
    first = identify(staircase, n_elements=N_ELEMENTS).model
    convex_s = time.perf_counter() - start
    fast = rig.measure(
        excitation.multisine(2.0, lowest_hz=2.0, highest_hz=3000.0, period_s=0.5, n_periods=2, rate_hz=1e4),
        seed=5,
    )  # sampled at 10 kHz: the resonance lies beyond what 1 kHz shows
    effects = with_fast_effects(first, fast).effects
    # Once the amplifier is known, the elements are fitted on the voltage it passes on: else the first
    # milliseconds of every step of the staircase are taken for hysteresis.
    start = time.perf_counter()
    convex = identify(passed_on(staircase, effects), n_elements=N_ELEMENTS)
    convex_s += time.perf_counter() - start
    tell(0.3, "convex identification on both recordings")
    both = identify([passed_on(record, effects) for record in (triangle, staircase)], n_elements=N_ELEMENTS)
    tell(0.4, "identification as the paper has it")
    start = time.perf_counter()
    paper_start = identify_paper([triangle, step], N_ELEMENTS, max_iterations=0).start_model
    slower = rig.measure(excitation.staircase(AMPLITUDE_V, rate_hz=50.0), seed=4)
    paper = identify_paper([slower], N_ELEMENTS, paper_start, max_iterations=80)
    paper_s = time.perf_counter() - start
    tell(0.9, "diagnosis of fast recordings")
    extended = convex.model.with_effects(*effects)
    diagnosed = convex.model.with_effects(*diagnosed_effects(rig))
    return Identified(triangle, staircase, step, convex, paper, both.model, extended, diagnosed, convex_s, paper_s)


def diagnosed_effects(rig: SimulatedRig) -> tuple[Effect, ...]:
    """Return the effects a diagnosis names when given fast recordings, and not told what to look for."""
    recordings = [
        rig.measure(excitation.staircase(AMPLITUDE_V, n_cycles=1, dwell_s=2.0, rate_hz=200.0), seed=6),
        rig.measure(excitation.triangle(AMPLITUDE_V, slope_v_per_s=60.0), seed=7),
        rig.measure(_fast_multisine(2.0, seed=0), seed=8),
    ]
    found = diagnose(recordings, test=rig.measure(_fast_multisine(1.7, seed=4), seed=9))
    # plays of an effect's own belong to the elements they were found beside, and what befell one record to that record
    effects = found.extended_model.effects
    return tuple(effect for effect in effects if not effect.owns_columns and not effect.belongs_to_record())


def _fast_multisine(amplitude_v: float, seed: int) -> excitation.Excitation:
    return excitation.multisine(
        amplitude_v, lowest_hz=1.0, highest_hz=3000.0, period_s=0.5, n_periods=2, seed=seed, rate_hz=1e4
    )


def passed_on(recording: Recording, effects: tuple[Effect, ...]) -> Recording:
    """Return the recording with its voltage as the drive effects found pass it on."""
    voltage = np.asarray(recording.voltage_v)
    for effect in effects:
        if effect.stage is Stage.DRIVE:
            voltage = effect.run(effect.initial_state(), voltage, recording.steps_s)
    return replace(recording, voltage_v=voltage)


def with_fast_effects(model: PiezoModel, fast: Recording) -> PiezoModel:
    """Return the model with what section 4.4 names as left out of it, fitted on a fast recording.

    Elements and creep order are held. Of the trial instances of these effects, each beside each, the fits begin at
    those that leave least.
    """
    kinds = [kind for kind in effect_classes().values() if kind.paper_section == _LEFT_OUT_BY_PAPER]
    records = (FitRecord.of(fast, substeps=Substeps.BENDS),)
    bare = TrialModel.of_play_form(model.play_form, model.creep_order)
    evidence = evidence_of(bare, records, residuals(bare, records), noise_um=0.0)
    starts = [replace(bare, effects=effects) for effects in product(*(kind.screening(evidence) for kind in kinds))]
    starts.sort(key=lambda start: squared_error(records, residuals(start, records)))
    held = Tangent.none(bare, records)
    fits = [refit(start, records, held, n_iterations=_N_ITERATIONS) for start in starts[:_N_STARTS]]
    best = min(fits, key=lambda fit: fit.squared_error)
    return replace(model, effects=best.model.effects, substeps=Substeps.BENDS)


@dataclass(frozen=True, eq=False)
class StartStudy:
    """The minimiser of (34) from random starts, beside the convex route, on one recording.

    Attributes:
        start_rms_um: error at each start [um], shape (n_starts,).
        paper_rms_um: error where (34) ended [um], shape (n_starts,).
        paper_s: time of each [s], shape (n_starts,).
        convex_rms_um: error of the convex route, which has no start [um].
        convex_s: its time [s].
    """

    start_rms_um: Array
    paper_rms_um: Array
    paper_s: Array
    convex_rms_um: float
    convex_s: float


def start_study(rig: SimulatedRig, tell: Tell, n_starts: int = 20, max_iterations: int = 25) -> StartStudy:
    """Fit the same staircase by (34) from random starts and by the convex route.

    Each parameter of a start is that of (29)-(33) times a factor within 1/2..2, evenly in its logarithm.
    """
    recording = rig.measure(excitation.staircase(AMPLITUDE_V, rate_hz=20.0), seed=90)
    rising = rig.measure(excitation.triangle(AMPLITUDE_V, n_cycles=1, rate_hz=200.0), seed=91)
    base = identify_paper([rising, recording], N_ELEMENTS, max_iterations=0).start_model
    rng = np.random.default_rng(92)
    found = []
    for number in range(n_starts):
        tell(number / n_starts, f"random start {number + 1} of {n_starts}")
        factors = np.exp(rng.uniform(-np.log(2.0), np.log(2.0), 2 * N_ELEMENTS + 2))
        start_model = PiezoModel(
            base.kappa_um_per_v * factors[: N_ELEMENTS + 1],
            base.saturation_v * factors[N_ELEMENTS + 1 : -1],
            float(base.creep_order * factors[-1]),
        )
        begun = time.perf_counter()
        fit = identify_paper([recording], N_ELEMENTS, start_model, max_iterations=max_iterations)
        found.append((fit.start_rms_um, fit.rms_um, time.perf_counter() - begun))
    begun = time.perf_counter()
    convex = identify(recording, n_elements=N_ELEMENTS)
    start, ended, seconds = np.array(found).T
    return StartStudy(start, ended, seconds, convex.rms_um, time.perf_counter() - begun)
