"""Find words that went: in pages, and in the docstrings and messages of the code. ``make check`` runs it.

``words_gone.toml`` lists them as regular expressions with what stands in their place.
"""

import ast
import re
import sys
import tomllib
from collections.abc import Iterator
from functools import cache
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
OUTSIDE = {"tests", "build", "changelog.d"}
HISTORY = {"CHANGELOG.md", "glossary.md"}
"""Pages that may say what a thing was called."""


@cache
def gone(kind: str) -> list[tuple[re.Pattern[str], str]]:
    """Each word that went from files of a kind, ``.md`` or ``.py``, and what to say."""
    content = tomllib.loads((ROOT / "docs" / "words_gone.toml").read_text(encoding="utf-8"))
    words = [word for word in content["gone"] if kind == ".py" or word.get("where") != "code"]
    return [(re.compile(word["pattern"]), word["say"]) for word in words]


def texts(path: Path) -> Iterator[tuple[int, str]]:
    """Line and text of whatever a person reads: all of a page, strings of more than one word in code."""
    content = path.read_text(encoding="utf-8")
    if path.suffix == ".md":
        yield from enumerate(content.splitlines(), 1)
        return
    for node in ast.walk(ast.parse(content)):
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and " " in node.value:
            yield node.lineno, node.value


def complaints(path: Path) -> list[str]:
    """One line for each word that went."""
    return [
        f"{path}:{line}: {found[0]!r} went; say {say}"
        for line, text in texts(path)
        for pattern, say in gone(path.suffix)
        if (found := pattern.search(text))
    ]


def pages() -> list[Path]:
    """Every page and module that is read for words."""
    every = (path for kind in ("*.md", "*.py") for path in ROOT.rglob(kind))
    parts = ((path, path.relative_to(ROOT).parts) for path in every)
    return sorted(p for p, (top, *_) in parts if top not in OUTSIDE and top[0] != "." and p.name not in HISTORY)


if __name__ == "__main__":
    said = [line for path in pages() for line in complaints(path)]
    sys.exit("\n".join(said) if said else 0)
