"""What is installed: the commands exist, both package descriptions agree, CI can start."""

from __future__ import annotations

import ast
import os
import re
import runpy
import xml.etree.ElementTree as ElementTree
from pathlib import Path
from typing import Any

import pytest
import setuptools

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


@pytest.fixture
def told(monkeypatch: pytest.MonkeyPatch) -> dict[str, Any]:
    """What setup.py tells setuptools."""
    arguments: dict[str, Any] = {}
    monkeypatch.setattr(setuptools, "setup", lambda **given: arguments.update(given))
    monkeypatch.chdir(_ROOT)
    runpy.run_path(str(_ROOT / "setup.py"))
    return arguments


def _rosdep_key(requirement: str) -> str:
    """Key of a requirement such as ``numpy>=1.23``; the wheels of ROS packages are called ros-NAME."""
    name = re.split(r"[\[<>=!~; ]", requirement)[0]
    if name.startswith("ros-"):
        return name.removeprefix("ros-").replace("-", "_")
    # Debian has no Bokeh: its key is that of the package index
    special = {"PyYAML": "python3-yaml", "bokeh": "python3-bokeh-pip"}
    return special.get(name, f"python3-{name}")


def test_both_descriptions_of_the_package_agree(told: dict[str, Any]) -> None:
    assert _PACKAGE.get("format") == "3"
    for field in ("name", "version", "license"):
        assert told[field] == _PACKAGE.findtext(field)
    maintainer = _PACKAGE.find("maintainer")
    assert maintainer is not None
    assert (told["maintainer"], told["maintainer_email"]) == (maintainer.text, maintainer.get("email"))
    assert (_ROOT / "resource" / str(_PACKAGE.findtext("name"))).is_file()
    assert _PACKAGE.findtext("export/build_type") == "ament_python"


def test_both_descriptions_ask_for_the_same_packages(told: dict[str, Any]) -> None:
    wanted = {_rosdep_key(requirement) for requirement in told["install_requires"] + told["extras_require"]["ros"]}
    declared = {str(element.text) for element in _PACKAGE.iter("exec_depend")}
    # Launch files run where ROS is installed, from its own packages: there are no wheels to ask for.
    assert declared - wanted == {"launch", "launch_ros", "ros2launch"}
    assert wanted - declared == set()
    tests = {_rosdep_key(requirement) for requirement in told["extras_require"]["test"]}
    assert {str(element.text) for element in _PACKAGE.iter("test_depend")} <= tests


def test_numba_is_part_of_the_base_and_its_old_extra_still_installs(told: dict[str, Any]) -> None:
    assert [requirement for requirement in told["install_requires"] if requirement.startswith("numba")]
    assert told["extras_require"]["fast"] == []


def test_types_are_installed_with_the_library(told: dict[str, Any]) -> None:
    assert "py.typed" in told["package_data"]["fomrc_core"]
    assert (_ROOT / "fomrc_core" / "py.typed").is_file()


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
