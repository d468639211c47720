"""What every test run needs: tests that talk over ROS run last, one after the other, in a domain of their own."""

from __future__ import annotations

import os
import random
from typing import Any

import pytest

_ROS_TESTS = "test/ros/"

# Set before any ROS context exists. Not overridden where the caller has chosen a domain.
os.environ.setdefault("ROS_DOMAIN_ID", str(random.randint(1, 100)))
os.environ.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Put the ROS tests last: several processes at 1 kHz want the processors to themselves."""
    items.sort(key=lambda item: item.nodeid.startswith(_ROS_TESTS))


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config: pytest.Config, log: Any) -> Any:
    """Spread tests over the workers one by one, but give all ROS tests to one.

    Nodes of tests that run at the same time would hear each other, and compete for time.
    """
    from xdist.scheduler import LoadScopeScheduling

    class RosTogether(LoadScopeScheduling):
        def _split_scope(self, nodeid: str) -> str:
            return _ROS_TESTS if nodeid.startswith(_ROS_TESTS) else nodeid

    # The scheduler would begin with the largest group, which is that of the ROS tests.
    config.option.loadscopereorder = False
    return RosTogether(config, log)
