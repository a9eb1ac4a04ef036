"""Where the box stands out of the envelope and why its cases fail, in words, on cases of known outcome."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from snarelab.tolerance.box import where_the_box_stands_out, why_the_box_fails
from snarelab.tolerance.capture import Axis, Capture, Outcome
from snarelab.tolerance.rays import rays
from snarelab.tolerance.study import Study, Success
from snarelab.tolerance.summary import Interval


@pytest.fixture
def study(tmp_path):
    axes = tuple(Axis(n, "m", n, 0.0, -1.0, 1.0) for n in ("radial_y", "radial_z"))
    capture = Capture("toy", axes, lambda values: Outcome.failed("never run"))
    ranges = {"radial_y": (-0.1, 0.1), "radial_z": (-0.1, 0.1)}
    return Study(tmp_path, "toy", capture, 1, "sobol", 8, 64, 0.05, ranges, {}, Success(0.010, 8e3), {}, 1)


def case(y, z, error, enclosed=True, contact=2.6, reason=""):
    margin = np.nan if reason else (1.0 - error / 0.010 if enclosed else -1.0)
    names = ("radial_y", "radial_z", "radial_error", "enclosed", "first_contact", "margin", "reason")
    return dict(zip(names, (y, z, error, enclosed, contact, margin, reason), strict=True))


def test_kinds_sizes_and_the_side_are_told(study):
    rows = [
        case(-0.02, 0.02, 0.0123),
        case(0.02, 0.02, 0.0104),
        case(-0.02, 0.02, 0.05, enclosed=False),
        case(0.02, 0.02, 0.05, enclosed=False, contact=np.nan),
        case(-0.02, -0.02, np.nan, enclosed=False, reason="the step diverged"),
        *(case(y, -0.02, 0.008) for y in (0.02, 0.02, -0.02)),
    ]
    assert why_the_box_fails(study, pd.DataFrame(rows)) == (
        "Of 8 cases of the box 5 do not succeed: 2 off the axis (by 10.4 to 12.3 mm; 10 mm are allowed), 1 escaped, "
        "1 never touched, 1 without a result. Most of them stand on one side: 4 of 4 with radial_z above its middle, "
        "but 1 of 4 with radial_z below."
    )


def test_no_side_is_told_where_both_fail_alike(study):
    rows = [case(y, z, 0.02 if y * z > 0 else 0.005) for y in (-0.02, 0.02) for z in (-0.02, 0.02)]
    words = why_the_box_fails(study, pd.DataFrame(rows))
    assert words == "Of 4 cases of the box 2 do not succeed: 2 off the axis (by 20.0 to 20.0 mm; 10 mm are allowed)."


def test_a_box_without_failures_says_so(study):
    rows = [case(y, 0.0, 0.005) for y in (-0.02, 0.02)]
    assert why_the_box_fails(study, pd.DataFrame(rows)) == "All 2 cases of the box succeed."


def disc(study, radius):
    """The ends of all rays where success is a disc about the nominal case."""
    return [(ray, Interval(*(np.sign(ray.length) * np.array([radius, radius - 1e-3, radius])))) for ray in rays(study)]


def test_a_square_box_stands_out_of_a_disc_at_its_corners(study):
    boxed = replace(study, box=dict.fromkeys(study.ranges, (-0.02, 0.02)))
    words = where_the_box_stands_out(boxed, disc(boxed, 0.025))
    assert words.startswith("The box is not within the envelope. Of 8 directions tried, everything else at nominal,")
    assert words.count("towards") == 4
    assert "towards -radial_y +radial_z, at 24 to 25 mm of 28.3;" in words
    assert where_the_box_stands_out(boxed, disc(boxed, 0.030)).startswith("In none of the 8 directions tried")


def test_a_side_of_the_box_that_is_not_named_reaches_to_the_limit_of_the_range(study):
    flat = replace(study, box={"radial_y": (-0.02, 0.02), "radial_z": (0.0, 0.0)})
    assert where_the_box_stands_out(flat, disc(flat, 0.025)).startswith("In none of the 2 directions tried")
    words = where_the_box_stands_out(replace(study, box={"radial_y": (-0.02, 0.02)}), disc(study, 0.025))
    assert "towards -radial_z, at 24 to 25 mm of 100;" in words
    assert "towards -radial_y," not in words


def test_nothing_is_said_of_a_box_that_the_nominal_case_is_not_in_or_fails_in(study):
    aside = replace(study, box=dict.fromkeys(study.ranges, (0.01, 0.02)))
    assert where_the_box_stands_out(aside, disc(aside, 0.025)) == ""
    assert where_the_box_stands_out(study, [(ray, Interval(np.nan, np.nan, np.nan)) for ray in rays(study)]) == ""
