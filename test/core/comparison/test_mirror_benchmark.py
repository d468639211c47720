"""The mirror benchmark: files that do not fit are told in a line, and scores are what they are said to be."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from fomrc_core.cli.application import run
from fomrc_core.comparison.mirror_benchmark import read_sets, score_causal, score_steady
from fomrc_core.errors import StorageError
from fomrc_core.model.axes import AxesModel
from fomrc_core.model.piezo_model import PiezoModel


def _write(folder: Path, level: int, shape: tuple[int, ...] = (64, 3, 6, 2)) -> None:
    values = np.random.default_rng(level).normal(size=shape)
    for quantity in "uy":
        np.save(folder / f"{quantity}_{level}mV_train.npy", values)


def test_sets_are_read_in_um_by_level(tmp_path: Path) -> None:
    for level in (200, 100):
        _write(tmp_path, level)
    sets = read_sets(tmp_path, "train")
    assert [one.level_mv for one in sets] == [100, 200]
    assert sets[0].displacement_um == pytest.approx(1e6 * sets[0].voltage_v)


def test_files_that_do_not_fit_are_told_in_a_line(tmp_path: Path) -> None:
    with pytest.raises(StorageError, match="no train sets"):
        read_sets(tmp_path, "train")
    _write(tmp_path, 100)
    (tmp_path / "y_100mV_train.npy").unlink()
    with pytest.raises(StorageError, match=r"y_100mV_train.npy: file is missing"):
        read_sets(tmp_path, "train")
    np.save(tmp_path / "y_100mV_train.npy", np.zeros((64, 3, 5, 2)))
    with pytest.raises(StorageError, match="shape differs from that of its voltages"):
        read_sets(tmp_path, "train")
    (tmp_path / "y_100mV_train.npy").write_bytes(b"not numpy")
    with pytest.raises(StorageError, match="not a readable npy file"):
        read_sets(tmp_path, "train")
    _write(tmp_path, 100)
    np.save(tmp_path / "u_100mV_train.npy", np.full((64, 3, 6, 2), np.nan))
    with pytest.raises(StorageError, match="not finite numbers"):
        read_sets(tmp_path, "train")
    _write(tmp_path, 100, (64, 3))
    with pytest.raises(StorageError, match="not four-dimensional"):
        read_sets(tmp_path, "train")


def test_a_bad_folder_or_level_ends_with_status_2(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    _write(tmp_path, 100)
    output = ["--output", str(tmp_path / "out")]
    assert run(["benchmark", "fsm", "--train", str(tmp_path / "none"), *output]) == 2
    assert run(["benchmark", "fsm", "--train", str(tmp_path), "--levels", "1x", *output]) == 2
    assert run(["benchmark", "fsm", "--train", str(tmp_path), "--levels", "300", *output]) == 2
    lines = capsys.readouterr().err.strip().splitlines()
    assert len(lines) == 3
    assert "no such folder" in lines[0]
    assert "not a list of levels" in lines[1]
    assert "no such level" in lines[2]


def test_a_model_that_is_right_scores_nothing_and_noise_scores_itself() -> None:
    rng = np.random.default_rng(0)
    model = AxesModel(tuple(PiezoModel(np.array([2.0]), np.zeros(0), 0.0) for _ in range(3)))
    u = np.repeat(rng.normal(size=(2000, 3, 1)), 2, axis=2)
    assert score_steady(model, u, 2.0 * u) == pytest.approx(0.0, abs=1e-12)
    assert score_causal(model, u, 2.0 * u + 5.0) == pytest.approx(0.0, abs=1e-12)
    noise = rng.normal(size=u.shape)
    assert score_steady(model, u, 2.0 * u + 0.02 * noise) == pytest.approx(0.01, rel=0.05)
