"""Targets of figures and reports: checked before anything moves, written at the end."""

from __future__ import annotations

import io
import sys
from contextlib import redirect_stdout
from pathlib import Path  # noqa: TC003 - typer reads it
from typing import TYPE_CHECKING

import typer

from ilc_rt.errors import BadInputError
from ilc_rt.result import STANDARD_OUTPUT
from ilc_rt.text import printable

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def json_target(context: typer.Context, path: Path | None) -> Path | None:
    """Check the target of ``--json`` before anything moves.

    If the figures go to standard output, everything else that the verb prints goes to standard
    error.
    """
    if path is None or context.resilient_parsing:
        return path
    if path == STANDARD_OUTPUT:
        context.with_resource(redirect_stdout(sys.stderr))
    else:
        check_file("--json", path)
    return path


def report_target(context: typer.Context, path: Path | None) -> Path | None:
    """Check the target of ``--report`` before anything moves."""
    if path is not None and not context.resilient_parsing:
        check_report("--report", path)
    return path


def check_file(option: str, path: Path) -> None:
    """Refuse a file that cannot be written; it stays unchanged, or absent."""
    is_new = not path.exists()
    if not is_new and not path.is_file() and not path.is_dir():
        return  # a device or a pipe: opening it now would use it
    try:
        with path.open("a"):
            pass
        if is_new:
            path.unlink()
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        message = (
            f"{option} {path}: cannot be written: {reason}; allowed: a file in a folder that exists"
        )
        raise BadInputError(message) from error


def check_report(option: str, path: Path) -> None:
    """Refuse a report's file or folder that could not be written at the end.

    A folder may be missing, but its parent must exist.
    """
    if path.is_dir():
        folder = path
    elif path.suffix:
        check_file(option, path)
        return
    elif path.exists():
        message = f"{option} {path}: is a file; a folder or a .html file is needed"
        raise BadInputError(message)
    else:
        folder = path.absolute().parent
    if not folder.is_dir():
        message = f"{option} {path}: no such folder: {folder}"
        raise BadInputError(message)
    probe = folder / ".ilc-probe"
    try:
        probe.touch()
        probe.unlink()
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        message = f"{option} {path}: cannot be written: {reason}"
        raise BadInputError(message) from error


def make_folder(folder: Path) -> None:
    """Create a missing folder, and report it."""
    if folder.is_dir():
        return
    try:
        folder.mkdir()
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        message = f"{folder}: cannot be made: {reason}"
        raise BadInputError(message) from error
    typer.echo(f"folder:  {printable(folder)} is new")


def write_picture(path: Path, figure: Figure) -> None:
    """Write a figure of matplotlib; the format is that of the extension.

    It is drawn before the file is opened: after Ctrl-C the former picture is still there.
    """
    drawn = io.BytesIO()
    figure.savefig(drawn, format=path.suffix.removeprefix("."))
    try:
        path.write_bytes(drawn.getvalue())
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        message = f"{path}: cannot be written: {reason}"
        raise BadInputError(message) from error
