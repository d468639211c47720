"""The launch files: readable everywhere, and describable where the launch system is installed."""

from __future__ import annotations

import ast
import runpy

import pytest
from harness import REPOSITORY

FILES = sorted((REPOSITORY / "launch").glob("*.launch.py"))


@pytest.mark.parametrize("file", FILES, ids=lambda file: file.name)
def test_executables_and_files_named_exist(file):
    tree = ast.parse(file.read_text())
    executables = {
        keyword.value.value
        for call in ast.walk(tree)
        if isinstance(call, ast.Call)
        for keyword in call.keywords
        if keyword.arg == "executable"
    }
    assert "compensator" in executables
    setup = (REPOSITORY / "setup.py").read_text()
    for executable in executables:
        assert f'"{executable} = fomrc_ros.' in setup
    texts = {str(node.value) for node in ast.walk(tree) if isinstance(node, ast.Constant)}
    for name in (text for text in texts if text.endswith(".yaml")):
        assert (REPOSITORY / "config" / name).exists()


@pytest.mark.parametrize("file", FILES, ids=lambda file: file.name)
def test_description_can_be_made(file):
    pytest.importorskip("launch_ros", reason="the launch system is not installed")
    packages = pytest.importorskip("ament_index_python.packages")
    try:
        packages.get_package_share_directory("fomrc_ros")
    except packages.PackageNotFoundError:
        pytest.skip("the package is not installed in a ROS workspace")
    assert runpy.run_path(str(file))["generate_launch_description"]().entities
