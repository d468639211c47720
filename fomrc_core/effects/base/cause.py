"""A cause: what measured data may show beside hysteresis and creep, its parameters, and how it is told.

Most causes are effects in the chain (effect.py); the past of the actuator is one as well.
"""

from __future__ import annotations

import math
from abc import ABC
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import MISSING, Field, dataclass, fields
from typing import Any, ClassVar, TypeVar

import numpy as np
from numpy.typing import NDArray

from fomrc_core.effects.base.evidence import Evidence
from fomrc_core.effects.base.parameter import Parameter
from fomrc_core.errors import ParameterError

Array = NDArray[np.float64]
AnyCause = TypeVar("AnyCause", bound="Cause")


@dataclass(frozen=True)
class Cause(ABC):
    """Something that makes an actuator's response other than hysteresis and creep alone would.

    A subclass is a frozen dataclass whose fields are its parameters. It states what it is, and, where that is not as
    with most causes, how a fit may move it and what a diagnosis must ask before it names it.
    """

    # what it is
    name: ClassVar[str]
    parameters: ClassVar[tuple[Parameter, ...]]
    main_parameter: ClassVar[str]
    meaning: ClassVar[str]
    signature: ClassVar[str]
    experiment: ClassVar[str]
    inverse_note: ClassVar[str]
    paper_section: ClassVar[str] = ""  # where the paper names it as left out of its model
    # how a fit may move it
    linear_parameters: ClassVar[tuple[str, ...]] = ()  # those in which the response is linear
    held_parameters: ClassVar[tuple[str, ...]] = ()  # those a fit leaves where the screening put them
    moved_times: ClassVar[tuple[str, ...]] = ()  # lists of times [s] of which a search moves each by itself
    moved_moments: ClassVar[tuple[str, ...]] = ()  # single moments [s] that a search moves
    moved_durations: ClassVar[tuple[str, ...]] = ()  # how long what begins there takes [s], moved as well
    is_scanned: ClassVar[bool] = False  # its response jumps with the main parameter: a fit scans it
    replaces_creep: ClassVar[bool] = False  # whether a model with it has no creep order of its own
    # what a diagnosis must know
    is_named: ClassVar[bool] = True  # whether it is something, and not only terms that follow what is left
    is_record_bound: ClassVar[bool] = False  # its parameters belong to one record, not to the actuator
    is_of_sensor: ClassVar[bool] = False  # the reading errs by it, not the position
    is_of_clock: ClassVar[bool] = False  # by it readings come early or late, in the end as if some had been lost
    is_exchangeable: ClassVar[bool] = True  # may take the place of another cause that was found, or give way to one
    needs_many_loops: ClassVar[bool] = False  # a drive that repeats one loop cannot tell it from others
    needs_loops: ClassVar[bool] = False  # it bends loops: where none are seen no record shows it
    adds_elements: ClassVar[bool] = False  # tested where the elements of a model are questioned, not by the search
    can_invert: ClassVar[bool] = False  # whether a compensator can undo it
    bends_to_much: ClassVar[bool] = False  # its form follows most of what others do: what is slow, many weights
    one_more_of: ClassVar[tuple[str, ...]] = ()  # causes beside which it is one more of their terms, and no name
    generalizes: ClassVar[str] = ""  # name of the simpler cause it is for one value of a parameter it has beside
    size_exponent: ClassVar[float] = 1.0  # main parameter ~ size of the signature to this power, for small sizes

    def __post_init__(self) -> None:
        for spec in self.parameters:
            object.__setattr__(self, spec.name, spec.checked(getattr(self, spec.name), self.name))

    def __str__(self) -> str:
        values = ((spec.name, getattr(self, spec.name)) for spec in self.parameters)
        shown = (f"{name}: {len(v)} values" if isinstance(v, tuple) else f"{name} {v:.5g}" for name, v in values)
        return f"{self.name} ({', '.join(shown)})"

    @classmethod
    def parameter(cls, name: str) -> Parameter:
        """Return the specification of one parameter."""
        return next(spec for spec in cls.parameters if spec.name == name)

    def check_alike(self, *names: str) -> None:
        """Raise ParameterError unless these lists are of one length."""
        lengths = tuple(len(getattr(self, name)) for name in names)
        if len(set(lengths)) > 1:
            raise ParameterError(
                "lists differ in length", where=self.name, value=lengths, allowed=f"{', '.join(names)} of one length"
            )

    # --- how a fit moves it

    def free_names(self) -> tuple[str, ...]:
        """Return the parameters a fit moves; a linear one that stands at zero is held there."""
        return tuple(
            spec.name
            for spec in self.parameters
            if not spec.is_list
            and spec.name not in self.held_parameters
            and not (spec.name in self.linear_parameters and getattr(self, spec.name) == 0.0)
        )

    @classmethod
    def has_own_times(cls) -> bool:
        """Return whether it comes and goes at times that a search moves, and no fit."""
        return bool(cls.moved_times or cls.moved_moments)

    def ran_away(self, duration_s: float) -> bool:
        """Return whether a fit to a record of this length [s] has come to where nothing leads back from."""
        return False

    def form(self) -> tuple[str, ...]:
        """Return what no fit leads from one instance to another by: the parameters it moves, and choices it makes."""
        return self.free_names()

    def scale_of(self, name: str, value: float) -> float:
        """Return the unit in which a fit moves a parameter that is not moved by its logarithm."""
        return abs(value) if value != 0.0 else 1.0

    def takes_either_sign(self) -> bool:
        """Return whether the signature may be turned about by the linear parameters that are not zero."""
        sized = [name for name in self.linear_parameters if isinstance(getattr(self, name), float)]
        acting = [self.parameter(name) for name in sized if getattr(self, name) != 0.0]
        return bool(acting) and all(spec.lower < 0.0 for spec in acting)

    # --- how a diagnosis tells it

    @classmethod
    def screening(cls, evidence: Evidence) -> Sequence[Cause]:
        """Return trial instances whose signatures a diagnosis compares with what the model left over."""
        return []

    @classmethod
    def proposed(cls: type[AnyCause], trials: Iterable[Mapping[str, Any]]) -> list[AnyCause]:
        """Return trial instances with these parameters, each once, those left out that cannot be.

        Records come at any scale, so a trial may lie where no such cause can be: beyond the bounds of a parameter. A
        linear parameter is then brought to its bound, for a diagnosis sizes it anyway; for any other the trial is
        left out, and so is one that is not finite or contradicts itself. Nothing is raised.

        Args:
            trials: parameters of each, by name.
        """
        found: list[AnyCause] = []
        for trial in trials:
            values = dict(trial)
            for name in set(cls.linear_parameters) & set(values):
                spec = cls.parameter(name)
                if not spec.is_list and math.isfinite(values[name]):
                    values[name] = min(max(values[name], spec.lower), spec.upper)
            try:
                instance = cls(**values)
            except ParameterError:
                continue
            if instance not in found:
                found.append(instance)
        return found

    def belongs_to_record(self) -> bool:
        """Return whether the parameters belong to one record and not to the actuator."""
        return self.is_record_bound

    def in_other_record(self, evidence: Evidence) -> Sequence[Cause]:
        """Return instances of it as it may act in a further record, where what records have in common is known.

        Args:
            evidence: of that record alone, with what a model without this cause leaves of it.
        """
        return []

    def special_case(self) -> dict[str, float]:
        """Return the parameters of the cause it generalizes that are nearest to it; none where it does not tell."""
        return {}

    def kin(self) -> dict[str, dict[str, float]]:
        """Return causes akin to it by name, each with the parameters nearest to it, for a fit to begin with."""
        special = self.special_case()
        return {self.generalizes: special} if special else {}

    def in_shortest_form(self: AnyCause) -> AnyCause:
        """Return the cause told the shorter way, where that says nearly the same; itself where there is none."""
        return self

    def other_forms(self: AnyCause) -> Sequence[AnyCause]:
        """Return itself in its other forms, each with the parameters nearest to it, for a fit to begin with.

        Of those that differ in what no fit moves; none where a fit moves all there is.
        """
        return ()

    def is_plausible(self, duration_s: float, step_s: float) -> bool:
        """Return whether records of this length and sample period [s] can show the cause with these parameters."""
        return True

    def is_shown_over(self, stroke_um: float) -> bool:
        """Return whether records of this stroke [um] can show the cause with these parameters."""
        return True

    def is_confirmed(self, time_s: Array, voltage_v: Array, residual_um: Array) -> bool:
        """Return whether a record's residual, this cause left in it, shows what the cause must show.

        Args:
            time_s: time since the first sample [s], shape (n_samples,).
            voltage_v: drive [V], shape (n_samples,).
            residual_um: measured minus the model without this cause [um], shape (n_samples,).
        """
        return True

    def smallest_detectable(self, factor: float) -> dict[str, float]:
        """Return the size that data would just have shown, by its parameter; empty where none can be stated.

        Args:
            factor: how many times as large as that of this trial instance a signature must be to show.
        """
        value = getattr(self, self.main_parameter)
        if not isinstance(value, float) or value == 0.0:
            return {}
        return {self.main_parameter: abs(value) * factor**self.size_exponent}

    @classmethod
    def smallest_detectable_of_rms(cls, rms_um: float) -> dict[str, float]:
        """Return the same for a cause whose size follows from the rms of its signature [um], no trial needed."""
        return {}

    # --- files

    @classmethod
    def from_mapping(cls: type[AnyCause], mapping: Any, where: str) -> AnyCause:
        """Return the cause with these parameters; raises ParameterError naming the key at fault."""
        known = {spec.name for spec in cls.parameters}
        if not isinstance(mapping, dict):
            raise ParameterError("not a mapping", where=where, value=mapping, allowed=", ".join(sorted(known)))
        for key in mapping:
            if key not in known:
                raise ParameterError("unknown parameter", where=where, value=key, allowed=", ".join(sorted(known)))
        required = {f.name for f in fields(cls) if f.name in known and not _has_default(f)}
        for key in sorted(required - set(mapping)):
            raise ParameterError(f"parameter {key} is missing", where=where, allowed=", ".join(sorted(known)))
        return cls(**mapping)

    def to_mapping(self) -> dict[str, float | list[float]]:
        """Return the parameters as plain numbers and lists, as a model file holds them."""
        values = {spec.name: getattr(self, spec.name) for spec in self.parameters}
        # ROS cannot tell the type of an empty list, so an empty one is left out
        return {
            name: list(value) if isinstance(value, tuple) else float(value)
            for name, value in values.items()
            if value != ()
        }


def _has_default(field: Field[Any]) -> bool:
    return field.default is not MISSING or field.default_factory is not MISSING
