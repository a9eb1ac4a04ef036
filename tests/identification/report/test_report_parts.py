"""What the report is made of: lines thinned for drawing, means in bins, numbers in print."""

import re

import numpy as np
import pytest
from diagnoses import missing_physics, spelt

from snarelab.identification.diagnosis import Trace
from snarelab.identification.report.findings import missing
from snarelab.identification.report.fit import changes
from snarelab.report.bins import binned
from snarelab.report.drawing import thinned
from snarelab.report.words import chance, number, percent, spans, unit_words, with_std, words


def test_thinning_keeps_peaks_ends_and_gaps() -> None:
    t = np.arange(20_000) / 200
    values = np.sin(t)
    values[[777, 15_003]] = 9.0, -9.0
    values[4000:4400] = np.nan
    t[10_000:] += 5.0
    kept_time, kept = thinned(t, values)
    assert kept_time.size < 1600
    assert (kept_time[0], kept_time[-1]) == (t[0], t[-1])
    for place in (777, 15_003):
        assert values[place] in kept[kept_time == t[place]]
    finite = np.isfinite(kept)
    assert np.all(np.isin(kept[finite], values))
    assert np.all(np.diff(kept_time) >= 0)
    for start, end in ((t[3999], t[4400]), (t[9999], t[10_000])):
        assert not np.any(finite & (kept_time > start) & (kept_time < end))
        assert np.any(~finite & (kept_time >= start) & (kept_time < end))


def test_bins_find_a_jump_at_zero() -> None:
    side = np.where(np.arange(4001) % 2, 0.5, -0.5)
    speed = np.linspace(-0.73, 1.1, 4001)
    centre, mean, spread = binned(speed, np.where(speed < 0, -2.0, 3.0) + side)
    known = np.isfinite(mean)
    assert known.sum() >= 39
    np.testing.assert_allclose(mean[known], np.where(centre[known] < 0, -2.0, 3.0), atol=0.03)
    np.testing.assert_allclose(spread[known], 0.5, atol=0.03)
    assert np.isnan(binned(np.array([-1.0, 1.0]), np.zeros(2))[1]).all()


@pytest.mark.parametrize(
    ("value", "std", "expected"),
    [
        (20.3935, 0.0432, ("20.39", "0.04")),
        (20.3937, 0.0149, ("20.394", "0.015")),
        (5423.0, 61.0, ("5420", "60")),
        (-3.1648, 0.0961, ("−3.16", "0.10")),
        (12.0, 340.0, ("0", "300")),
        (3.24e-5, 4e-6, ("3.2\u2009×\u200910⁻⁵", "0.4\u2009×\u200910⁻⁵")),
        (2.5e9, 3e7, ("2.50\u2009×\u200910⁹", "0.03\u2009×\u200910⁹")),
        (1.23456, 0.0, ("1.235", "–")),
        (1.23456, float("nan"), ("1.235", "–")),
    ],
)
def test_a_value_has_the_digits_of_its_deviation(value: float, std: float, expected: tuple[str, str]) -> None:
    assert with_std(value, std) == expected


def test_numbers_and_units_in_print() -> None:
    assert [number(x) for x in (0.0, 0.034567, 7.3551, 21634.0, 1.2e-7)] == [
        "0",
        "0.0346",
        "7.36",
        "21600",
        "1.20\u2009×\u200910⁻⁷",
    ]
    assert [percent(x, 3) for x in (0.83, 0.0161, 0.00001)] == ["83.0 %", "1.61 %", "under 0.01 %"]
    assert [chance(x) for x in (0.999, 0.87, 0.001)] == ["over 99 %", "87 %", "under 1 %"]
    assert [unit_words(u) for u in ("N*m*s/rad", "kg*m**2", "s^-1")] == ["N·m·s/rad", "kg·m²", "s⁻¹"]
    assert [unit_words(u) for u in ("N*m*s^2/rad", "N*s^2/m", "N/m**1.5", "1", "N * m")] == [
        "kg·m²",
        "kg",
        "N/m¹·⁵",
        "",
        "N·m",
    ]
    assert [words(n) for n in ("coulomb_friction", "joint_elasticity")] == ["Coulomb friction", "joint elasticity"]
    assert spans(((80.1, 96.44), (100.0, 101.0))) == "80.1–96.4, 100.0–101.0 s"


def test_edges_of_numbers_in_print() -> None:
    """Where a rounding or a form begins: each pair is the last of one and the first of the other."""
    assert [number(x) for x in (99960.0, 999600.0, 1.23e-4, 9.99e-5)] == [
        "100000",
        "1.00\u2009×\u200910⁶",
        "0.000123",
        "9.99\u2009×\u200910⁻⁵",
    ]
    assert [percent(x, 3) for x in (0.0, 4.9e-5, 5e-5, 0.0994, 0.09996)] == [
        "0 %",
        "under 0.01 %",
        "0.01 %",
        "9.94 %",
        "10.0 %",
    ]
    assert [chance(x) for x in (0.0, 0.0099, 0.01, 0.99, 0.991)] == [
        "under 1 %",
        "under 1 %",
        "1 %",
        "99 %",
        "over 99 %",
    ]
    nothing = float("nan")
    assert (number(nothing), percent(float("inf")), chance(nothing), spans(())) == ("–", "–", "–", "–")
    assert spans(tuple((k, k + 0.5) for k in range(8))).endswith("7.0–7.5 s")
    assert spans(tuple((k, k + 0.5) for k in range(9))).endswith("7.0–7.5 s, and 1 more")


def test_what_has_no_name_stands_below_what_has() -> None:
    title, content = missing(spelt("a < b"))[1:]
    assert title == "What is missing"
    assert content.index("<h3>a &lt; b</h3>") < content.index("<h3>Without a name</h3>\n<p>a &lt; b</p>")
    assert "Without a name" not in missing(missing_physics())[2]


def test_of_rivals_the_probabilities_stand_to_the_right_and_the_words_to_the_left() -> None:
    content = missing(missing_physics())[2]
    (rivals,) = re.findall(r"<caption>What else it could be.*?</table>", content.split("Joint elasticity at")[0], re.S)
    assert re.findall(r'class="n"[^>]*>([^<]*)<', rivals) == ["Probability", "8\u202f%", "3\u202f%"]
    words = re.findall(r"<td(?! class)[^>]*>([^<]*)<", rivals)
    assert [cell for cell in words if re.match(r"\d|over|under", cell)] == []


@pytest.mark.parametrize(("share", "twice"), [(0.0, False), (0.009, False), (0.011, True), (1.0, True)])
def test_a_model_is_drawn_twice_where_it_changed_by_over_a_hundredth_of_what_was_left(share, twice) -> None:
    """On a channel of many newton metres: what it carries is no measure of what was left of it."""
    t = np.arange(1000) / 100
    left, carried = np.sin(2 * np.pi * t), 50 * np.cos(t)
    still = Trace("a.csv", "train", "tau.joint1", "N*m", t, t, t, carried + left, carried, carried)
    moved = Trace("a.csv", "train", "tau.joint2", "N*m", t, t, t, carried + left, carried, carried + share * left)
    assert changes([moved]) is twice
    assert changes([still, moved]) is twice  # one that changed is enough
