"""Run one rival on inputs from a file, in the rivals' own environment; needs nothing of this project.

python rival_runs.py NAME inputs.npz outputs.npz
"""

import ctypes
import importlib.metadata
import importlib.util
import sys
import time
from pathlib import Path

import numpy as np


def pycaputo_trapezoidal(data):
    from pycaputo import grid
    from pycaputo.quadrature import quad
    from pycaputo.quadrature.riemann_liouville import Trapezoidal

    y = np.concatenate(([0.0], data["walk"]))  # it rises from zero over the first step, as here
    points = grid.make_uniform_points(y.size, 0.0, float(data["step_s"]) * (y.size - 1))
    start = time.process_time()
    x = quad(Trapezoidal(-float(data["order"])), lambda t: y, points)
    return time.process_time() - start, np.asarray(x)[1:], importlib.metadata.version("pycaputo")


def differint_gl(data):
    import differint.differint as library

    y = np.concatenate(([0.0], data["walk"]))
    end = float(data["step_s"]) * (y.size - 1)
    start = time.process_time()
    x = library.GL(-float(data["order"]), y.tolist(), 0.0, end, y.size)
    return time.process_time() - start, np.asarray(x)[1:], importlib.metadata.version("differint")


def opensees_chain(data):
    # its wheel does not find its own libraries everywhere: load them first
    folder = Path(importlib.util.find_spec("openseespylinux").origin).parent / "lib"
    for name in ("libquadmath.so.0", "libgfortran.so.4", "libgfortran.so.5", "libblas.so.3", "liblapack.so.3"):
        if (folder / name).exists():
            ctypes.CDLL(str(folder / name), mode=ctypes.RTLD_GLOBAL)
    import openseespy.opensees as ops

    ops.wipe()
    ops.model("basic", "-ndm", 1, "-ndf", 1)
    n = data["thresholds"].size
    for i in range(n):
        ops.uniaxialMaterial("ElasticPP", i + 1, float(data["weights"][i]), float(data["thresholds"][i]))
    ops.uniaxialMaterial("Elastic", n + 1, float(data["slope"]))
    ops.uniaxialMaterial("Parallel", n + 2, *range(1, n + 2))
    ops.testUniaxialMaterial(n + 2)
    strains, force = data["displacement"].tolist(), []
    start = time.process_time()
    for strain in strains:
        ops.setStrain(strain)
        force.append(ops.getStress())
    return time.process_time() - start, np.array(force), importlib.metadata.version("openseespy")


RUNS = {
    "pycaputo": pycaputo_trapezoidal,
    "differint GL": differint_gl,
    "openseespy": opensees_chain,
}

if __name__ == "__main__":
    name, source, target = sys.argv[1:]
    seconds, values, version = RUNS[name](np.load(source))
    np.savez(target, seconds=seconds, values=values, version=version)
