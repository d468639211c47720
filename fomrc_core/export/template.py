"""Templates in which ``piezo`` stands for the model's name and lines that begin with ``@`` choose and insert.

    @if NAME        the lines up to the @end that belongs to it, where the condition holds; "not NAME" for the opposite
    @insert NAME    a block of lines in its place, indented as the mark is

A template of C is so close to C that an editor takes it for such, and nothing in it needs to be escaped.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Mapping
from importlib import resources

_NAME = re.compile(r"(?<![A-Za-z0-9])(piezo|PIEZO|Piezo)(?=[_. ]|$)", re.MULTILINE)


def read_template(file_name: str) -> str:
    """Return the text of a template of this package."""
    return (resources.files("fomrc_core.export") / "templates" / file_name).read_text(encoding="utf-8")


def render(template: str, name: str, conditions: Collection[str], blocks: Mapping[str, str]) -> str:
    """Return the text a template makes of a model.

    Args:
        template: text with marks.
        name: what stands in the place of ``piezo``, lower case; ``PIEZO`` becomes its upper case.
        conditions: names that hold; any other does not.
        blocks: what is inserted, by name.

    Raises:
        KeyError: a block that is not given.
        ValueError: an ``@if`` without ``@end`` or the other way round.
    """
    # The name first: what is inserted carries its own.
    text = _NAME.sub(lambda match: name.upper() if match[1].isupper() else name, template)
    lines: list[str] = []
    holds = [True]
    for line in text.splitlines():
        mark, _, argument = line.strip().partition(" ")
        if mark == "@if":
            negated, _, condition = argument.rpartition(" ")
            holds.append(holds[-1] and (condition in conditions) is not (negated == "not"))
        elif mark == "@end":
            holds.pop()
            if not holds:
                raise ValueError("@end without @if")
        elif not holds[-1]:
            continue
        elif mark == "@insert":
            indent = line[: len(line) - len(line.lstrip())]
            lines += [indent + inner if inner else "" for inner in blocks[argument].splitlines()]
        else:
            lines.append(line)
    if len(holds) != 1:
        raise ValueError("@if without @end")
    return "\n".join(lines) + "\n"
