"""A piezo stage linearised through the ROS graph, and a measured actuator identified: ``make demo``."""

from __future__ import annotations

import argparse
import random
import signal
import sys
import tempfile
import time
from collections.abc import Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Any, NoReturn

import numpy as np
import rclpy
from rclpy.signals import SignalHandlerOptions
from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn
from rich.table import Table

from fomrc_core.errors import DataUnavailableError, FomrcError
from fomrc_core.identification.convex import identify
from fomrc_core.model.piezo_model import PiezoModel
from fomrc_core.plants import electromechanical
from fomrc_core.records import excitation
from fomrc_core.records.recording import Recording
from fomrc_core.records.residual import nrmse_percent
from fomrc_core.storage import make_directory, write_model
from fomrc_ros.demo import fast_scans
from fomrc_ros.demo.driver import COMPENSATED, UNCOMPENSATED, Driver
from fomrc_ros.demo.experiment import LINEARITY_MERIT, TRACKING_MERIT, Experiment
from fomrc_ros.demo.fast_figure import save_figure
from fomrc_ros.demo.figures import save_figures
from fomrc_ros.demo.node_processes import NodeProcess, private_environment
from fomrc_ros.demo.response import Verdict, percent_or_not
from fomrc_ros.demo.signals import signals_noted
from fomrc_ros.demo.targets import RATE_HZ, Target, tracking_target, triangle_target
from fomrc_ros.node.runtime import EXIT_BAD_INPUT, make_executor

NOISE_UM = 1e-3
AMPLITUDE_UM = 2.4
_CALIBRATION_RATE_HZ = 1000.0
# A run in which the machine stood still, and that missed the mark, is driven again so many times.
_REPEATS = 2


class _OneLineParser(argparse.ArgumentParser):
    """Refuses arguments in one line, as the other commands do."""

    def error(self, message: str) -> NoReturn:
        self.exit(EXIT_BAD_INPUT, f"{self.prog}: {message} (allowed: see --help)\n")


def main(arguments: list[str] | None = None) -> int:
    """Run the demo; return 0 unless it missed one of the paper's figures, or could not be run."""
    parser = _OneLineParser(prog="fomrc demo", description=__doc__)
    parser.add_argument("--output", type=Path, default=Path("demo_output"), help="folder for model and figures")
    parser.add_argument("--fast", action="store_true", help="fast rasters on a stage that rings instead")
    options = parser.parse_args(arguments)
    # its nodes are in sessions of their own: a demo that is told to end must end them first
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    return run_fast(options.output) if options.fast else run(options.output)


def run(folder: Path) -> int:
    """Run the demo and leave its model and figures in ``folder``; return the exit status."""
    console = Console()
    began = time.monotonic()
    columns = (TextColumn("{task.description}"), BarColumn(), TimeElapsedColumn())
    try:
        make_directory(folder)
    except FomrcError as error:
        print(f"fomrc demo: {error}", file=sys.stderr)
        return EXIT_BAD_INPUT
    try:
        with Progress(*columns, console=console) as progress:
            model_path, gain, calibration_text = _calibrate(folder, progress)
            tracking, triangle = _experiments(model_path, gain, progress)
            paths = save_figures(tracking.pair, triangle.pair, folder)
            measured_text = _measured_actuator(progress)
    except FomrcError as error:
        console.print(f"[red]demo: {error}")
        return 1
    except KeyboardInterrupt:
        console.print("stopped")
        return 130
    console.print(calibration_text)
    console.print(_table((tracking, triangle)))
    for experiment in (tracking, triangle):
        console.print(experiment.machine_text())
    console.print(measured_text)
    console.print(f"model {model_path}, figures {', '.join(str(path) for path in paths)}")
    console.print(f"took {time.monotonic() - began:.0f} s")
    return _exit_status((tracking, triangle), console)


def run_fast(folder: Path) -> int:
    """Scan a stage that rings, and leave its model and a picture in ``folder``; return the exit status."""
    console, began = Console(), time.monotonic()
    try:
        make_directory(folder)
    except FomrcError as error:
        print(f"fomrc demo: {error}", file=sys.stderr)
        return EXIT_BAD_INPUT
    stage = fast_scans.fast_stage()
    try:
        with Progress(TextColumn("{task.description}"), BarColumn(), TimeElapsedColumn(), console=console) as progress:
            learning = progress.add_task("diagnosing recordings of the stage", total=1.0)
            known = fast_scans.diagnosed(stage, lambda share, text: progress.update(learning, completed=share))
            progress.update(learning, completed=1.0)
            scanning = progress.add_task("scanning", total=1.0)
            found = fast_scans.scans(stage, known, lambda share, text: progress.update(scanning, completed=share))
    except KeyboardInterrupt:
        console.print("stopped")
        return 130
    write_model(known.model, folder / "diagnosed_model.yaml")
    save_figure(found, folder / "fast.png")
    console.print(f"model: {known.words}")
    table = Table(title="rasters of 4 um, turns rounded to 150 Hz: NRMSE", title_justify="left")
    table.add_column("")
    for frequency_hz in fast_scans.FREQUENCIES_HZ:
        table.add_column(f"{frequency_hz:g} Hz", justify="right")
    for name, scans in found.items():
        table.add_row(name, *(f"{scan.percent:.3g} %" for scan in scans.values()))
    console.print(table)
    console.print(f"model and picture fast.png in {folder}; took {time.monotonic() - began:.0f} s")
    return 0


def _exit_status(experiments: Sequence[Experiment], console: Console) -> int:
    for experiment in experiments:
        if experiment.verdict is Verdict.MISSED:
            percent, bar = experiment.merit.percent_of(experiment.pair[0]), experiment.merit.paper_percent[1]
            console.print(
                f"[red]{experiment.target.name}: {experiment.merit.name} {percent:.2f} % is above the paper's {bar:g} %"
            )
        elif experiment.verdict is Verdict.NOT_JUDGED:
            console.print(
                f"[yellow]{experiment.target.name}: the machine was too busy to judge; run the demo again when it is "
                "idle"
            )
    return 1 if any(experiment.verdict is Verdict.MISSED for experiment in experiments) else 0


def _calibrate(folder: Path, progress: Progress) -> tuple[Path, float, str]:
    """Identify a model of the simulated stage from a record of it; return file, constant gain and a summary."""
    task = progress.add_task("calibrating: the stage's answer to triangle and staircase", total=1.0)
    plant = electromechanical.table1_plant()
    routine = excitation.relaxation(2.5, duration_s=5.0, frequency_hz=2.0, rate_hz=_CALIBRATION_RATE_HZ)
    triangle = excitation.triangle(2.5, slope_v_per_s=1.0, rate_hz=_CALIBRATION_RATE_HZ)
    staircase = excitation.staircase(2.5, step_v=0.5, dwell_s=1.0, rate_hz=_CALIBRATION_RATE_HZ)
    voltage_v = np.concatenate((routine.voltage_v, triangle.voltage_v, staircase.voltage_v))
    state = plant.initial_state()
    moved_um = np.empty(voltage_v.size)
    for k, voltage in enumerate(voltage_v):
        moved_um[k] = plant.advance(state, float(voltage), 1.0 / _CALIBRATION_RATE_HZ)
        if k % 2000 == 0:
            progress.update(task, completed=0.7 * k / voltage_v.size)
    moved_um += NOISE_UM * np.random.default_rng(1).standard_normal(moved_um.size)
    start = routine.voltage_v.size
    time_s = np.arange(voltage_v.size - start) / _CALIBRATION_RATE_HZ
    recording = Recording(time_s, voltage_v[start:], moved_um[start:], name="calibration")
    fit = identify(
        [recording],
        progress=lambda fraction, text: progress.update(task, completed=0.7 + 0.3 * fraction),
    )
    progress.update(task, completed=1.0)
    model_path = folder / "identified_model.yaml"
    write_model(fit.model, model_path)
    gain = float(np.polyfit(recording.voltage_v, recording.measured_um, 1)[0])
    text = (
        f"calibrated on {recording.duration_s:.0f} s of the electromechanical stage (1 nm noise): "
        f"rms {1e3 * fit.rms_um:.2f} nm, creep order {fit.model.creep_order:.4f}"
    )
    return model_path, gain, text


def _experiments(model_path: Path, gain_um_per_v: float, progress: Progress) -> list[Experiment]:
    """Drive both experiments through topics, and return them."""
    domain_id = random.randint(1, 100)
    environment = private_environment(domain_id)
    stage = {
        "interface": "joint_state",
        "plant": "electromechanical",
        "noise_rms_m": 1e-6 * NOISE_UM,
        "rate_hz": RATE_HZ,
    }
    wanted = ((tracking_target(AMPLITUDE_UM), TRACKING_MERIT), (triangle_target(AMPLITUDE_UM), LINEARITY_MERIT))
    starting = progress.add_task("starting compensator and stage", total=None)
    with signals_noted() as is_told_to_end, ExitStack() as stack:
        logs = Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="fomrc_demo_")))
        nodes = [
            stack.enter_context(NodeProcess(*node, environment, logs / f"{k}.log"))
            for k, node in enumerate(
                (
                    ("fomrc_ros.compensator", f"/{COMPENSATED}", [model_path], {}),
                    ("fomrc_ros.simulated_stage", f"/{COMPENSATED}", [], {**stage, "seed": 1}),
                    ("fomrc_ros.simulated_stage", f"/{UNCOMPENSATED}", [], {**stage, "seed": 2}),
                )
            )
        ]

        def check() -> None:
            if is_told_to_end():
                raise KeyboardInterrupt
            for node in nodes:
                if not node.is_running:
                    raise FomrcError(f"a node ended early: {node.output().strip()}")

        context = rclpy.Context()
        rclpy.init(context=context, domain_id=domain_id, signal_handler_options=SignalHandlerOptions.NO)
        stack.callback(rclpy.try_shutdown, context=context)
        driver = Driver(gain_um_per_v, [node.pid for node in nodes], context, is_told_to_end)
        stack.callback(driver.destroy_node)
        executor = make_executor(context)
        stack.callback(executor.shutdown)
        executor.add_node(driver)
        driver.wait_until_ready(executor, check)
        progress.update(starting, total=1.0, completed=1.0)
        experiments = []
        for target, merit in wanted:
            again = ""
            for _ in range(1 + _REPEATS):
                _drive(driver, executor, target, again, progress)
                check()
                pair = driver.response(COMPENSATED), driver.response(UNCOMPENSATED)
                experiment = Experiment(target, merit, pair)
                stalled_s = experiment.pair[0].stalled_s
                if experiment.verdict is Verdict.MET or not stalled_s:
                    break
                again = f", again: the machine stood still for {stalled_s:.1f} s"
            experiments.append(experiment)
    return experiments


def _drive(driver: Driver, executor: Any, target: Target, again: str, progress: Progress) -> None:
    text = f"{target.name}, {target.duration_s:.0f} s{again}"
    task = progress.add_task(text, total=1.0)
    if not progress.console.is_terminal:
        progress.console.print(text)  # bars are drawn at the end there, and nobody would see that it goes on

    def show(fraction: float) -> None:
        progress.update(task, completed=fraction)

    executor.spin_until_future_complete(driver.start(target, show), timeout_sec=5.0 * target.duration_s)
    show(1.0)


def _measured_actuator(progress: Progress) -> str:
    """Identify the measured stack actuator where its data can be had; return what came of it."""
    from fomrc_core.storage import measured_examples as data_sources

    try:
        train, test = data_sources.pea_1hz()
    except DataUnavailableError as error:
        return f"measured actuator: skipped, {error}"
    task = progress.add_task("identifying the measured actuator pea_1hz", total=1.0)
    fit = identify([train], progress=lambda fraction, text: progress.update(task, completed=fraction))
    error_percent, rms_um = forward_error(fit.model, test)
    progress.update(task, completed=1.0)
    return (
        f"measured actuator pea_1hz (PICMA stack, 45 um): fitted to {train.duration_s:.0f} s, predicts the other "
        f"record with {rms_um:.2f} um rms, NRMSE {error_percent:.2f} %"
    )


def forward_error(model: PiezoModel, test: Recording, from_s: float = 0.5) -> tuple[float, float]:
    """Return NRMSE [%] and rms [um] of the forward prediction from ``from_s`` on, mean removed."""
    predicted_um = model.simulate(test.steps_s, test.voltage_v)
    late = test.time_s - test.time_s[0] >= from_s
    measured_um, predicted_um = test.measured_um[late], predicted_um[late]
    predicted_um = predicted_um + np.mean(measured_um - predicted_um)
    rms_um = float(np.sqrt(np.mean((measured_um - predicted_um) ** 2)))
    return float(nrmse_percent(measured_um, predicted_um)), rms_um


def _table(experiments: Sequence[Experiment]) -> Table:
    table = Table(title="through ROS topics, electromechanical stage, 1 nm noise", title_justify="left")
    table.add_column("experiment")
    table.add_column("figure of merit")
    for heading in ("without", "with", "paper without", "paper with"):
        table.add_column(heading, justify="right")
    for experiment in experiments:
        merit, (compensated, plain) = experiment.merit, experiment.pair
        values = (merit.percent_of(plain), merit.percent_of(compensated), *merit.paper_percent)
        table.add_row(experiment.target.name, merit.name, *(percent_or_not(value) for value in values))
    return table
