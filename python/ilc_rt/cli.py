"""The program `ilc`: run, inspect and store what the machine has learned."""

from __future__ import annotations

import os
import signal
import sys
from importlib import import_module
from typing import TYPE_CHECKING, Annotated

import typer
from typer import Typer

from ilc_rt._native import __version__
from ilc_rt.errors import (
    EXIT_BAD_INPUT,
    EXIT_FAILURE,
    EXIT_INTERRUPTED,
    CampaignError,
)
from ilc_rt.text import printable

if TYPE_CHECKING:
    from collections.abc import Sequence

#: Set by a shell that asks for completions.
COMPLETION = "_ILC_COMPLETE"

# The summary of each verb, in the order of the help, which imports no verb for it. A verb of
# several verbs is a `Typer` named `app` in its module.
VERBS = {
    "demo": "Let a simulated two-axis gantry learn its contour, and write a report.",
    "run": "Run a cell's program again and again, each run better than the last.",
    "identify": "Excite one axis while the others hold still, and fit a model to its response.",
    "repeatability": "Run a program without learning and tell what of its error repeats.",
    "plot": "Draw a campaign from the library: a report, or one picture a file.",
    "tune": "Propose weights of norm-optimal learning for a cell, with the reasons.",
    "sweep": "Let a cell learn in simulation with varied parameters: the map of its robustness.",
    "library": "List, show, export and trim the runs in a library.",
    "monitor": "Watch a controller: its state, each run's error, and faults.",
    "dashboard": (
        "Serve a web page that watches cells and compares the runs of libraries; it commands "
        "nothing."
    ),
    "bridge": "Show a running controller in PlotJuggler or Foxglove.",
    "reproduce": "Compute a paper's figures again, and set them beside the printed ones.",
}


def application(wanted: str | None = None) -> Typer:
    """Return the program with the wanted verb, whose modules alone are imported; or with all."""
    app = _empty()
    own = [name for name in VERBS if name != "reproduce"]
    verbs = [wanted] if wanted in own else own
    for name in verbs:
        module = import_module(f"ilc_rt.commands.{name}")
        if hasattr(module, "app"):
            app.add_typer(module.app, name=name)
        else:
            app.command(name)(getattr(module, name))
    if verbs is not own:
        return app
    from importlib.metadata import entry_points

    further = {entry.name: entry for entry in entry_points(group="ilc_rt.verbs")}
    for name, entry in further.items():
        app.command(name)(entry.load())
    if "reproduce" not in further:
        from ilc_rt.commands import reproduce

        app.command("reproduce", context_settings=reproduce.ANY_ARGUMENTS)(reproduce.reproduce)
    return app


def outline() -> Typer:
    """Return the program with the summaries of its verbs alone: for its help and its options."""
    app = _empty()
    for name, summary in VERBS.items():
        app.command(name, short_help=summary)(_nothing)
    return app


def _empty() -> Typer:
    # Help in plain text, as that of `ilc-rt`: in boxes it takes three times as long to appear.
    app = Typer(
        name="ilc",
        no_args_is_help=True,
        pretty_exceptions_enable=False,
        rich_markup_mode=None,
        help="The motion controller that learns: each run corrects the next.",
    )
    app.callback()(_options)
    return app


def _nothing() -> None:
    """Stand for a verb in the outline."""


def _tell_version(*, wanted: bool) -> None:
    if wanted:
        typer.echo(f"ilc {__version__}")
        raise typer.Exit


def _options(
    *,
    version: Annotated[
        bool,
        typer.Option(
            "--version",
            is_eager=True,
            callback=lambda value: _tell_version(wanted=value),
            help="Show the version and exit.",
        ),
    ] = False,
) -> None:
    """Handle the options before the verb."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run `ilc` and return its exit code; errors are one line.

    0 done, 2 bad input, 3 controlled stop after a fault, 130 and 143 stopped by a signal, 1 any
    other failure.
    """
    try:
        words = sys.argv[1:] if arguments is None else arguments
        first = words[0] if words else "--help"
        is_outline = first.startswith("-") and COMPLETION not in os.environ
        app = outline() if is_outline else application(first)
        code = app(args=arguments, standalone_mode=False, prog_name="ilc")
    except CampaignError as error:
        _say(error.reason)
        return error.exit_code
    except KeyboardInterrupt:
        return EXIT_INTERRUPTED
    except SystemExit as error:
        return error.code if isinstance(error.code, int) else EXIT_FAILURE
    except BrokenPipeError:
        # The output is closed, as in `ilc library list | head`; there is nothing left to print.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 128 + signal.SIGPIPE
    except Exception as error:
        if os.environ.get("ILC_TRACEBACK"):
            raise
        return _unexpected(error)
    return code if isinstance(code, int) else 0


def _unexpected(error: Exception) -> int:
    """Report an invalid command line, or an unexpected error."""
    format_message = getattr(error, "format_message", None)
    if callable(format_message):
        context = getattr(error, "ctx", None)
        hint = f" (see `{context.command_path} --help`)" if context is not None else ""
        text = str(format_message()).rstrip(".")
        if text.startswith("Usage:"):
            # No verb was named: its message is the help.
            typer.echo(text, err=True)
        elif text:
            _say(text + hint)
        return int(getattr(error, "exit_code", EXIT_BAD_INPUT))
    if isinstance(error, OverflowError):
        _say(f"a number is out of range: {error}")
        return EXIT_BAD_INPUT
    _say(f"unexpected {type(error).__name__}: {error} (ILC_TRACEBACK=1 shows where)")
    return EXIT_FAILURE


def _say(reason: str) -> None:
    typer.echo(f"ilc: {printable(' '.join(reason.split()))}", err=True)


if __name__ == "__main__":
    sys.exit(main())
