"""The launch files: readable everywhere, and describable where the launch system is installed."""

from __future__ import annotations

import ast
import os
import re
import runpy
import signal
import subprocess
import sys

import pytest
from node_server import REPOSITORY, die_with_the_parent
from node_under_test import PATIENCE_S

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


@pytest.fixture
def installed(tmp_path) -> dict[str, str]:
    """An environment in which the launch system finds the package as if a workspace had installed it."""
    prefix = tmp_path / "prefix"
    index, share = prefix / "share" / "ament_index" / "resource_index" / "packages", prefix / "share" / "fomrc_ros"
    executables = prefix / "lib" / "fomrc_ros"
    for folder in (index, share, executables):
        folder.mkdir(parents=True)
    (index / "fomrc_ros").touch()
    (share / "config").symlink_to(REPOSITORY / "config")
    for name, module, function in re.findall(
        r'"(\w+) = (fomrc_ros[\w.]+):(\w+)"', (REPOSITORY / "setup.py").read_text()
    ):
        path = executables / name
        path.write_text(f"#!{sys.executable}\nimport sys\nfrom {module} import {function}\nsys.exit({function}())\n")
        path.chmod(0o755)
    prefixes = [str(prefix), *filter(None, [os.environ.get("AMENT_PREFIX_PATH")])]
    paths = [str(REPOSITORY), *filter(None, [os.environ.get("PYTHONPATH")])]
    joined = {"AMENT_PREFIX_PATH": prefixes, "PYTHONPATH": paths}
    return dict(os.environ, **{name: os.pathsep.join(entries) for name, entries in joined.items()})


LAUNCH = """
import runpy, sys
from launch import LaunchService
service = LaunchService()
service.include_launch_description(runpy.run_path(sys.argv[1])["generate_launch_description"]())
sys.exit(service.run())
"""


@pytest.mark.parametrize(("name", "axis"), [("stage.launch.py", ""), ("tunable_filter.launch.py", "/axis1")])
def test_they_start_run_and_end_at_the_safe_voltage(tmp_path, probe, installed, name, axis):
    pytest.importorskip("launch_ros", reason="the launch system is not installed")
    file = REPOSITORY / "launch" / name
    command = [sys.executable, "-c", LAUNCH, str(file)]
    launched = subprocess.Popen(command, cwd=tmp_path, env=installed, preexec_fn=die_with_the_parent)
    try:
        heard = probe.record(f"{axis}/voltage" if axis else "voltage")
        publisher = probe.publisher(f"{axis}/desired_position" if axis else "desired_position")
        probe.until(lambda: probe.messages.get(f"{axis}/compensator"), "the compensator running")
        probe.drive(publisher, lambda t: 1e-6, 1.0)
        probe.until(lambda: heard and abs(heard[-1][1].data) > 0.1, "a voltage that is not the safe one")
        launched.send_signal(signal.SIGINT)
        assert launched.wait(PATIENCE_S) == 0
        probe.take()
        assert heard[-1][1].data == 0.0
    finally:
        launched.kill()
        launched.wait()
