"""The tables behind the bars."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable

import numpy as np

from test.hidden.effects import CAUSES
from test.hidden.study_cases import is_close
from test.hidden.study_scores import (
    Outcome,
    answer,
    by_noise,
    is_exact,
    is_first,
    main_errors,
    n_false,
    named,
    share,
)


def _median(values: Iterable[float | None], form: str = "{:.2f}") -> str:
    kept = [v for v in values if v is not None]
    return form.format(float(np.median(kept))) if kept else "-"


def details(groups: dict[str, list[Outcome]]) -> list[str]:
    """Return the tables behind the bars."""
    lines: list[str] = []
    if single := groups.get("single"):
        lines += [
            "",
            "## One effect, cause by cause",
            "",
            "| cause | cases | first | exact | parameter within 10 % "
            "| median error | median visible rms [nm] | otherwise answered |",
            "|---" * 8 + "|",
        ]
        for cause in CAUSES:
            group = [o for o in single if o["spec"]["causes"] == [cause]]
            if not group:
                continue
            errors = main_errors(group)
            others = Counter(answer(o) for o in group if not is_first(o))
            others.update(f"also {name}" for o in group if is_first(o) for name in named(o)[1:])
            visible = _median([1e3 * o["truth"]["visible_rms_um"][cause] for o in group if "truth" in o], "{:.1f}")
            close = f"{sum(map(is_close, errors))}/{len(errors)}" if errors else "-"
            lines.append(
                f"| {cause} | {len(group)} | {sum(map(is_first, group))} | {sum(map(is_exact, group))} "
                f"| {close} "
                f"| {_median([100 * e for e in errors], '{:.2f} %')} | {visible} "
                f"| {', '.join(f'{n}x {a}' for a, n in others.items()) or '-'} |"
            )
    if pairs := groups.get("pairs"):
        lines += ["", "## Two effects", "", "| hidden | named | status |", "|---|---|---|"]
        lines += [
            f"| {' + '.join(o['spec']['causes'])} | {', '.join(named(o)) or '-'} | {o['status']} |" for o in pairs
        ]
    if removed := groups.get("removed"):
        lines += ["", "## True cause removed", "", "| hidden and removed | named | status |", "|---|---|---|"]
        lines += [f"| {o['spec']['causes'][0]} | {', '.join(named(o)) or '-'} | {o['status']} |" for o in removed]
    if noise := groups.get("noise"):
        lines += [
            "",
            "## Noise",
            "",
            "| noise [nm] | effect hidden: first | false names | nothing hidden: named |",
            "|---" * 4 + "|",
        ]
        for level, group in by_noise(noise):
            hidden, empty = (
                [o for o in group if o["spec"]["causes"]],
                [o for o in group if not o["spec"]["causes"]],
            )
            lines.append(
                f"| {1e3 * level:g} | {share(hidden, is_first)} | {sum(map(n_false, group))} "
                f"| {sum(bool(named(o)) for o in empty)}/{len(empty)} |"
            )
    if poor := groups.get("poor"):
        lines += [
            "",
            "## Poor excitation",
            "",
            "| drive | hidden | visible rms [nm] | named | status | ambiguous with |",
            "|---" * 6 + "|",
        ]
        for o in poor:
            cause = o["spec"]["causes"][0]
            visible = f"{1e3 * o['truth']['visible_rms_um'][cause]:.2f}" if "truth" in o else "-"
            lines.append(
                f"| {o['spec']['excitation']} | {cause} | {visible} | {', '.join(named(o)) or '-'} "
                f"| {o['status']} | {', '.join(o.get('ambiguous_with', [])) or '-'} |"
            )
    if settle := groups.get("settle"):
        lines += [
            "",
            "## The proposed experiment",
            "",
            "| true | not | poor record: answer | ambiguous with | proposed | with it: answer |",
            "|---" * 6 + "|",
        ]
        for o in settle:
            first = o.get("poor", {})
            other = next(c for c in o["spec"]["pair"] if c not in o["spec"]["causes"])
            lines.append(
                f"| {o['spec']['causes'][0]} | {other} | {answer(first) if first else '-'} "
                f"| {', '.join(first.get('ambiguous_with', [])) or '-'} "
                f"| {first.get('next_experiment', '-')} "
                f"| {', '.join(named(o)) or o['status']} |"
            )
    return lines
