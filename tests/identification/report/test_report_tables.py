"""The report's pictures of tables without a name: which numbers stand where, their units, and the words beside them."""

from typing import Any

import numpy as np
import pytest
from drawn_axes import drawn
from pages import Page, pictures

from snarelab.identification.diagnosis import EmpiricalTable
from snarelab.identification.report import tables

X, Y = np.linspace(-1.0, 1.0, 5), np.linspace(0.0, 3.0, 5)
VALUE = 2.0 * X[:, None] + np.sin(Y)
STD = 0.1 + 0.01 * np.arange(25.0).reshape(5, 5)
MAP = EmpiricalTable("joint1", ("position", "speed of joint2"), "direction", (X, Y), VALUE, STD, "N*m", ("rad", "m/s"))
CURVE = EmpiricalTable("joint1", ("load",), "", (X,), X**2, 0.1 + 0.05 * X, "N*m", ("N*m",))


@pytest.fixture
def unwritten(monkeypatch):
    """Figures are handed out as they are before they become SVG."""
    monkeypatch.setattr(tables, "svg", lambda figure: figure)


@pytest.mark.usefixtures("unwritten")
def test_a_table_of_two_coordinates_is_a_map_of_its_values_beside_one_of_its_deviations():
    figure = drawn(tables.drawn(MAP))
    left, right, *bars = figure.axes
    assert [bar.get_ylabel() for bar in bars] == ["value [N·m]", "deviation [N·m]"]
    assert left.get_position().x0 < right.get_position().x0
    for axes, bar, numbers in zip((left, right), bars, (VALUE, STD), strict=True):
        assert (axes.get_xlabel(), axes.get_ylabel()) == ("position of joint1 [rad]", "speed of joint2 [m/s]")
        mesh: Any = axes.collections[0]
        places, shown = mesh.get_coordinates().reshape(-1, 2), mesh.get_array().ravel()
        found = {(x, y): z for (x, y), z in zip(places.tolist(), shown.tolist(), strict=True)}
        assert found == {(x, y): numbers[i, k] for i, x in enumerate(X) for k, y in enumerate(Y)}
        assert bar.get_ylim() == pytest.approx((numbers.min(), numbers.max()))
        assert axes.get_xlim() == pytest.approx((-1, 1), abs=0.1)
        assert axes.get_ylim() == pytest.approx((0, 3), abs=0.2)


@pytest.mark.usefixtures("unwritten")
def test_a_table_of_one_coordinate_is_a_curve_with_two_deviations_either_side():
    (axes,) = drawn(tables.drawn(CURVE)).axes
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("load of joint1 [N·m]", "value [N·m]")
    x, y = np.asarray(axes.lines[-1].get_data(), float)
    np.testing.assert_allclose(np.interp(X, x, y), X**2, atol=1e-12)  # every knot is one of the points
    band: Any = axes.collections[0]
    corners = band.get_paths()[0].vertices
    for at, value, std in zip(X, X**2, CURVE.std, strict=True):
        here = corners[np.isclose(corners[:, 0], at), 1]
        assert (here.min(), here.max()) == pytest.approx((value - 2 * std, value + 2 * std))


def test_each_picture_is_said_in_words():
    page = Page(tables.tables((MAP, CURVE)))
    of_map, of_curve = [image["alt"] for image in page.all("img")]
    assert of_map == (
        "Empirical law at joint1 over position and speed of joint2 by direction, without a name. "
        "Right: its standard deviation. Outside, the end value is held."
    )
    assert of_curve == (
        "Empirical law at joint1 over load, without a name. Band: two standard deviations. "
        "Outside, the end value is held."
    )
    assert ["deviation [N·m]" in picture for picture in pictures(page)] == [True, False]
