"""``from fomrc_core import ...``: what is offered, when it is imported, and how results print themselves."""

from __future__ import annotations

import ast
import inspect
import os
import pickle
import pydoc
import subprocess
import sys
from importlib.metadata import version
from pathlib import Path

import numpy as np
import pytest

import fomrc_core
from fomrc_core import Compensator, Fit, FomrcError, PiezoModel, Recording, identify, read_model
from fomrc_core.effects.amplifier_bandwidth import AmplifierBandwidth
from fomrc_core.effects.mains_hum import MainsHum
from fomrc_core.identification.fleet import FleetRecord
from fomrc_core.identification.uncertainty import ElementUncertainty, Uncertainty
from fomrc_core.records.excitation import triangle

_ROOT = Path(__file__).resolve().parents[2]
_TABLE_1 = _ROOT / "config" / "pi_p753_table1.yaml"


def _in_new_python(script: str) -> str:
    environment = {k: v for k, v in os.environ.items() if k != "_ROS_WHEELS_BOOTSTRAP_COMPLETE"}
    environment["PYTHONPATH"] = str(_ROOT)
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, env=environment, check=True)
    return done.stdout.splitlines()[-1]


def test_every_public_name_is_what_its_module_defines() -> None:
    tree = ast.parse((_ROOT / "fomrc_core" / "__init__.py").read_text())
    for_types = next(node for node in tree.body if isinstance(node, ast.If))
    stated = {a.name: node.module for node in for_types.body if isinstance(node, ast.ImportFrom) for a in node.names}
    assert {*stated, "__version__"} == set(fomrc_core.__all__)
    assert stated == fomrc_core._MODULE_OF_NAME
    for name, module in stated.items():
        assert getattr(fomrc_core, name) is getattr(sys.modules[module], name)
    assert set(fomrc_core.__all__) <= set(dir(fomrc_core))


def test_the_version_is_that_of_the_installed_package() -> None:
    assert fomrc_core.__version__ == version("fomrc_ros")


def test_a_name_it_does_not_have_is_an_attribute_error() -> None:
    with pytest.raises(AttributeError, match="no attribute 'identfy'"):
        _ = fomrc_core.identfy


def test_importing_the_package_costs_nothing_beside_numpy() -> None:
    # CPU of this process alone, so that a busy machine does not matter; the bar is 0.15 s.
    script = "import time, numpy; begun = time.process_time(); import fomrc_core; print(time.process_time() - begun)"
    assert float(_in_new_python(script)) < 0.05


def test_a_model_and_its_inverse_wait_for_nothing_a_fit_needs() -> None:
    script = (
        "import sys; from fomrc_core import Compensator, PiezoModel, read_model;"
        f"Compensator(read_model({str(_TABLE_1)!r})).initial_state();"
        "slow = {'scipy.signal', 'scipy.stats', 'scipy.optimize', 'matplotlib', 'typer', 'rich', 'pooch'};"
        "print(sorted(slow & set(sys.modules)))"
    )
    assert _in_new_python(script) == "[]"


@pytest.fixture(scope="module")
def record() -> Recording:
    drive = triangle(slope_v_per_s=5.0, n_cycles=2, rate_hz=200.0)
    moved_um = read_model(_TABLE_1).simulate(np.full(drive.n_samples, 1 / 200), drive.voltage_v)
    noise_um = np.random.default_rng(0).normal(0.0, 1e-3, drive.n_samples)
    return Recording(drive.time_s, drive.voltage_v, moved_um + noise_um, name="stage.csv")


@pytest.fixture(scope="module")
def fit(record: Recording) -> Fit:
    return identify(record, n_elements=4)


def test_a_recording_prints_its_size_and_ranges(record: Recording) -> None:
    first, *columns = str(record).splitlines()
    assert first == f"stage.csv: {record.n_samples} samples in {record.duration_s:g} s, every 0.005 s"
    assert [line.split()[0] for line in columns] == ["voltage_v", "displacement_um"]
    assert columns[0] == "voltage_v -2.5 to 2.5"


def test_a_fit_shows_itself_in_a_notebook(fit: Fit) -> None:
    assert all(line in fit._repr_html_() for line in ("creep order", "piezo model: 4 elements"))
    (axes,) = fit.plot().axes
    assert np.std(axes.get_lines()[0].get_ydata()) == pytest.approx(1e3 * fit.rms_um, rel=0.01)


def test_a_drive_prints_its_size_and_range() -> None:
    assert str(triangle(slope_v_per_s=5.0, n_cycles=1, rate_hz=100.0)) == "triangle: 201 samples, 2 s, -2.5 to 2.5 V"


def test_a_model_prints_its_gains_and_effects() -> None:
    model = PiezoModel(np.array([2.0, 1.0, 0.5]), np.array([0.5, 1.0]), 0.03, (AmplifierBandwidth(cutoff_hz=120.0),))
    first, gains, effect = str(model).splitlines()
    assert first == "piezo model: 2 elements, creep order 0.03"
    # Elements in series to the voltage: 1 / (1/2 + 1/1 + 1/0.5) before any slips, 0.5 after all have.
    assert gains.startswith("gain 0.28571 um/V at a turning point, 0.5 um/V once all elements slip")
    assert effect == "effect amplifier_bandwidth (cutoff_hz 120)"
    plain = PiezoModel(np.array([2.0]), np.array([]), 0.0)
    assert str(plain) == "piezo model: 0 elements, creep order 0\ngain 2 um/V at a turning point"


def test_a_compensator_prints_what_it_leaves_as_it_is() -> None:
    hum = MainsHum(frequency_hz=50.0, amplitude_um=0.01, phase_rad=0.0)
    told = str(Compensator(read_model(_TABLE_1).with_effects(hum)))
    assert told.startswith("compensator of a piezo model")
    assert "mains_hum is left as it is: " in told.splitlines()[-1]


def test_a_fit_prints_how_good_it_is(fit: Fit) -> None:
    first, order, error = str(fit).splitlines()
    assert first == f"{fit.outcome.value}: {fit.reason}"
    assert order.startswith(f"creep order {fit.model.creep_order:.5g} +- ")
    assert f"NRMSE {fit.nrmse_percent:.4g} %" in error


def test_an_uncertainty_prints_a_line_for_each_element() -> None:
    element = ElementUncertainty(1, 0.5, 0.01, 1.5, 0.4, 1.6, False)
    told = str(Uncertainty((element,), 0.03, (0.02, 0.04), (0.4, 0.6), np.zeros((20, 4)), ("drive it further",)))
    assert told.splitlines() == [
        "creep order 0.03, between 0.02 and 0.04 (95 %)",
        "element 1: kappa 0.5 um/V +- 1 %, saturation 1.5 V +- 40 %, not determined by this data",
        "drive it further",
    ]


def test_a_record_of_a_fleet_prints_what_became_of_it() -> None:
    assert str(FleetRecord("a.csv", False, False, "too short")) == "a.csv failed: too short"
    assert str(FleetRecord("a.csv", True, True, "", 0.5, 0.03)) == "a.csv: creep order 0.03, NRMSE 0.5 % (kept)"


def test_results_pickle(record: Recording, fit: Fit) -> None:
    for result in (record, fit.model, fit):
        assert str(pickle.loads(pickle.dumps(result))) == str(result)
    drive = np.linspace(0.0, 1.0, 50)
    inverse = pickle.loads(pickle.dumps(Compensator(fit.model)))
    expected = Compensator(fit.model).run(np.full(50, 0.01), drive)
    np.testing.assert_array_equal(inverse.run(np.full(50, 0.01), drive), expected)
    refused = FomrcError("not so")
    assert str(pickle.loads(pickle.dumps(refused))) == "not so"
    table = fit.to_dataframe()
    assert list(table.columns) == ["threshold_v", "threshold_error", "weight_um_per_v", "weight_error"]
    np.testing.assert_array_equal(table["weight_um_per_v"], fit.model.play_form.weights)


def test_help_of_every_public_name_is_whole() -> None:
    for name in set(fomrc_core.__all__) - {"__version__"}:
        offered = getattr(fomrc_core, name)
        text = pydoc.render_doc(offered, renderer=pydoc.plaintext)
        assert inspect.getdoc(offered), name
        members = inspect.getmembers(offered, inspect.isfunction) if inspect.isclass(offered) else []
        bare = [n for n, member in members if not n.startswith("_") and not inspect.getdoc(member)]
        assert bare == [], name
        assert name in text
