"""The cases of the study, and one case run from its seed to its outcome."""

from __future__ import annotations

import hashlib
import json
import math
import time
import traceback
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from test.hidden.effects import CAUSES
from test.hidden.study_parameters import parameter_error
from test.hidden.truth import HiddenCase, draw_case

PARTS = ("null", "single", "pairs", "removed", "noise", "poor")
NOISE_LEVELS_UM = (0.3e-3, 1e-3, 3e-3, 10e-3)
_ROOT = Path(__file__).resolve().parents[2]

# Where each kind of careless drive is weakest: causes it can hardly tell from others.
_POOR: dict[str, tuple[str, ...]] = {
    "slow_triangle": (
        "amplifier_bandwidth",
        "transport_delay",
        "sensor_nonlinearity",
        "asymmetric_hysteresis",
        "slow_relaxation",
    ),
    "single_sine": ("amplifier_bandwidth", "transport_delay", "mechanical_resonance", "dead_zone"),
    "slow_sines": ("amplifier_bandwidth", "transport_delay"),
    "level_hold": ("gain_drift", "thermal_drift", "slow_relaxation"),
    "steps_only": ("slow_relaxation", "gain_drift", "amplifier_bandwidth", "thermal_drift"),
    "staircase_only": ("sensor_nonlinearity", "slow_relaxation", "amplifier_slew_limit"),
    "multisine_only": ("transport_delay", "mechanical_resonance", "dac_quantization"),
}
_NOISE_CAUSES = (
    "amplifier_bandwidth",
    "asymmetric_hysteresis",
    "slow_relaxation",
    "mechanical_resonance",
    "thermal_drift",
    "sensor_nonlinearity",
    "mains_hum",
    "external_load",
)


@dataclass(frozen=True)
class Spec:
    """What one case of the study is drawn from."""

    part: str
    seed: int
    causes: tuple[str, ...] = ()
    noise_um: float = 1e-3
    excitation: str = "rich"
    excluded: tuple[str, ...] = ()

    @property
    def key(self) -> str:
        """Name of the case's file."""
        hidden = "+".join(self.causes) or "nothing"
        return f"{self.part}-{hidden}-{self.excitation}-{self.noise_um * 1e3:g}nm-{self.seed}"


def plan(part: str, n_seeds: int | None = None) -> list[Spec]:
    """Return the cases of a part; ``n_seeds`` overrides its number of seeds (of pairs, for "pairs")."""
    if part == "null":
        return [Spec(part, 1000 + k) for k in range(n_seeds or 50)]
    if part == "single":
        # Seed by seed through all causes, so that a run cut short has seen each cause about as often.
        return [Spec(part, 2000 + 100 * i + k, (c,)) for k in range(n_seeds or 10) for i, c in enumerate(CAUSES)]
    if part == "pairs":
        rng = np.random.default_rng(3000)
        drawn = [tuple(sorted(rng.choice(CAUSES, 2, replace=False).tolist())) for _ in range(n_seeds or 40)]
        return [Spec(part, 3000 + k, pair) for k, pair in enumerate(drawn)]
    if part == "removed":
        return [
            Spec(part, 4000 + 100 * i + k, (c,), excluded=(c,))
            for k in range(n_seeds or 3)
            for i, c in enumerate(CAUSES)
        ]
    if part == "noise":
        hidden = [(), (), *((c,) for c in _NOISE_CAUSES)]
        return [
            Spec(part, 5000 + 100 * i + k, causes, noise_um=noise_um)
            for k in range(n_seeds or 2)
            for noise_um in NOISE_LEVELS_UM
            for i, causes in enumerate(hidden)
        ]
    if part == "poor":
        return [
            Spec(part, 6000 + 100 * i + k, (cause,), excitation=excitation)
            for k in range(n_seeds or 2)
            for i, (excitation, cause) in enumerate((e, c) for e, causes in _POOR.items() for c in causes)
        ]
    raise ValueError(f"part {part!r}, one of {PARTS}")


def source_digest() -> str:
    """Return a short digest of the product's source: which state of it an outcome belongs to."""
    digest = hashlib.sha256()
    for path in sorted((_ROOT / "fomrc_core").rglob("*.py")):
        digest.update(path.read_bytes())
    return digest.hexdigest()[:12]


def diagnosis_plain(diagnosis: Any) -> dict[str, Any]:
    """Return what a diagnosis says in plain types."""
    findings = [
        {
            "cause": found.cause,
            "parameters": _plain(dict(found.parameters)),
            "standard_errors": _plain(dict(found.standard_errors)),
            "gain": _plain(found.gain),
            "p_value": _plain(found.p_value),
            "nrmse_percent_before": _plain(found.nrmse_percent_test_before),
            "nrmse_percent_after": _plain(found.nrmse_percent_test_after),
        }
        for found in diagnosis.findings
    ]
    return {
        "status": str(diagnosis.status.value),
        "findings": findings,
        "nrmse_percent_test": _plain(diagnosis.baseline_test_percent),
        "nrmse_percent_last": _plain(diagnosis.final_test_percent),
        "ambiguous_with": [str(c) for c in diagnosis.ambiguous_with],
        "noise_floor_um": _plain(diagnosis.noise_floor_um),
        "unexplained_percent": _plain(diagnosis.unexplained_percent),
        "next_experiment": str(diagnosis.next_experiment),
    }


def diagnosis_outcome(diagnosis: Any, case: HiddenCase) -> dict[str, Any]:
    """Return what a diagnosis says and how far it is from the truth, in plain types."""
    outcome = diagnosis_plain(diagnosis)
    for found in outcome["findings"]:
        cause = found["cause"]
        if cause in case.causes:
            found["parameter_error"] = parameter_error(cause, case.parameters[cause], found["parameters"], case)
    swing_um = float(np.ptp(case.report.measured_um))
    outcome["held_out_over_noise"] = outcome["nrmse_percent_last"] * swing_um / 100.0 / case.noise_um
    return outcome


def truth_of(case: HiddenCase) -> dict[str, Any]:
    """Return the key to a case in plain types."""
    return {
        "parameters": _plain(case.parameters),
        "effect_rms_um": case.effect_rms_um,
        "visible_rms_um": case.visible_rms_um,
        "n_samples": [r.n_samples for r in case.recordings],
    }


def run(spec: Spec, folder: str) -> str:
    """Run one case, write its file, and return its key."""
    outcome: dict[str, Any] = {"spec": asdict(spec), "source": source_digest()}
    try:
        from fomrc_core.diagnosis.diagnosis import diagnose

        start_s = time.perf_counter()
        case = draw_case(spec.seed, spec.causes, noise_um=spec.noise_um, excitation=spec.excitation)
        outcome["truth"] = truth_of(case)
        outcome["truth_wall_s"] = time.perf_counter() - start_s
        start_s, cpu_s = time.perf_counter(), time.process_time()
        diagnosis = diagnose(
            case.recordings,
            test=case.test,
            report=case.report,
            model=case.model,
            excluded_causes=spec.excluded,
        )
        outcome["wall_s"] = time.perf_counter() - start_s
        outcome["cpu_s"] = time.process_time() - cpu_s
        outcome |= diagnosis_outcome(diagnosis, case)
    except Exception as error:
        # A case that breaks is a result too: it counts against the bar, and the study goes on.
        outcome |= {
            "status": "error",
            "findings": [],
            "error": repr(error),
            "traceback": traceback.format_exc(),
        }
    write_json(outcome, Path(folder) / f"{spec.key}.json")
    return spec.key


def write_json(content: Any, path: Path) -> None:
    """Write a file whole or not at all, so that a killed run leaves nothing half done."""
    path.parent.mkdir(parents=True, exist_ok=True)
    partial = path.with_suffix(".partial")
    partial.write_text(json.dumps(content, indent=1, allow_nan=True), encoding="utf-8")
    partial.replace(path)


def _plain(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {str(k): _plain(v) for k, v in value.items()}
    if isinstance(value, (list, tuple, np.ndarray)):
        return [_plain(v) for v in value]
    if isinstance(value, (bool, np.bool_)):
        return bool(value)
    if isinstance(value, (int, np.integer)):
        return int(value)
    if isinstance(value, (float, np.floating)):
        return float(value)
    return value if value is None or isinstance(value, str) else str(value)


def is_close(error: float | None) -> bool:
    """Return whether a main parameter is within the bar of 10 %."""
    return error is not None and math.isfinite(error) and error <= 0.10
