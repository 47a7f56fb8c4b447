"""The examples in docstrings run, including those of the compiled module."""

from __future__ import annotations

import doctest
import importlib
import inspect
import pkgutil
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

import ilc_papers
import ilc_rt

if TYPE_CHECKING:
    from collections.abc import Iterator

ROOT = Path(__file__).resolve().parents[2]


def modules() -> list[str]:
    """Return the name of every module of the packages."""
    found = [ilc_rt.__name__]
    for package in (ilc_rt, ilc_papers):
        inside = pkgutil.walk_packages(package.__path__, f"{package.__name__}.")
        found += [one.name for one in inside]
    return sorted(name for name in found if not name.endswith("__main__"))


def documented(name: str) -> Iterator[tuple[str, str]]:
    """Yield every object that a module defines, with its docstring."""
    module = importlib.import_module(name)
    yield name, module.__doc__ or ""
    for attribute, value in vars(module).items():
        if getattr(value, "__module__", None) != name and not name.endswith("_native"):
            continue
        if not (inspect.isclass(value) or inspect.isroutine(value)):
            continue
        yield f"{name}.{attribute}", inspect.getdoc(value) or ""
        if inspect.isclass(value):
            for member, inner in vars(value).items():
                yield f"{name}.{attribute}.{member}", inspect.getdoc(inner) or ""


def examples(name: str) -> dict[str, str]:
    """Return each docstring of a module that has an example."""
    return {where: text for where, text in documented(name) if ">>>" in text}


@pytest.mark.parametrize("name", modules())
def test_the_examples_in_the_docstrings_of_a_module_run(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Each in a folder of its own with the examples, with no imports but its own."""
    for number, (where, text) in enumerate(examples(name).items()):
        assert "+SKIP" not in text, where
        folder = tmp_path / str(number)
        folder.mkdir()
        (folder / "examples").symlink_to(ROOT / "examples")
        monkeypatch.chdir(folder)
        variables = dict(vars(importlib.import_module(name)))
        test = doctest.DocTestParser().get_doctest(text, variables, where, None, None)
        said: list[str] = []
        flags = doctest.NORMALIZE_WHITESPACE | doctest.ELLIPSIS
        found = doctest.DocTestRunner(optionflags=flags).run(test, out=said.append)
        assert found.failed == 0, "".join(said)


def test_there_are_examples() -> None:
    """Examples of laws, of the package and of the compiled module are found."""
    assert any(where.endswith(".NormOptimalIlc") for where in examples("ilc_rt.laws.norm_optimal"))
    assert examples("ilc_rt.identify")
    assert examples("ilc_rt._native")
