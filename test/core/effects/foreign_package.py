"""A package of somebody else with an effect of its own, built as a wheel and installed into a folder, offline."""

from __future__ import annotations

import subprocess
import sys
import textwrap
import zipfile
from pathlib import Path

# Heat of the work done, in proportion to the squared speed, expands the stage and leaks away: none of ours depends on
# the speed squared.
SELF_HEATING = '''
from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from fomrc_core.effects import Effect, Parameter, Stage


@dataclass(frozen=True)
class SelfHeating(Effect):
    """Displacement plus an expansion by the heat of motion, which leaks away with one time constant."""

    name: ClassVar[str] = "self_heating"
    stage: ClassVar[Stage] = Stage.SENSED
    order: ClassVar[float] = 5.0
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter("expansion_s_per_um", "s/um", -1e3, 1e3, description="expansion per squared speed and second"),
        Parameter("leak_s", "s", 1e-3, 1e6, is_log=True, description="time constant of the leak"),
    )
    main_parameter: ClassVar[str] = "expansion_s_per_um"
    meaning: ClassVar[str] = "Friction in the stage heats it, and it expands."
    signature: ClassVar[str] = "residual rises while the stage moves fast, whichever way, and fades afterwards"
    experiment: ClassVar[str] = "a burst of fast triangles, then rest"
    inverse_note: ClassVar[str] = "inverted by the heat of the steps before"
    can_invert: ClassVar[bool] = True
    linear_parameters: ClassVar[tuple[str, ...]] = ("expansion_s_per_um",)

    expansion_s_per_um: float
    leak_s: float

    def initial_state(self):
        return np.zeros(3)  # heat [um^2/s], displacement [um] and whether there was one

    def _heat(self, state, displacement_um, step_s):
        before, kept = state[0], float(np.exp(-step_s / self.leak_s))
        speed = (displacement_um - state[1]) / step_s if state[2] else 0.0
        state[0] = kept * before + (1.0 - kept) * self.leak_s * speed**2
        state[1], state[2] = displacement_um, 1.0
        return before

    def run(self, state, values, steps_s, covariate=None):
        heat = [self._heat(state, x, dt) for x, dt in zip(values.tolist(), steps_s.tolist())]
        return values + self.expansion_s_per_um * np.array(heat)

    def invert(self, state, values, steps_s, covariate=None):
        out = np.empty(values.size)
        for k in range(values.size):
            out[k] = values[k] - self.expansion_s_per_um * state[0]
            self._heat(state, out[k], steps_s[k])
        return out

    @classmethod
    def screening(cls, evidence):
        longest = evidence.duration_s
        return [cls(1e-6, share * longest) for share in (0.02, 0.06, 0.2)]
'''


def install(folder: Path, package: str, entry_points: dict[str, str], source: str = SELF_HEATING) -> None:
    """Install a package of one module into a folder, with entry points of the group ``fomrc.effects``.

    Args:
        folder: what is then to be on PYTHONPATH.
        package: name of the module and of the package.
        entry_points: name -> ``module:Class``.
        source: text of the module.
    """
    wheel = folder.parent / f"{package}-1.0-py3-none-any.whl"
    info = f"{package}-1.0.dist-info"
    lines = [f"{name} = {target}" for name, target in entry_points.items()]
    files = {
        f"{package}.py": textwrap.dedent(source),
        f"{info}/METADATA": f"Metadata-Version: 2.1\nName: {package}\nVersion: 1.0\n",
        f"{info}/WHEEL": "Wheel-Version: 1.0\nGenerator: by hand\nRoot-Is-Purelib: true\nTag: py3-none-any\n",
        f"{info}/entry_points.txt": "\n".join(["[fomrc.effects]", *lines, ""]),
    }
    record = "".join(f"{name},,\n" for name in (*files, f"{info}/RECORD"))
    with zipfile.ZipFile(wheel, "w") as archive:
        for name, text in {**files, f"{info}/RECORD": record}.items():
            archive.writestr(name, text)
    command = [sys.executable, "-m", "pip", "install", "--quiet", "--no-deps", "--no-index", "--target", str(folder)]
    subprocess.run([*command, str(wheel)], check=True, timeout=120, capture_output=True)
