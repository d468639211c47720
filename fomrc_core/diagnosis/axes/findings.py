"""What a diagnosis of several axes found: causes of the stage as a whole, and of single axes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from fomrc_core.diagnosis.diagnosis import Diagnosis

Value = float | str | list[float]


@dataclass(frozen=True, eq=False)
class AxesFinding:
    """A cause of several axes that was accepted.

    Attributes:
        cause: its name.
        kind: its form, where it has more than one; else empty.
        parameters: what it says of the stage, by name with unit; axes count from 1.
        standard_errors: of the numbers a fit moved, in its own units.
        percent_before: held-out error without it, of the displacements' rms [%].
        percent_after: the same with it [%].
        gain: (before - after) / (before - noise), of the errors' squares [1].
        p_value: of the hypothesis that it gains nothing on held-out samples.
        evidence: why it was accepted, in a sentence.
        meaning: what it is, in a sentence.
        experiment: where it is seen best.
        margin: by how much it was likelier than the next cause, in log likelihood [1].
        tied: causes it cannot be told from.
        probability: that it is the cause, and not another or one that is not in the library [1].
    """

    cause: str
    kind: str
    parameters: Mapping[str, Value]
    standard_errors: tuple[float, ...]
    percent_before: float
    percent_after: float
    gain: float
    p_value: float
    evidence: str
    meaning: str
    experiment: str
    margin: float
    tied: tuple[str, ...]
    probability: float = float("nan")

    def __str__(self) -> str:
        shown = ", ".join(f"{name} {_shown(value)}" for name, value in self.parameters.items())
        kind = f", {self.kind}" if self.kind else ""
        return (
            f"{self.cause}{kind} ({shown}): held-out error {self.percent_before:.4g} % -> {self.percent_after:.4g} %; "
            f"probability {100.0 * self.probability:.0f} %"
        )


@dataclass(frozen=True, eq=False)
class AxisDiagnosis:
    """The one-axis diagnosis of one axis, what the others and the modes do taken out.

    Attributes:
        axis: which, from 1.
        diagnosis: what one-axis causes it came to.
    """

    axis: int
    diagnosis: Diagnosis

    @property
    def causes(self) -> tuple[str, ...]:
        """Names of the one-axis causes found."""
        return tuple(finding.cause for finding in self.diagnosis.findings)

    def __str__(self) -> str:
        lines = [finding.sentence() for finding in self.diagnosis.findings] or [self.diagnosis.status.value]
        return "\n".join(f"axis {self.axis} by itself: {line}" for line in lines)


def _shown(value: Value) -> str:
    if isinstance(value, str):
        return value
    if isinstance(value, list):
        return "[" + ", ".join(f"{v:.4g}" for v in value) + "]"
    return f"{value:.4g}"
