"""The second world's outcomes as one page: every bar with what was measured, and the tables behind."""

from __future__ import annotations

import itertools
from collections import Counter
from collections.abc import Callable
from pathlib import Path

import numpy as np

from test.hidden.study_cases import is_close
from test.hidden.study_scores import Outcome, answer, named, share
from test.hidden.study_second import FIRST_SEED
from test.hidden.study_second_scores import (
    ABSORBED,
    SURE,
    calibrated,
    cpu_seconds,
    errors_of,
    is_clean_null,
    is_first_or_open,
    is_first_right,
    is_halved,
    is_right_and_complete,
    is_worse,
    is_wrong_and_explained,
    wrong_names,
)

Groups = dict[str, list[Outcome]]
Row = tuple[str, str, str, bool]


def _at_least(outcomes: list[Outcome], test: Callable[[Outcome], bool], bar: float) -> tuple[str, bool]:
    return share(outcomes, test), sum(map(test, outcomes)) >= bar * len(outcomes)


def _overall_rows(groups: Groups) -> list[Row]:
    rows: list[Row] = []
    everything = [o for group in groups.values() for o in group]
    wrong = sum(map(is_wrong_and_explained, everything))
    told = share(everything, is_wrong_and_explained)
    rows.append(("wrong name and `explained`", "<= 1 %", told, wrong <= 0.01 * len(everything)))
    complete = [
        o for part in ("known", "new", "pairs", "triples") for o in groups.get(part, []) if is_right_and_complete(o)
    ]
    if complete:
        told, is_met = _at_least(complete, lambda o: o["status"] == "explained", 0.9)
        rows.append(("status of a right and complete answer", "`explained` >= 90 %", told, is_met))
    pairs = calibrated(everything)
    sure = [is_right for p, is_right in pairs if p >= SURE]
    if sure:
        part = sum(sure) / len(sure)
        told = f"{sum(sure)}/{len(sure)} ({100 * part:.0f} %)"
        rows.append((f"calibration: names with p >= {SURE}", "88 to 100 % right", told, 0.88 <= part <= 1.0))
    else:
        rows.append(("calibration", "88 to 100 % right", "findings carry no probability", False))
    times = cpu_seconds(everything)
    if times:
        most, worst = float(np.quantile(times, 0.95)), max(times)
        told = f"{most:.0f} s / {worst:.0f} s over {len(times)} records"
        rows.append(("CPU time, 95th percentile / worst", "<= 30 s / 60 s", told, most <= 30.0 and worst <= 60.0))
    if scales := groups.get("scales"):
        n_broken = sum(o["status"] == "error" for o in scales)
        rows.append((f"aborts over {len(scales)} random scales", "0", str(n_broken), n_broken == 0))
    return rows


def _group_rows(groups: Groups) -> list[Row]:
    rows: list[Row] = []
    if null := groups.get("null"):
        told, is_met = _at_least(null, is_clean_null, 0.95)
        rows.append(("nothing hidden, noise of six kinds and spikes", "`nothing_found` >= 95 %", told, is_met))
    if known := groups.get("known"):
        rows.append(("known single effects: first", ">= 95 %", *_at_least(known, is_first_right, 0.95)))
        told, is_met = _at_least(known, is_first_or_open, 0.95)
        rows.append(("the same, or left open where no drive tells it from another", ">= 95 %", told, is_met))
        rows.append(("known single effects: exact", ">= 90 %", *_at_least(known, is_right_and_complete, 0.90)))
        rows.append(_parameter_row("known single effects", known))
    if new := [o for o in groups.get("new", []) if o["spec"]["causes"] != [ABSORBED]]:
        rows.append(("new causes, single: first", ">= 90 %", *_at_least(new, is_first_right, 0.90)))
        told, is_met = _at_least(new, is_first_or_open, 0.90)
        rows.append(("the same, or left open where no drive tells it from another", ">= 90 %", told, is_met))
        rows.append(_parameter_row("new causes", new))
    if removed := groups.get("removed"):
        # Where the base leaves less than a tenth more than the noise there is nothing to halve.
        seen = [o for o in removed if o.get("report_over_noise_before", 2.0) > 1.1]
        if seen:
            rows.append(("cause not in the library: error halved", ">= 70 %", *_at_least(seen, is_halved, 0.7)))
        n_worse = sum(map(is_worse, removed))
        rows.append(("cause not in the library: worse by 5 %", "never", str(n_worse), n_worse == 0))
    for part, bar in (("pairs", 0.9), ("triples", 0.75)):
        if group := groups.get(part):
            told, is_met = _at_least(group, lambda o: set(o["spec"]["causes"]) <= set(named(o)), bar)
            rows.append((f"{part}: all found", f">= {100 * bar:.0f} %", told, is_met))
            told, is_met = _at_least(group, lambda o: set(o["spec"]["causes"]) - {ABSORBED} <= set(named(o)), bar)
            rows.append((f"the same, but for a {ABSORBED}, which plays can be", f">= {100 * bar:.0f} %", told, is_met))
    return rows


def _parameter_row(what: str, outcomes: list[Outcome]) -> Row:
    errors = errors_of(outcomes)
    close = sum(map(is_close, errors))
    told = f"{close}/{len(errors)}" if errors else "none compared"
    return (f"{what}: main parameter within 10 %", ">= 90 %", told, bool(errors) and close >= 0.9 * len(errors))


def _by(outcomes: list[Outcome], key: Callable[[Outcome], str]) -> dict[str, list[Outcome]]:
    found: dict[str, list[Outcome]] = {}
    for outcome in outcomes:
        found.setdefault(key(outcome), []).append(outcome)
    return dict(sorted(found.items()))


def _noise_of(outcome: Outcome) -> str:
    spec = outcome["spec"]
    return "+".join(spec["faults"]) or str(outcome.get("truth", {}).get("noise_kind", spec["noise"]))


def _null_table(groups: Groups) -> list[str]:
    if not groups.get("null"):
        return []
    lines = [
        "",
        "## Nothing hidden, noise by kind",
        "",
        "| noise | `nothing_found`, no name | answers |",
        "|---|---|---|",
    ]
    for kind, group in _by(groups["null"], _noise_of).items():
        answers = Counter(f"{answer(o)} ({o['status']})" if named(o) else str(o["status"]) for o in group)
        lines.append(f"| {kind} | {share(group, is_clean_null)} | {_counted(answers)} |")
    return lines


def _counted(answers: Counter[str]) -> str:
    return ", ".join(f"{n}x {a}" for a, n in answers.most_common()) or "-"


def _cause_table(title: str, outcomes: list[Outcome]) -> list[str]:
    if not outcomes:
        return []
    lines = ["", f"## {title}", ""]
    lines += [
        "| hidden | cases | first | exact | within 10 % | median error | statuses | otherwise |",
        "|---" * 8 + "|",
    ]
    for hidden, group in _by(outcomes, lambda o: " + ".join(o["spec"]["causes"]) or "nothing").items():
        errors = errors_of(group)
        middle = f"{100 * float(np.median(errors)):.2g} %" if errors else "-"
        others = Counter(", ".join(wrong_names(o)) for o in group if wrong_names(o))
        others.update("no name" for o in group if not named(o))
        lines.append(
            f"| {hidden} | {len(group)} | {sum(map(is_first_right, group))} "
            f"| {sum(map(is_right_and_complete, group))} | {sum(map(is_close, errors))}/{len(errors)} | {middle} "
            f"| {_counted(Counter(str(o['status']) for o in group))} | {_counted(others)} |"
        )
    return lines


def _circumstance_table(groups: Groups) -> list[str]:
    """First names of single effects by what the record was like: where the method is weak."""
    single = [o for part in ("known", "new") for o in groups.get(part, []) if "truth" in o]
    if not single:
        return []
    lines = ["", "## Single effects by circumstance", "", "| what | first | exact | `explained` |", "|---|---|---|---|"]

    def decade(low: float, value: float) -> str:
        return f"{10.0 ** np.floor(np.log10(value)) if value > 0 else low:g}"

    keys: dict[str, Callable[[Outcome], str]] = {
        "noise": _noise_of,
        "visible over noise from": lambda o: (
            f"{5 * int(next(iter(o['truth']['visible_over_noise'].values()))[1] // 5)}"
        ),
        "sampling from, Hz": lambda o: decade(0.1, o["truth"]["scale"]["rate_hz"]),
        "samples from": lambda o: decade(100, o["truth"]["n_samples"][0]),
        "held-out drive": lambda o: ", ".join(o["truth"]["drive_kinds"]["test"]),
    }
    for what, key in keys.items():
        for value, group in _by(single, key).items():
            explained = sum(o["status"] == "explained" for o in group)
            lines.append(
                f"| {what}: {value} | {share(group, is_first_right)} | {share(group, is_right_and_complete)} "
                f"| {explained}/{len(group)} |"
            )
    return lines


def _reliability_table(groups: Groups) -> list[str]:
    told = calibrated(o for group in groups.values() for o in group)
    if not told:
        return []
    lines = ["", "## Reliability", "", "| probability given | names | right |", "|---|---|---|"]
    edges = (0.0, 0.1, 0.3, 0.5, 0.7, 0.9, 0.99, 1.0 + 1e-12)
    for low, high in itertools.pairwise(edges):
        right = [is_right for p, is_right in told if low <= p < high]
        if right:
            lines.append(f"| {low:g} to {min(high, 1.0):g} | {len(right)} | {100 * sum(right) / len(right):.0f} % |")
    return lines


def _failures(groups: Groups) -> list[str]:
    broken = [o for group in groups.values() for o in group if o["status"] == "error"]
    if not broken:
        return []
    lines = ["", "## Broke off", "", "| part | seed | error |", "|---|---|---|"]
    return lines + [f"| {o['spec']['part']} | {o['spec']['seed']} | `{o['error'][:160]}` |" for o in broken]


def second_page(outcomes: list[Outcome], seeds: str) -> str:
    """Return the page of one set of seeds, "development" or "reporting", of whatever outcomes there are."""
    low = FIRST_SEED[seeds]
    mine = [o for o in outcomes if low <= o["spec"]["seed"] < low + 10_000]
    groups: Groups = {}
    for outcome in mine:
        groups.setdefault(outcome["spec"]["group"], []).append(outcome)
    states = Counter(o["source"] for o in mine)
    lines = [
        "# The second world: what the diagnosis finds where nobody tuned it",
        "",
        f"Made by `make study ARGS='--part second'` from {len(mine)} cases, {seeds} seeds. The truth shares no code",
        "with the product nor with the first world (test/hidden/second/).",
        f"State of the product's source: {', '.join(f'{s} ({n})' for s, n in states.items())}.",
        "",
        "| what | bar | measured | met |",
        "|---|---|---|---|",
    ]
    if mine:
        rows = _overall_rows(groups) + _group_rows(groups)
        lines += [f"| {what} | {bar} | {told} | {'yes' if met else '**no**'} |" for what, bar, told, met in rows]
    lines += _null_table(groups)
    for part, title in (
        ("known", "Known causes, one hidden"),
        ("new", "New causes, one hidden"),
        ("removed", "Taken out of the library"),
        ("pairs", "Pairs"),
        ("triples", "Triples"),
        ("faults", "Faulty data"),
    ):
        lines += _cause_table(title, groups.get(part, []))
    for form, group in _by(groups.get("forms", []), lambda o: o["spec"]["form"]).items():
        lines += _cause_table(f"Hysteresis of form {form}", group)
    lines += _circumstance_table(groups) + _reliability_table(groups) + _failures(groups)
    return "\n".join(lines) + "\n"


def write_second(outcomes: list[Outcome], seeds: str, folder: Path) -> Path:
    """Write the page as study_second.md into a folder."""
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / "study_second.md"
    path.write_text(second_page(outcomes, seeds), encoding="utf-8")
    return path
