"""How often the watch is wrong, and how soon it sees what: a day of normal work, and nine kinds of change.

    python test/hidden/study_watch.py                      # 10 days, 9 kinds x 5 seeds at 10 x and 3 x the noise
    python test/hidden/study_watch.py --days 2 --seeds 2

The stages are of test/hidden/watch: nothing of them is the product's. Each has 1 nm rms of noise over some 8 um; the
model in force is what ``identify`` makes of a calibration record at 200 Hz, with the amplifier's and the mass's
parameters, where the stage has them, off by 0.2, 0.05 and 0.5 %. A day is simulated without these dynamics at 100 Hz,
with 100 nm of thermal drift; changes at 1 kHz, after 200 s of work. Delay counts the motion between onset and
alarm: half seconds in which the drive moves by more than 20 mV.
"""

from __future__ import annotations

import argparse
import copy
import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from fomrc_core.diagnosis.watch.model_watch import ModelWatch
from fomrc_core.diagnosis.watch.naming import name_case
from fomrc_core.effects.amplifier_bandwidth import AmplifierBandwidth
from fomrc_core.effects.mechanical_resonance import MechanicalResonance
from fomrc_core.identification.convex import identify
from fomrc_core.model.piezo_model import PiezoModel
from fomrc_core.model.substeps import Substeps
from fomrc_core.records.recording import Recording
from test.hidden.watch.stage import KINDS, Stage, draw_stage, sized
from test.hidden.watch.work import calibration, day, motion

NAMES = {
    # Of a drift that still goes on the library has a name of its own.
    "gain": ("gain_ageing", "gain_drift"),
    "amplifier": ("amplifier_bandwidth",),
    "load": ("external_load",),
    "sensor_scale": ("sensor_scale",),
    "resonance": ("mechanical_resonance",),
    "creep": ("creep_order",),
    "hum": ("mains_hum",),
    "clock": ("clock_skew",),
    "loose_contact": ("loose_contact",),
}
HOUR_S = 3600.0
DAY_S, NORMAL_S, AFTER_S = 86400.0, 200.0, 90.0
CALIBRATION_HZ, DAY_HZ, FAST_HZ = 200.0, 100.0, 1000.0
THERMAL_UM = 0.05
MOVES_V, BLOCK_S = 0.02, 0.5


def identified(stage: Stage, seed: int, n_elements: int | str) -> tuple[PiezoModel, float]:
    """Return the model of a calibration record, and what it left [um]."""
    slow = replace(stage, is_quasistatic=True)
    drive = calibration(stage.largest_v, CALIBRATION_HZ)
    moved = slow.measured_um(slow.displacement_um(drive, CALIBRATION_HZ), np.random.default_rng((seed, 1)))
    found = identify([Recording(np.arange(drive.size) / CALIBRATION_HZ, drive, moved)], n_elements=n_elements)
    return found.model, found.rms_um


def with_dynamics(model: PiezoModel, stage: Stage) -> PiezoModel:
    """Return the model with the amplifier and the mass of the stage, their parameters known as a fit would."""
    amplifier = AmplifierBandwidth(1.002 * stage.cutoff_hz)
    mass = MechanicalResonance(1.0005 * stage.frequency_hz, 1.005 * stage.damping_ratio)
    return replace(model.with_effects(amplifier, mass), substeps=Substeps.NONE)


def false_alarms(seed: int, n_elements: int | str) -> tuple[list[str], float]:
    """Return the alarms of a day of normal work, and the share of a core the watch took at this rate."""
    stage = replace(draw_stage(seed), is_quasistatic=True)
    model, fit_rms_um = identified(stage, seed, n_elements)
    rng = np.random.default_rng((seed, 2))
    drive = day(DAY_S, stage.largest_v, DAY_HZ, rng)
    moved = stage.measured_um(stage.displacement_um(drive, DAY_HZ), rng)
    moved += THERMAL_UM * np.sin(2.0 * np.pi * np.arange(drive.size) / DAY_HZ / DAY_S)
    watch = ModelWatch(model, 1.0 / DAY_HZ, fit_rms_um=fit_rms_um)
    began = time.process_time()
    alarms = []
    for start in range(0, drive.size, 10_000):
        part = slice(start, start + 10_000)
        alarms += watch.take(np.full(drive[part].size, 1.0 / DAY_HZ), drive[part], moved[part])
    return [str(alarm) for alarm in alarms], (time.process_time() - began) / DAY_S


def fast_false_alarms(seed: int, n_elements: int | str) -> list[str]:
    """Return the alarms of an hour of normal work at 1 kHz, with the dynamics."""
    stage = draw_stage(seed)
    bare, fit_rms_um = identified(stage, seed, n_elements)
    drive = day(HOUR_S, stage.largest_v, FAST_HZ, np.random.default_rng((seed, 5)))
    moved = stage.measured_um(stage.displacement_um(drive, FAST_HZ), np.random.default_rng((seed, 6)))
    watch = ModelWatch(with_dynamics(bare, stage), 1.0 / FAST_HZ, fit_rms_um=fit_rms_um)
    return [str(alarm) for alarm in watch.take(np.full(drive.size, 1.0 / FAST_HZ), drive, moved)]


def motion_s(drive_v: np.ndarray, since_s: float, until_s: float) -> float:
    """Return the motion between two times [s]."""
    n = round(BLOCK_S * FAST_HZ)
    part = drive_v[round(since_s * FAST_HZ) : round(until_s * FAST_HZ)]
    blocks = part[: part.size // n * n].reshape(-1, n)
    return float(BLOCK_S * np.count_nonzero(np.ptp(blocks, axis=1) > MOVES_V))


def changes(seed: int, factors: tuple[float, ...], n_elements: int | str) -> list[tuple[str, float, float, str, str]]:
    """Return kind, factor, delay [s of motion] (nan where it was not seen), first name and the rest, of each kind."""
    stage = draw_stage(seed)
    bare, fit_rms_um = identified(stage, seed, n_elements)
    model = with_dynamics(bare, stage)
    drive = motion(NORMAL_S + AFTER_S, stage.largest_v, FAST_HZ, np.random.default_rng((seed, 3)))
    noise = stage.noise.draw(drive.size, np.random.default_rng((seed, 4)))
    steps = np.full(drive.size, 1.0 / FAST_HZ)
    n = round(NORMAL_S * FAST_HZ)
    normal = ModelWatch(model, 1.0 / FAST_HZ, fit_rms_um=fit_rms_um)
    early = normal.take(steps[:n], drive[:n], (stage.displacement_um(drive[:n], FAST_HZ) + noise[:n]))
    rows = []
    for factor in factors:
        for kind in KINDS:
            change = sized(stage, drive, FAST_HZ, kind, NORMAL_S, factor * stage.noise.rms_um)
            moved = stage.displacement_um(drive, FAST_HZ, change) + noise
            watch, alarms, case = copy.deepcopy(normal), list(early), None
            for start in range(n, drive.size, 1000):
                part = slice(start, start + 1000)
                alarms += watch.take(steps[part], drive[part], moved[part])
                case = case or watch.next_case()
            case = case or watch.next_case(is_last=True)
            if not alarms or case is None:
                rows.append((kind, factor, float("nan"), "", ""))
                continue
            found = name_case(case)
            delay = motion_s(drive, NORMAL_S, alarms[0].time_s)
            others = ", ".join(f"{n.cause} {n.probability:.2f}" for n in found.named[1:3])
            rows.append((kind, factor, delay, found.cause, others))
    return rows


def main() -> None:
    """Print what was measured."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--days", type=int, default=10, help="days of normal work, one stage each")
    parser.add_argument("--hours", type=int, default=5, help="hours of normal work at 1 kHz, one stage each")
    parser.add_argument("--seeds", type=int, default=5, help="stages for each kind of change")
    parser.add_argument("--factors", type=float, nargs="*", default=[10.0, 3.0], help="sizes, in rms of the noise")
    parser.add_argument("--elements", default="auto", help="elements of the model in force")
    given = parser.parse_args()
    n_elements = given.elements if given.elements == "auto" else int(given.elements)
    total = 0
    for seed in range(1, given.days + 1):
        alarms, share = false_alarms(seed, n_elements)
        total += len(alarms)
        print(f"day {seed}: {len(alarms)} false alarms, {100.0 * share:.3f} % of a core {alarms[:3]}", flush=True)
    if given.days:
        print(f"false alarms: {total} in {given.days} days of normal work", flush=True)
    fast = [fast_false_alarms(seed, n_elements) for seed in range(1, given.hours + 1)]
    if fast:
        said = [alarm for alarms in fast for alarm in alarms]
        print(f"false alarms: {len(said)} in {given.hours} hours of normal work at 1 kHz {said[:3]}", flush=True)
    rows = []
    for seed in range(1, given.seeds + 1):
        for row in changes(seed, tuple(given.factors), n_elements):
            rows.append(row)
            kind, factor, delay, name, others = row
            mark = "" if name in NAMES[kind] else "  <-"
            print(f"stage {seed}, {factor:g} x, {kind:14s} {delay:5.1f} s  {name} ({others}){mark}", flush=True)
    for factor in given.factors:
        some = [row for row in rows if row[1] == factor]
        if not some:
            continue
        seen = [row for row in some if np.isfinite(row[2])]
        named = sum(row[3] in NAMES[row[0]] for row in seen)
        print(
            f"{factor:g} x the noise: seen {len(seen)} of {len(some)}, median delay "
            f"{np.median([row[2] for row in seen]) if seen else float('nan'):.1f} s of motion, "
            f"named first {named} of {len(some)}"
        )
        for kind in KINDS:
            delays = [row[2] for row in some if row[0] == kind]
            print(f"  {kind:14s} delays {delays}, named {sum(r[3] in NAMES[kind] for r in some if r[0] == kind)}")


if __name__ == "__main__":
    main()
