"""Exported C on a Cortex-M7: size of code and state, and its self-test under qemu."""

from __future__ import annotations

import math
import os
import re
import shutil
import subprocess
import tempfile
from dataclasses import replace
from pathlib import Path

from benchmarks.export_rows import EVERY_EFFECT
from benchmarks.subjects import ROOT, table_1
from benchmarks.timing import Row
from fomrc_core.export import Direction, ExportOptions, Precision, export_model
from fomrc_core.model.piezo_model import PiezoModel
from fomrc_core.storage import read_model

_COMPILER = "arm-none-eabi-gcc"
_CORE = ("-mcpu=cortex-m7", "-mthumb", "-mfloat-abi=hard", "-mfpu=fpv5-d16")
_WARNINGS = ("-std=c99", "-Wall", "-Wextra", "-Wconversion", "-Wpedantic", "-Werror")
# A board with a Cortex-M7 that qemu knows; memory as it lies there.
_MACHINE = ("qemu-system-arm", "-M", "mps2-an500", "-nographic", "-semihosting", "-kernel")
_LARGEST_STATE = 1024
_LINKER_SCRIPT = """
MEMORY { FLASH (rx) : ORIGIN = 0x00000000, LENGTH = 4M  RAM (rwx) : ORIGIN = 0x60000000, LENGTH = 16M }
ENTRY(_start)
SECTIONS {
  .vectors : { KEEP(*(.vectors)) } > FLASH
  .text : { *(.text*) *(.rodata*) KEEP(*(.init)) KEEP(*(.fini)) *(.eh_frame*) } > FLASH
  .ARM.exidx : { *(.ARM.exidx*) } > FLASH
  .init_array : { __init_array_start = .; KEEP(*(.init_array*)) __init_array_end = .; } > FLASH
  .data : { *(.data*) } > RAM
  .bss : { __bss_start__ = .; *(.bss*) *(COMMON) __bss_end__ = .; } > RAM
  end = .; __end__ = .; _end = .;
  __stack = 0x60f00000;
}
"""
_START = """
extern void _start(void);
extern char __stack[];
void reset(void);
__attribute__((section(".vectors"), used)) static const void *const vectors[2] = {__stack, (void *)reset};
void reset(void)
{
    *(volatile unsigned *)0xE000ED88u |= 0xFu << 20; /* the floating-point unit */
    __asm volatile("dsb\\n isb");
    _start();
}
"""


def cortex_m7() -> list[Row]:
    """Code and state of the paper's model and of one with every effect, and what the self-test says there."""
    if shutil.which(_COMPILER) is None:
        return []
    every = read_model(EVERY_EFFECT)
    # What keeps samples of the past is as large as the past: told in a row of its own.
    compact = replace(every, effects=tuple(e for e in every.effects if len(e.initial_state()) < 1000))
    rows = []
    for label, model in (("paper's model", table_1()), ("every effect without a line of samples", compact)):
        for precision in Precision:
            for direction in (Direction.INVERSE, Direction.FORWARD):
                rows.append(_measured(label, model, precision, direction))
    rows.append(_measured("every effect", every, Precision.DOUBLE, Direction.FORWARD))
    return rows


def loop_at_20_khz(seconds: float = 10.0) -> list[Row]:
    """What examples/c_loop tells of itself: how late the clock woke it, and how many ticks it missed."""
    if shutil.which("gcc") is None:
        return []
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(temporary)
        export_model(table_1(), folder / "stage", ExportOptions("stage", sample_period_s=5e-5))
        sources = [str(ROOT / "examples" / "c_loop" / "loop.c"), str(folder / "stage" / "stage.c")]
        program = str(folder / "loop")
        subprocess.run(["gcc", "-std=c99", "-O2", f"-I{folder / 'stage'}", *sources, "-lm", "-o", program], check=True)
        targets = "\n".join(f"{0.8 * math.sin(k / 400.0):.6f}" for k in range(int(seconds * 20_000)))
        done = subprocess.run([program], input=targets, capture_output=True, text=True, check=True)
    load = f"load average {os.getloadavg()[0]:.1f} on {os.cpu_count()} processors, no real-time priority"
    return [Row("loop at 20 kHz in C", f"{done.stderr.strip()} ({load})")]


def _measured(label: str, model: PiezoModel, precision: Precision, direction: Direction) -> Row:
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(temporary)
        options = ExportOptions("stage", precision=precision, direction=direction, is_dropping=True)
        written = export_model(model, folder, options)
        fixed = _section_sizes(folder, "-DSTAGE_FIXED_STEP_ONLY")
        whole = _section_sizes(folder)
        state = written.n_inverse_bytes or written.n_forward_bytes
        said = _self_test(folder)
    what = f"Cortex-M7, -Os, {label}, {direction.value}, {precision.value}"
    figure = (
        f"code and tables {sum(fixed[:2])} bytes for the fixed step alone, {sum(whole[:2])} with any step; "
        f"data {whole[1]}; state {state} bytes; self-test under qemu: {said}"
    )
    is_bounded = label != "every effect"
    return Row(
        what,
        figure,
        f"state <= {_LARGEST_STATE} bytes; self-test passes" if is_bounded else "self-test passes",
        (state <= _LARGEST_STATE or not is_bounded) and said in ("passed", "not run"),
    )


def _section_sizes(folder: Path, *flags: str) -> tuple[int, int, int]:
    compiled = folder / "stage.o"
    command = [_COMPILER, *_CORE, *_WARNINGS, "-Os", *flags, "-c", str(folder / "stage.c"), "-o", str(compiled)]
    subprocess.run(command, check=True)
    listed = subprocess.run(["arm-none-eabi-size", str(compiled)], capture_output=True, text=True, check=True).stdout
    text, data, bss = (int(number) for number in listed.splitlines()[1].split()[:3])
    return text, data, bss


def _self_test(folder: Path) -> str:
    if shutil.which(_MACHINE[0]) is None:
        return "not run"
    (folder / "board.ld").write_text(_LINKER_SCRIPT)
    (folder / "board.c").write_text(_START)
    program = folder / "test.elf"
    sources = [str(folder / name) for name in ("stage.c", "self_test.c", "board.c")]
    command = [_COMPILER, *_CORE, "-std=c99", "-Os", *sources, "--specs=rdimon.specs", "-T", str(folder / "board.ld")]
    subprocess.run([*command, "-lm", "-o", str(program)], check=True)
    done = subprocess.run([*_MACHINE, str(program)], capture_output=True, text=True, timeout=300.0, check=False)
    if re.search(r"^self-test passed", done.stdout, re.MULTILINE):
        return "passed"
    return "FAILED: " + " ".join((done.stdout + done.stderr).split())[:200]
