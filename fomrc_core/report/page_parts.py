"""What every page is made of: head, tables that scroll, pictures with words instead, where it comes from."""

from __future__ import annotations

import base64
import html
import re
from collections.abc import Iterable, Iterator, Sequence
from functools import cache
from importlib.resources import files

from fomrc_core.report.provenance import Provenance

_UM = re.compile(r"(?<![\w.])um(?![\w.])")


def document(title: str, body: Iterable[str]) -> str:
    """Return a whole page: one file that loads nothing."""
    return (
        "<!doctype html>\n<html lang='en'><head><meta charset='utf-8'>"
        "<meta name='viewport' content='width=device-width,initial-scale=1'>"
        "<meta name='color-scheme' content='light dark'>"
        f"<title>{html.escape(title)}</title><style>{_style()}</style></head><body><main>\n"
        + "\n".join(body)
        + "\n</main></body></html>\n"
    )


def prose(text: str) -> str:
    """Return text of the library for the page: µm in one spelling, what stands between backticks as code."""
    parts = html.escape(text).split("`")
    return "".join(f"<code>{part}</code>" if k % 2 else _UM.sub("µm", part) for k, part in enumerate(parts))


def table(caption: str, head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Return a table that scrolls where it is wider than the page.

    Args:
        caption: what it holds.
        head: names of the columns.
        rows: cells as HTML.
    """
    titles = "".join(f"<th scope='col'>{html.escape(name)}</th>" for name in head)
    lines = "".join("<tr>" + "".join(f"<td>{cell}</td>" for cell in row) + "</tr>" for row in rows)
    name = html.escape(caption, quote=True)
    return (
        f"<div class='scroll' role='region' tabindex='0' aria-label='{name}'><table><caption>{html.escape(caption)}"
        f"</caption><thead><tr>{titles}</tr></thead><tbody>{lines}</tbody></table></div>"
    )


def image(content: bytes, description: str) -> str:
    """Return a picture, with words for who does not see it."""
    data = base64.b64encode(content).decode("ascii")
    alternative = html.escape(description, quote=True)
    return (
        f"<figure><img alt='{alternative}' src='data:image/png;base64,{data}'>"
        f"<figcaption>{html.escape(description)}</figcaption></figure>"
    )


def provenance_section(provenance: Provenance | None) -> Iterator[str]:
    """Yield where the page comes from, and the command that makes it again."""
    if provenance is None:
        return
    yield "<h2>Where this comes from</h2>"
    if provenance.command:
        yield (
            "<p>Made again, in the same folder, by</p>"
            f"<pre><code id='command'>{html.escape(provenance.command)}</code></pre>"
            "<p class='screen'><button type='button' id='copy'>Copy the command</button> "
            "<span id='copied' role='status'></span></p>"
            "<script>document.getElementById('copy').addEventListener('click',async()=>{"
            "const text=document.getElementById('command'),said=document.getElementById('copied');"
            "try{await navigator.clipboard.writeText(text.textContent);said.textContent='copied'}"
            "catch{getSelection().selectAllChildren(text);said.textContent='selected: copy it with Ctrl-C'}})</script>"
        )
    versions = ", ".join(f"{html.escape(name)} {html.escape(text)}" for name, text in provenance.versions.items())
    yield f"<p>Made on {html.escape(provenance.made_at)} with {versions}.</p>"
    if provenance.files:
        rows = (
            (
                html.escape(file.role),
                f"<code>{html.escape(file.path)}</code>",
                str(file.n_bytes),
                f"<code>{file.sha256 or 'none: no file'}</code>",
            )
            for file in provenance.files
        )
        yield table("Files and their checksums", ("what", "file", "bytes", "SHA-256"), rows)


@cache
def _style() -> str:
    return files("fomrc_core.report").joinpath("templates/page.css").read_text("utf-8")
