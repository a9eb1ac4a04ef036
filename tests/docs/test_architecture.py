"""Imports go one way: no part imports one above it, none but one circle is left, and no module leads back to itself."""

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
    assert {("studies", "identification"), ("cosim", "fmu"), ("fmu", "models"), ("models", "recordings")} <= found
    assert {(a, b) for a, b in found if DEPTH[a] > DEPTH[b]} == set()


def test_no_circle_but_the_one_that_is_known(imports):
    assert imports["circles"](imports["arrows"]()) == {frozenset({"identification", "checks"})}
    assert imports["circles"]({(a, b) for a, those in imports["modules"]().items() for b in those}) == set()
    assert imports["circles"]({("a", "b"), ("b", "c"), ("c", "a"), ("a", "d")}) == {frozenset("abc")}
