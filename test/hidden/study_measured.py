"""The measured actuator: fit on one record, name what is missing, and measure on another."""

from __future__ import annotations

import os
import time
import traceback
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from test.hidden.study_cases import diagnosis_plain, source_digest, write_json

_ROOT = Path(__file__).resolve().parents[2]
_COLUMNS = {"voltage": 0, "displacement": 4}
_RATE_HZ = 200.0


@dataclass(frozen=True)
class Measured:
    """The one measured case."""

    part: str = "measured"

    @property
    def key(self) -> str:
        """Name of the case's file."""
        return "measured-pea_1hz"


def data_folder() -> Path:
    """Return the folder of measured data: FOMRC_DATA, or ../shared/data beside the project."""
    return Path(os.environ.get("FOMRC_DATA", _ROOT.parent / "shared" / "data"))


def run(case: Measured, folder: str) -> str:
    """Diagnose the measured actuator and write what came of it."""
    outcome: dict[str, Any] = {"spec": asdict(case), "source": source_digest()}
    try:
        from fomrc_core.diagnosis.diagnosis import diagnose
        from fomrc_core.storage import read_recording

        train, test = (
            read_recording(data_folder() / "pea_1hz" / name, columns=_COLUMNS, rate_hz=_RATE_HZ)
            for name in ("model.dat", "test_first_25s.dat")
        )
        held_out = test.window(0.5, np.inf)
        start_s = time.perf_counter()
        diagnosis = diagnose((train,), test=held_out)
        outcome["wall_s"] = time.perf_counter() - start_s
        outcome |= diagnosis_plain(diagnosis)
        swing_um = float(np.ptp(held_out.measured_um))
        outcome["swing_um"] = swing_um
        outcome["rms_um_before"] = outcome["nrmse_percent_test"] * swing_um / 100.0
        outcome["rms_um_after"] = outcome["nrmse_percent_last"] * swing_um / 100.0
    except Exception as error:
        outcome |= {
            "status": "error",
            "findings": [],
            "error": repr(error),
            "traceback": traceback.format_exc(),
        }
    write_json(outcome, Path(folder) / f"{case.key}.json")
    return case.key
