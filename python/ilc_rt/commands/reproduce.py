"""`ilc reproduce` without the papers: how to install them."""

from __future__ import annotations

import typer  # noqa: TC002 - typer reads it

from ilc_rt.errors import BadInputError

#: Settings of a verb that accepts any arguments.
ANY_ARGUMENTS = {"allow_extra_args": True, "ignore_unknown_options": True}


def reproduce(_: typer.Context) -> None:
    """Compute a paper's figures again, and set them beside the printed ones.

    It needs the package ilc-papers: pip install 'ilc-rt[papers]'.
    """
    message = (
        "reproduce: the package ilc-papers is not installed; allowed after "
        "`pip install 'ilc-rt[papers]'`, or `pip install ./papers` in a checkout"
    )
    raise BadInputError(message)
