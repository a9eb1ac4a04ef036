"""The table of the numbers that decide, from `identification/deciding.py`; `make_pages.py` puts it in its place."""

import ast
from itertools import pairwise
from pathlib import Path

SOURCE = Path(__file__).resolve().parents[1] / "identification" / "deciding.py"

HEAD = """\
| constant | value | meaning |
| --- | --- | --- |
"""


def numbers() -> list[tuple[str, object, str]]:
    """Name, value and docstring of each, in order."""
    body = ast.parse(SOURCE.read_text(encoding="utf-8")).body
    found = []
    for statement, after in pairwise(body):
        if not isinstance(statement, ast.Assign):
            continue
        (target,) = statement.targets
        assert isinstance(target, ast.Name)
        assert isinstance(after, ast.Expr), f"{target.id} has no docstring"
        words = ast.literal_eval(after.value)
        found.append((target.id, ast.literal_eval(statement.value), " ".join(words.split())))
    return found


def table() -> str:
    """All of them in Markdown."""
    return HEAD + "".join(f"| `{name}` | {_written(value)} | {words} |\n" for name, value, words in numbers()) + "\n"


def _written(value: object) -> str:
    return ", ".join(str(x) for x in value) if isinstance(value, tuple) else str(value)
