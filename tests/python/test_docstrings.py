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


def examples() -> dict[str, str]:
    """Return each docstring with an example, once for an object of several modules."""
    by_text: dict[str, str] = {}
    for name in modules():
        for where, text in documented(name):
            if ">>>" in text:
                by_text.setdefault(text, where)
    return {where: text for text, where in by_text.items()}


EXAMPLES = examples()


@pytest.mark.parametrize("where", EXAMPLES)
def test_an_example_in_a_docstring_runs(
    where: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """In a folder with the examples, with no imports but the example's own."""
    (tmp_path / "examples").symlink_to(ROOT / "examples")
    monkeypatch.chdir(tmp_path)
    module = importlib.import_module(
        next(name for name in sorted(modules(), key=len, reverse=True) if where.startswith(name))
    )
    test = doctest.DocTestParser().get_doctest(
        EXAMPLES[where], dict(vars(module)), where, None, None
    )
    said: list[str] = []
    flags = doctest.NORMALIZE_WHITESPACE | doctest.ELLIPSIS
    found = doctest.DocTestRunner(optionflags=flags).run(test, out=said.append)
    assert found.failed == 0, "".join(said)


@pytest.mark.parametrize("where", EXAMPLES)
def test_no_example_is_passed_over(where: str) -> None:
    """Every example can run."""
    assert "+SKIP" not in EXAMPLES[where]


def test_there_are_examples() -> None:
    """Examples of the compiled module and of the package are found."""
    assert any(where.endswith(".NormOptimalIlc") for where in EXAMPLES)
    assert any(where.startswith("ilc_rt.identify") for where in EXAMPLES)
    assert len(EXAMPLES) > 40
