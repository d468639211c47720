"""docs/causes.md says what the effects say."""

from __future__ import annotations

import runpy
from pathlib import Path

from fomrc_core.model.causes import cause_classes

_DOCS = Path(__file__).resolve().parents[3] / "docs"


def test_the_page_of_causes_is_in_step_with_the_effects() -> None:
    page = (_DOCS / "causes.md").read_text(encoding="utf-8")
    assert page == runpy.run_path(str(_DOCS / "make_causes.py"))["text"](), "run python docs/make_causes.py"
    for name, kind in cause_classes().items():
        assert f"\n## {name}\n" in page
        assert all(f"| `{spec.name}` |" in page for spec in kind.parameters)
