"""An exported model compiled into a library, run over whole arrays: for comparing it with Python, and for timing."""

from __future__ import annotations

import ctypes
import shutil
import subprocess
import tempfile
from pathlib import Path

import numpy as np

from fomrc_core.export import ExportOptions, Precision, export_model
from fomrc_core.model.piezo_model import PiezoModel

FLAGS = ("-std=c99", "-O2")

_DRIVER = """
#include "NAME.h"
static NAME_WAY state;
void reset(void) { NAME_WAY_init(&state); }
size_t state_bytes(void) { return sizeof state; }
void run_fixed(size_t n, const NAME_real *in, NAME_real *out)
{
    for (size_t k = 0; k < n; k++) out[k] = NAME_WAY_step_fixed(&state, in[k]);
}
void run_any(size_t n, const NAME_real *in, const NAME_real *step_s, NAME_real *out)
{
    for (size_t k = 0; k < n; k++) out[k] = NAME_WAY_step(&state, in[k], step_s[k]);
}
"""
_COVARIATES = """
void run_beside(size_t n, const NAME_real *in, const NAME_real *step_s, NAME_real *out
    PARAMETERS)
{
    for (size_t k = 0; k < n; k++) {
SETTINGS
        out[k] = step_s ? NAME_WAY_step(&state, in[k], step_s[k]) : NAME_WAY_step_fixed(&state, in[k]);
    }
}
"""
_LIMITED = """
void run_limited(size_t n, const NAME_real *in, NAME_real *out)
{
    for (size_t k = 0; k < n; k++) out[k] = NAME_WAY_step_fixed_limited(&state, &NAME_default_limits, in[k]);
}
"""


class Exported:
    """One direction of an exported model, compiled; the model and the driver in files of their own, as in a controller.

    Args:
        model: what to export.
        options: how; its direction is taken from ``way``.
        way: "forward" or "inverse".
        compiler: C compiler.
        flags: its flags.
    """

    def __init__(
        self,
        model: PiezoModel,
        options: ExportOptions,
        way: str,
        compiler: str = "gcc",
        flags: tuple[str, ...] = FLAGS,
    ) -> None:
        self.options = options
        self.way = way
        self.dtype = np.float32 if options.precision is Precision.FLOAT else np.float64
        with tempfile.TemporaryDirectory() as temporary:
            folder = Path(temporary)
            export_model(model, folder, options)
            text = _DRIVER + (_LIMITED if way == "inverse" else "")
            header = (folder / f"{options.name}.h").read_text()
            self._covariates = [name for name in ("temperature_c", "cross") if f"{way}_set_{name}(" in header]
            if self._covariates:
                told = "".join(f", const NAME_real *{name}" for name in self._covariates)
                settings = "\n".join(f"        NAME_WAY_set_{c}(&state, {c}[k]);" for c in self._covariates)
                text += _COVARIATES.replace("PARAMETERS", told).replace("SETTINGS", settings)
            (folder / "driver.c").write_text(text.replace("NAME", options.name).replace("WAY", way))
            library = folder / "model.so"
            sources = [str(folder / f"{options.name}.c"), str(folder / "driver.c")]
            subprocess.run([compiler, *flags, "-shared", "-fPIC", *sources, "-lm", "-o", str(library)], check=True)
            self._library = ctypes.CDLL(str(library))

    def rounded(self, values: np.ndarray) -> np.ndarray:
        """Return what is left of numbers in the export's precision."""
        return values.astype(self.dtype).astype(np.float64)

    def run(self, steps_s: np.ndarray | None, values: np.ndarray, **covariates: np.ndarray) -> np.ndarray:
        """Return the answers from the relaxed state on; with the fixed step where no steps are given."""
        self._library.reset()
        given = np.ascontiguousarray(values, dtype=self.dtype)
        out = np.empty(given.size, dtype=self.dtype)
        if self._covariates:
            steps = None if steps_s is None else np.ascontiguousarray(steps_s, dtype=self.dtype)
            beside = [np.ascontiguousarray(covariates[name], dtype=self.dtype) for name in self._covariates]
            at_steps = ctypes.c_void_p(None) if steps is None else _at(steps)
            self._library.run_beside(ctypes.c_size_t(given.size), _at(given), at_steps, _at(out), *map(_at, beside))
        elif steps_s is None:
            self.run_into(given, out)
        else:
            steps = np.ascontiguousarray(steps_s, dtype=self.dtype)
            self._library.run_any(ctypes.c_size_t(given.size), _at(given), _at(steps), _at(out))
        return out.astype(np.float64)

    def run_into(self, values: np.ndarray, out: np.ndarray) -> None:
        """Fill ``out`` by fixed steps, going on from the present state; arrays of the export's precision."""
        self._library.run_fixed(ctypes.c_size_t(values.size), _at(values), _at(out))

    def run_limited(self, values: np.ndarray) -> np.ndarray:
        """Return the answers of the limited fixed step, from the relaxed state on."""
        self._library.reset()
        given = np.ascontiguousarray(values, dtype=self.dtype)
        out = np.empty(given.size, dtype=self.dtype)
        self._library.run_limited(ctypes.c_size_t(given.size), _at(given), _at(out))
        return out.astype(np.float64)


def _at(array: np.ndarray) -> ctypes.c_void_p:
    return ctypes.c_void_p(array.ctypes.data)


def available(compiler: str = "gcc") -> bool:
    """Tell whether a compiler is there."""
    return shutil.which(compiler) is not None
