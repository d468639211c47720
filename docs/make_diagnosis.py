"""Bring the tutorial's diagnosis of the measured stack up to date: python docs/make_diagnosis.py."""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

_ROOT = Path(__file__).resolve().parents[1]
_PAGE = Path(__file__).parent / "tutorials" / "diagnose-a-measured-stack.md"
_FIGURE = Path(__file__).parent / "figures" / "diagnosis_pea_1hz.png"


def main() -> None:
    """Run the two commands the page names, and put in what the second one prints, and its figure."""
    fomrc = [sys.executable, "-m", "fomrc_core.cli"]
    with tempfile.TemporaryDirectory() as folder:
        data, result = Path(folder) / "data", Path(folder) / "result"
        subprocess.run([*fomrc, "data", "pea_1hz", "--output", data], cwd=_ROOT, check=True)
        records = [data / "pea_1hz_train.csv", "--test", data / "pea_1hz_test.csv"]
        command = [*fomrc, "diagnose", *records, "--output", result]
        printed = subprocess.run(command, cwd=_ROOT, check=True, stdout=subprocess.PIPE, text=True).stdout
        shutil.copyfile(result / "where_it_is_wrong.png", _FIGURE)
    block = "\n".join(f"    {line}" for line in printed.splitlines())
    text, n_blocks = re.subn(r"    status: .*(\n    .*)*", lambda _: block, _PAGE.read_text(encoding="utf-8"))
    if n_blocks != 1:
        sys.exit(f"{_PAGE}: {n_blocks} indented blocks begin with 'status:' (allowed: 1)")
    _PAGE.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
