"""Joint screening: which two causes together leave least of what the model left over.

What one cause explains alone says little where several act: each bends to what the others leave, and the likeliest
alone may be none of them. The signatures of a screening are directions of a linear model, of which the best two are
told without a simulation (best subset selection: Hocking and Leslie, 1967; Miller, 2002, Subset selection in
regression). What brings plays of its own takes no part: they bend to what two others leave as well as to one.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import zip_longest

import numpy as np
from numpy.typing import NDArray

from fomrc_core.compute.arrays import Array
from fomrc_core.diagnosis.screening import Screened

_Form = tuple[str, tuple[object, ...]]  # name of a cause, and what no fit changes of it

_MOST_TRIALS = 8  # of a cause: of more the others differ little
# Power of a direction beside another, of its own: below it the two are one direction, and what is between them is a
# difference of large sizes that no signature, which is a slope, foresees.
_LEAST_APART = 1e-3


@dataclass(frozen=True, eq=False)
class LikelyPair:
    """Two causes that together leave little.

    Attributes:
        one: trial instances of the one cause, sized to act beside the other: of what belongs to single records one for
            each of them.
        other: the same of the other cause.
        left: share of the squared error that the two leave [1].
        alike: other pairs that explain nearly the same, that which leaves least first.
        other_forms: the same two in other forms, that which leaves least first: no fit leads from one to another.
    """

    one: tuple[Screened, ...]
    other: tuple[Screened, ...]
    left: float
    alike: tuple[LikelyPair, ...] = ()
    other_forms: tuple[LikelyPair, ...] = ()

    @property
    def names(self) -> frozenset[str]:
        """Names of the two."""
        return frozenset((self.one[0].name, self.other[0].name))

    @property
    def all_names(self) -> frozenset[frozenset[str]]:
        """Names of the two, and of each pair that is alike."""
        return frozenset((self.names, *(pair.names for pair in self.alike)))

    def with_form(self, pair: LikelyPair) -> LikelyPair:
        """Return the pair with these two, its own or alike to it, in another form."""
        if pair.names == self.names:
            return replace(self, other_forms=(*self.other_forms, pair))
        alike = (each.with_form(pair) if each.names == pair.names else each for each in self.alike)
        return replace(self, alike=tuple(alike))


@dataclass(frozen=True, eq=False)
class _Member:
    """Trials of one cause that act together.

    Attributes:
        trials: of what belongs to single records one for each, else one.
        shape: the direction they give, of length 1.
        size: what its length was [um].
    """

    trials: tuple[Screened, ...]
    shape: NDArray[np.float32]
    size: float

    @classmethod
    def of(cls, trials: tuple[Screened, ...], shape_um: Array) -> _Member:
        size = float(np.linalg.norm(shape_um))
        return cls(trials, np.asarray(shape_um / size, dtype=np.float32), size)

    @property
    def form(self) -> _Form:
        return self.trials[0].name, self.trials[0].cause.form()

    @property
    def has_own_times(self) -> bool:
        return self.trials[0].cause.has_own_times()

    @property
    def takes_either_sign(self) -> bool:
        return self.trials[0].cause.takes_either_sign()

    def sized(self, length_um: float) -> tuple[Screened, ...]:
        """Return the trials, so large that they explain that much."""
        return tuple(replace(trial, amplitude=length_um / self.size * trial.amplitude) for trial in self.trials)


@dataclass(frozen=True, eq=False)
class _Place:
    """Two members together.

    Attributes:
        explained_um2: what they explain of the squared error [um^2].
        at: numbers of the members, shape (2,).
        lengths_um: of what each explains [um], shape (2,).
    """

    explained_um2: float
    at: NDArray[np.int64]
    lengths_um: Array

    def apart_um2(self, other: _Place, gram: Array) -> float:
        """Return the power of the difference of what the two explain [um^2]."""
        at = np.concatenate((self.at, other.at))
        lengths = np.concatenate((self.lengths_um, -other.lengths_um))
        return float(lengths @ gram[np.ix_(at, at)] @ lengths)


def likely_pairs(
    screened: Sequence[Screened],
    clear_um: NDArray[np.float32],
    n_most: int,
    with_cause: str | None = None,
    given_up: frozenset[str] = frozenset(),
) -> tuple[LikelyPair, ...]:
    """Return pairs of causes, that which leaves least first, each unlike those before it.

    Two pairs are alike where what they explain differs by less than what they leave: kin of one lag, in most cases. No
    pair is of two that come and go at times no fit moves: a load makes up for an opening whose times are not yet right.

    Args:
        screened: the trial instances with their signatures.
        clear_um: sketch of what is left [um], shape (n_kept,), as in the signatures.
        n_most: number of pairs.
        with_cause: only pairs that have this one, where given.
        given_up: no pair is of two of these.
    """
    members = _members(screened)
    error = float(np.dot(clear_um, clear_um))
    if len(members) < 2 or not error > 0.0:
        return ()
    shapes = np.stack([member.shape for member in members])
    gram = np.asarray(shapes @ shapes.T, dtype=np.float64)
    moment = np.asarray(shapes @ clear_um, dtype=np.float64)
    best: dict[frozenset[_Form], _Place] = {}
    for place in _places(members, gram, moment):
        if all(members[k].has_own_times for k in place.at):
            continue
        forms = frozenset(members[k].form for k in place.at)
        names = frozenset(name for name, _ in forms)
        is_asked = (with_cause is None or with_cause in names) and not names <= given_up
        if is_asked and (forms not in best or place.explained_um2 > best[forms].explained_um2):
            best[forms] = place
    chosen: list[tuple[_Place, LikelyPair]] = []
    for place in sorted(best.values(), key=lambda found: -found.explained_um2):
        one, other = (members[k].sized(length) for k, length in zip(place.at, place.lengths_um, strict=True))
        pair = LikelyPair(one, other, 1.0 - place.explained_um2 / error)
        known = next((k for k, (_, first) in enumerate(chosen) if pair.names in first.all_names), None)
        if known is not None:
            chosen[known] = chosen[known][0], chosen[known][1].with_form(pair)
            continue
        left = error - place.explained_um2
        near = next((k for k, (first, _) in enumerate(chosen) if first.apart_um2(place, gram) < left), None)
        if near is not None:
            chosen[near] = chosen[near][0], replace(chosen[near][1], alike=(*chosen[near][1].alike, pair))
        elif len(chosen) < n_most:
            chosen.append((place, pair))
    return tuple(pair for _, pair in chosen)


def _members(screened: Sequence[Screened]) -> list[_Member]:
    by_name: dict[str, list[Screened]] = {}
    for trial in screened:
        if trial.sketch is not None and np.any(trial.sketch) and trial.amplitude != 0.0:
            by_name.setdefault(trial.name, []).append(trial)
    members: list[_Member] = []
    for trials in by_name.values():
        if any(trial.index is not None for trial in trials):
            # of what befalls single records one of each acts together: the best of all, the second of all
            by_share = sorted(trials, key=lambda t: -t.explained)
            of_record = [[t for t in by_share if t.index == index] for index in {t.index for t in trials}]
            columns = zip_longest(*(own[:_MOST_TRIALS] for own in of_record))
            groups = [tuple(t for t in column if t is not None) for column in columns]
        else:
            by_share = sorted(trials, key=lambda t: -(t.amplitude**2) * t.signature_power)
            of_forms = {t.cause.form(): t for t in reversed(by_share)}.values()
            further = [t for t in of_forms if not any(t is known for known in by_share[:_MOST_TRIALS])]
            groups = [(trial,) for trial in (*by_share[:_MOST_TRIALS], *further)]
        for group in (tuple(replace(t, amplitude=_directed(t)) for t in group) for group in groups):
            shapes = [t.amplitude * t.sketch.astype(np.float64) for t in group if t.sketch is not None]
            members.append(_Member.of(group, np.sum(shapes, axis=0)))
    return members


def _directed(trial: Screened) -> float:
    """Return its amplitude, of what acts in one direction only its size: beside another it may be right."""
    return trial.amplitude if trial.cause.takes_either_sign() else abs(trial.amplitude)


def _places(members: list[_Member], gram: Array, moment: Array) -> Iterator[_Place]:
    """Return each two members of different causes together, as large as explains most."""
    either = np.array([member.takes_either_sign for member in members])
    names = np.array([member.trials[0].name for member in members])
    for a in range(len(members)):
        shared = gram[a]
        apart = 1.0 - shared**2
        with np.errstate(divide="ignore", invalid="ignore"):
            length = (moment - shared * moment[a]) / apart
            own = moment[a] - shared * length
            explained = own * moment[a] + length * moment
        may = (apart > _LEAST_APART) & (names != names[a]) & (either | (length > 0.0))
        may &= np.arange(len(members)) > a
        if not either[a]:
            may &= own > 0.0
        for b in np.flatnonzero(may):
            yield _Place(float(explained[b]), np.array([a, b]), np.array([own[b], length[b]]))
