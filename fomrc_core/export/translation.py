"""Translate step functions (effects/base/step_form.py) into C: a small kind of Python, refused where it is not.

Everything computes in double precision; the state may hold less. Counts are whole numbers without a sign.
"""

from __future__ import annotations

import ast
import inspect
import textwrap
from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import Enum

from fomrc_core.effects.base.step_form import FieldKind, StateField, StepForm, StepFunction
from fomrc_core.errors import ParameterError
from fomrc_core.export.c_numbers import c_number
from fomrc_core.export.options import Precision


class CType(Enum):
    """Type of an expression in C."""

    NUMBER = "double"
    COUNT = "uint32_t"
    TRUTH = "int"


# In the order in which C takes them, with the type; s, k are pointers, c are constants of the file.
PARAMETERS = {
    "value": CType.NUMBER,
    "drive_v": CType.NUMBER,
    "step_s": CType.NUMBER,
    "covariate": CType.NUMBER,
    "is_known": CType.TRUTH,
}
_OPERATORS = {ast.Add: "+", ast.Sub: "-", ast.Mult: "*", ast.Div: "/", ast.Mod: "%"}
_COMPARISONS = {ast.Lt: "<", ast.LtE: "<=", ast.Gt: ">", ast.GtE: ">=", ast.Eq: "==", ast.NotEq: "!="}
_CALLS = {("min", 2): "least_of", ("max", 2): "most_of", ("abs", 1): "size_of", ("round", 1): "rounded"}
# Inside a step no library is called: the file has an exponential and a sine of its own.
_IN_STEP = {"exp": "exponential", "sin": "sine", "cos": "cosine", "log1p": "logarithm"}
_IN_PREPARE = {name: name for name in ("exp", "expm1", "sin", "cos", "sqrt", "log1p")}
# What of them the file must define, and what they call in turn.
_OWN = {name: {name, "rounded"} for name in ("exponential", "rounded")}
_OWN |= {name: {name, "wave", "rounded"} for name in ("sine", "cosine")} | {"logarithm": {"logarithm"}}
_OWN |= {name: {name} for name in ("least_of", "most_of", "size_of")}
FAILURE = "failure"


@dataclass(frozen=True)
class Surroundings:
    """What a function may name.

    Attributes:
        name: of the effect; its constants, types and functions begin with it.
        constants: its constants.
        fields: fields of its state.
        coefficients: size of each of its coefficients, 0 for a number.
        helpers: names of functions it may call.
    """

    name: str
    constants: Mapping[str, float | tuple[float, ...]]
    fields: Mapping[str, StateField]
    coefficients: Mapping[str, int]
    helpers: frozenset[str]

    @classmethod
    def of(cls, name: str, form: StepForm) -> Surroundings:
        """Return those of the functions of a step form."""
        fields = {field.name: field for field in form.state}
        helpers = frozenset(helper.__name__ for helper in form.helpers)
        return cls(name, dict(form.constants), fields, form.coefficient_sizes, helpers)


@dataclass(frozen=True)
class Translated:
    """A function in C.

    Attributes:
        text: its definition.
        parameters: its parameters, in the order of C, ``s`` and ``k`` first.
        needs: functions of the file's own that it calls, ``FAILURE`` where it may have no answer.
    """

    text: str
    parameters: tuple[str, ...]
    needs: frozenset[str]


def parsed(function: StepFunction) -> ast.FunctionDef:
    """Return the definition of a step function.

    Raises:
        ParameterError: its source cannot be read, or it is no plain function.
    """
    where = getattr(function, "__qualname__", repr(function))
    try:
        node = ast.parse(textwrap.dedent(inspect.getsource(function))).body[0]
    except (OSError, TypeError, SyntaxError) as error:
        raise ParameterError(f"source of a step function cannot be read ({error})", where=where) from None
    if not isinstance(node, ast.FunctionDef):
        raise ParameterError("not a plain function", where=where, allowed="def name(...):")
    return node


def parameters_of(function: StepFunction) -> tuple[str, ...]:
    """Return the parameters of a step function as it states them."""
    return tuple(inspect.signature(function).parameters)


def step_function(function: StepFunction, c_name: str, around: Surroundings, is_prepare: bool = False) -> Translated:
    """Return a step function in C.

    Args:
        function: in Python.
        c_name: what it is called in C.
        around: what it may name.
        is_prepare: whether it fills coefficients, and may call the mathematical library.

    Raises:
        ParameterError: something C is not made of here, with the line.
    """
    node = parsed(function)
    told = [argument.arg for argument in node.args.args]
    known = {name: kind for name, kind in PARAMETERS.items() if name in told}
    writer = _Writer(c_name, around, dict(known), is_prepare)
    if unknown := set(told) - set(PARAMETERS) - {"s", "k", "c"}:
        raise writer.refusal(node, f"parameter {sorted(unknown)[0]}")
    pointers = []
    if "s" in told:
        pointers.append(f"{'@prefix@'}_{around.name} *s")
    if "k" in told:
        pointers.append(f"{'' if is_prepare else 'const '}{around.name}_coefficients *k")
    parameters = [*pointers, *(f"{kind.value} {name}" for name, kind in known.items())]
    result = "void" if is_prepare else "double"
    names = tuple(name for name in ("s", "k") if name in told) + tuple(known)
    return writer.definition(node, f"static {result} {c_name}({', '.join(parameters) or 'void'})", names)


def helper_function(function: StepFunction, is_prepare: bool) -> Translated:
    """Return a helper in C, a function of numbers.

    Args:
        function: in Python.
        is_prepare: whether ``prepare`` alone calls it: then it may call the mathematical library.

    Raises:
        ParameterError: something C is not made of here, with the line.
    """
    node = parsed(function)
    kinds = {"float": CType.NUMBER, "int": CType.COUNT}
    known: dict[str, CType] = {}
    around = Surroundings(function.__name__, {}, {}, {}, frozenset())
    writer = _Writer(function.__name__, around, known, is_prepare)
    for argument in node.args.args:
        annotation = ast.unparse(argument.annotation) if argument.annotation is not None else ""
        if annotation not in kinds:
            raise writer.refusal(node, f"parameter {argument.arg} that is not annotated as float or int")
        known[argument.arg] = kinds[annotation]
    told = ", ".join(f"{kind.value} {name}" for name, kind in known.items())
    return writer.definition(node, f"static double {function.__name__}({told})", tuple(known))


@dataclass
class _Writer:
    """Writes one function; knows the type of each local."""

    c_name: str
    around: Surroundings
    types: dict[str, CType]
    is_prepare: bool
    lines: list[str] = field(default_factory=list)
    needs: set[str] = field(default_factory=set)
    locals: dict[str, CType] = field(default_factory=dict)

    def refusal(self, node: ast.AST, what: str) -> ParameterError:
        line = getattr(node, "lineno", 0)
        return ParameterError(
            f"{what} cannot be translated into C", where=f"{self.c_name}, line {line}", allowed="see step_form.py"
        )

    def definition(self, node: ast.FunctionDef, head: str, parameters: tuple[str, ...]) -> Translated:
        self._block(node.body, 1)
        declared = [
            f"    {kind.value} {', '.join(names)};"
            for kind in (CType.NUMBER, CType.COUNT)
            if (names := [name for name, own in self.locals.items() if own is kind])
        ]
        said = (ast.get_docstring(node) or "").splitlines()
        comment = [f"/* {said[0]} */"] if said else []
        text = "\n".join([*comment, head, "{", *declared, *self.lines, "}"])
        return Translated(text, parameters, frozenset(self.needs))

    # --- statements

    def _block(self, statements: list[ast.stmt], depth: int) -> None:
        for statement in statements:
            self._statement(statement, depth)

    def _say(self, depth: int, text: str) -> None:
        self.lines.append("    " * depth + text)

    def _statement(self, node: ast.stmt, depth: int) -> None:
        if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant) and isinstance(node.value.value, str):
            return
        if isinstance(node, ast.Assign) and len(node.targets) == 1:
            self._assign(node, node.targets[0], depth)
        elif isinstance(node, ast.Return) and node.value is not None:
            self._say(depth, f"return {self._expression(node.value)[0]};")
        elif isinstance(node, ast.If):
            self._if(node, depth)
        elif isinstance(node, ast.For) and not node.orelse:
            self._for(node, depth)
        elif isinstance(node, ast.Break):
            self._say(depth, "break;")
        else:
            raise self.refusal(node, type(node).__name__)

    def _assign(self, node: ast.Assign, target: ast.expr, depth: int) -> None:
        text, kind = self._expression(node.value)
        if isinstance(target, ast.Name):
            if target.id in PARAMETERS:
                raise self.refusal(node, f"a new value of parameter {target.id}")
            own = self.types.setdefault(target.id, CType.COUNT if kind is CType.TRUTH else kind)
            self.locals[target.id] = own
            if own is CType.COUNT and kind is CType.NUMBER:
                raise self.refusal(node, f"a number for the count {target.id}")
            self._say(depth, f"{target.id} = {text};")
            return
        place, own_kind = self._place(target)
        if place.startswith("k->") and not self.is_prepare:
            raise self.refusal(node, f"to store in {ast.unparse(target)}")
        if own_kind is FieldKind.COUNT and kind is CType.NUMBER:
            raise self.refusal(node, "a number for a count")
        cast = "(real)" if own_kind is FieldKind.REAL else ""
        simple = text.replace("_", "").isalnum()
        self._say(depth, f"{place} = {cast}{text if simple or not cast else f'({text})'};")

    def _place(self, node: ast.expr) -> tuple[str, FieldKind]:
        """Return where something is stored, and what is stored there."""
        inner = node.value if isinstance(node, ast.Subscript) else node
        if isinstance(inner, ast.Attribute) and isinstance(inner.value, ast.Name):
            index = f"[{self._index(node)}]" if isinstance(node, ast.Subscript) else ""
            if inner.value.id == "s" and inner.attr in self.around.fields:
                return f"s->{inner.attr}{index}", self.around.fields[inner.attr].kind
            if inner.value.id == "k" and inner.attr in self.around.coefficients:
                return f"k->{inner.attr}{index}", FieldKind.WIDE
        raise self.refusal(node, ast.unparse(node))

    def _if(self, node: ast.If, depth: int) -> None:
        test = self._expression(node.test)[0]
        # A comparison brings brackets of its own; a second pair is what compilers warn of.
        self._say(depth, f"if {test if test.startswith('(') and _is_one_pair(test) else f'({test})'} {{")
        self._block(node.body, depth + 1)
        if node.orelse:
            self._say(depth, "} else {")
            self._block(node.orelse, depth + 1)
        self._say(depth, "}")

    def _for(self, node: ast.For, depth: int) -> None:
        is_range = isinstance(node.iter, ast.Call) and ast.unparse(node.iter.func) == "range"
        if not is_range or len(node.iter.args) != 1 or not isinstance(node.target, ast.Name):  # type: ignore[attr-defined]
            raise self.refusal(node, "a loop over anything but range(number)")
        limit, kind = self._expression(node.iter.args[0])  # type: ignore[attr-defined]
        if kind is not CType.COUNT:
            raise self.refusal(node, "a range of what is no count")
        index = node.target.id if node.target.id != "_" else "turn"
        self.types[index] = CType.COUNT
        self._say(depth, f"for (uint32_t {index} = 0; {index} < {limit}; {index}++) {{")
        self._block(node.body, depth + 1)
        self._say(depth, "}")

    # --- expressions

    def _index(self, node: ast.Subscript) -> str:
        text, kind = self._expression(node.slice)
        if kind is not CType.COUNT:
            raise self.refusal(node, "an index that is no count")
        return text

    def _expression(self, node: ast.expr) -> tuple[str, CType]:
        """Return an expression in C, in brackets where it is made of several, and its type."""
        method = getattr(self, f"_{type(node).__name__.lower()}", None)
        if method is None:
            raise self.refusal(node, type(node).__name__)
        found: tuple[str, CType] = method(node)
        return found

    def _constant(self, node: ast.Constant) -> tuple[str, CType]:
        if isinstance(node.value, float):
            return c_number(node.value, Precision.DOUBLE), CType.NUMBER
        if isinstance(node.value, int) and not isinstance(node.value, bool) and 0 <= node.value < 1 << 32:
            return f"{node.value}u", CType.COUNT
        raise self.refusal(node, repr(node.value))

    def _name(self, node: ast.Name) -> tuple[str, CType]:
        if node.id not in self.types:
            raise self.refusal(node, f"the name {node.id}")
        return node.id, self.types[node.id]

    def _attribute(self, node: ast.Attribute) -> tuple[str, CType]:
        owner = node.value.id if isinstance(node.value, ast.Name) else ""
        if owner == "math" and node.attr == "nan":
            self.needs.add(FAILURE)
            return "(double)NAN", CType.NUMBER
        if owner == "c" and isinstance(self.around.constants.get(node.attr), (int, float)):
            return f"{self.around.name.upper()}_{node.attr.upper()}", CType.NUMBER
        return self._widened(*self._place(node))

    @staticmethod
    def _widened(place: str, kind: FieldKind) -> tuple[str, CType]:
        if kind is FieldKind.COUNT:
            return place, CType.COUNT
        return (f"(double){place}" if kind is FieldKind.REAL else place), CType.NUMBER

    def _subscript(self, node: ast.Subscript) -> tuple[str, CType]:
        inner = node.value
        if isinstance(inner, ast.Attribute) and isinstance(inner.value, ast.Name) and inner.value.id == "c":
            if isinstance(self.around.constants.get(inner.attr), tuple):
                return f"{self.around.name.upper()}_{inner.attr.upper()}[{self._index(node)}]", CType.NUMBER
            raise self.refusal(node, ast.unparse(node))
        return self._widened(*self._place(node))

    def _binop(self, node: ast.BinOp) -> tuple[str, CType]:
        operator = _OPERATORS.get(type(node.op))
        left, right = self._expression(node.left), self._expression(node.right)
        is_count = left[1] is not CType.NUMBER and right[1] is not CType.NUMBER
        if operator is None or (operator == "%" and not is_count) or (is_count and operator == "/"):
            raise self.refusal(node, f"the operator of {ast.unparse(node)}")
        texts = [text if kind is CType.NUMBER or is_count else f"(double){text}" for text, kind in (left, right)]
        return f"({texts[0]} {operator} {texts[1]})", CType.COUNT if is_count else CType.NUMBER

    def _unaryop(self, node: ast.UnaryOp) -> tuple[str, CType]:
        text, kind = self._expression(node.operand)
        if isinstance(node.op, ast.Not):
            return f"(!{text})", CType.TRUTH
        if isinstance(node.op, ast.USub) and kind is CType.NUMBER:
            return f"(-{text})", kind
        raise self.refusal(node, ast.unparse(node))

    def _compare(self, node: ast.Compare) -> tuple[str, CType]:
        if len(node.ops) != 1 or type(node.ops[0]) not in _COMPARISONS:
            raise self.refusal(node, f"the comparison {ast.unparse(node)}")
        left, right = self._expression(node.left)[0], self._expression(node.comparators[0])[0]
        return f"({left} {_COMPARISONS[type(node.ops[0])]} {right})", CType.TRUTH

    def _boolop(self, node: ast.BoolOp) -> tuple[str, CType]:
        sign = " && " if isinstance(node.op, ast.And) else " || "
        return f"({sign.join(self._expression(value)[0] for value in node.values)})", CType.TRUTH

    def _ifexp(self, node: ast.IfExp) -> tuple[str, CType]:
        test, first, second = (self._expression(part) for part in (node.test, node.body, node.orelse))
        if first[1] is not second[1]:
            raise self.refusal(node, "a choice between two types")
        return f"({test[0]} ? {first[0]} : {second[0]})", first[1]

    def _call(self, node: ast.Call) -> tuple[str, CType]:
        called = ast.unparse(node.func)
        if called == "len" and len(node.args) == 1:
            return f"{self._length(node.args[0])}u", CType.COUNT
        if called == "int" and len(node.args) == 1:
            return f"(uint32_t)({self._expression(node.args[0])[0]})", CType.COUNT
        name = _CALLS.get((called, len(node.args)))
        if called.startswith("math."):
            name = (_IN_PREPARE if self.is_prepare else _IN_STEP).get(called[5:])
        elif called in self.around.helpers:
            name = called
        if name is None or node.keywords:
            raise self.refusal(node, f"the call of {called}")
        self.needs |= _OWN.get(name, set())
        return f"{name}({', '.join(self._expression(argument)[0] for argument in node.args)})", CType.NUMBER

    def _length(self, node: ast.expr) -> int:
        if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name):
            table = self.around.constants.get(node.attr)
            if node.value.id == "c" and isinstance(table, tuple):
                return len(table)
            if node.value.id == "s" and node.attr in self.around.fields and self.around.fields[node.attr].is_array:
                return len(self.around.fields[node.attr].initial)
            if node.value.id == "k" and self.around.coefficients.get(node.attr):
                return self.around.coefficients[node.attr]
        raise self.refusal(node, f"len({ast.unparse(node)})")


def _is_one_pair(text: str) -> bool:
    """Return whether the first bracket of a text is closed by its last character."""
    depth = 0
    for at, letter in enumerate(text):
        depth += (letter == "(") - (letter == ")")
        if depth == 0:
            return at == len(text) - 1
    return False
