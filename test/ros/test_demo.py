"""The demo without its nodes: what is judged, and what is left to the machine. Run well it is ``make demo``."""

from __future__ import annotations

import contextlib
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from fomrc_core.plants import paper_stage
from fomrc_ros.demo import demo
from fomrc_ros.demo.experiment import LINEARITY_MERIT, TRACKING_MERIT, Experiment
from fomrc_ros.demo.figures import curves
from fomrc_ros.demo.processor_waits import ProcessorWaits
from fomrc_ros.demo.response import Response, Verdict, percent_or_not, response_of
from fomrc_ros.demo.signals import signals_noted
from fomrc_ros.demo.targets import RATE_HZ, tracking_target, triangle_target

_TARGET = triangle_target(2.4)
_TIMES_S = 100.0 + np.arange(_TARGET.desired_um.size) / RATE_HZ
_NO_WAITS = np.column_stack((_TIMES_S[::10], np.zeros(_TIMES_S[::10].size)))
_SENT = np.column_stack((_TIMES_S, _TARGET.desired_um))


def _seen(measured_um: np.ndarray) -> np.ndarray:
    return np.column_stack((_TIMES_S + 1e-3, measured_um))


def test_a_folder_that_cannot_be_made_is_one_line(tmp_path: Path, capsys) -> None:
    file = tmp_path / "a file"
    file.write_text("")
    assert demo.run(file / "results") == 2
    said = capsys.readouterr().err
    assert said.startswith("fomrc demo: --output: folder cannot be made")
    assert said.count("\n") == 1


@pytest.mark.parametrize("arguments", [["x"], ["--output"], ["--slow"]])
def test_an_argument_it_has_not_is_one_line(arguments: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as refused:
        demo.main(arguments)
    assert refused.value.code == 2
    said = capsys.readouterr().err
    assert said.startswith("fomrc demo: ")
    assert said.count("\n") == 1


def test_targets_go_where_the_figures_say_at_their_rate() -> None:
    assert _TARGET.desired_um[-1] == pytest.approx(0.0, abs=1e-12)
    assert np.max(np.abs(np.diff(_TARGET.desired_um))) == pytest.approx(1.2 / RATE_HZ, rel=1e-2)
    tracking = tracking_target(2.4)
    assert tracking.duration_s == pytest.approx(28.0, abs=0.01)
    assert np.min(tracking.desired_um) == pytest.approx(-2.4)


def test_without_a_stall_every_sample_is_judged_by_the_papers_measure() -> None:
    bent = _TARGET.desired_um + 0.024 * np.sin(np.pi * _TARGET.desired_um / 1.2)
    response = response_of(_SENT, _seen(bent), _NO_WAITS)
    # one sample is measured after the last target
    assert np.mean(response.is_judged) == 1.0
    assert response.stalled_s == 0.0
    # of the largest displacement, 2.4 um: 1 %, and what the line tilts; of the range it would be half of that
    assert response.nonlinearity_percent == pytest.approx(1.05, abs=0.1)
    assert response.verdict(response.nonlinearity_percent, paper_stage.NONLINEARITY_PERCENT[1]) is Verdict.MISSED


def test_what_lags_while_a_process_stood_still_is_not_the_compensations_fault() -> None:
    measured = _TARGET.desired_um.copy()
    late = slice(1000, 1100)  # 200 ms in which the stage stays where it is
    measured[late] = measured[1000]
    held = response_of(_SENT, _seen(measured), _NO_WAITS)
    assert held.verdict(held.nonlinearity_percent, 0.65) is Verdict.MISSED

    beats_s = np.delete(_TIMES_S, np.arange(1000, 1100))
    waited = np.where(np.arange(_NO_WAITS.shape[0]) == 110, 0.2, 0.0)
    for response in (
        response_of(_SENT, _seen(measured), _NO_WAITS, [beats_s]),
        response_of(_SENT, _seen(measured), np.column_stack((_NO_WAITS[:, 0], waited))),
        response_of(_SENT, np.delete(_seen(measured), np.arange(1000, 1100), axis=0), _NO_WAITS),
    ):
        assert response.stalled_s == pytest.approx(0.2, abs=0.01)
        assert response.longest_stall_s == pytest.approx(0.2, abs=0.01)
        assert response.verdict(response.nonlinearity_percent, 0.65) is Verdict.MET


def test_a_compensation_that_fails_is_not_excused_by_a_busy_machine() -> None:
    bent = 1.02 * _TARGET.desired_um + 0.05 * np.sign(np.gradient(_TARGET.desired_um))
    beats_s = np.delete(_TIMES_S, np.arange(5000, 9000))
    response = response_of(_SENT, _seen(bent), _NO_WAITS, [beats_s])
    assert 0.5 < np.mean(response.is_judged) < 0.7
    assert response.verdict(response.nonlinearity_percent, 0.65) is Verdict.MISSED


def test_few_displacements_are_judged_and_none_are_not() -> None:
    few = _seen(_TARGET.desired_um)[::3]
    response = response_of(_SENT, few, _NO_WAITS)
    assert response.verdict(response.nonlinearity_percent, 0.65) is Verdict.MET
    nothing = response_of(_SENT, np.zeros((0, 2)), _NO_WAITS)
    assert np.isnan(nothing.nonlinearity_percent)
    assert nothing.stalled_s == pytest.approx(nothing.duration_s)
    assert nothing.verdict(nothing.nrmse_percent, 0.36) is Verdict.NOT_JUDGED
    assert percent_or_not(nothing.nrmse_percent) == "not judged"
    shared = Experiment(_TARGET, LINEARITY_MERIT, (nothing, nothing))
    assert shared.verdict is Verdict.NOT_JUDGED
    assert "judged on the other 0 %" in shared.machine_text()


def test_no_line_is_drawn_where_nothing_was_measured() -> None:
    time_s = np.concatenate((np.arange(0.0, 1.0, 0.002), np.arange(2.4, 3.0, 0.002)))
    values = np.sin(time_s)
    response = Response(time_s, values, values, np.ones(time_s.size, dtype=np.bool_), 3.0, 1.4, 1.4)
    for drawn in curves(response):
        assert np.flatnonzero(np.isnan(drawn)).tolist() == [500]
    assert curves(response)[0].size == time_s.size + 1


def test_an_experiment_is_measured_by_its_own_merit() -> None:
    exact = response_of(_SENT, _seen(_TARGET.desired_um), _NO_WAITS)
    lagging = response_of(_SENT, _seen(_TARGET.desired_um + 0.02), _NO_WAITS)
    assert Experiment(_TARGET, LINEARITY_MERIT, (lagging, exact)).verdict is Verdict.MET
    assert Experiment(_TARGET, TRACKING_MERIT, (lagging, exact)).verdict is Verdict.MISSED
    assert "no process waited" in Experiment(_TARGET, TRACKING_MERIT, (exact, exact)).machine_text()


@pytest.mark.skipif(not Path("/proc/self/schedstat").exists(), reason="the system does not count waits")
def test_waits_for_a_processor_are_counted() -> None:
    # More that want to run than there are processors, all on one: each has to wait for the others.
    command = "import os, time; os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})\nwhile True: pass"
    crowd = [subprocess.Popen([sys.executable, "-c", command]) for _ in range(3)]
    try:
        time.sleep(0.5)
        waits = ProcessorWaits([process.pid for process in crowd])
        time.sleep(0.5)
        assert 0.05 < waits.longest_s() < 5.0
        waits.close()
        assert waits.longest_s() == 0.0
    finally:
        for process in crowd:
            process.kill()
            process.wait()
    gone = ProcessorWaits([crowd[0].pid, os.getpid()])
    assert gone.longest_s() >= 0.0
    gone.close()


def _nodes_in(temporary: Path) -> list[int]:
    """Return the process numbers of nodes whose files are in a demo's own temporary folder."""
    found = []
    for path in Path("/proc").glob("[0-9]*/environ"):
        with contextlib.suppress(OSError):  # it may just have ended
            command = (path.parent / "cmdline").read_bytes()
            if f"TMPDIR={temporary}".encode() in path.read_bytes() and b"fomrc_ros.demo" not in command:
                found.append(int(path.parent.name))
    return found


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_to_end_is_noted_where_it_comes_and_raised_at_the_end(number: signal.Signals) -> None:
    before, seen = signal.getsignal(number), []

    def told_twice() -> None:
        with signals_noted() as is_told_to_end:
            seen.append(is_told_to_end())
            signal.raise_signal(number)
            signal.raise_signal(number)
            seen.append(is_told_to_end())

    with pytest.raises(KeyboardInterrupt):
        told_twice()
    assert seen == [False, True]
    assert signal.getsignal(number) is before


def test_a_demo_that_is_told_to_end_ends_its_nodes(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "fomrc_ros.demo", "--output", str(tmp_path / "results")]
    environment = os.environ | {"TMPDIR": str(tmp_path)}
    with subprocess.Popen(command, env=environment, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        # it says so once all nodes answer
        assert any(line.startswith("tracking") for line in process.stdout), "it ended before its nodes were up"
        assert len(_nodes_in(tmp_path)) == 3
        process.send_signal(signal.SIGTERM)
        said, _ = process.communicate(timeout=60.0)
    assert process.returncode == 130
    assert said.rstrip().endswith("stopped")
    assert _nodes_in(tmp_path) == []
