"""Log what goes wrong in a lifecycle callback: the client library swallows it."""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import Any

from rclpy.lifecycle import LifecycleState, TransitionCallbackReturn

from fomrc_core.errors import FomrcError

Transition = Callable[[Any, LifecycleState], TransitionCallbackReturn]


def logged(transition: Transition) -> Transition:
    """Return the callback with its errors logged and kept in the node's ``problem``."""

    @functools.wraps(transition)
    def guarded(self: Any, state: LifecycleState) -> TransitionCallbackReturn:
        try:
            return transition(self, state)
        except FomrcError as error:
            self.problem = str(error)
            self.get_logger().error(f"{transition.__name__}: {error}")
            return TransitionCallbackReturn.FAILURE
        except Exception as error:
            self.problem = f"{type(error).__name__}: {error}"
            self.get_logger().error(f"{transition.__name__}: {self.problem}")
            return TransitionCallbackReturn.ERROR

    return guarded
