"""Random parameters, services, targets and kills: never a voltage beyond limits or slew, never dead without a word.

``FOMRC_FUZZ_S=600 FOMRC_FUZZ_SEED=3 pytest -s test/ros/test_fuzz_in_service.py`` runs the long one.
"""

from __future__ import annotations

import math
import os
import random
import signal
import time
from dataclasses import dataclass

import numpy as np
from diagnostic_msgs.msg import DiagnosticStatus
from harness import model_file
from lifecycle_msgs.srv import ChangeState
from node_under_test import PATIENCE_S
from std_msgs.msg import Float64
from std_srvs.srv import Trigger

RATE_HZ = 200.0
DURATION_S = float(os.environ.get("FOMRC_FUZZ_S", "60" if os.environ.get("FOMRC_ALL_CASES") else "20"))
SEED = int(os.environ.get("FOMRC_FUZZ_SEED", "1"))
TARGETS_M = (0.0, 1e-6, -1e-6, 3e-6, 50e-6, -50e-6, 0.5e-6, math.nan, math.inf, 1.0)
VOLTAGES_V = (0.0, 1.0, -1.0, 2.5, 1e9, -1e9, math.nan)
SERVICES = ("relax", "assume_relaxed", "reload_parameters", "borrow_voltage", "return_voltage")
VALUES = (
    ("minimum_voltage_v", (-2.5, -1.0, -0.2, 0.5)),
    ("maximum_voltage_v", (2.5, 1.0, 0.2, -0.5)),
    ("slew_limit_v_per_s", (500.0, 50.0, 5.0)),
    ("safe_voltage_v", (0.0, 0.1, -0.1)),
    ("safe_ramp_v_per_s", (100.0, 20.0)),
    ("stale_after_s", (0.0, 0.05, 1.0)),
    ("stale_policy", ("hold", "ramp")),
    ("stop_policy", ("hold", "ramp")),
    ("lease_s", (0.1, 1.0)),
    ("relax_amplitude_v", (0.1, 2.0)),
    ("relax_duration_s", (0.2, 1.0)),
    ("model.creep_order", (0.0, 0.015, 0.03, 1.0)),
    ("model.saturation_v", ([0.02, 0.07, 0.2], [0.03, 0.05, 0.3], [1e9, 1.0, 1.0])),
    ("model.kappa_um_per_v", ([20.0, 12.0, 9.0, 1.4], [0.01, 0.01, 0.01, 0.01], [1e308] * 4)),
)


@dataclass
class Bounds:
    """What the limits were from a time on."""

    since_s: float
    minimum_v: float
    maximum_v: float
    slew_v_per_s: float


class Fuzz:
    """Acts at random on one compensator, and knows the limits it was told."""

    def __init__(self, probe, start, tmp_path) -> None:
        self.probe, self._start, self._folder = probe, start, tmp_path
        self.random = random.Random(SEED)
        self.file = model_file(tmp_path / "model.yaml", slew_limit_v_per_s=500.0)
        self.heard = probe.record("voltage")
        self.n_sequences = self.n_kills = self.n_refused = 0
        self.bounds: list[Bounds] = []
        self.restarts_s: list[float] = []
        self._begin()
        self.targets = probe.publisher("desired_position")
        self.borrowed = probe.publisher("/compensator/borrowed_voltage")

    def _begin(self) -> None:
        self.restarts_s.append(time.perf_counter())
        self.node = self._start(
            "compensator", self.file, rate_hz=RATE_HZ, checkpoint_file=self._folder / "memory", checkpoint_period_s=0.5
        )
        self.limits = {"minimum_voltage_v": -2.5, "maximum_voltage_v": 2.5, "slew_limit_v_per_s": 500.0}
        self._note_bounds()
        self.probe.diagnostics.pop(self.node.name, None)
        self.probe.until(lambda: self.node.name in self.probe.diagnostics, "the node running")

    def _note_bounds(self) -> None:
        self.bounds.append(Bounds(time.perf_counter(), *self.limits.values()))

    def sequence(self) -> None:
        """Do one to five things."""
        actions = (self._target, self._target, self._set, self._set, self._service, self._borrow, self._transition)
        for _ in range(self.random.randint(1, 5)):
            self.random.choice(actions)()
        if self.random.random() < 0.01:
            self._kill()
        self.n_sequences += 1

    def _target(self) -> None:
        goal = self.random.choice(TARGETS_M)
        for _ in range(self.random.choice((1, 1, 20))):
            self.targets.publish(Float64(data=goal * self.random.random()))
        self.probe.spin_for(self.random.choice((0.0, 0.01, 0.1)))

    def _borrow(self) -> None:
        for _ in range(self.random.choice((1, 10))):
            self.borrowed.publish(Float64(data=self.random.choice(VOLTAGES_V)))
        self.probe.spin_for(self.random.choice((0.0, 0.05)))

    def _set(self) -> None:
        name, values = self.random.choice(VALUES)
        value = self.random.choice(values)
        if self.probe.set_one(self.node.name, name, value).successful:
            if name in self.limits:
                self.limits[name] = value
                self._note_bounds()
        else:
            self.n_refused += 1

    def _service(self) -> None:
        service = self.random.choice(SERVICES)
        self.probe.ask(Trigger, f"{self.node.name}/{service}", Trigger.Request())
        if service == "reload_parameters":
            # The file sets the slew limit again; when, only the answer tells.
            self.probe.trigger(f"{self.node.name}/reload_parameters")
            self.limits["slew_limit_v_per_s"] = self.probe.get(self.node.name, "slew_limit_v_per_s")
            self._note_bounds()

    def _transition(self) -> None:
        label = self.random.choice(("activate", "activate", "configure", "deactivate", "cleanup"))
        request = ChangeState.Request()
        request.transition.label = label
        future = self.probe.ask(ChangeState, f"{self.node.name}/change_state", request)
        if self.random.random() < 0.7:
            self.probe.until(future.done, f"answer to {label}")

    def _kill(self) -> None:
        number = self.random.choice((signal.SIGKILL, signal.SIGINT, signal.SIGTERM))
        self.node.process.send_signal(number)
        status = self.node.wait_for_exit()
        assert status == (-number if number == signal.SIGKILL else 0), self.node.output()
        self.probe.spin_for(0.2)
        self.n_kills += 1
        self._begin()

    def check_alive(self) -> None:
        """It answers; and it drives what it is told to, or says why it does not."""
        assert self.node.process.poll() is None, self.node.output()
        state = self.probe.state(self.node.name)
        n_heard = len(self.heard)
        self.targets.publish(Float64(data=0.1e-6))
        deadline_s = time.monotonic() + PATIENCE_S
        while state == "active" and len(self.heard) == n_heard:
            level = self.probe.levels.get(self.node.name, DiagnosticStatus.OK)
            if level != DiagnosticStatus.OK or self.probe.state(self.node.name) != "active":
                break
            said = self.probe.messages.get(self.node.name)
            assert time.monotonic() < deadline_s, f"active and silent, and says {said!r}"
            self.targets.publish(Float64(data=0.1e-6))
            self.probe.spin_for(0.02)

    def check_voltages(self) -> tuple[float, float]:
        """Return how near the voltages came to their bounds: furthest beyond [V], and largest share of the slew [1]."""
        times_s = np.array([time_s for time_s, _ in self.heard])
        volts = np.array([message.data for _, message in self.heard])
        assert np.all(np.isfinite(volts))
        furthest_v, largest_share = -math.inf, 0.0
        since_s = np.array([bounds.since_s for bounds in self.bounds])
        for k in range(volts.size):
            # The bounds told last before it; those told just after may be in force before their answer is here.
            last = max(int(np.searchsorted(since_s, times_s[k])) - 1, 0)
            near = self.bounds[max(last - 1, 0) : last + 3]
            beyond_v = max(volts[k] - max(b.maximum_v for b in near), min(b.minimum_v for b in near) - volts[k])
            furthest_v = max(furthest_v, beyond_v)
            if k == 0 or np.any((since_s > times_s[k - 1] - 0.1) & (since_s < times_s[k] + 0.5)):
                continue  # limits just narrowed come before the slew limit; a restarted node begins anew
            slew = max(b.slew_v_per_s for b in near)
            allowed_v = slew * (times_s[k] - times_s[k - 1] + 2.0 / RATE_HZ)
            largest_share = max(largest_share, abs(volts[k] - volts[k - 1]) / allowed_v)
        return furthest_v, largest_share


def test_never_beyond_limits_or_slew_and_never_dead_without_a_word(tmp_path, probe, start):
    fuzz = Fuzz(probe, start, tmp_path)
    end_s = time.monotonic() + DURATION_S
    while time.monotonic() < end_s:
        fuzz.sequence()
        if fuzz.n_sequences % 10 == 0:
            fuzz.check_alive()
    fuzz.check_alive()
    furthest_v, largest_share = fuzz.check_voltages()
    print(
        f"seed {SEED}: {fuzz.n_sequences} sequences in {DURATION_S:.0f} s, {fuzz.n_kills} kills, "
        f"{fuzz.n_refused} changes refused, {len(fuzz.heard)} voltages; "
        f"furthest beyond the limits {furthest_v:.2g} V, largest share of the slew limit {largest_share:.2f}"
    )
    assert len(fuzz.heard) > 100
    assert furthest_v <= 0.0
    assert largest_share <= 1.0
    assert "Traceback" not in fuzz.node.output()
