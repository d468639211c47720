"""Which causes the screening finds worth a joint refit."""

from __future__ import annotations

import numpy as np

from fomrc_core.diagnosis.data_split import MUCH_LEFT, DataSplit, held_squared_error
from fomrc_core.diagnosis.leverage import expected_excess
from fomrc_core.diagnosis.present_model import PresentModel, residual_inflation
from fomrc_core.diagnosis.screening import Screened
from fomrc_core.model.causes import cause_classes

_MAX_CANDIDATES = 8  # refitted in one round: as many as there are kinds of lag, which screen alike
_MIN_SCREENED = 25.0  # explained sum of squares over noise variance and correlation
_MOST_QUICK = 2  # beside them, of those that are surest once what is slow is taken out: mostly they are among them
_LEAST_SHARE = 0.005  # of the squared error: what explains less is no finding, however sure
_ENOUGH_SHARE = 0.1  # what explains as much is tried, however few samples a slow cause leaves independent
_CLOSE_TO_BEST = 0.2  # of what the best signature explains; a cause that explains less waits for another round
_UNPROMISING = 4  # of those few
_LARGEST_INFLATION = 200.0  # a residual that drifts as a whole is correlated without end


def worth_a_refit(present: PresentModel, split: DataSplit, screened: tuple[Screened, ...]) -> list[list[Screened]]:
    """Return the trial instances of each cause that may explain much, the likeliest first."""
    error = present.squared_error
    inflation = residual_inflation(present.residuals_um, split.train)
    variance = error / split.n_used
    limit = min(_MIN_SCREENED * variance * min(inflation, _LARGEST_INFLATION), _ENOUGH_SHARE * error)
    held_error = held_squared_error(present.model, split.held)
    # what weights learned from noise err there, any shape may explain
    learned = max(
        expected_excess(present.model, split.train, part, min(inflation, _LARGEST_INFLATION)) for part in split.held
    )
    n_held = sum(int(np.count_nonzero(part.record.is_used)) for part in split.held)
    learned_error = min(learned, 1.0) * min(split.noise_um**2 * n_held, held_error)
    held_limit = max(limit, _LEAST_SHARE * held_error, learned_error)
    limit = max(limit, _LEAST_SHARE * error)
    by_cause: dict[str, list[Screened]] = {}
    for trial in screened:
        is_sure = trial.explained > limit or trial.beside_slow > _MIN_SCREENED
        if is_sure or trial.explained_held > held_limit:
            by_cause.setdefault(trial.name, []).append(trial)
    if not by_cause:
        # what a large effect explains at full size its slope does not tell: the likeliest few are fitted all the same
        best = [trial for trial in screened if error > MUCH_LEFT * split.noise_um2]
        for trial in best:
            if len(by_cause) < _UNPROMISING or trial.name in by_cause:
                by_cause.setdefault(trial.name, []).append(trial)
    if not by_cause:
        return []
    likely = _likely({name: trials[0].explained for name, trials in by_cause.items()})
    held = {name: max(t.explained_held for t in trials) for name, trials in by_cause.items()}
    likely += [name for name in _likely(held) if name not in likely]
    quick = {name: max(t.beside_slow for t in trials) for name, trials in by_cause.items()}
    surest = sorted((name for name in quick if quick[name] > _MIN_SCREENED), key=lambda name: -quick[name])
    likely += [name for name in surest[:_MOST_QUICK] if name not in likely]
    most_held = max(held.values())

    def worth(trial: Screened) -> float:
        # what the base absorbs in training is told apart on the held-out record
        return trial.explained / error + (trial.explained_held / most_held if most_held > 0.0 else 0.0)

    # a scan takes longest: begun last it would be waited for
    likely.sort(key=lambda name: not cause_classes()[name].is_scanned)
    return [sorted(by_cause[name], key=worth, reverse=True) for name in likely]


def _likely(explained: dict[str, float]) -> list[str]:
    best = max(explained.values())
    names = [name for name, value in explained.items() if value > _CLOSE_TO_BEST * best and value > 0.0]
    names.sort(key=lambda name: -explained[name])
    # what befalls a record follows no drive: none of those that screen alike stands for it
    befalls = [name for name in names[_MAX_CANDIDATES:] if cause_classes()[name].is_record_bound]
    return names[:_MAX_CANDIDATES] + befalls
