"""Every exception the package raises on purpose, each saying what, where, which value and what is allowed."""

from __future__ import annotations

_LONGEST_VALUE = 80


def _shortened(shown: str) -> str:
    """Return the text with what is too much taken out of its middle: a path is told by its end."""
    if len(shown) <= _LONGEST_VALUE:
        return shown
    kept = _LONGEST_VALUE - 3
    return f"{shown[: kept // 2]}...{shown[len(shown) - (kept - kept // 2) :]}"


class FomrcError(Exception):
    """Base of every error raised on purpose by this package."""


class InputError(FomrcError, ValueError):
    """Bad input, told in one line: where, what, the value found and what is allowed.

    Args:
        what: what is wrong, e.g. ``"saturation voltage must be positive"``.
        where: file, line, field or argument at fault.
        value: the offending value; long values are shortened.
        allowed: what would have been accepted.
    """

    def __init__(self, what: str, *, where: str = "", value: object = None, allowed: str = "") -> None:
        self.what, self.where, self.value, self.allowed = what, where, value, allowed
        text = f"{where}: {what}" if where else what
        if value is not None:
            text += f", got {_shortened(' '.join(repr(value).split()))}"
        if allowed:
            text += f" (allowed: {allowed})"
        super().__init__(" ".join(text.split()))

    def __reduce__(self) -> tuple[object, ...]:
        # Keyword-only arguments are lost by the default pickling, and errors cross process boundaries.
        return _rebuild, (type(self), self.what, self.where, self.value, self.allowed)


def _rebuild(kind: type[InputError], what: str, where: str, value: object, allowed: str) -> InputError:
    return kind(what, where=where, value=value, allowed=allowed)


class RecordingError(InputError):
    """A recording that cannot be used."""


class ParameterError(InputError):
    """A model, effect or option value outside what is allowed."""


class StorageError(InputError):
    """A file that cannot be read or written as asked."""


class DataUnavailableError(FomrcError):
    """A measured example that is neither on this machine nor can be fetched."""
