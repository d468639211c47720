"""Model files: ROS parameter files that read back bit for bit, and one line for whatever is wrong."""

from __future__ import annotations

import itertools
import os
import re
from pathlib import Path

import numpy as np
import pytest
import yaml
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from fomrc_core.errors import ParameterError, StorageError
from fomrc_core.model.piezo_model import PiezoModel
from fomrc_core.storage import model_to_parameters, read_model, write_model

_GOOD_MODEL = """
/**:
  ros__parameters:
    rate_hz: 1000.0
    model:
      kappa_um_per_v: [10.0, 1.25]
      saturation_v: [0.1]
      creep_order: 15e-3
"""


def _file(folder: Path, text: str | bytes) -> Path:
    path = folder / "model.yaml"
    path.write_bytes(text.encode() if isinstance(text, str) else text)
    return path


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None)
@given(data=st.data(), n=st.integers(1, 12), creep_order=st.floats(0.0, 1.0))
def test_models_read_back_bit_for_bit(tmp_path: Path, data: st.DataObject, n: int, creep_order: float) -> None:
    positive = st.floats(1e-6, 1e6)
    kappa = data.draw(arrays(np.float64, n + 1, elements=positive))
    saturation = data.draw(arrays(np.float64, n, elements=positive))
    model = PiezoModel(kappa, saturation, creep_order)
    write_model(model, tmp_path / "model.yaml")
    again = read_model(tmp_path / "model.yaml")
    np.testing.assert_array_equal(again.kappa_um_per_v, kappa)
    np.testing.assert_array_equal(again.saturation_v, saturation)
    assert again.creep_order == creep_order
    # What ROS reads is what any YAML reader reads: the nesting, and numbers as numbers.
    plain = yaml.safe_load((tmp_path / "model.yaml").read_text())
    assert plain == model_to_parameters(model)


@pytest.mark.parametrize(
    "text",
    [
        _GOOD_MODEL,
        _GOOD_MODEL.replace("/**", "/axis1/compensator"),
        _GOOD_MODEL + "/other:\n  ros__parameters: {rate_hz: 5.0}\n",
        "/**: {ros__parameters: {model.kappa_um_per_v: [10.0, 1.25], model: {saturation_v: [0.1]}, "
        "model.creep_order: 0.015}}",
    ],
)
def test_ros_parameter_files_are_models(tmp_path: Path, text: str) -> None:
    model = read_model(_file(tmp_path, text))
    assert model.creep_order == 0.015
    np.testing.assert_array_equal(model.kappa_um_per_v, [10.0, 1.25])


_BOMB = "a: &a [x, x, x]\n" + "".join(
    f"{b}: &{b} [{', '.join(['*' + a] * 9)}]\n" for a, b in itertools.pairwise("abcdefghij")
)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("", "empty file"),
        ("just text", "not a parameter file"),
        ("model: {creep_order: 0.1}", "no model in the file, got ['model']"),
        ("/**: {model: {creep_order: 0.1}}", "no model in the file"),
        ("/**: {ros__parameters: {rate_hz: 1.0}}", "no model in the file"),
        ("/**: {ros__parameters: {model: [1, 2]}}", "not a block of parameters"),
        ("/**:\n  ros__parameters:\n\tmodel: 1\n", "model.yaml, line 3: not plain YAML"),
        ("/**: [1, 2\n", "not plain YAML"),
        (
            "a: !!python/object/apply:os.system ['true']",
            "line 1: not plain YAML (could not determine a constructor",
        ),
        ("/**: {ros__parameters: {x: 1, x: 2}}", "key 'x' stands twice"),
        ("? [1, 2]\n: 3", "not a name"),
        ("a: 2024-13-45", "not plain YAML"),
        ("a: 1\n---\nb: 2\n", "not plain YAML (but found another document)"),
        (_BOMB, "references (*) are not allowed"),
        ("[" * 5000, "nested too deeply"),
        ("#" * 300_000, "file too large"),
        (_GOOD_MODEL.replace("/**", "a") + _GOOD_MODEL.replace("/**", "b"), "several nodes have a model"),
        ("/**: {ros__parameters: {model.x: 1, model.x.y: 2}}", "'x' is both a value and a group"),
    ],
)
def test_what_is_wrong_with_a_model_file_is_told(tmp_path: Path, text: str, expected: str) -> None:
    with pytest.raises(StorageError, match=re.escape(expected)) as caught:
        read_model(_file(tmp_path, text))
    assert "\n" not in str(caught.value)
    assert "model.yaml" in str(caught.value)


@pytest.mark.parametrize(
    ("old", "new", "expected"),
    [
        ("15e-3", "1.5", "creep_order"),
        ("15e-3", ".nan", "creep_order"),
        ("15e-3", "soft", "creep_order"),
        ("[0.1]", "[0.1, 0.2]", "saturation_v"),
        ("[0.1]", "[-0.1]", "saturation_v"),
        ("[10.0, 1.25]", "[ten, 1.25]", "kappa_um_per_v"),
        ("creep_order", "creep_odor", "creep_order"),
    ],
)
def test_wrong_values_of_a_model_are_told_with_the_file(tmp_path: Path, old: str, new: str, expected: str) -> None:
    with pytest.raises(ParameterError, match=expected) as caught:
        read_model(_file(tmp_path, _GOOD_MODEL.replace(old, new)))
    assert "\n" not in str(caught.value)
    assert "model.yaml" in str(caught.value)


def test_binary_junk_is_no_model(tmp_path: Path) -> None:
    with pytest.raises(StorageError, match="not a text file"):
        read_model(_file(tmp_path, os.urandom(64) + b"\xff\xfe\x00"))
