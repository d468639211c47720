"""Which column or topic is what, as a user writes it in one line: ``time=none,voltage=0,displacement=4``."""

from __future__ import annotations

from fomrc_core.errors import ParameterError


def column_numbers(text: str, where: str) -> dict[str, int | None]:
    """Return column numbers by quantity from e.g. ``time=none,voltage=0``; None for a quantity that has no column.

    Args:
        text: what was written.
        where: the option or parameter, for messages.

    Raises:
        ParameterError: an entry that is not ``quantity=number`` or ``quantity=none``, or a quantity named twice.
    """
    numbers: dict[str, int | None] = {}
    for quantity, column in named_once(text, where).items():
        if column.lower() == "none":
            numbers[quantity] = None
        elif column.isascii() and column.isdigit():
            numbers[quantity] = int(column)
        else:
            raise ParameterError(
                "not a column number", where=f"{where} {quantity}", value=column, allowed="0, 1, 2, ... or none"
            )
    return numbers


def named_once(text: str, where: str) -> dict[str, str]:
    """Return what is said of each quantity, e.g. its topic, from ``voltage=/a/voltage,displacement=/a/displacement``.

    Args:
        text: what was written.
        where: the option or parameter, for messages.

    Raises:
        ParameterError: an entry that is not ``quantity=...``, or a quantity named twice.
    """
    found: dict[str, str] = {}
    for part in text.split(","):
        name, equals, value = (piece.strip() for piece in part.partition("="))
        if not (name and equals and value) or name in found:
            raise ParameterError("not understood", where=where, value=text, allowed="quantity=value,... each once")
        found[name] = value
    return found
