"""Parts of ``fomrc demo --fast``: what it asks of a stage, and the picture; the whole takes a minute."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from small_model import MODEL

from fomrc_core.model.piezo_model import PiezoModel
from fomrc_ros.demo import fast_scans
from fomrc_ros.demo.fast_figure import save_figure


def test_a_raster_is_straight_but_for_its_turns():
    time_s = np.arange(0.0, 2.0, 1e-4)
    for frequency_hz, asked in ((1.0, 0.99), (10.0, 0.9), (30.0, 0.8)):
        course_um = fast_scans.raster_um(frequency_hz, time_s)
        assert asked * fast_scans.RANGE_UM < np.ptp(course_um) <= fast_scans.RANGE_UM * 1.01
        spectrum = np.abs(np.fft.rfft(course_um))
        above = np.fft.rfftfreq(time_s.size, 1e-4) > fast_scans.ROUNDED_HZ + 1.0
        assert np.max(spectrum[above]) < 1e-9 * np.max(spectrum)


def test_every_way_is_scanned_and_drawn(tmp_path: Path, monkeypatch) -> None:
    """With a model that knows nothing of the dynamics, so that all that compensates is the static inverse."""
    monkeypatch.setattr(fast_scans, "FREQUENCIES_HZ", (30.0, 100.0))
    monkeypatch.setattr(fast_scans, "_LEAST_S", 0.2)
    seen: list[str] = []
    known = fast_scans.Known(PiezoModel.from_mapping(MODEL), 1.1, "")
    found = fast_scans.scans(fast_scans.fast_stage(), known, lambda share, text: seen.append(f"{share:.2f} {text}"))
    assert len(seen) == 8
    assert seen[-1].startswith("1.00")
    names = list(found)
    # The same, late by the preview and so under other noise, of 1 nm each.
    off_um = found[names[1]][30.0].measured_um - found[names[2]][30.0].measured_um
    assert np.std(off_um) < 2.0 * np.sqrt(2.0) * 1e-3
    assert len({scan.desired_um.size for scans in found.values() for scan in scans.values()}) == 2
    save_figure(found, tmp_path / "fast.png")
    assert (tmp_path / "fast.png").stat().st_size > 20_000
