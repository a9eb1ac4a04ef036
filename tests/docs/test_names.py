"""Names of types: each stands for one thing, and is a noun."""

import ast
import re
from collections import Counter
from collections.abc import Iterator

import pytest
from documentation import DOCS

PRODUCT = ("cosim", "fmi", "fmu", "identification", "models", "recordings", "report", "studies", "tolerance")
IRREGULAR = {
    "Apart",
    "Drawn",
    "Found",
    "Held",
    "Hung",
    "Kept",
    "Known",
    "Left",
    "Made",
    "Meant",
    "Read",
    "Said",
    "Seen",
}
IRREGULAR |= {"Shown", "Taken", "Told", "Written", "Beside", "Alike", "Along", "About", "Linear", "Passive", "Rigid"}


@pytest.fixture(scope="module")
def classes():
    files = [*DOCS.parent.glob("*.py"), *(path for part in PRODUCT for path in (DOCS.parent / part).rglob("*.py"))]
    trees = [ast.parse(path.read_text(encoding="utf-8")) for path in files]
    names = [node.name for tree in trees for node in ast.walk(tree) if isinstance(node, ast.ClassDef)]
    return [name for name in names if not name.startswith("_")]


def is_noun(name):
    last = re.findall(r"[A-Z][a-z0-9]*", name)[-1]
    return not last.endswith("ed") and last not in IRREGULAR


def test_no_class_name_stands_for_two_things(classes):
    assert len(classes) > 200
    assert [name for name, times in Counter(classes).items() if times > 1] == []


def test_types_are_nouns(classes):
    assert not any(is_noun(name) for name in ("Taken", "Judged", "LeftOverFound", "NotConverged"))
    assert [name for name in classes if not is_noun(name)] == []


def strings(tree) -> Iterator[str]:
    """Docstrings, and strings under fields and constants."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant) and isinstance(node.value.value, str):
            yield node.value.value


def letters(text):
    """Single letters in shapes such as (n, 10 L), (P,) or (n_band, k)."""
    size = r"(?:\d+|[A-Za-z]|n_\w+)"
    one = rf"{size}(?: ?[*+] ?{size}| [A-Z])*"
    found = re.findall(rf"(?<![\w])\({one}(?:, {one})*,?\)", text)
    return {x for shape in found if "," in shape for x in re.findall(r"\b[A-Za-z]\b", shape)}


def test_shapes_in_identification_use_the_glossarys_letters():
    assert letters("x (n, 10 L), y (P,), z (k + 1, n_band), f(q, x)") == {"n", "L", "P", "k"}
    page = (DOCS / "glossary.md").read_text(encoding="utf-8")
    known = set(re.findall(r"`([A-Za-z])`", page[page.index("## Symbols") :]))
    off = {}
    for path in sorted((DOCS.parent / "identification").rglob("*.py")):
        tree = ast.parse(path.read_text(encoding="utf-8"))
        if strange := {x for text in strings(tree) for x in letters(text)} - known:
            off[path.name] = strange
    assert off == {}
