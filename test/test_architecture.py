"""The shape of the project, kept by parsing its source: every module has a room, and imports point one way.

Imports inside functions and under ``TYPE_CHECKING`` count like any other: what a file names, it depends on.
"""

from __future__ import annotations

import ast
import functools
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

_ROOT = Path(__file__).resolve().parents[1]
_PACKAGES = ("fomrc_core", "fomrc_ros")

# Rooms, lowest layer first; why storage stands above the model: docs/decisions/storage-above-model.md. A room may
# import from the layers below its own, never from its own layer or a higher one. "fomrc_core" is the public API.
_LAYERS: tuple[tuple[str, ...], ...] = (
    ("fomrc_core.errors", "fomrc_core.compute"),
    ("fomrc_core.records", "fomrc_core.operators"),
    ("fomrc_core.effects", "fomrc_core.plants"),
    ("fomrc_core.model",),
    ("fomrc_core.storage", "fomrc_core.fitting"),
    ("fomrc_core.identification", "fomrc_core.diagnosis", "fomrc_core.control"),
    ("fomrc_core.report", "fomrc_core.comparison", "fomrc_core.reproduction", "fomrc_core.export"),
    ("fomrc_core",),
    ("fomrc_core.cli",),
    ("fomrc_ros.conversions",),
    ("fomrc_ros.node",),
    ("fomrc_ros.parameters",),
    ("fomrc_ros.compensator", "fomrc_ros.gap", "fomrc_ros.identification", "fomrc_ros.simulated_stage"),
    ("fomrc_ros.demo", "fomrc_ros.watch"),
    ("fomrc_ros",),
)
_LAYER_OF_ROOM = {room: k for k, layer in enumerate(_LAYERS) for room in layer}
_N_ROOMS_MAX = 16
_ROS = re.compile(
    r"(rclpy|rcl_interfaces|ament\w*|launch\w*|ros2\w*|rosidl\w*|\w+_msgs|std_srvs|builtin_interfaces|fomrc_ros)(\.|$)"
)
_N_LINES_MAX = 400
_N_FUNCTION_LINES, _N_PARAMETERS = 60, 6


def _sources(folder: str) -> list[Path]:
    return sorted(path for path in (_ROOT / folder).rglob("*.py") if "__pycache__" not in path.parts)


def _module_name(path: Path) -> str:
    parts = path.relative_to(_ROOT).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


@functools.cache
def _modules() -> dict[str, Path]:
    return {_module_name(path): path for package in _PACKAGES for path in _sources(package)}


def _room(module: str) -> str:
    return ".".join(module.split(".")[:2])


def _is_package(module: str) -> bool:
    return module in _modules() and _modules()[module].name == "__init__.py"


@functools.cache
def _imports(name: str, path: Path) -> tuple[tuple[str, str], ...]:
    """Return module and name of every import of a file; the name is empty for ``import module``."""
    return tuple(_each_import(name, path))


def _each_import(name: str, path: Path) -> Iterator[tuple[str, str]]:
    package = name if path.name == "__init__.py" else name.rpartition(".")[0]
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            yield from ((alias.name, "") for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            base = node.module or ""
            if node.level:
                parents = package.split(".")[: len(package.split(".")) - node.level + 1]
                base = ".".join([*parents, base] if base else parents)
            yield from ((base, alias.name) for alias in node.names)


def _imported(name: str, path: Path) -> set[str]:
    """Every module a file imports, by full name."""
    found: set[str] = set()
    for base, imported in _imports(name, path):
        submodule = f"{base}.{imported}"
        found.add(submodule if submodule in _modules() else base)
    return found


@functools.cache
def _graph() -> dict[str, frozenset[str]]:
    """Modules of the project each module imports."""
    return {
        name: frozenset(target for target in _imported(name, path) if target in _modules() and target != name)
        for name, path in _modules().items()
    }


def _way(start: str, goal: str) -> list[str]:
    """Shortest chain of imports from a module to another (or back to itself), empty where there is none."""
    ways, seen = [[start]], set()
    for way in ways:
        for target in sorted(_graph()[way[-1]]):
            if target == goal:
                return [*way, target]
            if target not in seen:
                seen.add(target)
                ways.append([*way, target])
    return []


def test_every_module_has_a_room() -> None:
    rooms = {_room(module) for module in _modules()}
    assert rooms - set(_LAYER_OF_ROOM) == set(), "a new room: name it in _LAYERS, docs/ and README.md"
    assert set(_LAYER_OF_ROOM) - rooms == set(), "a room that is no more"


def test_the_core_is_rooms_and_not_a_floor_of_files() -> None:
    files = {path.name for path in (_ROOT / "fomrc_core").glob("*.py")}
    assert files == {"__init__.py", "errors.py"}
    folders = [p for p in (_ROOT / "fomrc_core").iterdir() if p.is_dir() and p.name != "__pycache__"]
    assert [p.name for p in folders if not (p / "__init__.py").is_file()] == []
    assert len(folders) <= _N_ROOMS_MAX


def test_the_tests_follow_the_rooms() -> None:
    folders = {path.name for path in (_ROOT / "test" / "core").iterdir() if path.is_dir() and path.name[0] not in "._"}
    assert {f"fomrc_core.{folder}" for folder in folders} <= set(_LAYER_OF_ROOM)


@pytest.mark.parametrize("room", _LAYER_OF_ROOM)
def test_a_room_imports_only_from_layers_below(room: str) -> None:
    bad = [
        f"{module} imports {target}"
        for module, targets in _graph().items()
        if _room(module) == room
        for target in sorted(targets)
        if _room(target) != room and _LAYER_OF_ROOM[_room(target)] >= _LAYER_OF_ROOM[room]
    ]
    assert bad == []


def test_no_module_reaches_itself() -> None:
    circles = {" > ".join(way) for name in _modules() if (way := _way(name, name))}
    assert circles == set()


def test_the_core_imports_no_ros() -> None:
    bad = {
        name: sorted(m for m in _imported(name, path) if _ROS.match(m))
        for name, path in _modules().items()
        if name.startswith("fomrc_core")
    }
    assert {name: modules for name, modules in bad.items() if modules} == {}


def test_no_module_is_imported_by_a_name_the_contract_cannot_see() -> None:
    # Effects are found by looking into their folder and at entry points. The public names are imported at first
    # use, and stand beside it as imports for the sake of types, which count.
    dynamic = re.compile(r"\bimport_module\(|\b__import__\(")
    found = {name for name, path in _modules().items() if dynamic.search(path.read_text())}
    assert found <= {name for name in _modules() if _room(name) in ("fomrc_core", "fomrc_core.effects")}


def _public(package: str) -> tuple[str, ...]:
    for node in ast.parse(_modules()[package].read_text()).body:
        if isinstance(node, ast.Assign) and ast.unparse(node.targets[0]) == "__all__":
            names: list[str] = ast.literal_eval(node.value)
            return tuple(names)
    return ()


_PARTS = [module for module in _modules() if _is_package(module) and module not in _PACKAGES]


def _users() -> dict[str, Path]:
    """Whoever may use only what a package offers: other packages, benchmarks, examples; not the tests."""
    others = {_module_name(path): path for folder in ("benchmarks", "docs", "examples") for path in _sources(folder)}
    return _modules() | others


@pytest.mark.parametrize("package", _PARTS)
def test_a_package_says_what_lives_there_and_what_others_may_use(package: str) -> None:
    docstring = ast.get_docstring(ast.parse(_modules()[package].read_text())) or ""
    assert docstring.rstrip().endswith("."), "two sentences on what lives there"
    names = _public(package)
    assert list(names) == sorted(set(names))
    defined = _names_defined(_modules()[package])
    assert [name for name in names if name not in defined and f"{package}.{name}" not in _modules()] == []


def _names_defined(path: Path) -> set[str]:
    found: set[str] = set()
    for node in ast.parse(path.read_text()).body:
        if isinstance(node, (ast.FunctionDef, ast.ClassDef)):
            found.add(node.name)
        elif isinstance(node, ast.ImportFrom):
            found.update(alias.asname or alias.name for alias in node.names)
        elif isinstance(node, ast.Assign):
            found.update(target.id for target in node.targets if isinstance(target, ast.Name))
    return found


@pytest.mark.parametrize("package", _PARTS)
def test_others_use_only_what_a_package_offers(package: str) -> None:
    bad = []
    for user, path in _users().items():
        if user == package or user.startswith(f"{package}."):
            continue
        for base, name in _imports(user, path):
            inside = f"{base}.{name}".removeprefix(f"{package}.") if f"{base}.".startswith(f"{package}.") else ""
            first = inside.split(".")[0]
            # Any effect may be made by whoever is given its name; who may name one is another test's matter.
            is_effect = package == "fomrc_core.effects" and first not in _public(package) and first != "base"
            if first and first not in _public(package) and not is_effect:
                bad.append(f"{user} uses {first}")
    assert bad == []


def test_files_hold_one_concept_each() -> None:
    folders = (*_PACKAGES, "challenge", "test", "benchmarks", "launch", "examples", "docs")
    sources = [path for folder in folders for path in _sources(folder)] + [_ROOT / "setup.py"]
    n_lines = {str(path.relative_to(_ROOT)): len(path.read_text().splitlines()) for path in sources}
    assert {name: n for name, n in n_lines.items() if n > _N_LINES_MAX} == {}
    vague = {"utils.py", "util.py", "helpers.py", "misc.py", "common.py"}
    assert [name for name in n_lines if Path(name).name in vague] == []


def _size(function: ast.FunctionDef) -> tuple[int, int]:
    """Return the lines of a function less its docstring, and the number of its parameters less self."""
    body = function.body[0]
    documented = (body.end_lineno or 0) - body.lineno + 1 if ast.get_docstring(function) is not None else 0
    given = function.args
    names = [a.arg for a in (*given.posonlyargs, *given.args, *given.kwonlyargs)]
    return (function.end_lineno or 0) - function.lineno + 1 - documented, len(names) - (
        names[:1] in (["self"], ["cls"])
    )


def test_large_functions_say_why() -> None:
    # Compiled kernels take arrays and numbers, no objects; the parameters of a command are its options.
    reason = re.compile(r"# (Long|Many arguments): \w")
    bad = []
    for name, path in _modules().items():
        lines = path.read_text().splitlines()
        for node in ast.walk(ast.parse(path.read_text())):
            if not isinstance(node, ast.FunctionDef) or _room(name) == "fomrc_core.cli":
                continue
            if any(ast.unparse(decorator).startswith("compiled") for decorator in node.decorator_list):
                continue
            n_lines, n_parameters = _size(node)
            source = "\n".join(lines[node.lineno - 1 : node.end_lineno])
            if (n_lines > _N_FUNCTION_LINES or n_parameters > _N_PARAMETERS) and not reason.search(source):
                bad.append(f"{name}.{node.name}: {n_lines} lines, {n_parameters} parameters")
    assert bad == []


def test_the_check_sees_imports_of_every_form() -> None:
    source = _modules()["fomrc_core.storage.model_files"]
    assert {"fomrc_core.model.piezo_model", "fomrc_core.errors", "yaml"} <= _imported(
        "fomrc_core.storage.model_files", source
    )
    # Inside a function, and for the sake of types alone.
    assert "fomrc_core.comparison.figure" in _graph()["fomrc_core.comparison.comparison"]
    assert "fomrc_core.diagnosis.diagnosis" in _graph()["fomrc_core.report.diagnosis_files"]
    assert _way("fomrc_core.storage", "fomrc_core.errors")
    assert not _way("fomrc_core.errors", "fomrc_core.storage")
