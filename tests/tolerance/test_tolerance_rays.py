"""Ends of the envelope along single directions, against a shape that is known in closed form."""

import numpy as np
import pytest

from snarelab.tolerance.capture import Axis, Capture, Outcome
from snarelab.tolerance.rays import FINE, STAGE, ends, envelope, next_cases, rays, shortest
from snarelab.tolerance.results import Results
from snarelab.tolerance.study import Study, Success

SEMI_AXES = {"radial_y": 0.06, "radial_z": 0.05, "pitch": 0.20}
CENTRE = {"radial_y": 0.0, "radial_z": 0.01, "pitch": 0.0}
RANGES = {"radial_y": (-0.12, 0.12), "radial_z": (-0.1, 0.1), "pitch": (-0.1, 0.4), "speed": (0.0, 0.01)}


def outcome(values) -> Outcome:
    """An ellipsoid of the first three; speed does not matter."""
    return Outcome(True, 0.010 * sum(((values[n] - CENTRE[n]) / a) ** 2 for n, a in SEMI_AXES.items()), 2.6, 5.0, 1.0)


@pytest.fixture
def walked(tmp_path):
    """The study, and its results with every ray walked to its end; ``captures`` of them at a time are recorded."""

    def walk(run=outcome, captures=100):
        capture = Capture("ellipsoid", tuple(Axis(n, "m", n, 0.0, -1.0, 1.0) for n in RANGES), run)
        success = Success(0.010, 1e3)
        study = Study(tmp_path, "e", capture, 1, "sobol", 8, 8, 0.05, RANGES, {}, success, {}, 1)
        results = Results(tmp_path / f"{captures}", study)
        while wanted := next_cases(study, results.table(STAGE)):
            for number, point in list(wanted.items())[:captures]:
                results.add(STAGE, number, study.values(point), run(study.values(point)))
        return study, results.table(STAGE)

    return walk


def test_ends_stand_where_the_closed_form_has_them(walked):
    study, table = walked()
    found = ends(study, table)
    limits = envelope(study, found)
    # Along y at z = 0 the ellipsoid ends at 0.06 sqrt(1 - (0.01 / 0.05)^2), along pitch at 0.20 times that root.
    root = np.sqrt(1 - 0.2**2)
    for name, truth in (
        ("radial_y", (-0.06 * root, 0.06 * root)),
        ("radial_z", (-0.04, 0.06)),
        ("pitch", (-0.1, 0.2 * root)),  # downwards success goes to the limit
        ("speed", (0.0, 0.01)),  # nominal is its lower limit
    ):
        for end, exact, limit in zip(limits[name], truth, RANGES[name], strict=True):
            assert abs(end.low) <= abs(exact) + 1e-12
            assert abs(end.high) >= abs(exact) - 1e-12
            assert abs(end.high - end.low) <= abs(limit) / FINE + 1e-12
    down = limits["pitch"][0]
    assert (down.low, down.value, down.high) == pytest.approx((-0.1, -0.1, -0.1))


def test_the_diagonals_count_for_the_offset(walked):
    study, table = walked()
    found = ends(study, table)
    # -z is the shortest way out; the diagonal there is where (s/60)^2 + ((s+10)/50)^2 = 1 of s = 29.4 mm.
    worst = shortest(found, ("radial_y", "radial_z"))
    assert worst is not None
    assert worst.low <= 0.04 <= worst.high
    diagonal = next(e for r, e in found if len(r.axes) == 2 and (r.tip[:2] < 0).all())
    s = max(np.roots([1 / 60**2 + 1 / 50**2, 20 / 50**2, 100 / 50**2 - 1]).real) * 1e-3
    assert diagonal.low <= np.sqrt(2) * s <= diagonal.high
    assert shortest(found, ("roll",)) is None


def test_the_cases_are_the_same_however_they_are_broken_off(walked):
    _, whole = walked()
    _, pieces = walked(captures=1)
    assert whole.equals(pieces)
    assert len(whole) <= 1 + len(rays(walked()[0])) * 11


def test_where_the_nominal_case_fails_there_is_no_envelope(walked):
    study, table = walked(lambda values: Outcome.failed("diverged"))
    assert len(table) == 1
    found = ends(study, table)
    assert all(np.isnan(end.value) for _, end in found)


def test_the_first_failure_ends_it_whatever_is_behind(walked):
    def two_islands(values) -> Outcome:
        y = values["radial_y"]
        return Outcome(bool(y < 0.04 or y > 0.09), 0.0, 2.6, 5.0, 1.0)

    study, table = walked(two_islands)
    end = envelope(study, ends(study, table))["radial_y"][1]
    assert end.low < 0.04 <= end.high
