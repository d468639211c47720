"""The second world in the study: its cases, and one case run from its seed to its outcome.

Seeds 10000 to 19999 are for development, 460000 to 469999 for reporting: what is mended is never what is reported.
Those from 20000 to 29999 and from 60000 to 439999 were for reporting before, or looked at: what came after was decided
with their answers in sight.
"""

from __future__ import annotations

import math
import time
import traceback
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from test.hidden.second.data_faults import FAULT_KINDS
from test.hidden.second.hidden_causes import DRAWS, KNOWN_CAUSES, MISSING, NEW_CAUSES
from test.hidden.second.hysteresis_forms import OTHER
from test.hidden.second.second_case import SecondCase, draw
from test.hidden.second.sensor_noise import NOISE_KINDS
from test.hidden.study_cases import diagnosis_plain, source_digest, write_json
from test.hidden.study_recording import recording_of
from test.hidden.study_second_parameters import second_parameter_error

if TYPE_CHECKING:
    from fomrc_core.model.piezo_model import PiezoModel

GROUPS = ("null", "known", "new", "removed", "pairs", "triples", "faults", "forms", "scales", "long")
FIRST_SEED = {"development": 10_000, "reporting": 460_000}
_USUAL = (2000, 20_000)
_LENGTHS = {"scales": (200, 3000), "long": (50_000, 100_000)}
# Pairs and triples of causes that a stage has at once; a lack of a model's elements is no effect among effects.
_COMBINED = tuple(c for c in (*KNOWN_CAUSES, *NEW_CAUSES) if c != MISSING)


@dataclass(frozen=True)
class SecondSpec:
    """What one case of the second world is drawn from.

    Args:
        group: one of GROUPS.
        seed: of the case.
        causes: what is hidden.
        form: of the hysteresis, see `second_case.draw`.
        noise: kind of noise; at random where None.
        faults: of the data.
        excluded: causes taken out of the library.
        extent: of the scales, "any" or "usual".
    """

    group: str
    seed: int
    causes: tuple[str, ...] = ()
    form: str = "representable"
    noise: str | None = None
    faults: tuple[str, ...] = ()
    excluded: tuple[str, ...] = ()
    extent: str = "any"

    @property
    def part(self) -> str:
        """Part of the study the outcome belongs to."""
        return f"second_{self.group}"

    @property
    def key(self) -> str:
        """Name of the case's file."""
        hidden = "+".join(self.causes) or "nothing"
        told = "-".join([*self.faults, *([self.noise] if self.noise else [])]) or self.form
        scale = "" if self.extent == "any" else f"-{self.extent}"
        return f"{self.part}-{hidden}-{told}-{self.seed}{scale}"

    def draw(self) -> SecondCase:
        """Draw the case."""
        lengths = _LENGTHS.get(self.group, _USUAL)
        return draw(
            self.seed,
            self.causes,
            form=self.form,
            noise=self.noise,
            faults=self.faults,
            n_samples=lengths,
            extent=self.extent,
        )


def plan(group: str, seeds: str = "reporting", n_seeds: int | None = None) -> list[SecondSpec]:
    """Return the cases of a group, seed by seed so that a run cut short has seen each kind about as often.

    Args:
        group: one of GROUPS.
        seeds: "development" or "reporting".
        n_seeds: seeds for each kind of case in place of the group's own number.
    """
    start = FIRST_SEED[seeds] + 1000 * GROUPS.index(group)
    known_and_new = (*KNOWN_CAUSES, *NEW_CAUSES)
    rng = np.random.default_rng(start)
    kinds: list[dict[str, Any]]
    if group == "null":
        kinds, usual = [*({"noise": k} for k in NOISE_KINDS), {"faults": ("spikes",)}], 4
    elif group in ("known", "new"):
        kinds, usual = [{"causes": (c,)} for c in (KNOWN_CAUSES if group == "known" else NEW_CAUSES)], 5
    elif group == "removed":
        kinds, usual = [{"causes": (c,), "excluded": (c,)} for c in known_and_new], 2
    elif group in ("pairs", "triples"):
        many, usual = (2, 1) if group == "pairs" else (3, 1)
        n_drawn = 30 if group == "pairs" else 16
        kinds = [{"causes": _drawn_together(rng, many)} for _ in range(n_drawn)]
    elif group == "faults":
        with_load = [{"faults": (k,), "causes": ("external_load",)} for k in FAULT_KINDS]
        kinds, usual = [*({"faults": (k,)} for k in FAULT_KINDS), *with_load], 1
    elif group == "forms":
        hidden = ((), ("amplifier_bandwidth",), ("mains_hum",))
        kinds, usual = [{"form": form, "causes": causes} for causes in hidden for form in OTHER], 2
    elif group in ("scales", "long"):
        names = [(), *((c,) for c in DRAWS)]
        kinds = [{"causes": names[int(rng.integers(len(names)))]} for _ in range(300 if group == "scales" else 20)]
        usual = 1
    else:
        raise ValueError(f"group {group!r}, one of {GROUPS}")
    many = n_seeds or usual
    return [SecondSpec(group, start + len(kinds) * k + i, **kind) for k in range(many) for i, kind in enumerate(kinds)]


def _drawn_together(rng: np.random.Generator, many: int) -> tuple[str, ...]:
    while True:
        causes = tuple(sorted(rng.choice(_COMBINED, many, replace=False)))
        # one stack of plays has either of these: its truth has no form that is both
        if not {"asymmetric_hysteresis", "rate_dependent_hysteresis"} <= set(causes):
            return causes


def model_of(case: SecondCase) -> PiezoModel | None:
    """Return the coarse model to hand over as a model file would hold it, or None.

    A stack of plays is a chain of springs that slip, seen from the displacement: stiffnesses are differences of the
    reciprocal slopes of the first loading, strengths what each spring holds where it begins to slip.
    """
    from fomrc_core.model.piezo_model import PiezoModel

    coarse = case.coarse
    if coarse is None:
        return None
    slopes = coarse.slope_um_per_v + np.concatenate([[0.0], np.cumsum(coarse.weights_um_per_v)])
    stiffness = -np.diff(1.0 / slopes)
    loading_um = np.cumsum(slopes[:-1] * np.diff(coarse.thresholds_v, prepend=0.0))
    # The product's creep is t^order / Gamma(1 + order) of a step, this world's (t / reference)^order.
    unit = math.gamma(1.0 + coarse.creep_order) * coarse.reference_s ** (-coarse.creep_order)
    mapping = {
        "kappa_um_per_v": [float(unit / k) for k in (*stiffness, 1.0 / slopes[-1])],
        "saturation_v": [float(v) for v in stiffness * loading_um],
        "creep_order": float(coarse.creep_order),
    }
    return PiezoModel.from_mapping(mapping, where="coarse model")


def truth_of(case: SecondCase) -> dict[str, Any]:
    """Return the key to a case in plain types."""
    return {
        "parameters": {c: _plain(p) for c, p in case.parameters.items()},
        "visible_over_noise": {c: [v / case.noise_um for v in pair] for c, pair in case.visible_um.items()},
        "noise_kind": case.noise_kind,
        "noise_um": case.noise_um,
        "scale": asdict(case.scale),
        "hysteresis_form": case.hysteresis_form,
        "is_representable": case.is_representable,
        "form_error_over_noise": case.form_error_um / case.noise_um,
        "drive_kinds": {name: list(kinds) for name, kinds in case.drive_kinds.items()},
        "n_samples": [r.time_s.size for r in case.records],
        "swing_um": [float(np.ptp(r.clean_um)) for r in case.records],
    }


def run(spec: SecondSpec, folder: str) -> str:
    """Run one case, write its file, and return its key."""
    outcome: dict[str, Any] = {"spec": {**asdict(spec), "part": spec.part}, "source": source_digest()}
    try:
        start_s = time.perf_counter()
        case = spec.draw()
        outcome["truth"] = truth_of(case)
        if spec.group in ("known", "new") and spec.causes != (MISSING,):
            outcome["truth"]["rival"] = asdict(case.nearest_rival(spec.causes[0]))
        outcome["truth_wall_s"] = time.perf_counter() - start_s
        outcome |= _diagnosed(spec, case)
    except Exception as error:
        # A case that breaks is a result too: it counts against the bar, and the study goes on.
        outcome |= {"status": "error", "findings": [], "error": repr(error), "traceback": traceback.format_exc()}
    write_json(outcome, Path(folder) / f"{spec.key}.json")
    return spec.key


def _diagnosed(spec: SecondSpec, case: SecondCase) -> dict[str, Any]:
    from fomrc_core.diagnosis.belief import evidence_of
    from fomrc_core.diagnosis.diagnosis import diagnose
    from fomrc_core.effects import effect_classes

    train, test, report = (recording_of(r) for r in case.records)
    # A cause the library has not is out of it already.
    excluded = [c for c in spec.excluded if c in effect_classes()]
    start_s, cpu_s = time.perf_counter(), time.process_time()
    diagnosis = diagnose(train, test=test, report=report, model=model_of(case), excluded_causes=excluded)
    outcome = {"wall_s": time.perf_counter() - start_s, "cpu_s": time.process_time() - cpu_s}
    outcome |= diagnosis_plain(diagnosis)
    outcome["doubts"], outcome["stand_ins"] = list(diagnosis.doubts), [form.cause for form in diagnosis.stand_ins]
    for found, told in zip(outcome["findings"], diagnosis.findings, strict=True):
        found["probability"] = getattr(told, "probability", None)
        found["evidence"] = list(evidence_of(told, diagnosis.judgement))
        if found["cause"] in case.causes:
            true = case.parameters[found["cause"]]
            found["parameter_error"] = second_parameter_error(found["cause"], true, found["parameters"], case)
    swing_um = float(np.ptp(case.report.measured_um))
    noise_um = case.noise_um
    outcome["report_over_noise_before"] = outcome["nrmse_percent_test"] * swing_um / 100.0 / noise_um
    outcome["report_over_noise_after"] = outcome["nrmse_percent_last"] * swing_um / 100.0 / noise_um
    return outcome


def _plain(parameters: dict[str, Any]) -> dict[str, Any]:
    return {k: list(map(float, v)) if isinstance(v, tuple) else v for k, v in parameters.items()}
