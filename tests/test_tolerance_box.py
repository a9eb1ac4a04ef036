"""Why cases of the box fail, in words, on cases whose outcome is written down."""

import numpy as np
import pandas as pd
import pytest

from snarelab.tolerance.box import why_the_box_fails
from snarelab.tolerance.capture import Axis, Capture, Outcome
from snarelab.tolerance.study import Study, Success


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
