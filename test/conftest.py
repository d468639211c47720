"""What every test run needs: tests that talk over ROS stay in one worker, in a domain of their own."""

from __future__ import annotations

import os
import random
from pathlib import Path

import pytest

_ROS_TESTS = Path(__file__).parent / "ros"

# Set before any ROS context exists. Not overridden where the caller has chosen a domain.
os.environ.setdefault("ROS_DOMAIN_ID", str(random.randint(1, 100)))
os.environ.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Keep the ROS tests in one worker: timing over DDS suffers when they compete with each other."""
    for item in items:
        if _ROS_TESTS in item.path.parents:
            item.add_marker(pytest.mark.xdist_group("ros"))
