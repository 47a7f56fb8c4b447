"""The documentation site: Sphinx over the documents of the whole tree and the installed package.

`make docs` builds it into build/docs, without network and with warnings as errors.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from docutils import nodes
from latex2mathml.converter import convert

from ilc_rt import __version__

if TYPE_CHECKING:
    from sphinx.application import Sphinx
    from sphinx.writers.html5 import HTML5Translator

project = "ilc-rt"
author = "the authors of ilc-rt"
release = __version__

# The source is the root of the tree, so that a link in a document works here as on the forge.
extensions = [
    "myst_nb",
    "sphinx.ext.autodoc",
    "numpydoc",
]
root_doc = "docs/index"
include_patterns = [
    "*.md",
    "docs/*.md",
    "docs/gallery/*.md",
    "docs/python/*.md",
    "docs/theory/*.md",
    "docs/tutorial/*.ipynb",
]
exclude_patterns = [".*", "benchmarks", "build", "crates", "papers", "python", "target", "tests"]
html_extra_path = ["site"]

myst_enable_extensions = ["colon_fence", "dollarmath"]
myst_heading_anchors = 4

# Notebooks are kept without outputs and executed for the site, each in a folder of its own.
nb_execution_mode = "force"
nb_execution_in_temp = True
nb_execution_raise_on_error = True
nb_execution_timeout = 900
nb_merge_streams = True

# Types stand in the docstrings, with units and shapes, which annotations lack.
autodoc_typehints = "none"
autodoc_member_order = "bysource"
autodoc_default_options = {"members": True, "show-inheritance": True}
numpydoc_show_class_members = False

# Equations are MathML, which browsers show without a script from the network.
html_math_renderer = "mathml"
html_theme = "furo"
html_title = f"ilc-rt {release}"
html_copy_source = False


def inline_equation(page: HTML5Translator, node: nodes.Element) -> None:
    """Write an equation in a line of text."""
    page.body.append(convert(node.astext()))
    raise nodes.SkipNode


def equation(page: HTML5Translator, node: nodes.Element) -> None:
    """Write an equation in a line of its own."""
    style = "overflow-x: auto; overflow-y: hidden; padding: 0.5em 0"
    shown = convert(node.astext(), display="block")
    page.body.append(f'<div style="{style}">{shown}</div>')
    raise nodes.SkipNode


def setup(app: Sphinx) -> None:
    """Register the renderer of equations."""
    app.add_html_math_renderer("mathml", (inline_equation, None), (equation, None))
