"""Imports go one way: none to a part above, no circle of parts, and no module leads back to itself."""

import re
import runpy

import pytest
from documentation import DOCS

ROWS = (
    {"cli", "studies"},
    {"tolerance", "identification", "fmu", "report"},
    {"cosim"},
    {"fmi"},
    {"models"},
    {"recordings"},
    {"root files"},
)
DEPTH = {part: k for k, row in enumerate(ROWS) for part in row}


@pytest.fixture(scope="module")
def imports():
    return runpy.run_path(str(DOCS / "make_architecture.py"))


def test_no_import_goes_up(imports):
    found = imports["arrows"]()
    known = {("studies", "identification"), ("fmu", "cosim"), ("cosim", "fmi"), ("fmu", "models")}
    assert known | {("models", "recordings")} <= found
    assert {(a, b) for a, b in found if DEPTH[a] > DEPTH[b]} == set()


def test_no_circle(imports):
    assert imports["circles"](imports["arrows"]()) == set()
    assert imports["circles"]({(a, b) for a, those in imports["modules"]().items() for b in those}) == set()
    assert imports["circles"]({("a", "b"), ("b", "c"), ("c", "a"), ("a", "d")}) == {frozenset("abc")}


def test_exudyn_is_imported_in_one_place():
    """Its two builds differ in the last bits, and a process keeps the one that it imports first."""
    parts = ("bench", "cosim", "fmu", "identification", "models", "proof", "studies", "tolerance")
    files = [path for part in parts for path in (DOCS.parent / part).rglob("*.py")]
    named = [p.name for p in files if re.search(r"^\s*(import|from) exudyn\b", p.read_text(), re.MULTILINE)]
    assert named == ["exudyn_build.py"]
