"""`ilc plot`: the pictures of a campaign in the library."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from ilc_rt.commands.options import (
    DEFAULT_LIBRARY_FILE,
    REPORT_NAME,
    JsonFile,
    LibraryArgument,
)
from ilc_rt.commands.steps import Steps
from ilc_rt.commands.targets import check_report, make_folder, write_picture
from ilc_rt.errors import BadInputError
from ilc_rt.result import CampaignResult
from ilc_rt.text import printable

CampaignOption = Annotated[
    str | None, typer.Option(metavar="ID", help="Which campaign; the latest if not given.")
]
Out = Annotated[
    Path,
    typer.Option("--out", "-o", metavar="PATH", help="A .html report, or a folder for pictures."),
]


def plot(
    library: LibraryArgument = DEFAULT_LIBRARY_FILE,
    campaign: CampaignOption = None,
    out: Out = Path(REPORT_NAME),
    json_file: JsonFile = None,
) -> None:
    """Draw a campaign from the library: a report, or one picture a file.

    Example: ilc plot ilc-library.db --out pictures/
    """
    result = CampaignResult.from_library(library, campaign)
    # Imported here, as matplotlib is slow to import, and bad input should be reported before.
    from ilc_rt import plots
    from ilc_rt.report import write_report

    typer.echo(result.sentence())
    if json_file is not None:
        result.write_json(json_file)
    if out.suffix == ".html":
        with Steps("figures") as steps:
            written = write_report(result, out, steps.tell)
        typer.echo(f"report: {printable(written)}")
        return
    if out.suffix:
        message = f"{out}: must be a .html file or a folder"
        raise BadInputError(message)
    pictures = {
        "convergence": plots.convergence,
        "contour": plots.contour,
        "tracking": plots.tracking,
        "input": plots.learned_input,
    }
    check_report("--out", out)
    make_folder(out)
    with Steps("pictures") as steps:
        for number, (name, draw) in enumerate(pictures.items()):
            steps.tell(number, len(pictures))
            figure = draw(result)
            if figure is not None:
                write_picture(out / f"{name}.png", figure)
                steps.close()
                typer.echo(f"picture: {printable(out / name)}.png")
