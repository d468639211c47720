"""``fomrc export``: a model and its inverse as C, or as one Python file."""

from __future__ import annotations

import math
from typing import Annotated

import typer

from fomrc_core.cli.model_commands import ModelFile
from fomrc_core.cli.options import OutputDirectory
from fomrc_core.cli.progress import say
from fomrc_core.errors import ParameterError


def export(  # one argument for each option of the command line
    model: ModelFile,
    output: OutputDirectory,
    language: Annotated[
        str, typer.Option(metavar="c|python", help="C99, or one Python file that needs nothing else.")
    ] = "c",
    precision: Annotated[str, typer.Option(metavar="double|float", help="Precision of exported C.")] = "double",
    direction: Annotated[
        str, typer.Option(metavar="forward|inverse|both", help="Voltage to displacement, the other way, or both.")
    ] = "both",
    elements: Annotated[int | None, typer.Option(metavar="N", help="Join elements until N are left.")] = None,
    rate: Annotated[float, typer.Option(metavar="HZ", help="Sample rate of the fixed step.")] = 10_000.0,
    name: Annotated[
        str | None, typer.Option(help="Name of the files and functions; that of the model file by default.")
    ] = None,
    drop: Annotated[bool, typer.Option("--drop", help="Leave out effects that cannot be exported.")] = False,
    limits: Annotated[
        str | None,
        typer.Option(
            metavar="MIN,MAX,SLEW,SAFE,RAMP",
            help="Voltage limits [V, V, V/s, V, V/s]; -2.5,2.5,500,0,10 by default, as in the compensator node.",
        ),
    ] = None,
    self_test: Annotated[
        bool, typer.Option("--self-test", help="Build the self-test with $CC, cc, gcc or clang, and run it.")
    ] = False,
) -> None:
    """Export a model and its inverse as C, or as one Python file, for a controller.

    Writes NAME.h, NAME.c, a self-test with golden data, CMakeLists.txt and a README into a new or empty folder.
    """
    from fomrc_core.control.voltage_limits import VoltageLimits
    from fomrc_core.export import (
        Direction,
        ExportOptions,
        Language,
        Precision,
        choice,
        export_model,
        name_from,
        run_self_test,
    )
    from fomrc_core.storage import read_model

    if not (math.isfinite(rate) and rate > 0.0):
        raise ParameterError("sample rate is not positive", where="--rate", value=rate, allowed="> 0 Hz")
    own = {} if limits is None else {"limits": VoltageLimits(*_limit_values(limits))}
    options = ExportOptions(
        name=name if name is not None else name_from(model.name.split(".")[0]),
        language=choice(Language, language, "--language"),
        precision=choice(Precision, precision, "--precision"),
        direction=choice(Direction, direction, "--direction"),
        sample_period_s=1.0 / rate,
        n_elements=elements,
        is_dropping=drop,
        **own,
    )
    written = export_model(read_model(model), output, options)
    print(written)
    if self_test:
        test = run_self_test(output, options.name, options.language)
        print("\n".join((*test.lines, f"self-test passed with {test.with_what}")))
    else:
        say("not tested here: --self-test builds and runs the self-test")


def _limit_values(text: str) -> tuple[float, ...]:
    try:
        values = tuple(float(part) for part in text.split(","))
    except ValueError:
        values = ()
    if len(values) != 5 or not all(math.isfinite(value) for value in values):
        raise ParameterError(
            "not understood", where="--limits", value=text, allowed="MIN,MAX,SLEW,SAFE,RAMP: five numbers"
        )
    return values
