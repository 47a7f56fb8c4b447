"""The documentation site: Sphinx over the documents of the whole tree and the installed package.

`make docs` builds it into build/docs, without network and with warnings as errors.
"""

from ilc_rt import __version__

project = "ilc-rt"
author = "the authors of ilc-rt"
release = __version__

# The source is the root of the tree, so that a link in a document works here as on the forge.
extensions = [
    "myst_nb",
    "sphinx.ext.autodoc",
    "sphinx.ext.mathjax",
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
nb_execution_timeout = 120
nb_merge_streams = True

# Types stand in the docstrings, with units and shapes, which annotations lack.
autodoc_typehints = "none"
autodoc_member_order = "bysource"
autodoc_default_options = {"members": True, "show-inheritance": True}
numpydoc_show_class_members = False

html_theme = "furo"
html_title = f"ilc-rt {release}"
html_copy_source = False
