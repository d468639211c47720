"""What of the residuals noise that wanders as they do would not foresee, and what a cause explains of that.

Where something slow is left, few samples of it are independent, and what is quick and small shows in no share of all
that is left. By generalized least squares it shows: on the innovations of noise that wanders as the residuals do, each
direction in which the model can move taken out of both.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fomrc_core.compute.arrays import Array
from fomrc_core.compute.least_squares import gram_of, whitening_of
from fomrc_core.diagnosis.present_model import PresentModel
from fomrc_core.diagnosis.wander import Wander, wander_beside
from fomrc_core.records.noise import autocorrelation_inflation


@dataclass(frozen=True, eq=False)
class QuickView:
    """The innovations of the training records' residuals, used samples one record behind the other.

    Attributes:
        wander: noise that wanders as the residuals do.
        innovations_um: what it does not foresee of the residuals, what the model could explain of it taken out [um],
            shape (n_innovations,).
        directions: orthonormal directions in which the model can move them [1], shape (n_innovations, rank).
        variance_um2: of an independent one of them [um^2].
    """

    wander: Wander
    innovations_um: Array
    directions: Array
    variance_um2: float

    @classmethod
    def of(cls, present: PresentModel) -> QuickView:
        """Return the view of the training records."""
        masks = [record.is_used for record in present.records]
        left_um = [v[mask] for v, mask in zip(present.residuals_um, masks, strict=True)]
        wander = wander_beside(present.model, present.residuals_um, present.records)
        moved = [c[mask] for c, mask in zip(present.nuisance.columns, masks, strict=True)]
        columns = np.concatenate([wander.innovations(c) for c in moved])
        directions = columns @ whitening_of(gram_of([(columns, np.ones(len(columns), dtype=np.bool_))]))
        foreseen = np.concatenate([wander.innovations(v) for v in left_um])
        innovations_um = foreseen - directions @ (directions.T @ foreseen)
        power = float(innovations_um @ innovations_um)
        return cls(
            wander, innovations_um, directions, power * autocorrelation_inflation(innovations_um) / innovations_um.size
        )

    def explained(self, present: PresentModel, signatures_um: tuple[Array, ...]) -> float:
        """Return what a signature explains of the innovations, in units of their variance [1]."""
        used = zip(signatures_um, present.records, strict=True)
        shape = np.concatenate([self.wander.innovations(s[record.is_used]) for s, record in used])
        # the innovations are clear of the directions: only the signature's own power is not
        along = shape @ self.directions
        power = float(shape @ shape) - float(along @ along)
        moment = float(shape @ self.innovations_um)
        return moment**2 / (power * self.variance_um2) if power > 0.0 and self.variance_um2 > 0.0 else 0.0
