"""What a diagnosis came to: is what the model leaves noise, and how much of what the base missed is left.

Where the drive repeats itself or rests, the noise is known apart from any model, slow noise as well, and what is left
must be as small. Elsewhere it is known from what is left itself: whatever does not follow the drive, on data not
learned from, is noise as far as anyone can tell from these records.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum

import numpy as np

from fomrc_core.diagnosis.remainder import Dependence

_SIGNIFICANCE = 0.01  # of the hypothesis that nothing is left, for all tests together
_NEGLIGIBLE_SHARE = 0.1  # of the noise's power: it raises an rms by 5 %, about what a noise floor is known to
LARGEST_EXCESS = 1.2  # times the noise rms on held-out data, noise known apart from the model
# The same with a cause of dozens of weights: what a floor is known to, and no more. A floor that sees no slow noise is
# no measure of it: there such a cause may leave no more than LARGEST_EXCESS times what it leaves where it was learned.
_LARGEST_EXCESS_FLEXIBLE = 1.1
LARGEST_EXCESS_ANYWHERE = 1.5  # the same in the worst of all records, of which each has few independent samples
# Times the noise's power, of what weights learned from noise may err by: an estimate of it that is larger says that the
# records are too short for their noise, and not that anything may be left.
_LARGEST_LEARNING = 0.25
# Times the noise from sample to sample: slow noise of a sensor (1 / f from the sample rate down) comes to two or three,
# of one behind a filter to some more.
LARGEST_SLOW = 8.0
# Times what is left in training: noise is as large in every record, but for what grows with the displacement.
_LARGEST_CARRYING = 2.0
LEAST_BELIEVED = 0.5  # probability of a name: below, it is likelier wrong than right
# Of all names of an explanation together, which is right only where each of them is: the least at which no more than
# one in a hundred answers is explained and wrong. Of 464 cases (seeds from 120000 and 130000, used up), with
# probabilities learned from others in ten folds, 201 are explained rightly and 4 wrongly: what other doubts refuse is
# not among them, so that more are right than the names alone say. At 80 % it would be 196 and 4, at 70 % 204 and 6.
_LEAST_EXPLAINING = 0.75
# Of each of them: however few the names are, one that is wrong is wrong. Most of all of one whose form bends to much:
# where a cause is not in the library its near kin leaves as little. Of 107 right and 3 wrong explanations (seeds from
# 350000, used up) 106 and 1 have no name below.
LEAST_OF_EACH, LEAST_OF_BENDING = 0.85, 0.9
_MOST_UNEXPLAINED = 0.1  # of the power by which the base missed the data


class Status(Enum):
    """What a diagnosis came to."""

    EXPLAINED = "explained"
    SUSPECT = "suspect"
    AMBIGUOUS = "ambiguous"
    UNEXPLAINED = "unexplained"
    NOTHING_FOUND = "nothing_found"


def doubts_of_names(probabilities: Sequence[float], asked: Sequence[float] = ()) -> tuple[str, ...]:
    """Return why names as sure as these explain nothing, however little they leave; empty where they do.

    Args:
        probabilities: of each cause found, that it is the cause [1].
        asked: probability that each must have at least [1]; LEAST_OF_EACH unless given.
    """
    names, told, least = "the names are all", math.prod(probabilities), _LEAST_EXPLAINING
    if told >= least:
        pairs = zip(probabilities, asked or [LEAST_OF_EACH] * len(probabilities), strict=True)
        names, (told, least) = "one of the names is", min(pairs, key=lambda pair: pair[0] - pair[1], default=(1.0, 0.0))
    if told >= least:
        return ()
    names = "the name is" if len(probabilities) == 1 else names
    # rounded down: what is not enough must not read as if it were
    percent = math.floor(100.0 * told)
    return (f"{names} right with a probability of {percent} %, and an explanation asks for {100.0 * least:.0f} %",)


@dataclass(frozen=True)
class Judgement:
    """Whether what is left is noise.

    Attributes:
        noise_um: rms of the noise, as well as it is known [um].
        is_noise: whether what is left is noise, or so near it that it makes no difference.
        unexplained_share: share of the power by which the base missed the data that is left [1].
        dependences: what the rest was tested for, and what came of it.
        reasons: why it is not taken for noise, in words; empty where it is.
        rests_on: what it is taken for noise on, beside the tests, in words.
    """

    noise_um: float
    is_noise: bool
    unexplained_share: float
    dependences: tuple[Dependence, ...]
    reasons: tuple[str, ...]
    rests_on: tuple[str, ...] = ()

    def status(
        self, probabilities: Sequence[float], is_tied: bool, has_stand_ins: bool = False, asked: Sequence[float] = ()
    ) -> Status:
        """Return the word for it.

        Args:
            probabilities: of each cause found, that it is the cause.
            is_tied: whether one of them has an equal.
            has_stand_ins: whether something stands in for what has no name: then not everything is explained.
            asked: probability that each must have at least; LEAST_OF_EACH unless given.
        """
        if not probabilities:
            return Status.NOTHING_FOUND if self.is_noise and not has_stand_ins else Status.UNEXPLAINED
        if is_tied:
            return Status.AMBIGUOUS
        is_doubted = not self.is_noise or bool(self.doubts(probabilities, has_stand_ins, asked))
        return Status.SUSPECT if is_doubted else Status.EXPLAINED

    def doubts(
        self, probabilities: Sequence[float], has_stand_ins: bool = False, asked: Sequence[float] = ()
    ) -> tuple[str, ...]:
        """Return why what was named does not explain what the base missed, in words; empty where it does.

        Args:
            probabilities: of each cause found, that it is the cause; where there is none only what is left is told.
            has_stand_ins: whether something stands in for what has no name.
            asked: probability that each must have at least; LEAST_OF_EACH unless given.
        """
        doubts = [f"what is left is not noise: {reason}" for reason in self.reasons]
        if not probabilities:
            return tuple(doubts)
        if self.unexplained_share > _MOST_UNEXPLAINED:
            left, most = 100.0 * self.unexplained_share, 100.0 * _MOST_UNEXPLAINED
            doubts.append(f"{left:.0f} % of the power the base missed the data by is left, more than {most:.0f} %")
        if has_stand_ins:
            doubts.append("something is followed that has no name")
        doubts += doubts_of_names(probabilities, asked)
        return tuple(doubts)


def judge(
    floor_um: float,
    sees_slow_noise: bool,
    before_um: float,
    after_um: float,
    worst_um: float,
    dependences: Sequence[Dependence],
    learning_excess: float = 0.0,
    learned_um: float = math.inf,
    is_flexible: bool = False,
) -> Judgement:
    """Return whether what a model leaves is noise.

    Args:
        floor_um: noise rms known apart from the model [um].
        sees_slow_noise: whether slow noise is in it; without, the noise may be larger than the floor.
        before_um: rms of the base model on held-out data [um].
        after_um: rms of the extended model there [um].
        worst_um: rms of the extended model in the worst of all records [um].
        dependences: tests of what is left.
        learning_excess: share of the noise's power by which a right model, learned from these noisy samples, errs on
            held-out data [1].
        learned_um: rms of the extended model on the data it learned from [um].
        is_flexible: whether a cause with many weights of its own was found, which bends to much that is none: it is
            believed only where it leaves what is known to be noise apart from it.
    """
    # Many arguments: each is measured somewhere else, and no two are ever handed on together.
    excess = min(learning_excess, _LARGEST_LEARNING)
    sure = [d for d in dependences if d.p_value * len(dependences) < _SIGNIFICANCE]
    share = max((d.share for d in sure), default=0.0)
    undriven_um = after_um * math.sqrt(1.0 - share)
    noise_um = floor_um if sees_slow_noise else max(floor_um, undriven_um)
    reasons = []
    carried_um = learned_um * math.sqrt((1.0 + excess) / (1.0 - excess))
    # weights learned from noise that is correlated with itself err, which follows the drive, however right the model:
    # where more is left than such weights leave held out, no noise excuses what follows the drive
    excused = excess / (1.0 + excess) if after_um <= LARGEST_EXCESS * carried_um else 0.0
    if share > _NEGLIGIBLE_SHARE + excused:
        worst = max(sure, key=lambda d: d.share)
        says = "follows from" if worst.is_of_drive else "is"
        reasons.append(f"{100.0 * worst.share:.0f} % of its power {says} {worst.on} (p {worst.p_value:.1g})")
    expected_um = floor_um * math.sqrt(1.0 + excess)
    if sees_slow_noise and after_um > LARGEST_EXCESS * expected_um:
        reasons.append(f"it is {after_um / floor_um:.2f} times the noise of repeats and rests on held-out data")
    if sees_slow_noise and worst_um > LARGEST_EXCESS_ANYWHERE * expected_um:
        reasons.append(f"it is {worst_um / floor_um:.2f} times that noise in one of the records")
    # a cause that bends to much else must leave what is known to be noise, or at least carry all that it learned
    if is_flexible and sees_slow_noise and after_um > _LARGEST_EXCESS_FLEXIBLE * floor_um:
        reasons.append(f"it is {after_um / floor_um:.2f} times the known noise, with a cause that bends to much else")
    if is_flexible and not sees_slow_noise and after_um > LARGEST_EXCESS * carried_um:
        times = f"{after_um / learned_um:.2f} times what is left of the data it was learned from"
        reasons.append(f"it is {times}, with a cause that bends to much else")
    # also in a record that only chose among causes: what explains the one and not the other explains neither
    carried_to_um = max(after_um, worst_um)
    if carried_to_um > _LARGEST_CARRYING * carried_um:
        reasons.append(f"it is {carried_to_um / learned_um:.2f} times what is left of the data it was learned from")
        noise_um = max(floor_um, min(noise_um, carried_um))
    if not sees_slow_noise and noise_um > LARGEST_SLOW * floor_um:
        reasons.append(
            f"it is {noise_um / floor_um:.1f} times the noise from sample to sample, and no repeat shows it to be noise"
        )
        noise_um = floor_um  # of the rest nobody knows that it is noise, and it counts as unexplained
    unavoidable = noise_um**2 * (1.0 + excess)
    missed = before_um**2 - unavoidable
    left = max(after_um**2 - unavoidable, 0.0)
    unexplained = float(np.clip(left / missed, 0.0, 1.0)) if missed > 0.0 else 0.0
    return Judgement(noise_um, not reasons, unexplained, tuple(dependences), tuple(reasons))
