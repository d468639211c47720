"""What an effect is: a cause with a place in the chain, a response, and where there is one an inverse."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from enum import IntEnum
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from fomrc_core.compute.arrays import ComplexArray
from fomrc_core.compute.pulse import beat
from fomrc_core.effects.base.cause import Cause
from fomrc_core.effects.base.course import Course
from fomrc_core.effects.base.covariates import Covariate
from fomrc_core.effects.base.evidence import Evidence
from fomrc_core.effects.base.parameter import Parameter
from fomrc_core.effects.base.step_form import StepForm
from fomrc_core.effects.base.term_scales import TermScales
from fomrc_core.errors import ParameterError

__all__ = ["Array", "Effect", "Parameter", "Stage", "in_chain_order"]

Array = NDArray[np.float64]


class Stage(IntEnum):
    """Which part of the chain an effect acts in; the chain runs in this order."""

    SAMPLED_DRIVE = 0  # on the drive at the samples
    DRIVE = 1  # on the drive between the samples as well
    HYSTERESIS = 2  # beside the Maxwell elements: its output is added to theirs, before creep
    MECHANICAL = 3  # on the displacement, between the samples as well
    SENSED = 4  # on the displacement at the samples


@dataclass(frozen=True)
class Effect(Cause):
    """A physical effect beside hysteresis and creep.

    A subclass is a frozen dataclass whose fields are its parameters; one file per effect.
    The state is one float64 array of fixed size, owned by the model's state.
    """

    stage: ClassVar[Stage]
    order: ClassVar[float]  # within the stage, smaller acts earlier; ours stand at 10, 20, ...
    covariate: ClassVar[Covariate | None] = None  # what it reads beside its input
    needs_substeps: ClassVar[bool] = False  # whether it matters to it how its input runs within a step
    widens_with_rate: ClassVar[bool] = False  # whether thresholds depend on how fast the drive moves within a step
    rings: ClassVar[bool] = False  # whether its response to a jump swings within few samples
    is_steady_tone: ClassVar[bool] = False  # a tone in time: it is told by a line of a spectrum, evenly sampled
    owns_columns: ClassVar[bool] = False  # its plays are columns of a fit's linear part, see ``plays``
    slope_depends_on_input: ClassVar[bool] = False  # whether ``linearized`` looks at its ``values``

    @property
    def follows_elements(self) -> bool:
        """Whether it acts on what the elements have switched: it then is told them, and its ``run`` the drive."""
        return False

    # --- in the chain

    def __str__(self) -> str:
        values = ((spec.name, getattr(self, spec.name)) for spec in self.parameters)
        shown = (f"{name}: {len(v)} values" if isinstance(v, tuple) else f"{name} {v:.5g}" for name, v in values)
        return f"{self.name} ({', '.join(shown)})"

    @property
    def place(self) -> float:
        """Return where within its stage it acts: ``order``, but for a cause that may stand in several places."""
        return self.order

    @abstractmethod
    def initial_state(self) -> Array:
        """Return the state at rest, shape (n_state,)."""

    def carried_state(self, old: Array) -> Array:
        """Return the state of one of its kind with other parameters as its own; at rest where that cannot be.

        Called where a model is replaced while it runs. A state that holds parameters keeps its own: only what the past
        has left there is taken over.

        Args:
            old: state of the effect that was in force.
        """
        own = self.initial_state()
        return old.copy() if old.shape == own.shape else own

    @abstractmethod
    def run(self, state: Array, values: Array, steps_s: Array, covariate: Array | None = None) -> Array:
        """Return the effect's output for each sample, shape (n_samples,); the state moves on.

        Args:
            state: from ``initial_state`` or a former call; changed in place.
            values: drive [V] or displacement [um], whichever the stage carries, shape (n_samples,).
            steps_s: step that leads to each sample [s], any lengths, shape (n_samples,).
            covariate: the signal named by the class's ``covariate``, where it is known, shape (n_samples,); for a
                mechanical effect that follows the elements the drive as they see it [V].
        """

    def invert(self, state: Array, values: Array, steps_s: Array, covariate: Array | None = None) -> Array:
        """Return the input that gives the wanted output; only where ``can_invert``.

        A compensator inverts effects of the hysteresis stage together with the elements: they need no ``invert``, but a
        state that is a ``knee_block`` (kernels.py).

        Raises:
            ParameterError: the effect has no inverse.
        """
        raise ParameterError("effect has no inverse", where=self.name, allowed=self.inverse_note)

    def response(self, frequency_hz: Array) -> ComplexArray | None:
        """Return the complex gain [1] of a linear effect at frequencies [Hz], of one shape; None where it has none.

        In continuous time: how the simulation divides steps is none of its business.
        """
        return None

    def undo_known(self, wanted: Array, course: Course) -> Array | None:
        """Return the input that gives a wanted output known as a whole; None where the effect is left as it is.

        Near is near enough: whoever asks compares what the chain then gives with what was wanted, and asks again. So an
        effect that changes little may return what is wanted. What needs the future takes it from the samples to come.

        Args:
            wanted: output [V] or [um], whichever the stage carries, shape (n_samples,).
            course: its samples.
        """
        if self.response(np.zeros(1)) is not None:
            return course.undone(wanted, self._gain)
        return self.invert(self.initial_state(), wanted, course.steps_s) if self.can_invert else None

    def sampled_every(self, step_s: float) -> Effect:
        """Return the effect as it is among even samples this far apart [s]; of its parameters few ask for that."""
        return self

    def _gain(self, frequency_hz: Array) -> ComplexArray:
        gain = self.response(frequency_hz)
        assert gain is not None
        return gain

    def warp(self, drive_v: Array) -> Array:
        """Return the drive [V] as the elements see it; only effects of the hysteresis stage are asked."""
        return drive_v

    def unwarp(self, warped_v: Array) -> Array:
        """Return the drive [V] that ``warp`` turns into this one."""
        return warped_v

    @property
    def holds(self) -> bool:
        """Whether the drive stands still from sample to sample; only effects at the samples are asked.

        Their ``run`` then returns what is held from each sample on, and what is read at a sample is the mean over half
        a sample before the jump and half a sample after it.
        """
        return False

    def widening(self, state: Array, drive_v: Array, steps_s: Array) -> Array | None:
        """Return by which factor the elements' thresholds are wider, (n_samples,); None where they are as they are.

        Only effects of the hysteresis stage are asked; the state moves on here, and ``run`` leaves it.

        Args:
            state: of the effect.
            drive_v: warped drive [V], shape (n_samples,).
            steps_s: step that leads to each sample [s], shape (n_samples,).
        """
        return None

    @classmethod
    def acts_before_record(cls) -> bool:
        """Return whether it acts on what went before a record, too; what a record's clock starts does not."""
        return cls.stage in (Stage.DRIVE, Stage.HYSTERESIS, Stage.MECHANICAL)

    def is_null(self) -> bool:
        """Return whether it changes nothing, not even a bit: all the response is linear in stands at zero."""
        return bool(self.linear_parameters) and not any(np.any(getattr(self, name)) for name in self.linear_parameters)

    def least_parts(self, effects: tuple[Effect, ...]) -> int:
        """Return into how many parts each step is at least divided for it.

        Args:
            effects: all effects of the chain, this one among them.
        """
        return 1

    def parts_of_turn(self, effects: tuple[Effect, ...], step_s: float, turn: float) -> int:
        """Return the same where a fit knows its steps, at most as many: what swings slowly needs fewer.

        Args:
            effects: all effects of the chain, this one among them.
            step_s: a step [s].
            turn: by how much what swings may turn in a part [rad].
        """
        return self.least_parts(effects)

    def turn_at_swing(self, values: Array, steps_s: Array, least: float) -> Array:
        """Return by what a step is to be divided where it swings, so that straight parts miss so little of it.

        Asked of what rings alone; as often as may be unless it knows better.

        Args:
            values: what drives it, shape (n_samples,).
            steps_s: step that leads to each sample [s], shape (n_samples,).
            least: what may be missed, in the unit of the values.

        Returns:
            Number of parts, not rounded, shape (n_samples,).
        """
        return np.full(values.size, np.inf)

    def step_form(self, shortest_part_s: float) -> StepForm | None:
        """Return the step for a controller, of which C and Python are made; None where there is none.

        Args:
            shortest_part_s: shortest part of a step that the state must have room for, one after the other [s].
        """
        return None

    # --- in a fit

    @classmethod
    def in_place_of_creep(cls, order: float, shortest_s: float, longest_s: float) -> list[Effect]:
        """Return instances that creep as nearly as they can as the power law, where they take its place.

        Args:
            order: of the power law [1].
            shortest_s: time after a step from which they shall agree [s].
            longest_s: time up to which they shall [s].
        """
        return []

    @classmethod
    def screening(cls, evidence: Evidence) -> Sequence[Effect]:
        """Return trial instances whose signatures a diagnosis compares with what the model left over."""
        return []

    def linearized(self, changes: Array, steps_s: Array, values: Array | None = None) -> Array:
        """Return the first-order change of the output for small changes of the input, (n_samples, n_changes).

        By default a mechanical effect is taken as linear and at rest, so that changes pass it like displacements, and
        an effect on the sensor as something added, which leaves changes as they are.

        Args:
            changes: changes of the input at each sample, shape (n_samples, n_changes).
            steps_s: step that leads to each sample [s], shape (n_samples,).
            values: the input itself [um], shape (n_samples,), for effects with ``slope_depends_on_input``.
        """
        if self.stage is not Stage.MECHANICAL:
            return changes
        passed = np.empty(changes.shape, order="F")  # each change is read and written as a whole
        for column in range(changes.shape[1]):
            beat("simulations")
            one = np.ascontiguousarray(changes[:, column])
            passed[:, column] = self.run(self.initial_state(), one, steps_s)
        return passed

    @classmethod
    def offered(cls, scales: TermScales) -> Effect | None:
        """Return all terms a diagnosis may choose from where no cause explains what is left; None with most effects.

        Each with weight one; ``terms`` gives them and ``with_terms`` those chosen.

        Args:
            scales: what the records are like.
        """
        return None

    @property
    def n_terms(self) -> int:
        """Number of terms, for effects that are a sum of them."""
        return 0

    def terms(self, state: Array, values: Array, steps_s: Array, covariate: Array | None = None) -> Array:
        """Return each term without its weight, shape (n_samples, n_terms); the state moves on."""
        return np.zeros((values.size, 0))

    def with_terms(self, chosen: Sequence[int], weights_um: Array) -> Effect:
        """Return the effect of some of the terms, with these weights [um]."""
        return self

    def check_terms(self, *names: str) -> None:
        """Raise ParameterError unless these lists have an entry for each weight of the terms."""
        n_weights = len(getattr(self, self.main_parameter))
        for name in names:
            if len(getattr(self, name)) != n_weights:
                raise ParameterError(
                    "as many as there are weights",
                    where=f"{self.name}.{name}",
                    value=len(getattr(self, name)),
                    allowed=f"{n_weights} numbers",
                )

    def memory(self) -> Array:
        """Return logarithms of the times or rates that are fitted beside the weights of terms, shape (n_numbers,)."""
        return np.zeros(0)

    def with_memory(self, logs: Array) -> Effect:
        """Return the effect with these in place of its ``memory``."""
        return self

    def weight_of_span(self) -> float:
        """Return the weight with which a term of size one moves as much as what it acts on, in the unit of weights."""
        return 1.0

    def words(self) -> str:
        """Return what the terms depend on, in words with "; on " between, the weightiest first; "" where none are."""
        return ""

    @property
    def cycle_um(self) -> float:
        """Way of the displacement after which what it adds comes again [um]; 0 where it does not."""
        return 0.0

    def plays(self) -> tuple[Array, Array, Array]:
        """Return thresholds [V], knees [V] and weights [um/V] of its plays, for effects that own columns.

        A fit takes such plays for columns of its linear part: the effect it moves holds none, and gets them back, with
        their weights, by ``with_plays``.
        """
        nothing = np.zeros(0)
        return nothing, nothing, nothing

    def with_plays(self, thresholds_v: Array, knees_v: Array, weights_um_per_v: Array) -> Effect:
        """Return the effect with these plays in place of its own."""
        return self

    def beside_elements(self, thresholds_v: Array, weights_um_per_v: Array, creep_order: float) -> Effect:
        """Return the effect beside elements of these half widths [V] and weights [um/V], (n_plays,), and this creep."""
        return self

    def of_plays(self, thresholds_v: Array, plays_v: Array, steps_s: Array) -> Array:
        """Return what a unit weight of each element makes an effect add that follows them [um], (n_samples, n_plays).

        Args:
            thresholds_v: half widths of the elements' plays [V], shape (n_plays,).
            plays_v: the plays themselves, before any creep [V], shape (n_samples, n_plays).
            steps_s: step that leads to each sample [s], shape (n_samples,).
        """
        return np.zeros(plays_v.shape)


def in_chain_order(effects: Iterable[Effect]) -> tuple[Effect, ...]:
    """Return effects in the order in which they act."""
    return tuple(sorted(effects, key=lambda effect: (effect.stage, effect.place, effect.name)))
