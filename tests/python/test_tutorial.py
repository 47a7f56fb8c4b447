"""The notebooks of the tutorial run from top to bottom, and are kept without outputs."""

from __future__ import annotations

import json
import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
NOTEBOOKS = sorted((ROOT / "docs" / "tutorial").glob("*.ipynb"))

#: Executes a notebook in the current folder, over sockets of that folder: ports may be taken.
EXECUTE = """
import json, sys
import jupyter_client, nbclient, nbformat
notebook = nbformat.read(sys.argv[1], as_version=4)
nbformat.validate(notebook)
kernel = jupyter_client.AsyncKernelManager(kernel_name="python3", transport="ipc")
nbclient.NotebookClient(notebook, km=kernel, timeout=900, startup_timeout=900).execute()
print(json.dumps([cell.get("outputs", []) for cell in notebook.cells]))
"""


def executed(notebook: Path, folder: Path) -> list[dict[str, object]]:
    """Return the outputs of all cells of a notebook, executed in a folder."""
    done = subprocess.run(
        [sys.executable, "-c", EXECUTE, str(notebook)],
        cwd=folder, capture_output=True, text=True, timeout=1000, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    return [output for cell in json.loads(done.stdout) for output in cell]


def said(outputs: list[dict[str, object]]) -> str:
    """Return the text of outputs, printed and shown."""
    parts = []
    for output in outputs:
        shown = output.get("data", {})
        assert isinstance(shown, dict)
        parts += ["".join(output.get("text", "")), "".join(shown.get("text/plain", ""))]
    return "\n".join(parts)


def laws_are_compared(text: str, _folder: Path) -> None:
    """Check that the naive law diverges, as its analysis says, and two others do not."""
    assert "from 12.204 Hz on the error grows" in " ".join(text.split())
    changes = re.findall(r"'first': ([\d.e-]+), 'best': [\d.e-]+, 'last': ([\d.e-]+)", text)
    mine, p_type, norm_optimal = (float(last) / float(first) for first, last in changes)
    assert mine > 1.0
    assert norm_optimal < 0.1 * p_type < 0.01


def a_plant_is_learned(text: str, folder: Path) -> None:
    """Check that other stages are learned by the same law, and that an experiment resumes."""
    worst = re.search(r"worst of 12 stages: ([\d.]+)%", text)
    assert worst
    assert float(worst[1]) < 1.0
    assert "from run 0" in text
    assert "from run 3" in text
    assert (folder / "bench.db").exists()


def another_part_is_right_at_once(text: str, folder: Path) -> None:
    """Check that what was learned elsewhere takes 70 % of the error in the first run with it."""
    found = re.search(r"(\d+) µm without, (\d+) µm at once", text)
    assert found
    assert float(found[2]) < 0.3 * float(found[1])
    assert {"bench.db", "bench.toml", "other.toml"} <= {one.name for one in folder.iterdir()}


CLAIMS = {"1": laws_are_compared, "2": a_plant_is_learned, "3": another_part_is_right_at_once}


@pytest.mark.timeout(1200)
@pytest.mark.parametrize("notebook", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_runs_as_a_reader_runs_it(notebook: Path, tmp_path: Path) -> None:
    """In an empty folder, with pictures, and without a warning to the reader."""
    outputs = executed(notebook, tmp_path)
    assert sum("image/png" in str(output.get("data", {})) for output in outputs) >= 2
    assert not [output for output in outputs if output.get("name") == "stderr"]
    text = said(outputs)
    CLAIMS[notebook.stem[0]](text, tmp_path)


@pytest.mark.parametrize("notebook", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_is_kept_without_outputs(notebook: Path) -> None:
    """So that a change is a change of its text; the site shows it executed."""
    content = json.loads(notebook.read_text(encoding="utf-8"))
    for cell in content["cells"]:
        assert not cell.get("outputs")
        assert cell.get("execution_count") is None
    assert content["metadata"]["kernelspec"]["name"] == "python3"
    assert content["cells"][0]["source"][0].startswith("# ")


def test_there_are_notebooks() -> None:
    assert len(NOTEBOOKS) >= 3
