"""Rows of numbers that fill a processor's vector registers: what is left over costs as much as as many more."""

from __future__ import annotations

from fomrc_core.compute.compiled import compiled

_REGISTER = 8  # numbers of the widest one


@compiled
def in_whole_registers(n: int) -> int:
    """Return how many numbers fill the registers that so many begin."""
    return (n + _REGISTER - 1) // _REGISTER * _REGISTER
