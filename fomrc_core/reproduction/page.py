"""The reproduction as one self-contained HTML page."""

from __future__ import annotations

import base64
import html
import math
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from fomrc_core.reproduction.claims import Claim
    from fomrc_core.reproduction.result import Reproduction

_STYLE = """
body{font:15px/1.5 system-ui,sans-serif;max-width:62rem;margin:2rem auto;padding:0 1rem;color:#222}
table{border-collapse:collapse;width:100%;font-size:13px}td,th{padding:.25rem .6rem;border-bottom:1px solid
#ddd} td.n{text-align:right;font-variant-numeric:tabular-nums}th{text-align:left;vertical-align:bottom}
.paper{background:#f4f1ea}.ours{background:#eaf3f6}.yes{color:#1b7f4d}.no{color:#b3261e;font-weight:700}
img{width:100%;margin:.5rem 0 1.5rem}p.note{background:#f6f6f6;padding:.6rem .9rem;border-left:4px solid
#1f6f8b}
"""
_INTRODUCTION = """
<p class="note"><b>What is behind the numbers.</b> The paper's numbers were measured on its stage, a PI
P-753.1CD on an E-625, and are quoted from its text: its recordings are not available. Ours come from a
simulated plant that is not the fitted model: the electromechanical model of Goldfarb and Celanovic with 40
resistocaptances, each with its own memory and an order that differs by up to 5&nbsp;%, amplifier
(250&nbsp;Hz), resonance (2&nbsp;kHz, damping 0.3), 16-bit D/A, 18-bit A/D and 1&nbsp;nm of sensor noise,
integrated in time. Excitations are the paper's. Every curve below is from that simulated plant. What the
paper leaves open: NRMSE is taken of the measured range, for steps of the displacement at 60&nbsp;s as in
its Table 2; nonlinearity is the largest deviation from the best straight line, of the largest displacement;
triangles slower than 1&nbsp;V/s are sampled in proportion to their slope.</p> <p>FOMRC has ten elements,
identified on the staircase as in the paper's (34), but by the convex route; for figures 15 and 16 on
staircase and 1&nbsp;V/s triangle together. Amplifier and resonance were fitted on a multisine sampled at
10&nbsp;kHz. Beside that stands what <code>fomrc diagnose</code> named when given fast recordings and not told what to
look for. Tables and figures are held-out recordings.</p>
"""


def page(reproduction: Reproduction, directory: Path) -> str:
    """Return the page; the figures are read from ``directory`` and embedded."""
    met = [claim.is_met for claim in reproduction.claims if claim.is_met is not None]
    parts = [
        "<!doctype html><html lang='en'><meta charset='utf-8'><title>FOMRC paper, reproduced</title>",
        f"<style>{_STYLE}</style><h1>The FOMRC paper, reproduced</h1>",
        "<p>Liu, Shan, Gabbert and Qi: Smart Materials and Structures 22 (2013) 115020. ",
        f"{sum(met)} of {len(met)} bars met; made in {reproduction.duration_s:.0f} s.</p>",
        _INTRODUCTION,
        "<h2>Numbers</h2><table><tr><th>where<th>what<th class='paper'>paper<br><small>measured stage</small>"
        "<th class='ours'>here<br><small>simulated plant</small><th>bar<th>met</tr>",
        *(_row(claim) for claim in reproduction.claims),
        "</table><h2>Figures</h2>",
    ]
    for name in reproduction.figure_names:
        data = base64.b64encode((directory / f"{name}.png").read_bytes()).decode("ascii")
        title = name.replace("_", " ")
        parts.append(f"<img alt='{title}' src='data:image/png;base64,{data}'>")
    parts.append("</html>")
    return "\n".join(parts)


def _row(claim: Claim) -> str:
    met = {None: "", True: "<span class='yes'>yes</span>", False: "<span class='no'>no</span>"}[claim.is_met]
    return (
        f"<tr><td>{html.escape(claim.where)}<td>{html.escape(claim.what)} [{html.escape(claim.unit)}]"
        f"<td class='n paper'>{_number(claim.paper)}<td class='n ours'>{_number(claim.value)}"
        f"<td class='n'>{_number(claim.bar)}<td>{met}</tr>"
    )


def _number(value: float) -> str:
    return "" if math.isnan(value) else f"{value:.3g}"
