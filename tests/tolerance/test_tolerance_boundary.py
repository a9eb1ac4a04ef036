"""The boundary of success against a shape that is known in closed form."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from scipy.stats import beta, qmc

from snarelab.errors import InputError
from snarelab.tolerance.boundary import fit_boundary
from snarelab.tolerance.capture import Axis, Capture, Outcome, run_case
from snarelab.tolerance.report import summarise
from snarelab.tolerance.results import Results
from snarelab.tolerance.run import space_boundary
from snarelab.tolerance.study import Study, Success
from snarelab.tolerance.summary import sensitivities, success_probability

SEMI_AXES = np.array([0.06, 0.05, 0.20])
CENTRE = np.array([0.0, 0.01, 0.0])


def error(point):
    return 0.010 * np.linalg.norm((point - CENTRE) / SEMI_AXES, axis=-1) ** 2


def outcome(values) -> Outcome:
    e = float(error(np.array([values[n] for n in ("radial_y", "radial_z", "pitch")])))
    return Outcome(e < 0.013, e, 2.6, 5.0, 100.0)  # farther out, the pin escapes: a jump, as in a real capture


def make_study(tmp_path) -> Study:
    axes = [Axis(n, u, n, 0.0, -1.0, 1.0) for n, u in (("radial_y", "m"), ("radial_z", "m"), ("pitch", "rad"))]
    ranges = {"radial_y": (-0.12, 0.12), "radial_z": (-0.1, 0.1), "pitch": (-0.4, 0.4)}
    capture = Capture("ellipsoid", tuple(axes), outcome)
    return Study(tmp_path, "e", capture, 1, "adaptive", 8, 256, 0.02, ranges, {}, Success(0.010, 1e3), {}, 1)


def margins(study, unit):
    return np.array([study.success.margin(outcome(study.values(p))) for p in study.scaled(unit)])


@pytest.fixture(scope="module")
def adaptive(tmp_path_factory):
    study = make_study(tmp_path_factory.mktemp("study"))
    unit, widths = np.vstack([[0.5, 0.5, 0.5], qmc.Sobol(3, rng=1).random(8)[1:]]), []
    while True:
        boundary = fit_boundary(unit, margins(study, unit))
        widths.append(boundary.width())
        if max(widths[-2:]) <= study.width or len(unit) >= 256:
            return study, boundary, len(unit)
        unit = np.vstack([unit, boundary.next_cases(8, len(unit))])


def test_boundary_stands_where_the_closed_form_has_it(adaptive):
    study, boundary, _ = adaptive
    unit = np.random.default_rng(0).random((4000, 3))
    truth = error(study.scaled(unit)) < 0.010
    wrong = (boundary.probability(unit) > 0.5) != truth
    p = boundary.probability(unit)
    sure = (p < 0.05) | (p > 0.95)
    assert np.mean(wrong) < 0.02
    assert np.mean(wrong[sure]) < 0.02


def test_a_quarter_of_the_cases_that_plain_sobol_needs(adaptive):
    study, boundary, cases = adaptive
    unit = qmc.Sobol(3, rng=1).random_base2(10)
    plain = fit_boundary(unit[: 4 * cases], margins(study, unit[: 4 * cases]))
    assert 4 * cases <= len(unit)
    assert boundary.width() <= study.width < plain.width()


def test_an_axis_that_does_not_matter_has_no_sensitivity(adaptive):
    study, *_ = adaptive
    unit = qmc.Sobol(2, rng=2).random(64)
    boundary = fit_boundary(unit, np.clip(0.5 - 2 * np.abs(unit[:, 0] - 0.5), -1, 1))
    two = Study(**{**vars(study), "ranges": {"radial_y": (-0.12, 0.12), "radial_z": (-0.1, 0.1)}})
    found = sensitivities(two, boundary)
    assert found.loc["radial_y", "total"] > 0.9
    assert abs(float(np.asarray(found.loc["radial_z", "total"]))) < 0.05


@pytest.mark.parametrize(("won", "total"), [(0, 60), (57, 60), (60, 60)])
def test_clopper_pearson_against_the_beta_quantiles(won, total):
    table = pd.DataFrame({"margin": [0.1] * won + [-1.0] * (total - won)})
    found = success_probability(table)
    low = beta.ppf(0.025, won, total - won + 1) if won else 0.0
    high = beta.ppf(0.975, won + 1, total - won) if won < total else 1.0
    assert (found.low, found.high) == pytest.approx((low, high), abs=1e-9)


@pytest.mark.parametrize("error", [0.0, 1.0])
def test_a_study_in_which_all_succeed_or_all_fail_has_a_summary(tmp_path, error):
    capture = Capture("all", make_study(tmp_path).capture.axes, lambda values: Outcome(True, error, 2.6, 5.0, 100.0))
    study = replace(make_study(tmp_path), capture=capture, sampling="sobol", cases=32, envelope=None)
    results = Results(tmp_path / "out", study)
    for number, point in enumerate(study.scaled(np.random.default_rng(0).random((32, 3)))):
        results.add("space", number, study.values(point), run_case(capture, study.values(point)))
    content = summarise(study, results)
    results.write("result.json", content)  # JSON has no NaN
    assert not np.any(sensitivities(study, space_boundary(study, results)))


def test_a_capture_that_gives_no_outcome_is_a_mistake_and_one_without_numbers_has_none(tmp_path):
    axes = make_study(tmp_path).capture.axes
    with pytest.raises(InputError, match=r"^mine: run gives a dict; give an Outcome$"):
        run_case(Capture("mine", axes, lambda values: {"radial_error": 0.0}), {})  # pyright: ignore[reportArgumentType]
    found = run_case(Capture("mine", axes, lambda values: Outcome(True, np.nan, 2.6, 5.0, 100.0)), {})
    assert not found.enclosed
    assert "not finite" in found.reason


def test_a_cube_of_more_cases_is_another_study(tmp_path):
    cube = replace(make_study(tmp_path), sampling="latin_hypercube")
    assert cube.identity() != replace(cube, cases=cube.cases + 1).identity()
    assert make_study(tmp_path).identity() == replace(make_study(tmp_path), cases=7).identity()
