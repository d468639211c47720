"""What is installed: the commands exist, both package descriptions agree, CI can start."""

from __future__ import annotations

import ast
import os
import re
import xml.etree.ElementTree as ElementTree
from pathlib import Path

_ROOT = Path(__file__).resolve().parents[1]
_SETUP = (_ROOT / "setup.py").read_text()
_PACKAGE = ElementTree.parse(_ROOT / "package.xml").getroot()


def _commands() -> dict[str, tuple[str, str]]:
    """Module and function of each command."""
    return {name: (module, function) for name, module, function in re.findall(r'"(\w+) = ([\w.]+):(\w+)"', _SETUP)}


def _defined(module: str) -> set[str]:
    path = _ROOT.joinpath(*module.split("."))
    source = path / "__init__.py" if path.is_dir() else path.with_suffix(".py")
    names: set[str] = set()
    for node in ast.parse(source.read_text()).body:
        if isinstance(node, ast.FunctionDef):
            names.add(node.name)
        elif isinstance(node, ast.ImportFrom):
            names.update(alias.asname or alias.name for alias in node.names)
    return names


def test_every_command_exists() -> None:
    commands = _commands()
    assert {"fomrc", "compensator", "simulated_pea", "identification"} <= set(commands)
    missing = {name: target for name, target in commands.items() if target[1] not in _defined(target[0])}
    assert missing == {}


def test_what_launch_files_start_is_installed() -> None:
    started = {
        name
        for path in (_ROOT / "launch").glob("*.launch.py")
        for name in re.findall(r'executable="(\w+)"', path.read_text())
    }
    assert started
    assert started <= set(_commands())


def test_both_descriptions_of_the_package_agree() -> None:
    assert _PACKAGE.get("format") == "3"
    assert f'package_name = "{_PACKAGE.findtext("name")}"' in _SETUP
    assert f'version="{_PACKAGE.findtext("version")}"' in _SETUP
    assert f'license="{_PACKAGE.findtext("license")}"' in _SETUP
    assert (_ROOT / "resource" / str(_PACKAGE.findtext("name"))).is_file()
    assert _PACKAGE.findtext("export/build_type") == "ament_python"


def test_every_message_package_in_use_is_declared() -> None:
    declared = {element.text for element in _PACKAGE.iter("exec_depend")}
    used: set[str] = set()
    for path in (_ROOT / "fomrc_ros").rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text())):
            modules = [node.module or ""] if isinstance(node, ast.ImportFrom) else []
            modules += [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
            used.update(module.partition(".")[0] for module in modules)
    ros = {name for name in used if name == "rclpy" or name.endswith(("_msgs", "_srvs", "_interfaces"))}
    assert ros <= declared | {"builtin_interfaces"}


def test_ci_can_be_started() -> None:
    entry = _ROOT / ".ci" / "run"
    assert os.access(entry, os.X_OK)
    assert entry.read_text().startswith("#!/usr/bin/env bash\n")
