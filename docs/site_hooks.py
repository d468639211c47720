"""Hooks of the site (mkdocs): its navigation is that of docs/README.md, and pages outside of docs/ are in it too."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

from mkdocs.structure.files import File, Files

_ROOT = Path(__file__).resolve().parents[1]
# Pages at the top of the repository that pages of docs/ lead to.
_OUTSIDE = ("QUALITY_DECLARATION.md",)
_LINK = re.compile(r"\[([^\]]+)\]\(([^)#]+\.(?:md|py))\)")


def on_config(config: Any) -> Any:
    """Take the navigation from the index: its parts, and in each the pages it leads to, in order."""
    index = (_ROOT / "docs" / "README.md").read_text(encoding="utf-8")
    parts: list[dict[str, Any]] = [{"Home": "README.md"}]
    seen: set[str] = set()
    for section in re.split(r"^## ", index, flags=re.MULTILINE)[1:]:
        title = section.partition("\n")[0].partition(":")[0]
        pages = []
        for words, target in _LINK.findall(section):
            page = target.removeprefix("../")
            if page not in seen:
                seen.add(page)
                pages.append({" ".join(words.split()).capitalize(): page})
        parts.append({title: pages})
    config.nav = parts
    return config


def on_files(files: Files, config: Any) -> Files:
    """Add the pages outside of docs/."""
    for name in _OUTSIDE:
        text = (_ROOT / name).read_text(encoding="utf-8")
        files.append(File.generated(config, name, content=re.sub(r"\]\(docs/", "](", text)))
    return files


def on_page_markdown(markdown: str, page: Any, **_: Any) -> str:
    """Let links that leave docs/ lead to where the site has those pages."""
    for name in _OUTSIDE:
        up = "../" * (page.file.src_uri.count("/") + 1)
        markdown = markdown.replace(f"]({up}{name})", f"]({up.removeprefix('../')}{name})")
    return markdown
