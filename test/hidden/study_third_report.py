"""The third world's outcomes as one page."""

from __future__ import annotations

import itertools
from collections import Counter
from collections.abc import Callable
from pathlib import Path

import numpy as np

from test.hidden.study_scores import Outcome, answer, is_exact, is_first, named, share
from test.hidden.study_second_scores import cpu_seconds
from test.hidden.study_third import FIRST_SEED, GROUPS
from test.hidden.study_third_scores import (
    SURE,
    calibrated,
    has_all,
    is_clean_null,
    is_exact_and_explained,
    is_left_open,
    is_overlooked,
    is_wrong_and_explained,
    wrong_names,
)

Groups = dict[str, list[Outcome]]


def _rows(groups: Groups) -> list[tuple[str, str]]:
    """Return what was measured and how much it is; of groups that have cases."""
    everything = [o for group in groups.values() for o in group]
    rows = [("wrong name and `explained`, of all", share(everything, is_wrong_and_explained))]
    asked: tuple[tuple[str, str, Callable[[Outcome], bool]], ...] = (
        ("nothing hidden: `nothing_found`", "null", is_clean_null),
        ("single causes: first", "known", is_first),
        ("single causes: exact", "known", is_exact),
        ("pairs: all found", "pairs", has_all),
        ("pairs: exact", "pairs", is_exact),
        (f"effects without a name: not `explained`, no name with p >= {SURE}", "unknown", is_left_open),
        ("effects without a name: `nothing_found`", "unknown", is_overlooked),
        (f"other forms of hysteresis: not `explained`, no wrong name with p >= {SURE}", "forms", is_left_open),
    )
    rows += [(what, share(groups[part], test)) for what, part, test in asked if groups.get(part)]
    complete = [o for part in ("known", "pairs") for o in groups.get(part, []) if is_exact(o)]
    if complete:
        rows.append(("of the right and complete: `explained`", share(complete, is_exact_and_explained)))
    if times := cpu_seconds(everything):
        most, worst = float(np.quantile(times, 0.95)), max(times)
        rows.append(("CPU time of a diagnosis, 95th percentile / worst", f"{most:.0f} s / {worst:.0f} s"))
    rows.append(("broke off", share(everything, lambda o: o["status"] == "error")))
    return rows


def _counted(answers: Counter[str]) -> str:
    return ", ".join(f"{n}x {a}" for a, n in answers.most_common()) or "-"


def _by(outcomes: list[Outcome], key: Callable[[Outcome], str]) -> Groups:
    found: Groups = {}
    for outcome in outcomes:
        found.setdefault(key(outcome), []).append(outcome)
    return dict(sorted(found.items()))


def _what_is_hidden(outcome: Outcome) -> str:
    spec = outcome["spec"]
    if spec["group"] == "null":
        return f"nothing, noise {spec['noise']}"
    return " + ".join(spec["causes"]) or f"form {spec['form']}"


def _otherwise(outcome: Outcome) -> str:
    """Return what was said in place of what is hidden, with the status."""
    said = ", ".join(wrong_names(outcome)) or ("part of it" if named(outcome) else "no name")
    return f"{said} ({outcome['status']})"


def _table(part: str, outcomes: list[Outcome]) -> list[str]:
    lines = ["", f"## {part.capitalize()}", ""]
    lines += ["| hidden | cases | first | exact | left open | statuses | otherwise |", "|---" * 7 + "|"]
    for hidden, group in _by(outcomes, _what_is_hidden).items():
        statuses = Counter(str(o["status"]) for o in group)
        exact = [is_exact(o) and o["status"] != "error" for o in group]
        others = Counter(_otherwise(o) for o, is_right in zip(group, exact, strict=True) if not is_right)
        lines.append(
            f"| {hidden} | {len(group)} | {sum(map(is_first, group))} | {sum(exact)} "
            f"| {sum(map(is_left_open, group))} | {_counted(statuses)} | {_counted(others)} |"
        )
    return lines


def _circumstances(groups: Groups) -> list[str]:
    """First names of single causes by what the records were like: where the method is weak."""
    single = [o for o in groups.get("known", []) if "truth" in o]
    if not single:
        return []
    keys: dict[str, Callable[[Outcome], str]] = {
        "noise": lambda o: str(o["truth"]["noise_kind"]),
        "visible in training, over noise, to": lambda o: f"{10 * int(1 + _visible(o) // 10):02d}",
        "trained on": lambda o: f"{len(o['truth']['drive_kinds'][0])} kinds of drive",
        "range": lambda o: "bipolar" if o["truth"]["scale"]["low_v"] < 0.0 else "unipolar",
        "sampling from, Hz": lambda o: f"{10.0 ** np.floor(np.log10(o['truth']['scale']['rates_hz'][0])):06.0f}",
    }
    lines = ["", "## Single causes by circumstance", "", "| what | first | exact |", "|---|---|---|"]
    for what, key in keys.items():
        for value, group in _by(single, key).items():
            lines.append(f"| {what}: {value} | {share(group, is_first)} | {share(group, is_exact)} |")
    return lines


def _visible(outcome: Outcome) -> float:
    return float(next(iter(outcome["truth"]["visible_over_noise"].values()))[0])


def _reliability(groups: Groups) -> list[str]:
    told = calibrated(o for group in groups.values() for o in group)
    if not told:
        return []
    lines = ["", "## Reliability", "", "| probability given | names | right |", "|---|---|---|"]
    for low, high in itertools.pairwise((0.0, 0.1, 0.3, 0.5, 0.7, SURE, 0.95, 0.99, 1.0 + 1e-12)):
        right = [is_right for p, is_right in told if low <= p < high]
        if right:
            lines.append(f"| {low:g} to {min(high, 1.0):g} | {len(right)} | {100 * sum(right) / len(right):.0f} % |")
    return lines


def _wrong_and_broken(groups: Groups) -> list[str]:
    everything = [o for group in groups.values() for o in group]
    lines = ["", "## Case by case: wrong and `explained`, or broken off", "", "| part | seed | said |", "|---|---|---|"]
    told = [
        f"| {_place(o)} | {answer(o)}, hidden {_what_is_hidden(o)} |"
        for o in filter(is_wrong_and_explained, everything)
    ]
    told += [f"| {_place(o)} | `{o['error'][:140]}` |" for o in everything if o["status"] == "error"]
    return [*lines, *told] if told else []


def _place(outcome: Outcome) -> str:
    return f"{outcome['spec']['part']} | {outcome['spec']['seed']}"


def third_page(outcomes: list[Outcome], seeds: str) -> str:
    """Return the page of one set of seeds, "development" or "reporting", of whatever outcomes there are."""
    low = FIRST_SEED[seeds]
    mine = [o for o in outcomes if low <= o["spec"]["seed"] < low + 10_000]
    groups = {part: found for part in GROUPS if (found := [o for o in mine if o["spec"]["group"] == part])}
    states = Counter(o["source"] for o in mine)
    lines = [
        "# The third world: a truth written from the documentation alone",
        "",
        f"Made by `make study ARGS='--part third'` from {len(mine)} cases, {seeds} seeds. The truth shares no code",
        "with the product nor with the other worlds (test/hidden/third/): Masing hysteresis from closed curves, and",
        "effects that no cause in the library is.",
        f"State of the product's source: {', '.join(f'{s} ({n})' for s, n in states.items())}.",
        "",
        "| what | measured |",
        "|---|---|",
    ]
    lines += [f"| {what} | {told} |" for what, told in _rows(groups)] if mine else []
    for part, group in groups.items():
        lines += _table(part, group)
    lines += _circumstances(groups) + _reliability(groups) + _wrong_and_broken(groups)
    return "\n".join(lines) + "\n"


def write_third(outcomes: list[Outcome], seeds: str, folder: Path) -> Path:
    """Write the page as study_third.md into a folder."""
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / "study_third.md"
    path.write_text(third_page(outcomes, seeds), encoding="utf-8")
    return path
