"""Compile the plain C reference with gcc and run it on a model."""

from __future__ import annotations

import ctypes
import shutil
import subprocess
import tempfile
from pathlib import Path

import numpy as np

from fomrc_core.model.piezo_model import PiezoModel
from fomrc_core.operators import creep
from fomrc_core.operators.hysteresis import OperatorSum

FLAGS = {
    "gcc -O3": ["-O3"],
    "gcc -O3 -march=native": ["-O3", "-march=native"],
    "gcc -O3 -march=native -ffast-math": ["-O3", "-march=native", "-ffast-math"],
}
_POINTER = ctypes.POINTER(ctypes.c_double)


class _Chain(ctypes.Structure):
    _fields_ = (
        [(name, ctypes.c_size_t) for name in ("n_plays", "n_modes")]
        + [(name, ctypes.c_double) for name in ("slope", "current", "held", "previous")]
        + [
            (name, _POINTER)
            for name in (
                "thresholds",
                "weights",
                "decays",
                "from_previous",
                "from_current",
                "weighted_decays",
                "plays",
                "modes",
            )
        ]
    )


def _pointer(array):
    return array.ctypes.data_as(_POINTER)


def _aligned(values):
    """Copy to where vector loads are fastest: the reference shall not lose for its addresses."""
    space = np.zeros(values.size + 8)
    start = (-space.ctypes.data // 8) % 8
    copy = space[start : start + values.size]
    copy[:] = values
    return copy


class CReference:
    """The reference for one model and step length, compiled with one set of flags."""

    def __init__(self, model: PiezoModel, step_s: float, flags: list[str]) -> None:
        source = Path(__file__).with_name("reference.c")
        with tempfile.TemporaryDirectory() as folder:
            library = Path(folder) / "reference.so"
            subprocess.run(["gcc", *flags, "-shared", "-fPIC", str(source), "-o", str(library)], check=True)
            self._library = ctypes.CDLL(str(library))
        self._model, self._step_s = model, step_s

    def run(self, name: str, values: np.ndarray, out: np.ndarray) -> None:
        """Run ``forward``, ``inverse`` or ``stops`` from the relaxed state."""
        form = self._model.play_form if name == "forward" else self._model.stop_form
        chain, kept = self._chain(form)
        getattr(self._library, name)(ctypes.byref(chain), ctypes.c_size_t(values.size), _pointer(values), _pointer(out))
        del kept

    def _chain(self, form: OperatorSum):
        block = creep.creep_block(self._model.creep_modes)
        creep.prepare_step(block, 0, self._step_s)
        n = self._model.creep_modes.n_modes
        arrays = block[creep.HEADER :].reshape(-1, n)
        kept = [
            _aligned(a)
            for a in (
                form.thresholds,
                form.weights,
                arrays[creep.DECAY],
                arrays[creep.FROM_PREVIOUS],
                arrays[creep.FROM_CURRENT],
                arrays[creep.WEIGHTED_DECAY],
                np.zeros(form.thresholds.size),
                np.zeros(n),
            )
        ]
        scalars = (form.slope, block[creep.CURRENT_WEIGHT], block[creep.HELD_WEIGHT], 0.0)
        return _Chain(form.thresholds.size, n, *scalars, *(_pointer(a) for a in kept)), kept


def available() -> bool:
    """Tell whether gcc is there."""
    return shutil.which("gcc") is not None
