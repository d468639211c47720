"""Outcomes of the second world told anew with the belief of today, where only that has changed since they ran.

    python test/hidden/study_rebelieved.py FROM TO

FROM holds outcomes as ``study.py --part second`` writes them; names, models and what is left of the data stay, and the
evidence of each name with them. Probabilities are those of the weights in ``fomrc_core.diagnosis.belief``, and whether
an answer is explained follows from them and from the doubts it had beside them. Reported with
``study.py --part second --report-only --output TO``.
"""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path
from typing import Any

if __package__ in (None, ""):
    sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from test.hidden.study_calibration import standing_weights, told_by

_OF_NAMES = "right with a probability of"


def rebelieved(outcome: dict[str, Any]) -> dict[str, Any]:
    """Return the outcome with the probabilities and the status of today."""
    import numpy as np

    from fomrc_core.diagnosis.belief import asked_of
    from fomrc_core.diagnosis.judgement import doubts_of_names

    if not outcome["findings"]:
        return outcome
    for found in outcome["findings"]:
        found["probability"] = float(told_by(standing_weights(), np.array([found["evidence"]]))[0])
    doubts = [doubt for doubt in outcome["doubts"] if _OF_NAMES not in doubt]
    told = [found["probability"] for found in outcome["findings"]]
    causes = [found["cause"] for found in outcome["findings"]]
    outcome["doubts"] = [*doubts, *doubts_of_names(told, asked_of(causes))]
    if outcome["status"] in ("explained", "suspect"):
        outcome["status"] = "suspect" if outcome["doubts"] else "explained"
    return outcome


def main() -> None:
    """Read, tell anew, write."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("source", type=Path, help="folder of outcomes")
    parser.add_argument("target", type=Path, help="folder for what is told of them today")
    options = parser.parse_args()
    (options.target / "cases").mkdir(parents=True, exist_ok=True)
    for file in sorted((options.source / "cases").glob("second_*.json")):
        told = rebelieved(json.loads(file.read_text(encoding="utf-8")))
        (options.target / "cases" / file.name).write_text(json.dumps(told), encoding="utf-8")


if __name__ == "__main__":
    main()
