"""Lint of the language: comments, docstrings and documents use the field's terms.

Prints file and line of each old phrase with its replacement; the rules are in CONTRIBUTING.md,
"Language".
"""

from __future__ import annotations

import ast
import io
import json
import re
import subprocess
import sys
import tokenize
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    from collections.abc import Iterator

ROOT = Path(__file__).parents[2]
# Pages that `make gallery` writes.
DERIVED = ("docs/gallery/",)
# Folders and files that are not reworded yet: none, and it stays so.
NOT_YET_CLEAN: tuple[str, ...] = ()

# First words of a doc comment or docstring: it starts with a noun phrase or a verb instead.
HEAD = re.compile(r"(What|Whether|How|Why|Where|Which|Whatever|Whoever|Whose|Who)\b(?! if)")
# Old phrase, and its replacement.
PHRASES = {
    r"(?<!there )\b(is|are|was|were) (?-i:none)\b": 'say "is not a …", "no …", "unlimited"',
    r"\banew\b": "again, new",
    r"\b(whoever|somebody|nobody)\b": "the caller, another program, the user, no …",
    r"\b(taken|takes?|took) back\b": "rolled back, undone, subtracted",
    r"\bas which\b": "name the purpose",
    r"\bof which (the|a law)\b": "whose, if the",
    r"\bthe most (that|by which)\b": "largest, at most",
    r"\bas a temperature\b": "e.g. a temperature",
    r"\bsuperfluous\b": "redundant, unobservable, uncontrollable",
    r"\b(astray|misfit|good-?bye|hopeless|scribbl\w+)\b": "wrong, residual, end of session, …",
    r"\b(to go|goes|go|going|gone|went) on with\b": "resume, continue with",
    r"\beach \w+ by itself\b": "individually, each … alone",
    r"\bbeyond all measure\b": "without bound, overflow",
    r"\bfor ever\b": "indefinitely",
    r"\b(one|row|column|line|value|number|matrix|entry) an? "
    r"(run|tick|cycle|sample|line|axis|leg|segment|channel|agent)\b": "one per …",
    r"\b(is|are|was|were) told( of)?\b": "is reported, logged, commanded",
    r"\bwhat (came|becomes|became|comes) (of|out)\b": "the outcome, result or output of",
    r"\bput right\b": "corrected",
    r"\b(goes|go|put|puts) round\b": "wraps",
    r"\bwork(s|ed)? out\b": "computes",
    r"\bhalf the sampl(e|ing) rate\b": "the Nyquist frequency",
}
COMPILED = [(re.compile(old, re.IGNORECASE), new) for old, new in PHRASES.items()]
CODE = re.compile(r"``.*?``|`[^`]*`")


class Block(NamedTuple):
    """A comment or docstring: its first line, its lines, and whether it documents an item."""

    line: int
    lines: list[str]
    documents: bool


def rust(text: str) -> Iterator[Block]:
    """Yield the comments of a Rust file without their fenced code."""
    kind, block, fenced = "", Block(0, [], documents=False), False
    for number, line in enumerate([*text.splitlines(), ""], 1):
        comment = re.match(r"\s*(//[/!]?)(?!/) ?(.*)", line)
        trailing = None if comment else re.search(r"[^:\"] // ([^\"]*)$", line)
        if not comment or comment[1] != kind:
            if block.lines:
                yield block
            kind, fenced = comment[1] if comment else "", False
            block = Block(number, [], documents=kind in ("///", "//!"))
        if comment:
            fence = comment[2].startswith("```") and block.documents
            block.lines.append("" if fence or fenced else comment[2])
            fenced ^= fence
        elif trailing:
            yield Block(number, [trailing[1]], documents=False)


def python(text: str) -> Iterator[Block]:
    """Yield the docstrings and comments of a Python file without doctests."""
    for node in ast.walk(ast.parse(text)):
        body = getattr(node, "body", None)
        for statement in body if isinstance(body, list) else []:
            value = statement.value if isinstance(statement, ast.Expr) else None
            if isinstance(value, ast.Constant) and isinstance(value.value, str):
                lines = re.sub(r"^ *(>>>|\.\.\.).*", "", value.value, flags=re.MULTILINE)
                yield Block(statement.lineno, lines.split("\n"), documents=True)
    for token in tokenize.generate_tokens(io.StringIO(text).readline):
        if token.type == tokenize.COMMENT:
            yield Block(token.start[0], [token.string.lstrip("#: ")], documents=False)


def markdown(text: str) -> Iterator[Block]:
    """Yield a document without its fenced code."""
    lines, fenced = [], False
    for line in text.splitlines():
        fence = line.startswith("```")
        lines.append("" if fence or fenced else line)
        fenced ^= fence
    yield Block(1, lines, documents=False)


def notebook(text: str) -> Iterator[Block]:
    """Yield the text of a notebook, and the comments of its code; lines are those of a cell."""
    for cell in json.loads(text)["cells"]:
        # A line of magic, e.g. `%matplotlib inline`, is not Python.
        source = re.sub(r"^%.*", "", "".join(cell["source"]), flags=re.MULTILINE)
        yield from markdown(source) if cell["cell_type"] == "markdown" else python(source)


READERS = {".rs": rust, ".py": python, ".pyi": python, ".md": markdown, ".ipynb": notebook}


def findings(path: Path) -> Iterator[tuple[int, str, str]]:
    """Yield line, phrase and replacement of everything wrong in a file."""
    for block in READERS[path.suffix](path.read_text(encoding="utf-8")):
        joined = "\n".join(block.lines)
        plain = CODE.sub(lambda code: re.sub(r"[^\n]", "`", code[0]), joined)
        head = HEAD.match(plain.lstrip()) if block.documents else None
        if head:
            yield block.line, head[0], "start with a noun phrase or a verb in the third person"
        for old, new in COMPILED:
            for found in old.finditer(re.sub(r"\n[ ]*", lambda gap: " " * len(gap[0]), plain)):
                yield block.line + plain.count("\n", 0, found.start()), found[0], new


def main() -> int:
    """Check every tracked file; return 1 if a phrase is found."""
    patterns = ["*.rs", "*.py", "*.pyi", "*.ipynb", "docs/*.md", "README.md", "ARCHITECTURE.md"]
    listed = subprocess.run(["git", "ls-files", *patterns, "CONTRIBUTING.md"], cwd=ROOT, check=True,
                            capture_output=True, text=True)  # fmt: skip
    count = 0
    for name in listed.stdout.split():
        if name.startswith(DERIVED + NOT_YET_CLEAN) or not (ROOT / name).exists():
            continue
        for line, phrase, new in findings(ROOT / name):
            print(f"{name}:{line}: {phrase!r}: {new}")
            count += 1
    print(f"{count} phrases to reword" if count else "the language is clean", file=sys.stderr)
    return int(count > 0)


if __name__ == "__main__":
    sys.exit(main())
