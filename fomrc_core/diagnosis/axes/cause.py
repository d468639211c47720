"""A cause of several axes: what makes a stage answer other than its model, as a change of that model."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from fomrc_core.compute.arrays import Array
from fomrc_core.diagnosis.axes.records import AxesRecord
from fomrc_core.model.axes import AxesModel


@dataclass(frozen=True, eq=False)
class AxesEvidence:
    """What a cause may look at before it proposes where it acts.

    Attributes:
        model: the present model.
        records: the records.
        residuals_um: what the model leaves of each [um], (n_samples, n_outputs).
    """

    model: AxesModel
    records: Sequence[AxesRecord]
    residuals_um: Sequence[Array]


@dataclass(frozen=True, eq=False)
class AxesCause(ABC):
    """A change of a model by some numbers, none of which changes it where it is zero.

    A subclass is one file. It states what it is, proposes where it may act, and changes the model.

    Attributes:
        values: its numbers, all of order one or less.
    """

    name: ClassVar[str]
    meaning: ClassVar[str]
    signature: ClassVar[str]
    experiment: ClassVar[str]

    values: Array

    @property
    def kind(self) -> str:
        """Which of its forms this is; empty where it has one only."""
        return ""

    @property
    def side(self) -> str:
        """Where on the chain it acts, if that may be on either: trials of each side are fitted apart."""
        return ""

    @classmethod
    @abstractmethod
    def trials(cls, evidence: AxesEvidence) -> list[AxesCause]:
        """Return where and in which form it may act, each with the values a fit begins with."""

    @abstractmethod
    def applied(self, model: AxesModel) -> AxesModel:
        """Return the model with the change; raises ParameterError where values are none a model can have."""

    @abstractmethod
    def parameters(self, model: AxesModel) -> Mapping[str, float | str | list[float]]:
        """Return what it says of the stage, by name with unit.

        Args:
            model: the model it changes.
        """

    @property
    def longest_step(self) -> Array:
        """Longest step of each value that a fit may take at once, (n_values,)."""
        return np.full(self.values.size, np.inf)

    def companions(self) -> AxesCause | None:
        """Return what merely comes along with it, that is, itself without what it is named for; None where nothing.

        A cause whose companions explain most by themselves is not the cause.
        """
        return None

    def is_plausible(self) -> bool:
        """Return whether values are what its name says; asked after the fit."""
        return True


def no_values() -> Array:
    """Return the values of a change without numbers."""
    return np.zeros(0)
