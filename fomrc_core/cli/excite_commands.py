"""``fomrc excite``: drive voltages as CSV."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from fomrc_core.cli.help_examples import example_of
from fomrc_core.cli.progress import say
from fomrc_core.errors import ParameterError

if TYPE_CHECKING:
    from fomrc_core.records.excitation import Excitation

excite = typer.Typer(
    help="Write a drive voltage, columns time_s and voltage_v; defaults are the paper's.",
    no_args_is_help=True,
)

Output = Annotated[Path, typer.Option("--output", "-o", metavar="CSV", help="Where to write.")]
Amplitude = Annotated[float, typer.Option(help="Amplitude [V].")]
Offset = Annotated[float, typer.Option(help="Voltage about which it runs [V].")]
Rate = Annotated[float, typer.Option(help="Sample rate [Hz].")]
Cycles = Annotated[int, typer.Option(help="Cycles, each of less amplitude than the one before.")]
Unipolar = Annotated[bool, typer.Option("--unipolar", help="Between zero and the amplitude.")]


@excite.command(epilog=example_of("excite relax"))
def relax(
    output: Output,
    amplitude: Amplitude = 2.5,
    duration: Annotated[float, typer.Option(help="Time to die away [s].")] = 30.0,
    frequency: Annotated[float, typer.Option(help="Frequency [Hz].")] = 10.0,
    rest: Annotated[float, typer.Option(help="Time at rest after it [s].")] = 0.0,
    offset: Offset = 0.0,
    rate: Rate = 1000.0,
) -> None:
    """Oscillation that dies away and leaves the actuator relaxed, (27)-(28)."""
    from fomrc_core.records.excitation import relaxation

    _write(
        relaxation(amplitude, duration_s=duration, frequency_hz=frequency, rest_s=rest, offset_v=offset, rate_hz=rate),
        output,
    )


@excite.command(epilog=example_of("excite triangle"))
def triangle(
    output: Output,
    amplitude: Amplitude = 2.5,
    slope: Annotated[float, typer.Option(help="Slope [V/s].")] = 1.0,
    cycles: Cycles = 5,
    unipolar: Unipolar = False,
    offset: Offset = 0.0,
    rate: Rate = 1000.0,
) -> None:
    """Triangle of decreasing amplitude, figure 9(a)."""
    from fomrc_core.records import excitation

    _write(
        excitation.triangle(
            amplitude,
            slope_v_per_s=slope,
            n_cycles=cycles,
            is_unipolar=unipolar,
            offset_v=offset,
            rate_hz=rate,
        ),
        output,
    )


@excite.command(epilog=example_of("excite staircase"))
def staircase(
    output: Output,
    amplitude: Amplitude = 2.5,
    step: Annotated[float, typer.Option(help="Height of a step [V].")] = 0.25,
    dwell: Annotated[float, typer.Option(help="Time on each step [s].")] = 3.0,
    cycles: Cycles = 2,
    unipolar: Unipolar = False,
    offset: Offset = 0.0,
    rate: Rate = 1000.0,
) -> None:
    """Staircase of decreasing amplitude, figure 9(b)."""
    from fomrc_core.records import excitation

    _write(
        excitation.staircase(
            amplitude,
            step_v=step,
            dwell_s=dwell,
            n_cycles=cycles,
            is_unipolar=unipolar,
            offset_v=offset,
            rate_hz=rate,
        ),
        output,
    )


@excite.command(epilog=example_of("excite steps"))
def steps(
    output: Output,
    levels: Annotated[str, typer.Option(help="Levels [V], in order.")] = "2.5,0,1.5,0,0.5,0,-0.5,0,-1.5,0,-2.5,0",
    dwell: Annotated[float, typer.Option(help="Time on each level [s].")] = 60.0,
    lead_in: Annotated[float, typer.Option(help="Time at zero before the first [s].")] = 1.0,
    offset: Offset = 0.0,
    rate: Rate = 1000.0,
) -> None:
    """Steps through given levels, figure 11."""
    from fomrc_core.records import excitation

    try:
        levels_v = [float(level) for level in levels.split(",")]
    except ValueError:
        raise ParameterError(
            "not a list of numbers", where="--levels", value=levels, allowed="e.g. 2.5,0,-2.5"
        ) from None
    _write(excitation.steps(levels_v, dwell_s=dwell, lead_in_s=lead_in, offset_v=offset, rate_hz=rate), output)


@excite.command(epilog=example_of("excite multisine"))
def multisine(
    output: Output,
    amplitude: Amplitude = 2.5,
    lowest: Annotated[float, typer.Option(help="Lower end of the band [Hz].")] = 0.1,
    highest: Annotated[float, typer.Option(help="Upper end of the band [Hz].")] = 20.0,
    period: Annotated[float, typer.Option(help="Period [s].")] = 10.0,
    periods: Annotated[int, typer.Option(help="Number of periods.")] = 3,
    seed: Annotated[int, typer.Option(help="Seed of the phases.")] = 0,
    offset: Offset = 0.0,
    rate: Rate = 1000.0,
) -> None:
    """Random-phase multisine, repeated."""
    from fomrc_core.records import excitation

    _write(
        excitation.multisine(
            amplitude,
            lowest_hz=lowest,
            highest_hz=highest,
            period_s=period,
            n_periods=periods,
            seed=seed,
            offset_v=offset,
            rate_hz=rate,
        ),
        output,
    )


def _write(drive: Excitation, output: Path) -> None:
    from fomrc_core.storage import write_recording

    write_recording(drive.to_recording(), output)
    say(str(drive))
