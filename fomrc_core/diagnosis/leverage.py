"""Which samples of a record those of others determine: the leverage of a linear fit (Hoaglin and Welsch, 1978)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fomrc_core.compute.least_squares import product
from fomrc_core.diagnosis.data_split import HeldOut
from fomrc_core.fitting.fit_record import FitRecord
from fomrc_core.fitting.linear_part import tangent
from fomrc_core.fitting.trial_model import TrialModel

_LARGEST = 10.0  # times its mean over the learned samples, number of columns over number of samples
_RIDGE = 1e-9  # of orthonormal columns, whose moment is 1: far below what any sample determines


def determined(
    model: TrialModel, learned: tuple[FitRecord, ...], asked: tuple[NDArray[np.bool_], ...]
) -> tuple[NDArray[np.bool_], ...]:
    """Return those of the asked samples whose prediction the learned samples determine, per record.

    The one rise in which the drive reaches its highest voltage moves plays that nothing else moves: a fit without it
    says nothing about it, whatever the model.

    Args:
        model: the model; its linear part is what is learned.
        learned: records, their used samples those that are learned from.
        asked: per record, samples that may be predicted, shape (n_samples,).
    """
    whole = tuple(r.using(r.is_used | a) for r, a in zip(learned, asked, strict=True))
    directions = tangent(model, whole)
    n = directions.whitening.shape[1]
    moment = np.zeros((n, n))
    for columns, record in zip(directions.columns, learned, strict=True):
        moment += directions.whitening.T @ product(columns, columns, record.is_used) @ directions.whitening
    # what was not learned at all has a leverage without bound; the ridge keeps it finite
    values, vectors = np.linalg.eigh(moment + _RIDGE * np.eye(n))
    whitening = directions.whitening @ (vectors / np.sqrt(np.maximum(values, _RIDGE)))
    largest = _LARGEST * n / sum(int(np.count_nonzero(r.is_used)) for r in learned)
    found = []
    for columns, mask in zip(directions.columns, asked, strict=True):
        rows = columns[mask] @ whitening
        is_determined = mask.copy()
        is_determined[mask] = np.einsum("ij,ij->i", rows, rows) <= largest
        found.append(is_determined)
    return tuple(found)


def expected_excess(model: TrialModel, learned: tuple[FitRecord, ...], part: HeldOut, inflation: float) -> float:
    """Return by what share the error on a held-out stretch exceeds the noise's power, however right the model [1].

    Weights are learned from noisy samples, and noise that is correlated with itself says less: a prediction errs by
    ``leverage * inflation`` times the noise's power beside the noise itself (Hoaglin and Welsch, 1978).

    Args:
        model: the model; its linear part is what is learned.
        learned: records it was fitted to.
        part: the stretch.
        inflation: by how much the mean of the noise varies more than if it were white [1].
    """
    whitening = tangent(model, learned).whitening
    columns = tangent(model.alone(part.index), (part.record,)).columns[0]
    rows = columns[part.record.is_used] @ whitening
    return inflation * float(np.mean(np.sum(rows * rows, axis=1)))
