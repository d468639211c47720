"""``time=none,voltage=0``: one reading of it, for the command line and the nodes."""

from __future__ import annotations

import pytest

from fomrc_core.errors import ParameterError
from fomrc_core.storage.told_columns import column_numbers, named_once


def test_columns_are_taken_apart() -> None:
    assert column_numbers("time=none, voltage=0,displacement=4", "--columns") == {
        "time": None,
        "voltage": 0,
        "displacement": 4,
    }
    assert named_once("voltage=/a/b", "--topics") == {"voltage": "/a/b"}


@pytest.mark.parametrize(
    "text", ["", "voltage=", "=3", "voltage", "voltage=1,voltage=2", "voltage=-1", "voltage=\u00b2"]
)
def test_what_is_not_understood_is_told_with_the_option(text: str) -> None:
    with pytest.raises(ParameterError, match="--columns"):
        column_numbers(text, "--columns")
