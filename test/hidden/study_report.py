"""The study's outcomes as one page: every bar with what was measured, then the tables behind it."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path

import numpy as np

from test.hidden.study_cases import is_close
from test.hidden.study_confusion import write_confusion
from test.hidden.study_scores import (
    Outcome,
    by_noise,
    is_exact,
    is_first,
    is_misled,
    main_errors,
    n_false,
    named,
    share,
)
from test.hidden.study_tables import details

_AddRow = Callable[[str, str, str, bool, list[Outcome]], None]


def bars(groups: dict[str, list[Outcome]]) -> list[str]:
    """Return the table of what must be shown: bar, measured, met or not."""
    rows = ["| what | bar | measured | met |", "|---|---|---|---|"]

    def row(what: str, bar: str, measured: str, is_met: bool, group: list[Outcome]) -> None:
        n_broken = sum(o["status"] == "error" for o in group)
        if n_broken:
            measured += f"; {n_broken} broke off"
        rows.append(f"| {what} | {bar} | {measured} | {'yes' if is_met and not n_broken else '**no**'} |")

    explained = [o for part in ("null", "single", "pairs") for o in groups.get(part, []) if o["status"] == "explained"]
    sections = (
        (groups.get("null"), _null_rows),
        (groups.get("single"), _single_rows),
        (groups.get("pairs"), _pairs_rows),
        (groups.get("removed"), _removed_rows),
        (groups.get("noise"), _noise_rows),
        (groups.get("poor"), _poor_rows),
        (groups.get("settle"), _settle_rows),
        (explained, _explained_rows),
        (groups.get("timing"), _timing_rows),
        (groups.get("measured"), _measured_rows),
    )
    for outcomes, write in sections:
        if outcomes:
            write(outcomes, row)
    return rows


def _null_rows(null: list[Outcome], add: _AddRow) -> None:
    hits = sum(bool(named(o)) for o in null)
    add(
        f"nothing hidden, {len(null)} seeds",
        "<= 2 % named",
        share(null, lambda o: bool(named(o))),
        hits <= 0.02 * len(null),
        null,
    )


def _single_rows(single: list[Outcome], add: _AddRow) -> None:
    n = len(single)
    add(
        "one effect: true cause named first",
        ">= 95 %",
        share(single, is_first),
        sum(map(is_first, single)) >= 0.95 * n,
        single,
    )
    add(
        "one effect: exact set",
        ">= 90 %",
        share(single, is_exact),
        sum(map(is_exact, single)) >= 0.90 * n,
        single,
    )
    errors = main_errors(single)
    close = sum(map(is_close, errors))
    add(
        "one effect: main parameter within 10 %, where truth and product share it",
        "all",
        f"{close}/{len(errors)} ({100.0 * close / max(1, len(errors)):.0f} %)",
        close == len(errors),
        single,
    )


def _pairs_rows(pairs: list[Outcome], add: _AddRow) -> None:
    both = [set(o["spec"]["causes"]) <= set(named(o)) for o in pairs]
    add(
        f"two effects, {len(pairs)} random pairs: both found",
        ">= 85 %",
        f"{sum(both)}/{len(both)} ({100.0 * sum(both) / len(both):.0f} %)",
        sum(both) >= 0.85 * len(both),
        pairs,
    )


def _removed_rows(removed: list[Outcome], add: _AddRow) -> None:
    wrong = sum(o["status"] == "explained" and bool(named(o)) for o in removed)
    add(
        f"true cause removed from the library, {len(removed)} cases",
        "0 wrong names with `explained`",
        str(wrong),
        wrong == 0,
        removed,
    )


def _noise_rows(noise: list[Outcome], add: _AddRow) -> None:
    counts = [sum(map(n_false, group)) for _, group in by_noise(noise)]
    add(
        "noise 0.3, 1, 3, 10 nm: false names",
        "never more as noise rises",
        ", ".join(map(str, counts)),
        all(b <= a for a, b in pairwise(counts)),
        noise,
    )


def _poor_rows(poor: list[Outcome], add: _AddRow) -> None:
    wrong = sum(map(is_misled, poor))
    add(
        f"poor excitation, {len(poor)} cases",
        "no wrong name",
        f"{wrong} with a wrong name",
        wrong == 0,
        poor,
    )


def _settle_rows(settle: list[Outcome], add: _AddRow) -> None:
    settled = sum(is_first(o) and n_false(o) == 0 for o in settle)
    add(
        "proposed experiment settles it, both truths of 3 pairs",
        "all",
        f"{settled}/{len(settle)}",
        settled == len(settle),
        settle,
    )


def _timing_rows(timing: list[Outcome], add: _AddRow) -> None:
    times = [o["wall_s"] for o in timing if "wall_s" in o]
    add(
        "time, 90 000 samples, 2 threads",
        "<= 30 s",
        ", ".join(f"{t:.0f} s" for t in times) or "failed",
        bool(times) and len(times) == len(timing) and max(times) <= 30.0,
        timing,
    )


def _measured_rows(measured: list[Outcome], add: _AddRow) -> None:
    o = measured[0]
    if "rms_um_after" in o:
        first = named(o)[:1] == ["amplifier_bandwidth"] or "amplifier_bandwidth" in o["ambiguous_with"]
        add(
            "measured pea_1hz, held-out rms",
            "amplifier_bandwidth first; <= 0.22 um",
            f"{o['rms_um_before']:.2f} -> {o['rms_um_after']:.3f} um; {', '.join(named(o)) or o['status']}",
            first and o["rms_um_after"] <= 0.22,
            measured,
        )
    else:
        add("measured pea_1hz", "amplifier_bandwidth first; <= 0.22 um", o["error"], False, measured)


def _explained_rows(explained: list[Outcome], add: _AddRow) -> None:
    ratios = np.array([o["held_out_over_noise"] for o in explained])
    add(
        "held-out error over the true noise, `explained` cases",
        "<= 1.2",
        f"median {np.median(ratios):.2f}, largest {ratios.max():.3f}, {np.sum(ratios <= 1.2)}/{ratios.size} within",
        bool(np.all(ratios <= 1.2)),
        explained,
    )


def _parts(cases: Counter[str]) -> str:
    return ", ".join(f"{n} {part}" for part, n in cases.items())


def write(outcomes: list[Outcome], folder: Path) -> Path:
    """Write study.md and the confusion matrix into a folder, from whatever outcomes there are."""
    groups: dict[str, list[Outcome]] = {}
    for outcome in outcomes:
        groups.setdefault(outcome["spec"]["part"], []).append(outcome)
    folder.mkdir(parents=True, exist_ok=True)
    states: dict[str, Counter[str]] = {}
    for outcome in outcomes:
        states.setdefault(outcome["source"], Counter())[outcome["spec"]["part"]] += 1
    times = [o["wall_s"] for part in ("null", "single", "pairs") for o in groups.get(part, []) if "wall_s" in o]
    n_errors = sum(o["status"] == "error" for o in outcomes)
    lines = [
        "# Hidden effects: what the diagnosis finds",
        "",
        f"Made by `make study` (test/hidden/study.py) from {len(outcomes)} cases; {n_errors} broke off.",
        "The truth that hides the effects shares no code and no form with the product (test/hidden/).",
        f"State of the product's source: {'; '.join(f'{s} ({_parts(c)})' for s, c in states.items())}.",
        "",
        *bars(groups),
    ]
    if times:
        lines += [
            "",
            f"One diagnosis in one process, while another runs beside it: median {np.median(times):.0f} s, "
            f"longest {np.max(times):.0f} s.",
        ]
    classified = groups.get("null", []) + groups.get("single", [])
    if classified:
        write_confusion(classified, folder)
        lines += ["", "![Confusion matrix](confusion_matrix.png)"]
    lines += details(groups)
    page = folder / "study.md"
    page.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return page
