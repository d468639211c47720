"""What a process with a piece of work says, and does; it waits for the imports of the work, not for those of ROS."""

from __future__ import annotations

import contextlib
import signal
from collections.abc import Callable
from dataclasses import dataclass
from multiprocessing.connection import Connection
from typing import Any

from fomrc_core.errors import FomrcError

Work = Callable[[Any, Callable[[float, str], None]], Any]


@dataclass(frozen=True)
class Progress:
    """How far the work is: fraction done [1] and what is being done."""

    fraction: float
    message: str


@dataclass(frozen=True)
class Outcome:
    """How the work ended: its result, or the reason there is none."""

    result: Any = None
    reason: str = ""


def do(sender: Connection, work: Work, request: Any) -> None:
    """Do the work and tell how it goes and ends; the whole of a process.

    Args:
        sender: hears of Progress, and at last an Outcome.
        work: what to do.
        request: its argument.
    """
    # Ctrl-C goes to the whole terminal; the node decides what becomes of this process.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, signal.SIG_DFL)

    def tell(fraction: float, message: str) -> None:
        sender.send(Progress(float(fraction), str(message)[:200]))

    try:
        outcome = Outcome(result=work(request, tell))
    except FomrcError as error:
        outcome = Outcome(reason=str(error))
    except MemoryError:
        outcome = Outcome(reason="not enough memory")
    except BrokenPipeError:
        return  # whoever asked is gone
    except Exception as error:
        outcome = Outcome(reason=" ".join(f"{type(error).__name__}: {error}".split())[:300])
    with contextlib.suppress(OSError):
        sender.send(outcome)
        sender.close()
