"""Write docs/causes.md from the effects themselves: python docs/make_causes.py."""

from __future__ import annotations

import sys
from pathlib import Path

_ROOT = Path(__file__).resolve().parents[1]
_PAGE = Path(__file__).with_name("causes.md")

_INTRODUCTION = """# The causes a diagnosis can name

Made by `python docs/make_causes.py` from the files in `fomrc_core/effects/`, one file each; a test keeps this page
in step with them. The name of a cause is the name of its file, the `cause` in `diagnosis.json` and the key in a
model file. The order is that of the chain, from the voltage that is commanded to the displacement that is read:

    commanded voltage -> drive -> hysteresis -> creep -> mechanics -> sensor -> displacement

"Belongs to" says whether the parameters are the actuator's, the same in every record, or one record's own.
"""
_UNNAMED = """
Those whose names begin with `unnamed` are no causes. Where something is left that none explains, a diagnosis adds a few
terms that follow it and says what they depend on, not why (`unnamed_extension` in `diagnosis.json`): past and
swings of the drive and of the displacement, what comes back with the commanded voltage, place and motion (`unnamed`), a
curve over the place (`unnamed_static`), the time since the start, a second axis, the temperature; the status stays what
it was without them.
"""
_STAGES = {
    "SAMPLED_DRIVE": "drive, at the samples",
    "DRIVE": "drive, between the samples as well",
    "HYSTERESIS": "beside the hysteresis",
    "START": "before the first sample",
    "MECHANICAL": "mechanics, between the samples as well",
    "SENSED": "sensor side, at the samples",
}


def text() -> str:
    """Return the page."""
    from fomrc_core.effects import Effect
    from fomrc_core.model.causes import cause_classes

    kinds = cause_classes()
    parts = [_INTRODUCTION, "| cause | where in the chain | main parameter | inverted |", "|---|---|---|---|"]
    named = {name: kind for name, kind in kinds.items() if kind.is_named}
    for name, kind in named.items():
        unit = next(spec.unit for spec in kind.parameters if spec.name == kind.main_parameter)
        where = _STAGES[kind.stage.name if issubclass(kind, Effect) else "START"]
        parts.append(
            f"| [{name}](#{name}) | {where} | `{kind.main_parameter}` [{unit}] | {'yes' if kind.can_invert else 'no'} |"
        )
    parts.append(_UNNAMED)
    for name, kind in kinds.items():
        parts += [
            f"\n## {name}\n",
            f"{kind.meaning}\n",
            f"- Signature: {kind.signature}.",
            f"- Best experiment: {kind.experiment}.",
            f"- Compensator: {kind.inverse_note}.",
            f"- Belongs to: {'one record' if kind.is_record_bound else 'the actuator'}.\n",
            "| parameter | unit | allowed | what it is |",
            "|---|---|---|---|",
        ]
        for spec in kind.parameters:
            values = "list, each " if spec.is_list else ""
            parts.append(
                f"| `{spec.name}` | {spec.unit} | {values}{spec.lower:g} to {spec.upper:g} | {spec.description} |"
            )
    return "\n".join(parts) + "\n"


if __name__ == "__main__":
    sys.path.insert(0, str(_ROOT))
    _PAGE.write_text(text(), encoding="utf-8")
