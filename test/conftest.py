"""What every test run needs: tests that talk over ROS stay in one worker, in a domain of their own."""

from __future__ import annotations

import os
import random
from typing import Any

import pytest

_ROS_TESTS = "test/ros/"

# Set before any ROS context exists. Not overridden where the caller has chosen a domain.
os.environ.setdefault("ROS_DOMAIN_ID", str(random.randint(1, 100)))
os.environ.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config: pytest.Config, log: Any) -> Any:
    """Spread tests over the workers one by one, but give all ROS tests to one.

    Nodes of tests that run at the same time would hear each other, and compete for time.
    """
    from xdist.scheduler import LoadScopeScheduling

    class RosTogether(LoadScopeScheduling):
        def _split_scope(self, nodeid: str) -> str:
            return _ROS_TESTS if nodeid.startswith(_ROS_TESTS) else nodeid

    return RosTogether(config, log)
