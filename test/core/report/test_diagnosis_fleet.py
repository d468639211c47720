"""Many diagnoses: a row each, resumable, and which stages share a cause."""

from __future__ import annotations

import csv
import json
import math
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from fomrc_core.cli.application import run
from fomrc_core.effects.amplifier_bandwidth import AmplifierBandwidth
from fomrc_core.effects.external_load import ExternalLoad
from fomrc_core.model.piezo_model import PiezoModel
from fomrc_core.records.recording import Recording
from fomrc_core.report.diagnosis_fleet import DiagnosedRecord, FleetDiagnosis, diagnose_fleet
from fomrc_core.storage import write_recording
from fomrc_core.storage.record_work import records_in

PLAIN = PiezoModel([10.0, 4.0, 7.0, 1.5], [0.02, 0.1, 0.3], 0.02)


def stage(effect, seed: int, n: int = 1500) -> Recording:
    """A record at 250 Hz: a shrinking triangle with steps in it, 1 nm of noise."""
    t = np.arange(n) / 250.0
    voltage = (2.0 - t / 4.0) * (2.0 * np.abs((t / 0.8 + 0.5) % 2.0 - 1.0) - 1.0) * np.minimum(t / 0.2, 1.0)
    voltage = np.where((t > 3.0) & (t < 4.0), np.round(2.0 * voltage) / 2.0, voltage)
    steps = np.full(n, 1.0 / 250.0)
    moved = PLAIN.with_effects(effect).simulate(steps, voltage)
    return Recording(t, voltage, moved + 1e-3 * np.random.default_rng(seed).standard_normal(n))


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("stages")
    # Two alike: what the engine names is not the matter here, but that it names the same for both.
    for name in ("stage_1.csv", "stage_2.csv"):
        write_recording(stage(ExternalLoad(0.15, 1.3, 2.7), 1), folder / name)
    write_recording(stage(AmplifierBandwidth(12.0), 3), folder / "stage_3.csv")
    (folder / "stage_4.csv").write_text("time_s,voltage_v,displacement_um\n0,0,0\n1,nonsense,0\n")
    return folder


def test_a_row_each_resumed_and_who_shares_a_cause(folder, tmp_path) -> None:
    with ThreadPoolExecutor(1) as executor:
        found = diagnose_fleet(records_in(folder), tmp_path, executor=executor)
        stamp = (tmp_path / "stage_1.csv.diagnosis" / "report.html").stat().st_mtime_ns
        again = diagnose_fleet(records_in(folder), tmp_path, executor=executor)
    assert (tmp_path / "stage_1.csv.diagnosis" / "report.html").stat().st_mtime_ns == stamp
    assert [record.is_kept for record in again.records] == [True, True, True, False]
    assert [record.causes for record in again.records] == [record.causes for record in found.records]
    by_cause = {cause: [record.name for record in records] for cause, records in found.shared_by.items()}
    first, second, third, bad = found.records
    assert first.causes == second.causes
    assert by_cause["external_load"] == ["stage_1.csv", "stage_2.csv"]
    told = json.loads((tmp_path / "stage_2.csv.diagnosis" / "diagnosis.json").read_text())
    assert list(second.causes) == [finding["cause"] for finding in told["findings"]]
    # A plain lag is told from its generalisations only where the data can.
    assert "amplifier_bandwidth" in (*third.causes, *third.ambiguous_with)
    assert "external_load (" in str(found)
    assert "2 of 3: stage_1.csv, stage_2.csv" in str(found)
    assert "nonsense" in bad.reason
    rows = list(csv.DictReader((tmp_path / "fleet.csv").read_text().splitlines()))
    assert [row["recording"] for row in rows] == [f"stage_{k}.csv" for k in (1, 2, 3, 4)]
    assert rows[3]["status"].startswith("failed")
    assert json.loads((tmp_path / "stage_2.csv.diagnosis.json").read_text())["is_done"] is True


def test_the_summary_says_who_shares_a_cause_and_who_is_alone() -> None:
    def record(name, causes, status="explained", tied=()):
        return DiagnosedRecord(name, True, False, status, causes, 2.0, 0.1, "nothing", tied)

    fleet = FleetDiagnosis(
        (
            record("a", {"amplifier_bandwidth": 11.0, "gain_drift": 0.001}),
            record("b", {"amplifier_bandwidth": 14.0}, tied=("unequal_lag",)),
            record("c", {}, "nothing_found"),
            record("d", {}, "unexplained"),
            record("g", {"unequal_lag": 0.01}),
            record("e", {"asymmetric_hysteresis": math.nan}),
            DiagnosedRecord("f", False, False, "no such file"),
        )
    )
    assert str(fleet).splitlines() == [
        "amplifier_bandwidth (11 to 14): 2 of 6: a, b",
        "asymmetric_hysteresis: e alone",
        "gain_drift (0.001): a alone",
        "unequal_lag (0.01): 1 of 6: g, perhaps b",
        "nothing found: c",
        "not explained: d",
        "f failed: no such file",
    ]
    told = "b: explained: amplifier_bandwidth (14), cannot be told from unequal_lag, 2 % -> 0.1 %"
    assert str(fleet.records[1]) == told


def test_the_command_tells_bad_folders_in_one_line(tmp_path, capsys) -> None:
    assert run(["diagnose-fleet", str(tmp_path / "none"), "--output", str(tmp_path / "out")]) == 2
    assert "no such folder" in capsys.readouterr().err
