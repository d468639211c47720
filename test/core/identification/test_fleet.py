"""Many records: any executor, failures passed over, resumable after a kill."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest

from fomrc_core.errors import InputError
from fomrc_core.identification.fleet import FleetOptions, identify_fleet, records_in
from fomrc_core.storage import read_model

ROOT = Path(__file__).parents[3]
OPTIONS = FleetOptions(n_elements=3)


def actuators(count: int, n: int = 2400):
    """Times, drive and what each actuator moved: literal elements, creep as a sum over its whole past.

    Nothing of the product. Shapes (n,), (n,) and (n, count).
    """
    kappa, saturation = np.array([8.0, 4.0, 6.0]), np.array([0.05, 0.12, 0.1])
    last = 1.2 + 0.02 * np.arange(count)
    t = 1e-2 * np.arange(n)
    envelope = 2.0 * (1.0 - t / t[-1])
    voltage = envelope * (2.0 * np.abs((t / 4.0) % 2.0 - 1.0) - 1.0) * np.minimum(t / 0.5, 1.0)
    # displacement of the elements in series for a rising voltage: bisected, element by element
    stretch, y, moved = np.zeros((count, 3)), np.zeros(count), np.empty((n, count))
    for k, u in enumerate(voltage):
        low, high = y - 5.0, y + 5.0
        for _ in range(45):
            middle = 0.5 * (low + high)
            elements = np.clip(stretch + (middle - y)[:, np.newaxis] / kappa, -saturation, saturation)
            is_low = np.sum(elements, axis=1) + middle / last < u
            low, high = np.where(is_low, middle, low), np.where(is_low, high, middle)
        y, stretch = middle, elements
        moved[k] = y
    lag = np.arange(1, n + 1, dtype=float) ** 1.02
    weights = np.diff(lag, prepend=0.0) * (1e-2**0.02 / 0.9937)
    creeping = np.empty((n, count))
    for index in range(count):
        noise_um = 1e-3 * np.random.default_rng(index).standard_normal(n)
        creeping[:, index] = np.convolve(np.diff(moved[:, index], prepend=0.0), weights)[:n] + noise_um
    return t, voltage, creeping


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("fleet")
    time_s, voltage_v, moved_um = actuators(4)
    for index in range(4):
        table = np.column_stack((time_s, voltage_v, moved_um[:, index]))
        np.savetxt(
            folder / f"unit_{index}.csv", table, delimiter=",", header="time_s,voltage_v,displacement_um", comments=""
        )
    (folder / "unit_bad.csv").write_text("time_s,voltage_v,displacement_um\n0,0,0\n1,nonsense,0\n")
    (folder / "notes.md").write_text("not a recording")
    return folder


def assert_all_done(records, output):
    assert [r.name for r in records] == [*(f"unit_{i}.csv" for i in range(4)), "unit_bad.csv"]
    for index, record in enumerate(records[:4]):
        assert record.is_done, record.reason
        assert record.nrmse_percent < 0.2
        assert record.creep_order == pytest.approx(0.02, rel=0.2)
        model = read_model(output / f"{record.name}.model.yaml")
        assert np.sum(model.kappa_um_per_v) > 0.0
        # far out the last element alone is left
        assert model.kappa_um_per_v[-1] == pytest.approx(1.2 + 0.02 * index, rel=0.15)
    bad = records[4]
    assert not bad.is_done
    assert "unit_bad.csv" in bad.reason
    assert "nonsense" in bad.reason
    assert json.loads((output / "unit_bad.csv.fit.json").read_text())["is_done"] is False


def test_processes_finish_the_rest_of_a_fleet_with_a_bad_record(folder, tmp_path):
    told = []
    records = identify_fleet(
        records_in(folder),
        tmp_path,
        options=OPTIONS,
        n_workers=2,
        progress=lambda share, text: told.append((share, text)),
    )
    assert_all_done(records, tmp_path)
    assert [share for share, _ in told] == sorted(share for share, _ in told)
    assert told[-1][0] == 1.0
    assert any("unit_bad.csv" in text and "FAILED" in text for _, text in told)


def test_what_is_done_is_kept_and_what_failed_is_tried_again(folder, tmp_path):
    with ThreadPoolExecutor(1) as executor:
        first = identify_fleet(records_in(folder), tmp_path, options=OPTIONS, executor=executor)
        stamps = {p.name: p.stat().st_mtime_ns for p in tmp_path.glob("*.model.yaml")}
        again = identify_fleet(records_in(folder), tmp_path, options=OPTIONS, executor=executor)
        assert {p.name: p.stat().st_mtime_ns for p in tmp_path.glob("*.model.yaml")} == stamps
        assert [r.is_kept for r in again] == [True] * 4 + [False]
        assert [r.creep_order for r in again][:4] == [r.creep_order for r in first][:4]
        # a result cut short is done again, and so is everything with other options
        (tmp_path / "unit_1.csv.fit.json").write_text('{"is_done": tr')
        third = identify_fleet(records_in(folder)[:2], tmp_path, options=OPTIONS, executor=executor)
        assert [r.is_kept for r in third] == [True, False]
        other = identify_fleet(records_in(folder)[:1], tmp_path, options=FleetOptions(n_elements=2), executor=executor)
        assert [r.is_kept for r in other] == [False]


RUN = """
import sys
from pathlib import Path
from concurrent.futures import ThreadPoolExecutor
from fomrc_core.identification.fleet import FleetOptions, identify_fleet, records_in
with ThreadPoolExecutor(1) as executor:
    options = FleetOptions(n_elements=3)
    identify_fleet(records_in(Path(sys.argv[1])), Path(sys.argv[2]), options=options, executor=executor)
"""


def test_a_killed_run_goes_on_where_it_stopped(folder, tmp_path):
    run = subprocess.Popen(
        [sys.executable, "-c", RUN, str(folder), str(tmp_path)], cwd=ROOT, env={**os.environ, "PYTHONPATH": str(ROOT)}
    )
    deadline = time.monotonic() + 180.0
    while not list(tmp_path.glob("*.fit.json")) and time.monotonic() < deadline and run.poll() is None:
        time.sleep(0.005)
    run.send_signal(signal.SIGKILL)
    run.wait()
    done = {p.name.removesuffix(".fit.json") for p in tmp_path.glob("*.fit.json")}
    assert done
    with ThreadPoolExecutor(1) as executor:
        records = identify_fleet(records_in(folder), tmp_path, options=OPTIONS, executor=executor)
    assert_all_done(records, tmp_path)
    assert {r.name for r in records if r.is_kept} == done - {"unit_bad.csv"}


@pytest.mark.filterwarnings("ignore")
def test_dask_scheduler_with_two_worker_processes(folder, tmp_path):
    distributed = pytest.importorskip("distributed", reason="Dask's distributed is not installed")
    with (
        distributed.LocalCluster(
            n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None, host="127.0.0.1"
        ) as cluster,
        distributed.Client(cluster) as client,
    ):
        client.wait_for_workers(2, timeout=120)
        processes = set(client.run(os.getpid).values())
        assert len(processes) == 2
        assert os.getpid() not in processes
        client.run(lambda: sys.path.insert(0, str(ROOT)))
        with client.get_executor() as executor:
            records = identify_fleet(records_in(folder), tmp_path, options=OPTIONS, executor=executor)
    assert_all_done(records, tmp_path)


def test_bad_input_is_named(tmp_path):
    with pytest.raises(InputError, match="no such folder"):
        records_in(tmp_path / "none")
    with pytest.raises(InputError, match="no recording"):
        records_in(tmp_path)
    with pytest.raises(InputError, match="name"):
        identify_fleet([tmp_path / "a" / "x.csv", tmp_path / "b" / "x.csv"], tmp_path)
    with pytest.raises(InputError, match="n_workers"):
        identify_fleet([tmp_path / "x.csv"], tmp_path, n_workers=0)


def test_command_finishes_the_rest_and_tells_what_failed(folder, tmp_path):
    command = [
        sys.executable,
        "-m",
        "fomrc_core.cli",
        "identify-fleet",
        str(folder),
        "--output",
        str(tmp_path),
        "--elements",
        "3",
        "--workers",
        "1",
    ]
    done = subprocess.run(command, capture_output=True, text=True, cwd=ROOT, timeout=300, check=False)
    assert done.returncode == 2
    assert "4 of 5 recordings identified" in done.stdout
    failures = [line for line in done.stderr.splitlines() if "failed" in line]
    assert len(failures) == 1
    assert "unit_bad.csv" in failures[0]
    assert "Traceback" not in done.stderr
    again = subprocess.run(command, capture_output=True, text=True, cwd=ROOT, timeout=300, check=False)
    assert again.stdout.count("(kept)") == 4
