"""Descents of an identification kept as they proceed: one that was stopped goes on with the step it was at.

An identification is the same sequence of descents whenever it is begun anew from the same records. Each is known by
all it depends on - records, drives, start, what is free, when it ends - so that none is taken for another, and leads,
from the last point kept, bit for bit where it would have led.
"""

from __future__ import annotations

import base64
import hashlib
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from fomrc_core.compute.arrays import Array
from fomrc_core.identification.axes.periodic import PeriodicRecord
from fomrc_core.storage.kept_work import KeptWork, fingerprint_of

_PAUSE_S = 1.0  # between two writings: a kill loses no more, and writing takes no time worth the name


class _HasVector(Protocol):
    def vector(self) -> Array: ...


class _AxesPoint(Protocol):
    @property
    def parameters(self) -> _HasVector: ...

    @property
    def squared_error(self) -> float: ...


def digest_of(arrays: Iterable[NDArray[Any]]) -> bytes:
    """Return what tells these arrays from all others."""
    digest = hashlib.sha256()
    for values in arrays:
        digest.update(repr((values.shape, values.dtype.str)).encode())
        digest.update(np.ascontiguousarray(values).tobytes())
    return digest.digest()[:16]


class KeptDescents:
    """Descents of one identification.

    Args:
        work: the file they are kept in; None keeps nothing.
    """

    def __init__(self, work: KeptWork | None = None) -> None:
        self._work = work

    def trail(self, fit_digest: Callable[[], bytes], *begin: NDArray[Any]) -> KeptTrail:
        """Return the trail of a descent.

        Args:
            fit_digest: of the fit it is of, asked where anything is kept.
            begin: where it begins, and all else it depends on.
        """
        if self._work is None:
            return KeptTrail(None, "")
        return KeptTrail(self._work, (fit_digest() + digest_of(begin)).hex())


class KeptTrail:
    """The trail of one descent, see ``compute.gauss_newton.Trail``.

    Attributes:
        vector: parameters of the last point kept, None where there is none.
        begun: linearizations made before it, and the damping there.
        is_done: whether the descent ended there.
    """

    def __init__(self, work: KeptWork | None, name: str) -> None:
        self._work, self._name = work, name
        self.vector: Array | None = None
        self.begun: tuple[int, float] | None = None
        self.is_done = False
        kept = None if work is None else work.get(name)
        try:
            if kept is not None:
                self.vector = np.frombuffer(base64.b64decode(kept["vector"]), dtype="<f8").astype(np.float64)
                self.begun = int(kept["n_done"]), float(kept["damping"])
                self.is_done = bool(kept["is_done"])
        except (KeyError, TypeError, ValueError):
            self.vector, self.begun, self.is_done = None, None, False  # not ours: done anew

    def note(self, point: _AxesPoint, n_done: int, damping: float) -> None:
        """Keep a point on the way."""
        self._keep(point, n_done, damping, False)

    def end(self, point: _AxesPoint) -> None:
        """Keep the last point."""
        self._keep(point, 0, 0.0, True)

    def _keep(self, point: _AxesPoint, n_done: int, damping: float, is_done: bool) -> None:
        if self._work is None:
            return
        vector = base64.b64encode(point.parameters.vector().astype("<f8").tobytes()).decode()
        self._work.keep(self._name, {"vector": vector, "n_done": n_done, "damping": damping, "is_done": is_done})


def kept_identification(path: Path | None, records: tuple[PeriodicRecord, ...], options: object) -> KeptWork:
    """Return what an identification of these records with these options has kept in a file, or is to keep.

    Args:
        path: the file; None keeps nothing.
        records: what is identified from.
        options: all that is asked for, by its repr.
    """
    contents = [repr(options).encode()]
    for record in records:
        arrays = (record.lines, record.voltage_v, record.displacement, record.rms_um, record.noise_um)
        contents.append(repr((record.name, record.rate_hz, record.n_samples)).encode())
        contents.extend(values.tobytes() for values in arrays)
    return KeptWork(path, fingerprint_of(contents), _PAUSE_S)
