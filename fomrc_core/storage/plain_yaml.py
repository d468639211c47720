"""YAML as parameter files use it: no tags, references or repeated keys; numbers as ROS reads them."""

from __future__ import annotations

import re
from collections.abc import Hashable
from typing import Any

import yaml
from yaml.composer import ComposerError
from yaml.constructor import ConstructorError

from fomrc_core.errors import StorageError

_ALLOWED = "mappings, lists, numbers and text"


class _PlainLoader(yaml.SafeLoader):
    """Safe YAML that refuses references and repeated keys, and reads 1e-3 as the number it is."""

    def compose_node(self, parent: Any, index: Any) -> Any:
        if self.check_event(yaml.AliasEvent):
            # References to references grow without bound in a file of a few bytes.
            event = self.peek_event()  # type: ignore[no-untyped-call]
            raise ComposerError(None, None, "references (*) are not allowed", event.start_mark)
        return super().compose_node(parent, index)

    def construct_mapping(self, node: Any, deep: bool = False) -> dict[Hashable, Any]:
        seen = set()
        for key_node, _ in node.value:
            key = self.construct_object(key_node, deep=True)
            if not isinstance(key, Hashable):
                raise ConstructorError(None, None, "key is not a name", key_node.start_mark)
            if key in seen:
                raise ConstructorError(None, None, f"key {key!r} stands twice", key_node.start_mark)
            seen.add(key)
        return super().construct_mapping(node, deep)


# YAML 1.1 as PyYAML reads it takes 1e-3 for text, where the ROS parser takes it for a number.
_PlainLoader.add_implicit_resolver(
    "tag:yaml.org,2002:float", re.compile(r"^[-+]?(\d+\.?\d*|\.\d+)[eE][-+]?\d+$"), list("-+.0123456789")
)


def load_yaml(text: str, where: str) -> Any:
    """Read one YAML document.

    Args:
        text: the document, its size bounded by the caller.
        where: file it came from, for messages.

    Raises:
        StorageError: with the line, for anything but one document of plain YAML.
    """
    try:
        loader = _PlainLoader(text)
        try:
            return loader.get_single_data()
        finally:
            loader.dispose()
    except yaml.MarkedYAMLError as error:
        line = f", line {error.problem_mark.line + 1}" if error.problem_mark else ""
        raise StorageError(f"not plain YAML ({error.problem})", where=where + line, allowed=_ALLOWED) from None
    except (yaml.YAMLError, ValueError) as error:
        # ValueError: a date that is none, e.g. 2024-13-45.
        reason = str(error).splitlines()[0]
        raise StorageError(f"not plain YAML ({reason})", where=where, allowed=_ALLOWED) from None
    except RecursionError:
        raise StorageError("YAML nested too deeply", where=where, allowed=_ALLOWED) from None
