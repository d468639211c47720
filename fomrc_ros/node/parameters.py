"""Node parameters, each declared once with type, unit, range and description, and changed all or nothing."""

from __future__ import annotations

import difflib
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from rcl_interfaces.msg import FloatingPointRange, IntegerRange, ParameterDescriptor, SetParametersResult
from rclpy.exceptions import ParameterUninitializedException
from rclpy.node import Node
from rclpy.parameter import Parameter

from fomrc_core.errors import FomrcError, ParameterError

Kind = Parameter.Type
_PYTHON_TYPES: dict[Any, tuple[Any, str]] = {
    Kind.BOOL: (bool, "true or false"),
    Kind.INTEGER: (int, "an integer"),
    Kind.DOUBLE: (float, "a number"),
    Kind.STRING: (str, "a string"),
}
_ELEMENT_KINDS = {
    Kind.DOUBLE_ARRAY: Kind.DOUBLE,
    Kind.STRING_ARRAY: Kind.STRING,
    Kind.INTEGER_ARRAY: Kind.INTEGER,
}
_OF_CLIENT_LIBRARY = ("use_sim_time", "start_type_description_service")
# A list longer than this is a mistake or an attack, never a piezo model.
_LONGEST_LIST = 4096
_LONGEST_STRING = 4096


@dataclass(frozen=True)
class ParameterSpec:
    """One parameter: its name, type, default and what is allowed.

    Args:
        name: full parameter name.
        default: default value; None for a parameter that has none until it is set.
        description: what it does, one sentence.
        kind: ROS type; found from the default where not given.
        unit: unit, "" where it has none.
        minimum: smallest allowed value, numbers only.
        maximum: largest allowed value, numbers only.
        choices: allowed values, strings only.
        is_read_only: whether it is fixed once the node runs.
    """

    name: str
    default: Any
    description: str
    kind: Any = Kind.NOT_SET
    unit: str = ""
    minimum: float | None = None
    maximum: float | None = None
    choices: tuple[str, ...] = ()
    is_read_only: bool = False

    def __post_init__(self) -> None:
        if self.kind is Kind.NOT_SET:
            object.__setattr__(self, "kind", Kind.from_parameter_value(self.default))

    @property
    def allowed(self) -> str:
        """What values are allowed, in words."""
        if self.choices:
            return " | ".join(self.choices)
        if self.minimum is not None or self.maximum is not None:
            low = "-inf" if self.minimum is None else f"{self.minimum:g}"
            high = "inf" if self.maximum is None else f"{self.maximum:g}"
            return f"{low} to {high}" + (f" {self.unit}" if self.unit not in ("", "1") else "")
        element = _ELEMENT_KINDS.get(self.kind)
        if element is not None:
            return f"a list, each {_PYTHON_TYPES[element][1]}"
        return _PYTHON_TYPES[self.kind][1]

    def descriptor(self) -> ParameterDescriptor:
        """Return the ROS descriptor: description with unit, range, read_only."""
        unit = f" [{self.unit}]" if self.unit else ""
        descriptor = ParameterDescriptor(
            description=self.description + unit,
            additional_constraints=f"allowed: {self.allowed}",
            read_only=self.is_read_only,
        )
        if self.minimum is not None or self.maximum is not None:
            low = -math.inf if self.minimum is None else self.minimum
            high = math.inf if self.maximum is None else self.maximum
            if self.kind is Kind.DOUBLE:
                descriptor.floating_point_range = [FloatingPointRange(from_value=low, to_value=high, step=0.0)]
            elif self.kind is Kind.INTEGER:
                descriptor.integer_range = [IntegerRange(from_value=int(low), to_value=int(high), step=1)]
        return descriptor

    def coerced(self, value: Any) -> Any:
        """Return the value in the declared type; integers are accepted for numbers, and a,b,c for a list of strings.

        Raises:
            ParameterError: another type, a number that is not finite or not in range, a list too long.
        """
        element = _ELEMENT_KINDS.get(self.kind)
        if element is None:
            return self._checked(value, self.kind, self.name)
        if isinstance(value, str) and element is Kind.STRING and "," in value:
            value = [part.strip() for part in value.split(",")]
        if isinstance(value, (str, bytes)) or (not isinstance(value, Sequence) and not hasattr(value, "__len__")):
            raise ParameterError("not a list", where=self.name, value=value, allowed=self.allowed)
        if len(value) > _LONGEST_LIST:
            raise ParameterError(
                "list too long",
                where=self.name,
                value=len(value),
                allowed=f"{_LONGEST_LIST} entries or fewer",
            )
        return [self._checked(entry, element, f"{self.name}[{k}]") for k, entry in enumerate(value)]

    def _checked(self, value: Any, kind: Any, where: str) -> Any:
        expected, words = _PYTHON_TYPES[kind]
        if kind is Kind.DOUBLE and isinstance(value, int) and not isinstance(value, bool):
            try:
                value = float(value)
            except OverflowError:
                raise ParameterError("number too large", where=where, allowed=self.allowed) from None
        if not isinstance(value, expected) or (kind is not Kind.BOOL and isinstance(value, bool)):
            raise ParameterError(f"not {words}", where=where, value=value, allowed=self.allowed)
        if kind is Kind.DOUBLE and not math.isfinite(value):
            raise ParameterError("not finite", where=where, value=value, allowed=self.allowed)
        if kind in (Kind.DOUBLE, Kind.INTEGER) and (
            (self.minimum is not None and value < self.minimum) or (self.maximum is not None and value > self.maximum)
        ):
            raise ParameterError("out of range", where=where, value=value, allowed=self.allowed)
        if kind is Kind.INTEGER and not -(2**63) <= value < 2**63:
            raise ParameterError("integer too large", where=where, value=value, allowed="64 bits")
        if kind is Kind.STRING and len(value) > _LONGEST_STRING:
            raise ParameterError(
                "string too long",
                where=where,
                value=len(value),
                allowed=f"{_LONGEST_STRING} characters or fewer",
            )
        if self.choices and value not in self.choices:
            raise ParameterError("not one of the choices", where=where, value=value, allowed=self.allowed)
        return value


@dataclass(frozen=True)
class FurtherNames:
    """Parameter names a node may meet beside its own.

    Args:
        find_spec: gives the specification of a name that may come later (an effect's parameter), or None.
        called_for: names that the values given at start call for, e.g. those of the effects a model names.
        is_elsewhere: whether a name is that of another node that may share the file; such are passed over.
    """

    find_spec: Callable[[str], ParameterSpec | None] = lambda name: None
    called_for: Callable[[Mapping[str, Any]], Sequence[str]] = lambda values: ()
    is_elsewhere: Callable[[str], bool] = lambda name: False


class NodeParameters:
    """All parameters of one node: values by name, changed only as a whole that was validated.

    Args:
        node: a node made with ``allow_undeclared_parameters=True``, so that a model may bring an effect whose
            parameters were not known at start. Names that no specification knows are refused all the same.
        specs: the parameters of the node.
        build: makes the node's settings from all values; raises FomrcError where they do not fit.
        apply: takes over settings that have been built, called after every change.
        further: names that are not in ``specs``.

    Raises:
        FomrcError: the values the node was started with are not acceptable.
    """

    def __init__(
        self,
        node: Node,
        specs: Sequence[ParameterSpec],
        build: Callable[[Mapping[str, Any]], Any],
        apply: Callable[[Any], None],
        further: FurtherNames,
    ) -> None:
        self._node, self._build, self._apply, self._further = node, build, apply, further
        self._specs = {spec.name: spec for spec in specs}
        self.values: dict[str, Any] = {}
        self._candidate: tuple[dict[str, Any], Any] | None = None
        for spec in specs:
            self._declare(spec)
        for name in further.called_for(self.values):
            more = self.spec(name)
            if more is not None and name not in self._specs:
                self._specs[name] = more
                self._declare(more)
        for name in given_names(node):
            if self.spec(name) is None and not self._is_foreign(name):
                raise self._unknown(name)
        self.settings = build(self.values)

    def watch(self) -> None:
        """Accept changes from now on: refused whole with a reason, or taken over whole."""
        self._node.add_pre_set_parameters_callback(self._coerce)
        self._node.add_on_set_parameters_callback(self._validate)
        self._node.add_post_set_parameters_callback(self._take_over)

    def spec(self, name: str) -> ParameterSpec | None:
        """Return the specification of a parameter, None where there is no such parameter."""
        return self._specs.get(name) or self._further.find_spec(name)

    def set_all(self, values: Mapping[str, Any]) -> None:
        """Set several parameters, all or nothing.

        Raises:
            ParameterError: unknown name, wrong type, out of range, or values that do not fit together.
        """
        changes = []
        for name, value in values.items():
            spec = self.spec(name)
            if spec is None:
                if self._is_foreign(name):
                    continue
                raise self._unknown(name)
            value = spec.coerced(value)
            if spec.is_read_only:
                if value != self.values.get(name):
                    raise ParameterError(
                        "cannot change while the node runs",
                        where=name,
                        value=value,
                        allowed=f"{self.values.get(name)!r}, set at start",
                    )
                continue
            changes.append(Parameter(name, spec.kind, value))
        if not changes:
            raise ParameterError("nothing to set", allowed="at least one parameter of this node")
        result = self._node.set_parameters_atomically(changes)
        if not result.successful:
            raise ParameterError(result.reason)

    def _declare(self, spec: ParameterSpec) -> None:
        # An integer given for a number raises when declared with its type, so look at it untyped first.
        probe = self._node.declare_parameter(spec.name, None, ParameterDescriptor(dynamic_typing=True))
        given = probe.value if probe.type_ is not Kind.NOT_SET else spec.default
        self._node.undeclare_parameter(spec.name)
        if given is None and spec.kind in _ELEMENT_KINDS:
            given = []
        if given is None:
            self._node.declare_parameter(spec.name, spec.kind, spec.descriptor(), ignore_override=True)
            return
        value = spec.coerced(given)
        self.values[spec.name] = value
        if isinstance(value, list) and not value:
            # An empty list has no type of its own, and declared by type alone it would have no value to be dumped.
            self._node.declare_parameter(spec.name, spec.kind, ignore_override=True)
            self._node.set_parameters([Parameter(spec.name, spec.kind, value)])
            descriptor = spec.descriptor()
            descriptor.type = spec.kind.value
            self._node.set_descriptor(spec.name, descriptor)
        else:
            self._node.declare_parameter(spec.name, value, spec.descriptor(), ignore_override=True)

    def _coerce(self, parameters: list[Parameter]) -> list[Parameter]:
        return [self._coerced(parameter) for parameter in parameters]

    def _coerced(self, parameter: Parameter) -> Parameter:
        spec = self.spec(parameter.name)
        if spec is None or parameter.type_ is Kind.NOT_SET:
            return parameter
        try:
            return Parameter(parameter.name, spec.kind, spec.coerced(parameter.value))
        except FomrcError:
            return parameter  # refused with its reason in _validate

    def _validate(self, parameters: list[Parameter]) -> SetParametersResult:
        try:
            values = dict(self.values)
            is_ours = False
            for parameter in parameters:
                if _is_of_client_library(parameter.name):
                    continue
                spec = self.spec(parameter.name)
                if spec is None:
                    raise self._unknown(parameter.name)
                if parameter.type_ is Kind.NOT_SET:
                    raise ParameterError("cannot be deleted", where=parameter.name, allowed=spec.allowed)
                values[parameter.name] = spec.coerced(parameter.value)
                is_ours = True
            if is_ours:
                self._candidate = (values, self._build(values))
        except FomrcError as error:
            self._candidate = None
            return SetParametersResult(successful=False, reason=str(error))
        except Exception as error:  # a callback that raises would take the node down with it
            self._candidate = None
            return SetParametersResult(successful=False, reason=f"{type(error).__name__}: {error}")
        return SetParametersResult(successful=True)

    def _take_over(self, parameters: list[Parameter]) -> None:
        if self._candidate is None:
            return
        self.values, self.settings = self._candidate
        self._candidate = None
        for parameter in parameters:
            spec = self.spec(parameter.name)
            if spec is not None and parameter.name not in self._specs:
                self._specs[parameter.name] = spec
                descriptor = spec.descriptor()
                descriptor.type = parameter.type_.value
                self._node.set_descriptor(parameter.name, descriptor)
        self._apply(self.settings)

    def _is_foreign(self, name: str) -> bool:
        return _is_of_client_library(name) or self._further.is_elsewhere(name)

    def _unknown(self, name: str) -> ParameterError:
        near = difflib.get_close_matches(name[:200], self._specs, n=1)
        meant = f", did you mean {near[0]}?" if near else ""
        return ParameterError(f"no such parameter{meant}", where=name[:200], allowed=", ".join(sorted(self._specs)))


def _is_of_client_library(name: str) -> bool:
    # Fixed at start by whoever starts the node.
    return name in _OF_CLIENT_LIBRARY or name.startswith("qos_overrides.")


def given_names(node: Node) -> list[str]:
    """Return the names of all parameters a node was given at start, known or not."""
    # The client library keeps to itself what nobody has declared; it has no public way to ask.
    overrides: Mapping[str, Any] = node._parameter_overrides
    return list(overrides)


def value_or_none(node: Node, name: str) -> Any:
    """Return a parameter's value, None where it has none yet."""
    try:
        return node.get_parameter(name).value
    except ParameterUninitializedException:
        return None
