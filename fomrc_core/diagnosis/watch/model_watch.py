"""The model in force beside the stage: what it gets wrong, block by block, and whether that is still as it was.

watch = ModelWatch(model, period_s)
for alarm in watch.take(steps_s, voltage_v, displacement_um): ...
case = watch.next_case()  # some time after an alarm: what naming.py needs to say what has changed
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from enum import Enum

import numpy as np

from fomrc_core.compute.arrays import Array, Mask
from fomrc_core.diagnosis.watch.alarm import Alarm, Case
from fomrc_core.diagnosis.watch.block_statistics import IS_SIGNED, STATISTICS, Blocks, BlockStatistics
from fomrc_core.diagnosis.watch.change_detector import ChangeDetector, n_dependent
from fomrc_core.diagnosis.watch.null_scale import NullScale, learnt_scale
from fomrc_core.diagnosis.watch.recent_past import RecentPast
from fomrc_core.errors import ParameterError
from fomrc_core.model.piezo_model import PiezoModel
from fomrc_core.model.record_start import estimate_start
from fomrc_core.model.state import ModelState
from fomrc_core.records.recording import Recording

_DAY_S = 86400.0
_N_BLOCK_MIN = 16
# The start of the model, relaxed or not, is found from so much.
_START_S = 10.0
# Of what a diagnosis waits for, so much does where no more comes.
_ENOUGH = 0.5
# A block has motion where the stage goes further than so many times what the model gets wrong.
_MOTION = 10.0
# Of the blocks that are learnt from; a night of rest teaches no more than a minute of it.
_LARGEST_REST_SHARE = 0.3
# What the model gets wrong differs from place to place. In motion it is told from its mean over many places; after a
# rest from its value at one, which may itself be as wrong, and at the edge of the range more so.
_OF_PLACE = ("level", "gain")
_REST_POWER = 2.0
# At most so many blocks at a time: the state of the model is kept before each such stride.
_STRIDE_BLOCKS = 20


class WatchState(Enum):
    """What the watch is doing."""

    STARTING = "starting"
    LEARNING = "learning"
    WATCHING = "watching"


@dataclass(frozen=True)
class WatchSettings:
    """How to watch.

    Args:
        false_alarms_per_day: mean number of false alarms in a day of normal work that is wanted.
        block_s: length of a block [s]; at least 16 samples.
        learn_s: motion from which normal work is learnt [s].
        memory_s: how much of the recent past is kept for a diagnosis [s].
        follow_s: how long after an alarm a diagnosis waits for what it needs [s].
    """

    false_alarms_per_day: float = 0.1
    block_s: float = 0.5
    learn_s: float = 120.0
    memory_s: float = 120.0
    follow_s: float = 20.0

    def __post_init__(self) -> None:
        for name, low, high in (
            ("false_alarms_per_day", 1e-6, 100.0),
            ("block_s", 0.01, 60.0),
            ("learn_s", 10.0, 1e5),
            ("memory_s", 60.0, 3600.0),
            ("follow_s", 1.0, 600.0),
        ):
            value = getattr(self, name)
            if not low <= value <= high:
                raise ParameterError("out of range", where=name, value=value, allowed=f"{low:g} to {high:g}")


class ModelWatch:
    """Runs the model beside the stage; memory is bounded whatever the length of the watch.

    Args:
        model: the model in force.
        settings: how to watch.
        period_s: sample period [s].
        fit_rms_um: what the model left when it was fitted [um], 0 where not known.
    """

    def __init__(
        self, model: PiezoModel, period_s: float, settings: WatchSettings | None = None, fit_rms_um: float = 0.0
    ) -> None:
        self.settings = settings or WatchSettings()
        self.model, self.period_s, self._fit_rms_um = model, period_s, fit_rms_um
        self._n_block = max(_N_BLOCK_MIN, round(self.settings.block_s / period_s))
        self._waiting: list[tuple[Array, Array, Array]] = []
        self._n_waiting = 0
        self._model_state: ModelState | None = None
        self.past = RecentPast(model, self.settings.memory_s)
        self._pending: list[Alarm] = []
        self._cut_short: list[Case] = []
        self._start_known_s = 0.0
        self.time_s = 0.0
        self.state = WatchState.STARTING
        self._statistics = BlockStatistics(period_s, self._n_block, fit_rms_um)
        self._learn_anew()

    @property
    def share_of_threshold(self) -> float:
        """How far the evidence for a change is on the way to an alarm, by its logarithm, 0 to 1."""
        return 0.0 if self._detector is None else self._detector.share_of_threshold

    def take(self, steps_s: Array, voltage_v: Array, displacement_um: Array) -> list[Alarm]:
        """Take in what was driven and measured; return the alarms it raises.

        Args:
            steps_s: step that leads to each sample [s], shape (n_samples,).
            voltage_v: drive [V], shape (n_samples,).
            displacement_um: measured displacement [um], shape (n_samples,); not a number where it was lost.

        Raises:
            ParameterError: lengths that differ, values that are not finite.
        """
        given = tuple(np.asarray(v, dtype=np.float64) for v in (steps_s, voltage_v, displacement_um))
        if len({v.shape for v in given}) != 1 or given[0].ndim != 1:
            raise ParameterError("do not fit", where="voltage_v, displacement_um", allowed="shape (n_samples,) each")
        if not (np.all(np.isfinite(given[0])) and np.all(np.isfinite(given[1])) and not np.any(np.isinf(given[2]))):
            raise ParameterError("not finite", where="voltage_v, displacement_um", allowed="finite")
        self._waiting.append((given[0], given[1], given[2]))
        self._n_waiting += given[0].size
        if self._model_state is None and self._n_waiting * self.period_s < _START_S:
            return []
        steps, drive, moved = (np.concatenate(parts) for parts in zip(*self._waiting, strict=True))
        if self._model_state is None:
            self._begin(steps, drive, moved)
        alarms = []
        n_blocks = steps.size // self._n_block
        for first in range(0, n_blocks, _STRIDE_BLOCKS):
            part = slice(first * self._n_block, min(first + _STRIDE_BLOCKS, n_blocks) * self._n_block)
            alarm = self._stride(steps[part], drive[part], moved[part])
            if alarm is not None:
                alarms.append(alarm)
        self._pending += alarms
        left = n_blocks * self._n_block
        self._waiting = [(steps[left:], drive[left:], moved[left:])]
        self._n_waiting = steps.size - left
        return alarms

    def next_case(self, *, is_last: bool = False) -> Case | None:
        """Return the oldest alarm that has enough measured after it for a diagnosis, once; None where there is none.

        Args:
            is_last: whether nothing more will be measured.
        """
        if self._cut_short:
            return self._cut_short.pop(0)
        if not self._pending:
            return None
        alarm = self._pending[0]
        if not is_last and self.time_s < max(alarm.time_s, self._start_known_s) + self.settings.follow_s:
            return None
        return self._case_of(self._pending.pop(0))

    def _case_of(self, alarm: Alarm) -> Case:
        past = self.past
        return Case(alarm, self.model, past.state(), past.recording(), past.began_s, self._fit_rms_um)

    def begin_record(self) -> None:
        """Go on with another record of the same stage: what is normal is kept, where the model stands is not.

        What was before a change goes with the old record: an alarm has its case now, if there is enough after it.
        """
        enough_s = self.time_s - _ENOUGH * self.settings.follow_s
        self._cut_short += [self._case_of(alarm) for alarm in self._pending if alarm.time_s <= enough_s]
        self._pending = [alarm for alarm in self._pending if alarm.time_s > enough_s]
        self._model_state = None
        self._waiting, self._n_waiting = [], 0
        self.past = RecentPast(self.model, self.settings.memory_s)
        self._statistics = BlockStatistics(self.period_s, self._n_block, self._fit_rms_um)

    def _begin(self, steps_s: Array, voltage_v: Array, moved_um: Array) -> None:
        time_s = np.cumsum(steps_s) - steps_s[0]
        record = Recording(time_s, voltage_v, _with_lost_filled(time_s, moved_um), name="start of the watch")
        start = estimate_start(self.model, record)
        self._model_state = start.state
        self._start_known_s = self.time_s + float(np.sum(steps_s[: start.n_samples]))
        if self.state is WatchState.STARTING:
            self.state = WatchState.LEARNING

    def _learn_anew(self) -> None:
        self._learnt: list[tuple[Array, Array]] = []
        self._n_motion = self._n_rest = 0
        self._detector: ChangeDetector | None = None
        self._scales: list[NullScale] = []
        # Of each block since detection began, when it began and the motion before it; the oldest go.
        self._recent: deque[tuple[float, float]] = deque(maxlen=self._n_blocks_in(self.settings.memory_s))
        self._motion_s = 0.0
        if self.state is not WatchState.STARTING:
            self.state = WatchState.LEARNING

    def _n_blocks_in(self, duration_s: float) -> int:
        return max(1, round(duration_s / (self._n_block * self.period_s)))

    def _stride(self, steps_s: Array, voltage_v: Array, moved_um: Array) -> Alarm | None:
        assert self._model_state is not None
        before = self._model_state.copy()
        predicted_um = self.model.simulate(steps_s, voltage_v, self._model_state)
        # What was lost speaks neither for nor against the model.
        moved_um = predicted_um + _with_lost_filled(np.cumsum(steps_s), moved_um - predicted_um)
        is_of_start = self.time_s < self._start_known_s
        self.past.add(self.time_s, steps_s, voltage_v, moved_um, before, is_of_start=is_of_start)
        durations_s = steps_s.reshape(-1, self._n_block).sum(axis=1)
        ends_s = self.time_s + np.cumsum(durations_s)
        self.time_s = float(ends_s[-1])
        if is_of_start:
            self._start_known_s = max(self._start_known_s, self.time_s)
        blocks = self._statistics.of(moved_um - predicted_um, predicted_um)
        unrest = blocks.statistics[:, STATISTICS.index("unrest")]
        moves = np.ptp(predicted_um.reshape(-1, self._n_block), axis=1) > _MOTION * np.maximum(unrest, self._fit_rms_um)
        if self._detector is None:
            self._learn(blocks, moves)
            return None
        before_s = self._motion_s + np.cumsum(durations_s * moves) - durations_s * moves
        self._motion_s = float(before_s[-1] + durations_s[-1] * moves[-1])
        self._recent.extend(zip((ends_s - durations_s).tolist(), before_s.tolist(), strict=True))
        return self._look(blocks, ends_s)

    def _learn(self, blocks: Blocks, moves: Mask) -> None:
        n_wanted = self._n_blocks_in(self.settings.learn_s)
        for k, is_moving in enumerate(moves):
            if is_moving:
                self._n_motion += 1
            elif self._n_rest >= _LARGEST_REST_SHARE * n_wanted:
                continue
            self._n_rest += not is_moving
            self._learnt.append((blocks.statistics[k], blocks.measures[k]))
        if self._n_motion < n_wanted:
            return
        values, measures = (np.array([block[k] for block in self._learnt]) for k in (0, 1))
        floors = [self._fit_rms_um if name in ("level", "gain") else 0.0 for name in STATISTICS]
        self._scales = [learnt_scale(values[:, k], measures, floor) for k, floor in enumerate(floors)]
        dependent = [n_dependent(values[:, k] / scale.of(measures)) for k, scale in enumerate(self._scales)]
        blocks_between = self._n_blocks_in(_DAY_S / self.settings.false_alarms_per_day)
        self._detector = ChangeDetector(dependent, IS_SIGNED, blocks_between)
        self._learnt = []
        self.state = WatchState.WATCHING

    def _look(self, blocks: Blocks, ends_s: Array) -> Alarm | None:
        assert self._detector is not None
        scales = np.column_stack([scale.of(blocks.measures) for scale in self._scales])
        for name in _OF_PLACE:
            scales[:, STATISTICS.index(name)] *= np.sqrt(1.0 + _REST_POWER * blocks.rested)
        n_before = self._detector.n_blocks
        crossing = self._detector.add(blocks.statistics / scales)
        if crossing is None:
            return None
        at = crossing.block - n_before
        ago = min(ends_s.size - 1 - at + crossing.block - crossing.since_block, len(self._recent) - 1)
        since_s, motion_then_s = self._recent[-1 - ago]
        motion_now_s = self._recent[-(ends_s.size - at)][1]
        k = crossing.statistic
        alarm = Alarm(
            float(ends_s[at]),
            since_s,
            STATISTICS[k],
            motion_now_s - motion_then_s,
            1e3 * float(blocks.statistics[at, k]),
            1e3 * float(scales[at, k]),
        )
        self._learn_anew()
        return alarm


def _with_lost_filled(time_s: Array, values: Array) -> Array:
    """Return values with those that are not numbers on straight lines between the others, zero without any."""
    is_lost = np.isnan(values)
    if not np.any(is_lost):
        return values
    if np.all(is_lost):
        return np.zeros(values.size)
    return np.asarray(np.interp(time_s, time_s[~is_lost], values[~is_lost]))
