"""What a watch raises: that the stage is no longer its model, and what was measured before and after."""

from __future__ import annotations

from dataclasses import dataclass

from fomrc_core.model.piezo_model import PiezoModel
from fomrc_core.model.state import ModelState
from fomrc_core.records.recording import Recording


@dataclass(frozen=True)
class Alarm:
    """The stage is no longer the model.

    Attributes:
        time_s: when it was noticed, from the start of the watch [s].
        since_s: when it is likeliest to have begun [s].
        statistic: which statistic showed it.
        motion_s: motion between the two [s].
        level_nm: size of that statistic now [nm].
        normal_nm: its standard deviation in normal work [nm].
    """

    time_s: float
    since_s: float
    statistic: str
    motion_s: float
    level_nm: float
    normal_nm: float

    def __str__(self) -> str:
        return (
            f"changed since {self.since_s:.1f} s, noticed at {self.time_s:.1f} s, "
            f"{self.motion_s:.1f} s of motion later: {self.statistic} {self.level_nm:.3g} nm, "
            f"normally {self.normal_nm:.3g} nm"
        )


@dataclass(frozen=True, eq=False)
class Case:
    """An alarm with what was measured before and after it.

    Attributes:
        alarm: the alarm.
        model: the model in force.
        state: its state just before the recording.
        recording: the recent past; its time begins at zero.
        began_s: when it began, from the start of the watch [s].
        fit_rms_um: what the model left when it was fitted [um].
    """

    alarm: Alarm
    model: PiezoModel
    state: ModelState
    recording: Recording
    began_s: float
    fit_rms_um: float
