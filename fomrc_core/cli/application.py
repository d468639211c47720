"""The command line as a whole: its commands, and how errors leave it."""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from typing import Annotated, Any

import typer

from fomrc_core.cli.axes_commands import benchmark, identify_axes
from fomrc_core.cli.check_command import check
from fomrc_core.cli.compensate_command import compensate
from fomrc_core.cli.data_commands import doctor, import_file
from fomrc_core.cli.example_commands import compare, data, demo, reproduce
from fomrc_core.cli.excite_commands import excite
from fomrc_core.cli.export_command import export
from fomrc_core.cli.fit_commands import diagnose, identify
from fomrc_core.cli.fleet_commands import diagnose_fleet, identify_fleet
from fomrc_core.cli.help_examples import example_of
from fomrc_core.cli.interrupts import Interrupts, interrupts_kept
from fomrc_core.cli.model_commands import simulate
from fomrc_core.cli.options import COMMAND
from fomrc_core.cli.progress import loading_told
from fomrc_core.cli.view_command import view
from fomrc_core.cli.watch_command import watch
from fomrc_core.errors import FomrcError

DONE, BAD_INPUT, INTERRUPTED = 0, 2, 130

application = typer.Typer(
    name="fomrc",
    help="Hysteresis and creep of piezo actuators: simulate, invert, fit, and find what a model misses.",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
)


def _show_version(is_asked: bool) -> None:
    if is_asked:
        from fomrc_core import __version__

        print(f"fomrc {__version__}")
        raise typer.Exit


@application.callback()
def _before_any_command(
    version: Annotated[
        bool, typer.Option("--version", callback=_show_version, is_eager=True, help="Show the version and exit.")
    ] = False,
) -> None:
    pass


_COMMANDS: dict[str, Callable[..., int | None]] = {
    "simulate": simulate,
    "compensate": compensate,
    "export": export,
    "identify": identify,
    "identify-fleet": identify_fleet,
    "identify-axes": identify_axes,
    "check": check,
    "diagnose": diagnose,
    "diagnose-fleet": diagnose_fleet,
    "watch": watch,
    "view": view,
    "compare": compare,
    "reproduce": reproduce,
    "benchmark": benchmark,
    "data": data,
    "import": import_file,
    "doctor": doctor,
    "demo": demo,
}
_PASSED_ON = {"allow_extra_args": True, "ignore_unknown_options": True}
for _name, _command in _COMMANDS.items():
    _settings = _PASSED_ON if _name == "demo" else {}
    application.command(_name, epilog=example_of(_name), context_settings=_settings)(_command)
application.add_typer(excite, name="excite")


def run(arguments: Sequence[str]) -> int:
    """Run the command line and return its exit status."""
    with interrupts_kept() as interrupts:
        return _run(arguments, interrupts)


def _run(arguments: Sequence[str], interrupts: Interrupts) -> int:
    COMMAND.set(("fomrc", *arguments))
    try:
        with loading_told():
            status = application(args=list(arguments), prog_name="fomrc", standalone_mode=False)
    except FomrcError as error:
        return _refuse(str(error))
    except KeyboardInterrupt:
        return INTERRUPTED
    except OSError as error:
        # a path the system will not take, such as one too long: files that are missing are told of where they are read
        return _refuse(f"{error.filename or 'a file'}: cannot be used ({error.strerror or error})")
    except MemoryError as error:
        return _refuse(f"not enough memory ({error or 'no size told'}): shorter records or fewer samples")
    except Exception as error:
        # Wrong usage. The class is click's or, in newer releases, a copy of it inside of typer.
        if type(error).__name__ == "Abort" or interrupts.have_come or _is_of_interrupt(error):
            return INTERRUPTED
        if type(error).__name__ == "NoArgsIsHelpError":
            print(error.format_message(), flush=True)  # type: ignore[attr-defined]
            return _refuse("no command (allowed: one of those above)")
        if not hasattr(error, "format_message"):
            raise
        return _refuse(_usage_error(error, arguments))
    return status if isinstance(status, int) else DONE


def _is_of_interrupt(error: BaseException | None) -> bool:
    """Return whether an error comes of an interrupt: compiled modules that are being loaded make others of it."""
    while error is not None:
        if isinstance(error, KeyboardInterrupt):
            return True
        error = error.__cause__ or error.__context__
    return False


def _usage_error(error: Any, arguments: Sequence[str]) -> str:
    """Return what is wrong with the arguments, with the value that is wrong where the error leaves it out."""
    message = error.format_message().rstrip(".")
    names = getattr(getattr(error, "param", None), "opts", ())
    for argument, following in zip(arguments, [*arguments[1:], ""], strict=True):
        name, equals, value = argument.partition("=")
        value = value if equals else following
        if name in names and message.startswith("Invalid") and repr(value) not in message:
            message += f", got {value!r}"
    return f"{message} (allowed: see --help)"


def _refuse(message: str) -> int:
    print("fomrc: " + " ".join(message.split()), file=sys.stderr)
    return BAD_INPUT
