"""Recordings as laboratories have them: each understood as it was meant, or refused in one line."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from odd_exports import EXPORTS_REFUSED, EXPORTS_UNDERSTOOD
from odd_recordings import REFUSED, UNDERSTOOD, Odd, truth

import fomrc_core.cli.fit_commands  # noqa: F401  the library's warnings come before those of a test
from fomrc_core.cli.application import run
from fomrc_core.storage import read_recording

_UNDERSTOOD, _REFUSED = (*UNDERSTOOD, *EXPORTS_UNDERSTOOD), (*REFUSED, *EXPORTS_REFUSED)
_NEEDED = {".parquet": "pyarrow", ".xlsx": "openpyxl", ".h5": "h5py", ".tdms": "nptdms"}


def _written(odd: Odd, folder: Path) -> Path:
    path = folder / odd.name
    if path.suffix in _NEEDED:
        pytest.importorskip(_NEEDED[path.suffix])
        pytest.importorskip("pandas")
    odd.write(path)
    return path


def test_there_are_sixty_and_more() -> None:
    names = [odd.name for odd in (*_UNDERSTOOD, *_REFUSED)]
    assert len(set(names)) == len(names) >= 60


@pytest.mark.filterwarnings("ignore::DeprecationWarning")
@pytest.mark.parametrize("odd", _UNDERSTOOD, ids=lambda odd: odd.name)
def test_it_is_understood_as_it_was_meant(odd: Odd, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = _written(odd, tmp_path)
    assert run(["import", str(path), "--output", str(tmp_path / "ours.csv"), *odd.options]) == 0, (
        capsys.readouterr().err
    )
    told = capsys.readouterr().err
    assert odd.said in told
    assert f"read {odd.name}: " in told
    ours = read_recording(tmp_path / "ours.csv")
    meant = truth(**odd.shape)  # type: ignore[arg-type]
    read = (ours.time_s, ours.voltage_v, ours.measured_um)
    for values, expected, scale in zip(read, meant, odd.scales, strict=True):
        np.testing.assert_allclose(
            values[odd.rows], scale * expected[odd.rows], rtol=1e-6, atol=1e-6 * np.ptp(expected)
        )


@pytest.mark.parametrize("odd", _REFUSED, ids=lambda odd: odd.name)
def test_it_is_refused_in_one_line(odd: Odd, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = _written(odd, tmp_path)
    assert run(["identify", str(path), "--output", str(tmp_path / "model.yaml"), "--elements", "2", *odd.options]) == 2
    *before, line = capsys.readouterr().err.splitlines()
    assert line.startswith("fomrc: ")
    assert odd.refused is not None
    assert odd.refused in line
    assert odd.name in line
    assert all(shown.startswith(("read ", "identify: ")) for shown in before)
    assert not (tmp_path / "model.yaml").exists()
