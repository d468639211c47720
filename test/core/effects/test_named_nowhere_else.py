"""No module outside the effects' own folder names one of them: what others need to know is a hook of Effect."""

from __future__ import annotations

import ast
from pathlib import Path

from fomrc_core.effects import effect_classes

_ROOT = Path(__file__).resolve().parents[3]
_EFFECTS = _ROOT / "fomrc_core" / "effects"
# rivals of the model, each with an amplifier before it so that they are compared like for like
_BASELINES = _ROOT / "fomrc_core" / "comparison" / "baselines"


def _named_in(source: str) -> list[str]:
    """Return what of a source names an effect: its module, its class, or its name as a string."""
    kinds = {kind.__name__ for kind in effect_classes().values()}
    names = set(effect_classes())
    found = []
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Constant) and node.value in names:
            found.append(f"{node.lineno}: {node.value!r}")
        elif isinstance(node, (ast.Name, ast.Attribute)):
            word = node.id if isinstance(node, ast.Name) else node.attr
            found += [f"{node.lineno}: {word}"] if word in kinds else []
        elif isinstance(node, (ast.Import, ast.ImportFrom)):
            words = {part for alias in node.names for part in alias.name.split(".")}
            words |= set((node.module or "").split(".")) if isinstance(node, ast.ImportFrom) else set()
            found += [f"{node.lineno}: {word}" for word in sorted(words & (kinds | names))]
    return found


def test_no_module_outside_the_effects_names_one() -> None:
    found = {}
    for package in ("fomrc_core", "fomrc_ros"):
        for path in sorted((_ROOT / package).rglob("*.py")):
            if _EFFECTS in path.parents or _BASELINES in path.parents:
                continue
            if named := _named_in(path.read_text(encoding="utf-8")):
                found[str(path.relative_to(_ROOT))] = named
    assert found == {}


def test_the_check_sees_every_form_of_a_name() -> None:
    assert len(_named_in("from fomrc_core.effects.gain_drift import GainDrift")) == 2
    assert len(_named_in("import fomrc_core.effects.mains_hum as hum\nhum.MainsHum(50.0, 0.1)")) == 2
    assert len(_named_in("if effect.name == 'dead_zone' or name in ('clock_skew', 'other'): pass")) == 2
    assert _named_in("'''Words on amplifier_bandwidth and others.'''\neffect.initial_state()") == []
