"""Effects in exported C and Python: each alone, all together, and those that cannot be exported or inverted."""

from __future__ import annotations

import shutil
import subprocess
from dataclasses import replace
from pathlib import Path
from typing import ClassVar

import numpy as np
import pytest
from random_models import relative

from benchmarks.export_rows import BARS, errors_of, jumping_drive
from benchmarks.exported import Exported
from fomrc_core.control.compensation_loop import CompensationLoop, LoopSettings
from fomrc_core.control.voltage_limits import VoltageLimits
from fomrc_core.effects import effect_classes
from fomrc_core.effects.amplifier_bandwidth import AmplifierBandwidth
from fomrc_core.effects.amplitude_dependent_creep import AmplitudeDependentCreep
from fomrc_core.effects.asymmetric_hysteresis import AsymmetricHysteresis
from fomrc_core.effects.clock_skew import ClockSkew
from fomrc_core.effects.creep_law import CreepLaw
from fomrc_core.effects.dac_quantization import DacQuantization
from fomrc_core.effects.dead_zone import DeadZone
from fomrc_core.effects.gain_drift import GainDrift
from fomrc_core.effects.intermittent_contact import IntermittentContact
from fomrc_core.effects.slow_relaxation import SlowRelaxation
from fomrc_core.effects.thermal_drift import ThermalDrift
from fomrc_core.effects.transport_delay import TransportDelay
from fomrc_core.effects.zero_order_hold import ZeroOrderHold
from fomrc_core.errors import ParameterError
from fomrc_core.export import Direction, ExportOptions, Language, Precision, export_model, run_self_test
from fomrc_core.export.self_test import C_FLAGS
from fomrc_core.model.compensator import Compensator
from fomrc_core.model.piezo_model import PiezoModel
from fomrc_core.model.prehistory import Prehistory
from fomrc_core.model.substeps import Substeps
from fomrc_core.storage import read_model

ROOT = Path(__file__).parents[3]
EVERY = read_model(ROOT / "benchmarks" / "every_effect.yaml")
PLAIN = PiezoModel(EVERY.kappa_um_per_v, EVERY.saturation_v, EVERY.creep_order, substeps=Substeps.BENDS)
SANITIZERS = ("-std=c99", "-O1", "-g", "-fsanitize=address,undefined", "-fno-sanitize-recover=all")
QUICK = (*(flag for flag in C_FLAGS if flag != "-O2"), "-O0")
PERIOD_S = 1e-3


def options(**changes) -> ExportOptions:
    return ExportOptions(**{"name": "stage", "sample_period_s": PERIOD_S, "is_dropping": True, **changes})


# In the place of the fractional creep, not beside it: no part of a model with every effect.
CREEP_LAW = CreepLaw(per_decade=0.02, onset_s=0.01, first_share=0.05, first_s=3.0)
# The other forms of effects that are among them.
LEAD = IntermittentContact(opens_s=(0.021, 0.3), closes_s=(0.05, 0.34))
EACH_SAMPLE = ZeroOrderHold(5.0 * PERIOD_S, per_sample=1.0)
OF_ELEMENTS = AmplitudeDependentCreep(
    per_decade_per_um=1e-3,
    onset_s=0.2,
    switched_per_decade=0.02,
    reach_um=2.0,
    elements_per_decade=0.1,
    steepness=0.7,
    reach_v=2.0,
    creep_order=0.015,
    thresholds_v=(0.1, 0.4, 1.1),
    weights_um_per_v=(0.3, 0.2, 0.4),
)
OTHER_FORMS = (LEAD, EACH_SAMPLE, OF_ELEMENTS)


def test_every_effect_is_exported() -> None:
    assert {effect.name for effect in (*EVERY.effects, CREEP_LAW)} == set(effect_classes())


@pytest.mark.parametrize("effect", [*EVERY.effects, CREEP_LAW, *OTHER_FORMS], ids=lambda effect: effect.name)
def test_an_effect_alone_passes_its_self_test_in_c_and_python(effect, tmp_path) -> None:
    model = replace(PLAIN, creep_order=0.0 if effect.replaces_creep else PLAIN.creep_order).with_effects(effect)
    written = export_model(model, tmp_path / "c", options())
    assert [cause.name for cause in written.left_out] == ([] if effect.can_invert else [effect.name])
    assert run_self_test(tmp_path / "c", "stage", Language.C, "gcc", QUICK).lines[-1] == "self-test passed"
    export_model(model, tmp_path / "python", options(language=Language.PYTHON))
    assert len(run_self_test(tmp_path / "python", "stage", Language.PYTHON).lines) == 2


@pytest.mark.parametrize("precision", list(Precision))
@pytest.mark.parametrize("way", ["forward", "inverse"])
def test_all_effects_together_over_sweeps_jumps_and_rests(precision, way) -> None:
    steps, voltage = jumping_drive(6000)
    values = voltage if way == "forward" else PLAIN.simulate(steps, voltage)
    compiled = Exported(EVERY, options(precision=precision), way)
    for lengths in (None, steps * np.random.default_rng(0).uniform(0.5, 2.0, steps.size)):
        assert np.max(errors_of(compiled, EVERY, lengths, values)) <= BARS[precision]


@pytest.mark.parametrize("precision", list(Precision))
def test_an_effect_that_follows_the_elements_hears_the_drive_they_see(precision) -> None:
    # bent before the elements, and beside another effect of the mechanics: it is the bent drive that is heard
    bent = AsymmetricHysteresis(warp_per_v=0.05)
    model = PLAIN.with_effects(bent, AmplifierBandwidth(80.0), SlowRelaxation(0.02, 0.5), OF_ELEMENTS)
    _, voltage = jumping_drive(3000)
    compiled = Exported(model, options(precision=precision, direction=Direction.FORWARD), "forward")
    assert np.max(errors_of(compiled, model, None, voltage)) <= BARS[precision]


@pytest.mark.parametrize("precision", list(Precision))
@pytest.mark.parametrize("effects", [(DeadZone(0.005),), (AmplifierBandwidth(80.0), DeadZone(0.005))])
def test_an_inverse_that_jumps_at_zero_volts_does_so_with_python(precision, effects) -> None:
    # Half of the targets are those of zero volts: single precision leaves 1e-8 V of either sign, double 1e-17.
    steps, voltage = jumping_drive(6000)
    voltage[::2] = 0.0
    values = replace(PLAIN, substeps=Substeps.NONE).simulate(steps, voltage)
    model = PLAIN.with_effects(*effects)
    assert np.count_nonzero(np.abs(Compensator(PLAIN).run(steps, values)) < 1e-12) >= 3000
    compiled = Exported(model, options(precision=precision), "inverse", flags=("-std=c99", "-O0"))
    assert np.max(errors_of(compiled, model, None, values)) <= BARS[precision]


def test_what_jumps_is_computed_in_double_and_said(tmp_path) -> None:
    single = options(precision=Precision.FLOAT)
    export_model(PLAIN.with_effects(DeadZone(0.005)), tmp_path / "both", single)
    for file_name in ("stage.h", "stage.c"):
        assert "dead_zone may jump" in (tmp_path / "both" / file_name).read_text()
    assert "computed in double" in (tmp_path / "both" / "README.md").read_text()
    forward = replace(single, direction=Direction.FORWARD)
    export_model(PLAIN.with_effects(DeadZone(0.005)), tmp_path / "forward", forward)
    assert "may jump" not in (tmp_path / "forward" / "stage.h").read_text()
    # What comes in is what jumps: nothing was computed before it.
    held = PLAIN.with_effects(ZeroOrderHold(PERIOD_S), DacQuantization(0.001), IntermittentContact(1.0, 0.1))
    export_model(held, tmp_path / "held", forward)
    assert "may jump" not in (tmp_path / "held" / "stage.h").read_text()


@pytest.mark.parametrize(("compiler", "precision"), [("gcc", Precision.DOUBLE), ("clang", Precision.FLOAT)])
def test_no_warning_and_no_undefined_behaviour_with_every_effect(compiler, precision, tmp_path) -> None:
    if compiler != "gcc" and shutil.which(compiler) is None:
        pytest.skip(f"{compiler} is not installed")
    model = EVERY.with_start(Prehistory(1.0, -0.5, 2.0, 1.0))
    export_model(model, tmp_path, options(precision=precision))
    program = tmp_path / "test"
    sources = [str(tmp_path / "stage.c"), str(tmp_path / "self_test.c")]
    # warnings as it is delivered; what watches the run compiles in a quarter of the time where little is optimised
    for flags in (C_FLAGS, SANITIZERS):
        subprocess.run([compiler, *flags, *sources, "-lm", "-o", str(program)], check=True)
    done = subprocess.run([str(program), "300"], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr


def test_a_fixed_step_with_every_effect_calls_no_library(tmp_path) -> None:
    export_model(EVERY, tmp_path, options())
    command = ["gcc", "-std=c99", "-O2", "-DSTAGE_FIXED_STEP_ONLY", "-c", str(tmp_path / "stage.c")]
    subprocess.run([*command, "-o", str(tmp_path / "stage.o")], check=True)
    listed = subprocess.run(["nm", "-u", str(tmp_path / "stage.o")], capture_output=True, text=True, check=True).stdout
    needed = {line.split()[-1] for line in listed.splitlines()} - {"_GLOBAL_OFFSET_TABLE_"}
    assert needed <= {"memcpy", "memcmp", "memset", "__stack_chk_fail"}


def test_a_sensor_whose_clock_runs_late_continues_the_last_slope(tmp_path) -> None:
    export_model(PLAIN.with_effects(ClockSkew(ppm=900.0)), tmp_path, options())
    run_self_test(tmp_path, "stage", Language.C, "gcc", QUICK)


def test_a_model_starts_where_its_past_leaves_it(tmp_path) -> None:
    past = Prehistory(1.5, -0.4, 3.0, 0.7)
    export_model(EVERY.with_start(past), tmp_path / "every", options())
    run_self_test(tmp_path / "every", "stage", Language.C, "gcc", QUICK)
    export_model(PLAIN.with_start(past), tmp_path / "plain", options(language=Language.PYTHON))
    run_self_test(tmp_path / "plain", "stage", Language.PYTHON)


@pytest.mark.parametrize("substeps", [Substeps.NONE, Substeps.JUMPS])
def test_steps_are_divided_as_the_model_says(substeps) -> None:
    _, voltage = jumping_drive(3000)
    for model in (PLAIN, PLAIN.with_effects(AmplifierBandwidth(80.0), GainDrift(1e-3))):
        divided = replace(model, substeps=substeps)
        compiled = Exported(divided, options(), "forward", flags=("-std=c99", "-O0"))
        assert np.max(errors_of(compiled, divided, None, voltage)) <= 1e-12


def test_what_has_no_inverse_is_refused_or_left_out_and_said(tmp_path) -> None:
    model = PLAIN.with_effects(GainDrift(1e-4), SlowRelaxation(0.1, 0.5))
    with pytest.raises(ParameterError, match=r"gain_drift: effect cannot be inverted.*--drop"):
        export_model(model, tmp_path / "a", options(is_dropping=False))
    assert not (tmp_path / "a").exists()
    assert export_model(model, tmp_path / "b", options(is_dropping=False, direction=Direction.FORWARD)).left_out == ()
    export_model(model, tmp_path / "c", options())
    for file_name in ("stage.h", "stage.c", "README.md"):
        text = (tmp_path / "c" / file_name).read_text()
        assert "eft out: gain_drift (of the inverse; not inverted: the drift is" in " ".join(text.split())
    inverse = (tmp_path / "c" / "stage.c").read_text().split("static real inverse_value")[1].split("\n}\n")[0]
    assert "slow_relaxation_inverse" in inverse
    assert "gain_drift" not in inverse


def test_an_effect_without_a_step_form_is_refused_or_left_out(tmp_path) -> None:
    class Untold(GainDrift):
        name: ClassVar[str] = "untold"

        def step_form(self, shortest_part_s):
            return None

    model = PLAIN.with_effects(Untold(1e-4))
    with pytest.raises(ParameterError, match=r"model.untold: effect cannot be exported.*no step form"):
        export_model(model, tmp_path / "a", options(is_dropping=False, direction=Direction.FORWARD))
    written = export_model(model, tmp_path / "b", options())
    assert str(written.left_out[0]) == "untold (it has no step form)"
    run_self_test(tmp_path / "b", "stage", Language.C, "gcc", QUICK)


def test_limits_with_effects_are_those_of_the_node() -> None:
    # The node searches for the displacement to 1e-12 V; so does the exported step.
    asymmetric = AsymmetricHysteresis((0.2,), (0.1,), (0.05,), warp_per_v=0.01)
    limits = VoltageLimits(minimum_v=-1.2, maximum_v=1.5, slew_v_per_s=200.0, safe_v=0.0, safe_ramp_v_per_s=5.0)
    target_um = 2.4 * np.sin(np.linspace(0.0, 12.0, 500)) + np.where(np.arange(500) // 100 % 2 == 0, 0.0, 0.3)
    settings = LoopSettings(limits, stale_after_s=0.0, ramps_when_stale=False, period_s=PERIOD_S, history_s=0.01)
    for effects in ((AmplifierBandwidth(200.0), SlowRelaxation(0.05, 0.3)), (asymmetric,)):
        model = PLAIN.with_effects(*effects)
        loop = CompensationLoop(Compensator(model), settings)
        wanted = np.empty(target_um.size)
        for k, target in enumerate(target_um):
            loop.set_target(float(target))
            wanted[k] = loop.tick(PERIOD_S)
        assert loop.counts.n_clamped > 30
        answers = Exported(model, options(limits=limits), "inverse", flags=("-std=c99", "-O0")).run_limited(target_um)
        assert relative(answers, wanted) <= 1e-8


def run_c(folder: Path, body: str, way: str = "forward") -> list[str]:
    """Lines that a program prints which has an exported state of its own."""
    (folder / "user.c").write_text(
        '#include "stage.h"\n#include <stdio.h>\n#include <string.h>\n#include <math.h>\n'
        f"int main(void) {{ stage_{way} state, before; stage_{way}_init(&state); before = state;\n{body}\n"
        "(void)before; return 0; }\n"
    )
    program = str(folder / "user")
    command = ["gcc", "-std=c99", "-O0", str(folder / "user.c"), str(folder / "stage.c"), "-lm", "-o", program]
    subprocess.run(command, check=True)
    return subprocess.run([program], capture_output=True, text=True, check=True).stdout.split()


def test_a_delay_has_no_answer_while_steps_are_too_short_for_its_line(tmp_path) -> None:
    export_model(PLAIN.with_effects(TransportDelay(0.02)), tmp_path, options())
    lines = run_c(
        tmp_path,
        "int first = 1, last, later; double answer;\n"
        "for (int k = 0; k < 400; k++) { answer = stage_forward_step(&state, 0.5, 1e-4); first &= answer == answer; }\n"
        "for (int k = 0; k < 4000; k++) answer = stage_forward_step(&state, 0.5, 1e-5);\n"
        "last = answer == answer;\n"
        "for (int k = 0; k < 100; k++) answer = stage_forward_step_fixed(&state, 0.5);\n"
        'later = answer == answer; printf("%d %d %d\\n", first, last, later);',
    )
    assert lines == ["1", "0", "1"]


def test_a_warp_that_turns_back_is_answered_with_nan_and_does_no_harm(tmp_path) -> None:
    model = PLAIN.with_effects(AsymmetricHysteresis(warp_per_v=0.3), SlowRelaxation(0.05, 0.3))
    # It turns back within the range of the golden data.
    with pytest.raises(ParameterError, match="turns back"):
        export_model(model, tmp_path / "steep", options())
    export_model(PLAIN.with_effects(AsymmetricHysteresis(warp_per_v=0.05)), tmp_path / "mild", options())
    lines = run_c(
        tmp_path / "mild",
        "for (int k = 0; k < 30; k++) stage_inverse_step_fixed(&state, 0.01 * k);\nbefore = state;\n"
        "double far = stage_inverse_step_fixed(&state, -9.0);\n"
        "double limited = stage_inverse_step_fixed_limited(&state, &stage_default_limits, -9.0);\n"
        'printf("%d %d %d\\n", far != far, limited != limited, !memcmp(&before, &state, sizeof state));',
        "inverse",
    )
    assert lines == ["1", "1", "1"]


def test_a_temperature_counts_from_the_first_that_is_known(tmp_path) -> None:
    model = PLAIN.with_effects(ThermalDrift(um_per_c=0.5))
    export_model(model, tmp_path, options())
    lines = run_c(
        tmp_path,
        "double cold, first, warm, unknown;\n"
        "cold = stage_forward_step_fixed(&state, 0.0);\n"
        "stage_forward_set_temperature_c(&state, 21.0); first = stage_forward_step_fixed(&state, 0.0);\n"
        "stage_forward_set_temperature_c(&state, 23.0); warm = stage_forward_step_fixed(&state, 0.0);\n"
        "stage_forward_set_temperature_c(&state, (double)NAN); unknown = stage_forward_step_fixed(&state, 0.0);\n"
        'printf("%g %g %g %g\\n", cold, first, warm, unknown);',
    )
    assert [float(line) for line in lines] == [0.0, 0.0, 1.0, 0.0]


@pytest.mark.parametrize("direction", [Direction.FORWARD, Direction.INVERSE])
@pytest.mark.parametrize("flag", ["-DSTAGE_FIXED_STEP_ONLY", "-DANY_STEP"])
def test_no_part_stands_there_unused(direction, flag, tmp_path) -> None:
    export_model(EVERY, tmp_path, options(direction=direction))
    command = ["gcc", *QUICK, flag, "-c", str(tmp_path / "stage.c"), "-o", str(tmp_path / "stage.o")]
    subprocess.run(command, check=True)
