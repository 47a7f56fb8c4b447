"""The lint of the language finds old phrases in prose, and leaves code alone."""

from __future__ import annotations

import json
import sys
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path

import pytest

SCRIPT = Path(__file__).parents[1] / "lint/language.py"

PYTHON = '''"""{}"""

# {}
TEXT = "somebody"
'''


@pytest.fixture(scope="module")
def lint():
    spec = spec_from_file_location("language", SCRIPT)
    module = module_from_spec(spec)
    sys.modules["language"] = module
    spec.loader.exec_module(module)
    yield module
    del sys.modules["language"]


def found(lint, path, text):
    path.write_text(text, encoding="utf-8")
    return [(line, phrase) for line, phrase, _ in lint.findings(path)]


def test_rust_comments(lint, tmp_path):
    text = (
        "/// Whether it is on.\n"
        "fn is_on() {} // somebody's\n"
        '/// Returns `true`.\n///\n/// ```\n/// print("whoever");\n/// ```\n'
        'const TEXT: &str = "somebody"; // a comment\n'
        "// Split over a line: it is\n// none of these.\n"
    )
    expected = [(1, "Whether"), (2, "somebody"), (9, "is none")]
    assert found(lint, tmp_path / "lib.rs", text) == expected


def test_python_docstrings_and_comments(lint, tmp_path):
    text = PYTHON.format("What it does.", "The row is `None`; there is none.")
    assert found(lint, tmp_path / "a.py", text) == [(1, "What")]
    text = PYTHON.format("Return it.", "Starts anew, one row a run.")
    assert found(lint, tmp_path / "b.py", text) == [(3, "anew"), (3, "row a run")]


def test_documents_without_their_code(lint, tmp_path):
    text = "# Title\n\nHow it works. Half the sample rate.\n\n```sh\nanew\n```\n\n`anew`\n"
    assert found(lint, tmp_path / "a.md", text) == [(3, "Half the sample rate")]


def test_notebooks_text_and_comments(lint, tmp_path):
    cells = [
        {"cell_type": "markdown", "source": ["Starts\n", "anew. `anew`"]},
        {"cell_type": "code", "source": ["%magic\n", 'x = "anew"  # for ever']},
    ]
    text = json.dumps({"cells": cells})
    assert found(lint, tmp_path / "a.ipynb", text) == [(2, "anew"), (2, "for ever")]


def test_no_folder_is_left_out(lint):
    assert lint.NOT_YET_CLEAN == ()
