"""Imports go one way: none to a part above, no circle of parts but two, and no module leads back to itself."""

import runpy

import pytest
from documentation import DOCS

ROWS = (
    {"cli", "studies"},
    {"tolerance", "identification", "checks", "cosim", "fmu", "report"},
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
    assert {("studies", "identification"), ("fmu", "cosim"), ("fmu", "models"), ("models", "recordings")} <= found
    assert {(a, b) for a, b in found if DEPTH[a] > DEPTH[b]} == set()


def test_no_circle_but_the_two_that_are_known(imports):
    known = {frozenset({"identification", "checks"}), frozenset({"cosim", "fmu"})}
    assert imports["circles"](imports["arrows"]()) == known
    assert imports["circles"]({(a, b) for a, those in imports["modules"]().items() for b in those}) == set()
    assert imports["circles"]({("a", "b"), ("b", "c"), ("c", "a"), ("a", "d")}) == {frozenset("abc")}
