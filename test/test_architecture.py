"""The shape of the project, kept by parsing its source: imports point one way, the core knows no ROS."""

from __future__ import annotations

import ast
import functools
import re
from pathlib import Path

import pytest

_ROOT = Path(__file__).resolve().parents[1]
_PACKAGES = ("fomrc_core", "fomrc_ros")

# Lowest first; see docs/decisions/storage-above-model.md. Modules that are not named here find their place
# by what they import: through them, too, no lower layer may reach a higher one.
_LAYERS: tuple[tuple[str, ...], ...] = (
    ("fomrc_core.errors",),
    ("fomrc_core.records.recording",),
    ("fomrc_core.operators.hysteresis", "fomrc_core.operators.creep", "fomrc_core.effects"),
    ("fomrc_core.model.piezo_model",),
    ("fomrc_core.storage",),
    ("fomrc_core.records.residual",),
    ("fomrc_core.identification.convex", "fomrc_core.model.compensator"),
    ("fomrc_core.diagnosis.diagnosis",),
    ("fomrc_core.report.diagnosis_files",),
    ("fomrc_core.cli",),
    ("fomrc_ros",),
)
_ROS = re.compile(
    r"(rclpy|rcl_interfaces|ament\w*|launch\w*|ros2\w*|rosidl\w*|\w+_msgs|std_srvs|builtin_interfaces|fomrc_ros)(\.|$)"
)
_N_LINES_MAX = 400


def _sources(package: str) -> list[Path]:
    return sorted(path for path in (_ROOT / package).rglob("*.py") if "__pycache__" not in path.parts)


def _module_name(path: Path) -> str:
    parts = path.relative_to(_ROOT).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


@functools.cache
def _modules() -> dict[str, Path]:
    return {_module_name(path): path for package in _PACKAGES for path in _sources(package)}


class _RunTimeOnly(ast.NodeTransformer):
    def visit_If(self, node: ast.If) -> ast.AST | None:
        return None if ast.unparse(node.test) == "TYPE_CHECKING" else self.generic_visit(node)


def _imported(name: str, path: Path, *, with_types: bool = True) -> set[str]:
    """Every module a file imports, inside functions too, by full name."""
    package = name if path.name == "__init__.py" else name.rpartition(".")[0]
    found: set[str] = set()
    tree = ast.parse(path.read_text())
    for node in ast.walk(tree if with_types else _RunTimeOnly().visit(tree)):
        if isinstance(node, ast.Import):
            found.update(alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            base = node.module or ""
            if node.level:
                parents = package.split(".")[: len(package.split(".")) - node.level + 1]
                base = ".".join([*parents, base] if base else parents)
            for alias in node.names:
                submodule = f"{base}.{alias.name}"
                found.add(submodule if submodule in _modules() else base)
    return found


@functools.cache
def _graph(*, with_types: bool = True) -> dict[str, frozenset[str]]:
    """Modules of the project each module imports."""
    graph = {}
    for name, path in _modules().items():
        imported = _imported(name, path, with_types=with_types)
        graph[name] = frozenset(target for target in imported if target in _modules() and target != name)
    return graph


def _way(start: str, is_goal: set[str], *, with_types: bool = True) -> list[str]:
    """Shortest chain of imports from a module to a goal, empty where there is none."""
    ways, seen = [[start]], {start}
    for way in ways:
        for target in sorted(_graph(with_types=with_types)[way[-1]]):
            if target in is_goal:
                return [*way, target]
            if target not in seen:
                seen.add(target)
                ways.append([*way, target])
    return []


def _in_layer(layer: tuple[str, ...]) -> set[str]:
    return {name for name in _modules() for member in layer if name == member or name.startswith(member + ".")}


def test_every_layer_exists() -> None:
    missing = [member for layer in _LAYERS for member in layer if member not in _modules()]
    assert missing == []


@pytest.mark.parametrize("k", range(len(_LAYERS)), ids=lambda k: _LAYERS[k][0])
def test_no_layer_reaches_a_higher_one(k: int) -> None:
    higher = set().union(*(_in_layer(layer) for layer in _LAYERS[k + 1 :]))
    ways = [" > ".join(way) for start in sorted(_in_layer(_LAYERS[k])) if (way := _way(start, higher))]
    assert ways == []


def test_no_module_reaches_itself() -> None:
    # Two files of one layer may name each other's types, as long as neither needs the other to run.
    ways = (_way(name, {name}, with_types=False) for name in _modules())
    circles = {" > ".join(way) for way in ways if way}
    assert circles == set()


def test_the_core_imports_no_ros() -> None:
    bad = {
        name: sorted(module for module in _imported(name, path) if _ROS.match(module))
        for name, path in _modules().items()
        if name.startswith("fomrc_core")
    }
    assert {name: modules for name, modules in bad.items() if modules} == {}


def test_files_hold_one_concept_each() -> None:
    folders = (*_PACKAGES, "test", "benchmarks", "launch")
    sources = [path for folder in folders for path in _sources(folder)] + [_ROOT / "setup.py"]
    n_lines = {str(path.relative_to(_ROOT)): len(path.read_text().splitlines()) for path in sources}
    assert {name: n for name, n in n_lines.items() if n > _N_LINES_MAX} == {}
    vague = {"utils.py", "util.py", "helpers.py", "misc.py", "common.py"}
    assert [name for name in n_lines if Path(name).name in vague] == []


def test_the_check_sees_imports_of_every_form() -> None:
    source = _modules()["fomrc_core.storage.model_files"]
    assert {"fomrc_core.model.piezo_model", "fomrc_core.errors", "yaml"} <= _imported(
        "fomrc_core.storage.model_files", source
    )
    assert _way("fomrc_core.storage", {"fomrc_core.errors"})
    assert not _way("fomrc_core.errors", {"fomrc_core.storage"})
