"""What is computed is computed in one place: solvers, descents, figures of merit, the paper's numbers."""

from __future__ import annotations

import ast
import functools
from collections.abc import Iterator
from pathlib import Path

import pytest

_ROOT = Path(__file__).resolve().parents[1]
_PACKAGES = ("fomrc_core", "fomrc_ros")


@functools.cache
def _trees() -> dict[str, ast.Module]:
    paths = (path for package in _PACKAGES for path in (_ROOT / package).rglob("*.py"))
    return {
        str(path.relative_to(_ROOT).with_suffix("")).replace("/", "."): ast.parse(path.read_text()) for path in paths
    }


def _nodes(kind: type[ast.AST]) -> Iterator[tuple[str, ast.AST]]:
    for module, tree in _trees().items():
        yield from ((module, node) for node in ast.walk(tree) if isinstance(node, kind))


def test_each_solver_of_scipy_has_one_user() -> None:
    found = {
        (alias.name, module)
        for module, node in _nodes(ast.ImportFrom)
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("scipy.optimize")
        for alias in node.names
        if alias.name not in {"brentq", "root_scalar"}  # a root of one equation is no fit
    }
    assert found == {
        # one non-negative solver; no other least squares of scipy's: the damped descent is ours
        ("nnls", "fomrc_core.compute.least_squares"),
        # what the paper and its rivals minimise by, to be compared with
        ("minimize", "fomrc_core.identification.paper"),
        ("minimize", "fomrc_core.comparison.baselines.goldfarb_celanovic"),
        ("minimize_scalar", "fomrc_core.comparison.baselines.amplified"),
        # one number of a change, within bounds
        ("minimize_scalar", "fomrc_core.diagnosis.watch.hypotheses"),
        ("minimize_scalar", "fomrc_core.diagnosis.watch.additions"),
        # within bounds: what went before a record did not lie beyond what it shows
        ("least_squares", "fomrc_core.model.record_start"),
    }
    whole = {
        module
        for module, node in _nodes(ast.Import)
        if isinstance(node, ast.Import) and any(alias.name.startswith("scipy.optimize") for alias in node.names)
    }
    assert whole == set()


def test_fits_solve_their_equations_where_least_squares_live() -> None:
    # A regression of a few terms within a noise or an effect may be numpy's own.
    fits = ("compute", "fitting", "identification", "diagnosis", "model", "control", "comparison", "reproduction")
    found = {
        module
        for module, node in _nodes(ast.Attribute)
        if isinstance(node, ast.Attribute)
        and node.attr in {"solve", "lstsq", "pinv", "inv", "cholesky"}
        and isinstance(node.value, ast.Attribute)
        and node.value.attr == "linalg"
        and module.startswith(tuple(f"fomrc_core.{room}." for room in fits))
    }
    # the matrix of static gains between axes is square, and inverted as it stands: no fit
    found -= {"fomrc_core.model.axes.compensator"}
    assert found == {"fomrc_core.compute.least_squares", "fomrc_core.compute.gauss_newton"}


def test_gram_matrices_are_assembled_in_one_place() -> None:
    def is_gram(node: ast.AST) -> bool:
        return (
            isinstance(node, ast.BinOp)
            and isinstance(node.op, ast.MatMult)
            and isinstance(node.left, ast.Attribute)
            and node.left.attr == "T"
            and ast.unparse(node.left.value) == ast.unparse(node.right)
        )

    assert {module for module, node in _nodes(ast.BinOp) if is_gram(node)} == set()
    calls = {
        module
        for module, node in _nodes(ast.Call)
        if isinstance(node, ast.Call)
        and isinstance(node.func, ast.Name)
        and node.func.id == "product"
        and len(node.args) == 3
        and ast.unparse(node.args[0]) == ast.unparse(node.args[1])
    }
    # the leverage needs what the learned samples add to directions of all samples
    assert calls == {"fomrc_core.compute.least_squares", "fomrc_core.diagnosis.leverage"}


def test_there_is_one_descent_and_four_fits_by_it() -> None:
    damped = {
        module
        for module, node in _nodes(ast.While)
        if isinstance(node, ast.While) and "damping" in ast.unparse(node.test)
    }
    assert damped == {"fomrc_core.compute.gauss_newton"}
    users = {
        module
        for module, node in _nodes(ast.Call)
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id == "descend"
    }
    # elements alone, with an analytic Jacobian; effects beside them, by differences; several axes, on their spectra;
    # changes of several axes, by differences of their simulation
    fits = {"fomrc_core.fitting.element_fit", "fomrc_core.fitting.joint_fit", "fomrc_core.identification.axes.fit"}
    fits |= {"fomrc_core.diagnosis.axes.fit"}
    assert users == fits


@pytest.mark.parametrize(
    ("name", "place"),
    [
        ("turning_points", "fomrc_core.records.drive"),
        ("begins_at_zero", "fomrc_core.records.drive"),
        ("held_out_blocks", "fomrc_core.records.drive"),
        ("learned_blocks", "fomrc_core.records.drive"),
        ("n_loop_kinds", "fomrc_core.records.drive"),
        ("nrmse_percent", "fomrc_core.records.residual"),
        ("nonlinearity_percent", "fomrc_core.records.residual"),
        ("whitening_of", "fomrc_core.compute.least_squares"),
        ("non_negative_weights", "fomrc_core.compute.least_squares"),
    ],
)
def test_a_concept_has_one_definition(name: str, place: str) -> None:
    places = {
        module
        for module, tree in _trees().items()
        for node in tree.body
        if isinstance(node, ast.FunctionDef) and node.name.lstrip("_") == name
    }
    assert places == {place}


def test_errors_are_normalised_by_a_range_in_one_place() -> None:
    # per cent of a range that is taken on the spot
    found = {
        module
        for module, node in _nodes(ast.BinOp)
        if isinstance(node, ast.BinOp)
        and isinstance(node.op, ast.Div)
        and "100.0" in ast.unparse(node.left)
        and ("ptp(" in ast.unparse(node.right) or ast.unparse(node.right) == "span")
    }
    assert found == {"fomrc_core.records.residual"}


def test_the_numbers_the_paper_prints_stand_in_one_table() -> None:
    # of Table 1 and figures 14 to 16; those that stand for something else too are left out
    printed = {10.4571, 23.6702, 1.2808, 0.0368, 0.1036, 1.255, 12.06, 5.04}
    found = {
        module
        for module, node in _nodes(ast.Constant)
        if isinstance(node, ast.Constant) and isinstance(node.value, float) and node.value in printed
    }
    assert found == {"fomrc_core.plants.paper_stage"}
