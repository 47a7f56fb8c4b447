"""`ilc reproduce` where the papers are not installed: how to get them."""

from __future__ import annotations

import typer  # noqa: TC002 - typer reads it

from ilc_rt.errors import BadInputError

#: What a verb must allow so that it takes any arguments.
ANY_ARGUMENTS = {"allow_extra_args": True, "ignore_unknown_options": True}


def reproduce(_: typer.Context) -> None:
    """Compute a paper's figures again; needs the package ilc-papers.

    Install it with pip install 'ilc-rt[papers]'.
    """
    message = (
        "reproduce: the package ilc-papers is not installed; allowed after "
        "`pip install 'ilc-rt[papers]'`, or `pip install ./papers` in a checkout"
    )
    raise BadInputError(message)
