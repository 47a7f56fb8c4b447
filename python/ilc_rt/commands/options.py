"""Options and arguments shared by several verbs; those of the controller come from `ilc-rt`."""

from __future__ import annotations

import inspect
from enum import Enum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, TypeVar

import typer

from ilc_rt.commands.targets import json_target
from ilc_rt.errors import BadInputError
from ilc_rt.options import DEFAULT_LIBRARY, Option, Verb, options
from ilc_rt.transports import SYNTAXES

if TYPE_CHECKING:
    from collections.abc import Callable

    F = TypeVar("F", bound=Callable[..., None])

TYPES: dict[str, type] = {
    "flag": bool, "inverse_flag": bool, "integer": int, "number": float, "path": Path, "text": str,
    "renamed": str,
}  # fmt: skip


class DriveChoice(str, Enum):
    """Choice of simulated or external drives."""

    auto = "auto"
    simulated = "simulated"
    external = "external"


def declared(verb: Verb, *names: str) -> Callable[[F], F]:
    """Declare options of ``ilc-rt`` in place of a function's ``**options``.

    By default all options of the verb but those that the function has parameters for, and the
    choice of simulated drives.
    """

    def declare(function: F) -> F:
        signature = inspect.signature(function, eval_str=True)
        own = [p for p in signature.parameters.values() if p.kind is not p.VAR_KEYWORD]
        taken = {parameter.name for parameter in own} | {"simulated"}
        chosen = names or [name for name in options(verb) if name not in taken]
        found = [_parameter(options(verb)[name]) for name in chosen]
        keyword = inspect.Parameter.KEYWORD_ONLY
        all_of_them = [*own[:1], *found, *own[1:]]
        all_of_them[1:] = [parameter.replace(kind=keyword) for parameter in all_of_them[1:]]
        function.__signature__ = signature.replace(parameters=all_of_them)  # type: ignore[attr-defined]
        function.__annotations__ = {p.name: p.annotation for p in all_of_them}
        return function

    return declare


def given(values: dict[str, Any]) -> dict[str, Any]:
    """Return the values of declared options as Python keywords."""
    return {
        name: value.value if isinstance(value, Enum) else value for name, value in values.items()
    }


def _parameter(option: Option) -> inspect.Parameter:
    kind: Any = TYPES.get(option.kind)
    default: Any = None
    if option.kind == "choice":
        choice: Any = Enum
        kind = choice(option.name.title(), {name: name for name in option.choices}, type=str)
    if option.kind in {"flag", "inverse_flag"}:
        default = option.kind == "inverse_flag"
    elif option.default is not None:
        default = kind(option.default)
    flags = option.flags if option.kind != "inverse_flag" else (f" /{option.flags[0]}",)
    how = typer.Option(
        *flags,
        metavar=None if option.choices else option.placeholder,
        show_default=option.kind != "inverse_flag",
        # Here, the simulated drives may be in this process.
        help=f"Bus address in place of the cell's: {SYNTAXES}."
        if option.name == "bus"
        else option.help,
        hidden=option.kind == "renamed",
        callback=_refuse_renamed(option) if option.kind == "renamed" else None,
    )
    return inspect.Parameter(
        option.name,
        inspect.Parameter.KEYWORD_ONLY,
        default=default,
        annotation=Annotated[kind if default is not None else kind | None, how],
    )


def _refuse_renamed(option: Option) -> Callable[[str | None], None]:
    def refuse(value: str | None) -> None:
        if value is not None:
            message = f"{option.flags[0]}: this option is now {option.help}"
            raise BadInputError(message)

    return refuse


CellFile = Annotated[Path, typer.Argument(metavar="CELL", help="Cell description, a TOML file.")]
Lockstep = Annotated[
    bool | None,
    typer.Option(
        "--lockstep/--realtime", help=f"{options('run')['lockstep'].help} Default on loopback:."
    ),
]
KeepIn = Annotated[
    Path | None,
    typer.Option("--library", metavar="FILE", help="Store the runs in this library."),
]
JsonFile = Annotated[
    Path | None,
    typer.Option(
        "--json",
        metavar="FILE",
        callback=json_target,
        help="Write the figures to this file; - for standard output.",
    ),
]
DriveOption = Annotated[
    DriveChoice, typer.Option(help="Start simulated drives; auto never does on a can: bus.")
]
LibraryArgument = Annotated[Path, typer.Argument(metavar="LIBRARY", help="Library file.")]
REPORT_NAME = "ilc-report.html"
DEFAULT_LIBRARY_FILE = Path(DEFAULT_LIBRARY)
