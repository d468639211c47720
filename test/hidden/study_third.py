"""The third world in the study: its cases, and one case run from its seed to its outcome.

Seeds 30000 to 39999 are for development, 50000 to 59999 for reporting: what is mended is never what is reported.
"""

from __future__ import annotations

import time
import traceback
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from test.hidden.study_cases import diagnosis_plain, source_digest, write_json
from test.hidden.study_recording import recording_of
from test.hidden.third.catalogue import KNOWN_NAMES, UNLISTED_NAMES, can_act_together
from test.hidden.third.other_forms import OTHER_FORMS
from test.hidden.third.sensor_noise import NOISE_KINDS
from test.hidden.third.third_case import Order, ThirdCase, draw

if TYPE_CHECKING:
    from fomrc_core import PiezoModel, Recording

GROUPS = ("null", "known", "pairs", "unknown", "forms")
FIRST_SEED = {"development": 30_000, "reporting": 50_000}
# Cases of each kind; of pairs, how many kinds there are.
_USUAL = {"null": 5, "known": 5, "pairs": 1, "unknown": 4, "forms": 6}
_N_PAIRS = 40


@dataclass(frozen=True)
class ThirdSpec:
    """What one case of the third world is drawn from.

    Args:
        group: one of GROUPS.
        seed: of the case.
        causes: what is hidden, the library's or not.
        form: of the hysteresis.
        noise: kind, at random where None.
    """

    group: str
    seed: int
    causes: tuple[str, ...] = ()
    form: str = "masing"
    noise: str | None = None

    @property
    def part(self) -> str:
        """Part of the study the outcome belongs to."""
        return f"third_{self.group}"

    @property
    def key(self) -> str:
        """Name of the case's file."""
        return f"{self.part}-{'+'.join(self.causes) or 'nothing'}-{self.noise or self.form}-{self.seed}"

    def draw(self) -> ThirdCase:
        """Draw the case."""
        return draw(self.seed, Order(self.causes, self.form, self.noise))


def plan(group: str, seeds: str = "reporting", n_seeds: int | None = None) -> list[ThirdSpec]:
    """Return the cases of a group, seed by seed so that a run cut short has seen each kind about as often.

    Args:
        group: one of GROUPS.
        seeds: "development" or "reporting".
        n_seeds: cases of each kind in place of the group's own number.
    """
    if group not in GROUPS:
        raise ValueError(f"group {group!r}, one of {GROUPS}")
    start = FIRST_SEED[seeds] + 2000 * GROUPS.index(group)
    kinds: list[dict[str, Any]]
    if group == "null":
        kinds = [{"noise": kind} for kind in NOISE_KINDS]
    elif group == "known":
        kinds = [{"causes": (name,)} for name in KNOWN_NAMES]
    elif group == "pairs":
        kinds = [{"causes": pair} for pair in _pairs(np.random.default_rng(start))]
    elif group == "unknown":
        kinds = [{"causes": (name,)} for name in UNLISTED_NAMES]
    else:
        kinds = [{"form": form} for form in OTHER_FORMS]
    many = n_seeds or _USUAL[group]
    return [ThirdSpec(group, start + len(kinds) * k + i, **kind) for k in range(many) for i, kind in enumerate(kinds)]


def _pairs(rng: np.random.Generator) -> list[tuple[str, str]]:
    pairs: list[tuple[str, str]] = []
    while len(pairs) < _N_PAIRS:
        first, second = sorted(map(str, rng.choice(KNOWN_NAMES, 2, replace=False)))
        if can_act_together(first, second):
            pairs.append((first, second))
    return pairs


def model_of(case: ThirdCase, train: Recording) -> PiezoModel | None:
    """Return the model to hand over where one with too few elements is hidden, or None."""
    from fomrc_core import identify

    few = case.n_coarse_elements
    return None if few is None else identify([train], n_elements=few).model


def truth_of(case: ThirdCase) -> dict[str, Any]:
    """Return the key to a case in plain types."""
    bench = case.bench
    return {
        "parameters": {one.effect.name: dict(one.values) for one in case.hidden},
        "visible_over_noise": {
            name: [v.training_um / case.noise_um, v.test_um / case.noise_um] for name, v in case.visible_um.items()
        },
        "noise_kind": case.noise_kind,
        "noise_um": case.noise_um,
        "scale": {
            "low_v": bench.low_v,
            "high_v": bench.high_v,
            "stroke_um": bench.stroke_um,
            "rates_hz": list(bench.rates_hz),
        },
        "hysteresis": {"form": bench.form, **asdict(bench.curve)},
        "creep_order": bench.creep_order,
        "drive_kinds": [list(kinds) for kinds in case.drive_kinds],
        "columns": [
            name
            for name in ("temperature_c", "cross_voltage_v", "cross_displacement_um")
            if getattr(case.records[0], name) is not None
        ],
        "n_samples": list(bench.n_samples),
        "swing_um": [float(np.ptp(r.clean_um)) for r in case.records],
        "n_attempts": case.n_attempts,
    }


def run(spec: ThirdSpec, folder: str) -> str:
    """Run one case, write its file, and return its key."""
    outcome: dict[str, Any] = {"spec": {**asdict(spec), "part": spec.part}, "source": source_digest()}
    try:
        start_s = time.perf_counter()
        case = spec.draw()
        outcome["truth"] = truth_of(case)
        outcome["truth_wall_s"] = time.perf_counter() - start_s
        outcome |= _diagnosed(case)
    except Exception as error:
        # A case that breaks is a result too: it counts against the bar, and the study goes on.
        outcome |= {"status": "error", "findings": [], "error": repr(error), "traceback": traceback.format_exc()}
    write_json(outcome, Path(folder) / f"{spec.key}.json")
    return spec.key


def _diagnosed(case: ThirdCase) -> dict[str, Any]:
    from fomrc_core import diagnose

    train, test, report = (recording_of(r) for r in case.records)
    model = model_of(case, train)
    start_s, cpu_s = time.perf_counter(), time.process_time()
    diagnosis = diagnose([train], test=test, report=report, model=model)
    outcome: dict[str, Any] = {"wall_s": time.perf_counter() - start_s, "cpu_s": time.process_time() - cpu_s}
    outcome |= diagnosis_plain(diagnosis)
    for found, told in zip(outcome["findings"], diagnosis.findings, strict=True):
        found["probability"] = getattr(told, "probability", None)
    over = float(np.ptp(case.records[2].measured_um)) / 100.0 / case.noise_um
    outcome["report_over_noise_before"] = outcome["nrmse_percent_test"] * over
    outcome["report_over_noise_after"] = outcome["nrmse_percent_last"] * over
    return outcome
