"""One round of a capture's search: which values are tried, what is expected of them, and which are fitted."""

import numpy as np
import pytest
from captures_by_hand import CLEARANCE, FRICTION, PRETENSION, UMBILICAL, Straight, along, captures_of, fit_of

from snarelab.identification.snare import trials as module
from snarelab.identification.snare.fit import evaluate, with_slopes
from snarelab.identification.snare.handles import handle_of
from snarelab.identification.snare.trials import _energy, _expected, _explained, _joint, _most_hopeful, try_all

BACK_AND_FORTH = along(*(np.where(np.arange(16) % 2, 1.0, -1.0)))
RISING = along(*((0.0, 0.01 * k, 0.0) for k in range(16)))
"""[m] Quarters of a second of two courses at right angles."""
FLOOR_SQUARED = 1.5e-4**2 + 1e-8 / 5
"""[m²] What a position counts for at least, with noise of 0.1 mm."""


def quiet(_text):
    pass


def captures_with(courses, measured, **options):
    runs = Straight(courses, **options)
    captures = captures_of(runs, measured)
    return runs, captures, with_slopes(captures, evaluate(captures, [], [np.zeros(0)])[0])


def height(square):
    """L of 48 numbers whose squares sum up to this."""
    return -6 * np.log(square / 48 + FLOOR_SQUARED)


class Model:
    """Stands for a model without the effects."""


@pytest.fixture(autouse=True)
def _nothing_there(monkeypatch):
    monkeypatch.setattr(module, "absent", lambda _model, placed: handle_of(placed).x(0.0))


def test_energy_and_share_explained_count_each_block_by_its_own_scale():
    """Squares 4 + 1 over 0.5 and 8 over 4 make 12; by the scales before, 3 of 12 are left of it in the second fit."""
    before = {"position": np.array([[2.0, 1.0]]), "turn": np.array([[2.0], [2.0]])}
    assert _energy([before], {"position": 0.5, "turn": 4.0}) == pytest.approx(12.0)
    assert _energy([before, before], {"position": 0.5, "turn": 4.0}) == pytest.approx(24.0)
    (own,) = captures_of(Straight({}), along(0.0)).captures
    found = fit_of([], [], 0.0, [{"position": np.array([[2.0, 1.0]])}])
    there = fit_of([], [], 0.0, [{"position": np.array([[1.0, 0.5]])}])
    assert _explained([own], found, there) == pytest.approx(0.75, rel=1e-12)
    assert _explained([own], found, fit_of([], [], -np.inf)) == 0.0


def test_without_parameters_a_try_reaches_what_it_has():
    there = fit_of([FRICTION], [0.1], -3.0, [{"position": np.zeros((1, 3))}])
    assert _expected([], fit_of([], [], -5.0), there)[0] == -3.0


def test_a_try_is_expected_to_gain_what_the_parameters_that_were_there_make_good():
    """Friction of 0.25 beside a pretension that is 40 N short: 1/1.01 of the way, all but (0.01/1.01)² of the gain."""
    runs = Straight({PRETENSION: RISING, FRICTION: BACK_AND_FORTH})
    captures = captures_of(runs, 140.0 * RISING + 0.3 * BACK_AND_FORTH)
    found = with_slopes(captures, evaluate(captures, [PRETENSION], [np.array([100.0])])[0])
    (there,) = evaluate(captures, [PRETENSION, FRICTION], [np.array([100.0, 0.25])])
    expected, moved = _expected(captures.captures, found, there)
    assert moved == pytest.approx([100.0 + 40.0 / 1.01])
    misses = 40.0**2 * 1e-4 * sum(k * k for k in range(16)), 0.05**2 * 16
    variance = 4 * (sum(misses) / 48 + FLOOR_SQUARED)
    gain = 0.5 * misses[0] / variance * (1 - (0.01 / 1.01) ** 2)
    assert expected == pytest.approx(height(sum(misses)) + gain, rel=1e-9)
    assert _most_hopeful(captures.captures, found, [there]) == (expected, there)


def test_derivatives_are_believed_as_far_as_four_differences():
    """A pretension 400 N short moves by 4 · 60 N."""
    captures = captures_of(Straight({PRETENSION: RISING, FRICTION: BACK_AND_FORTH}), 500.0 * RISING)
    found = with_slopes(captures, evaluate(captures, [PRETENSION], [np.array([100.0])])[0])
    (there,) = evaluate(captures, [PRETENSION, FRICTION], [np.array([100.0, 0.0])])
    assert _expected(captures.captures, found, there)[1] == pytest.approx([340.0])


def test_the_most_hopeful_try_is_the_one_expected_highest():
    tries = [fit_of([FRICTION], [x], likelihood) for x, likelihood in ((0.1, -4.0), (0.2, -2.0), (0.3, -np.inf))]
    expected, best = _most_hopeful([], fit_of([], [], -5.0), tries)
    assert expected == -2.0
    assert best is tries[1]


@pytest.mark.parametrize(
    ("truth", "between"),
    [
        # The best try is 0.25. Below it stands 0.08; above nothing, so as far again: to 0.42, by thirds.
        (0.3, [0.25 - 0.17 / 3, 0.25 - 0.34 / 3, 0.25 + 0.17 / 3, 0.25 + 0.34 / 3]),
        # The best try is 0.08: between its absence at 0 and the other try.
        (0.1, [0.08 - 0.08 / 3, 0.08 - 0.16 / 3, 0.08 + 0.17 / 3, 0.08 + 0.34 / 3]),
    ],
)
def test_four_more_values_stand_by_thirds_on_both_sides_of_the_best_try(truth, between):
    runs, captures, found = captures_with({FRICTION: BACK_AND_FORTH}, truth * BACK_AND_FORTH, law=lambda x: x)
    tried = evaluate(captures, [FRICTION], [np.array([x]) for x in (0.08, 0.25)])
    runs.asked.clear()
    best = _joint(captures, found, tried, 0.0)
    assert [x for (x,) in runs.asked[:4]] == pytest.approx(between)
    assert best.x == pytest.approx([truth], abs=2e-3)


def test_beside_a_single_try_four_values_stand_about_it_by_its_distance_from_nothing():
    """Of 0.3 alone: thirds of the way down to 0, and as far up."""
    runs, captures, found = captures_with({FRICTION: BACK_AND_FORTH}, 0.3 * BACK_AND_FORTH)
    tried = evaluate(captures, [FRICTION], [np.array([0.3])])
    runs.asked.clear()
    _joint(captures, found, tried, 0.0)
    assert [x for (x,) in runs.asked[:4]] == pytest.approx([0.2, 0.1, 0.4, 0.5])


def test_values_outside_the_bounds_are_not_tried():
    """Friction is best at 1.4 of 0.9 and 1.4: as far again is 1.9, two thirds of the way to which are beyond 1.5."""
    runs, captures, found = captures_with({FRICTION: BACK_AND_FORTH}, 1.45 * BACK_AND_FORTH)
    tried = evaluate(captures, [FRICTION], [np.array([x]) for x in (1.1, 1.4)])
    runs.asked.clear()
    _joint(captures, found, tried, 0.0)
    assert [x for (x,) in runs.asked[:2]] == pytest.approx([1.3, 1.2])
    assert all(x <= 1.5 for (x,) in runs.asked)


def test_a_candidates_first_derivative_is_the_secant_to_its_nearest_try(monkeypatch):
    """A square law, best at 0.25: to 0.25 + 0.17/3 the course changes by the sum of both for each unit."""
    monkeypatch.setattr(module, "fit", lambda _captures, here: here)
    _, captures, found = captures_with({FRICTION: BACK_AND_FORTH}, 0.0625 * BACK_AND_FORTH, law=lambda x: x * x)
    tried = evaluate(captures, [FRICTION], [np.array([x]) for x in (0.08, 0.25)])
    here = _joint(captures, found, tried, 0.0)
    assert here.x == pytest.approx([0.25])
    assert here.slopes is not None
    # The nearest are a third of 0.17 away on either side; the first of them, below, is taken.
    other = 0.25 - 0.17 / 3
    np.testing.assert_allclose(here.slopes[-1][0]["position"], -(0.25 + other) * BACK_AND_FORTH[::5], rtol=1e-6)


def test_a_round_scores_every_candidate_and_fits_those_that_are_hopeful():
    """Truth is a friction of 0.2. Pretension at right angles only loses; what is expected 2 below is not fitted."""
    told = []
    _, captures, found = captures_with({FRICTION: BACK_AND_FORTH, PRETENSION: RISING}, 0.2 * BACK_AND_FORTH)
    tried = try_all(Model, captures, found, [PRETENSION, FRICTION], (), told.append)  # pyright: ignore[reportArgumentType]
    assert [t.placed for t in tried] == [FRICTION, PRETENSION]
    assert told == [
        "trying 2 effects at 4 values in simulation",
        "fitting contact_friction at pin together with the model's effects",
    ]
    friction, pretension = tried
    assert friction.fit.x == pytest.approx([0.2], abs=1e-3)
    assert friction.explained == pytest.approx(1.0, abs=1e-4)
    start, price = height(16 * 0.2**2), 0.5 * np.log(48 / 4)
    assert friction.score == pytest.approx(friction.fit.likelihood - start - price, rel=1e-9)
    # Of the two tensions the smaller one, 200 N, loses less: its course adds to what is left.
    more = 200.0**2 * 1e-4 * sum(k * k for k in range(16))
    assert pretension.fit.x == pytest.approx([200.0])
    assert pretension.score == pytest.approx(height(16 * 0.2**2 + more) - start - price, rel=1e-9)
    assert pretension.explained == pytest.approx(-more / (16 * 0.2**2), rel=1e-9)


def test_a_rejected_candidate_is_tried_but_not_fitted():
    runs, captures, found = captures_with({FRICTION: BACK_AND_FORTH}, 0.2 * BACK_AND_FORTH)
    runs.asked.clear()
    (trial,) = try_all(Model, captures, found, [FRICTION], {FRICTION.key}, quiet)  # pyright: ignore[reportArgumentType]
    assert trial.fit.x == pytest.approx([0.25])  # 0.05 off, nearer than 0.08
    assert {x for (x,) in runs.asked} == {0.08, 0.25}


@pytest.mark.parametrize(("expected", "fitted"), [(-7.01, False), (-6.99, True), (-np.inf, False)])
def test_the_best_three_are_fitted_if_they_are_expected_to_lose_less_than_two(expected, fitted, monkeypatch):
    """L is -5 before; the last of four is never fitted, nor what cannot be simulated."""
    candidates = [CLEARANCE, UMBILICAL, FRICTION, PRETENSION]
    reached = dict(zip(candidates, (-1.0, -2.0, expected, expected - 0.001), strict=True))
    left = ({"position": np.ones((1, 3))},)

    def evaluated(_captures, placed, many):
        return [fit_of(placed, x, reached[placed[-1]], left) for x in many]

    made = []

    def joint(_captures, _found, tries, nothing):
        made.append(tries[0].placed[-1])
        assert nothing == 0.0
        return tries[0]

    monkeypatch.setattr(module, "evaluate", evaluated)
    monkeypatch.setattr(module, "_joint", joint)
    captures = captures_of(Straight({p: along(0.0) for p in candidates}), along(0.0))
    found = fit_of([], [], -5.0, left, slopes=())
    tried = try_all(Model, captures, found, candidates, (), quiet)  # pyright: ignore[reportArgumentType]
    assert made == [CLEARANCE, UMBILICAL, *([FRICTION] if fitted else [])]
    assert [t.placed for t in tried] == candidates
    assert tried[0].score == pytest.approx(4.0 - 0.5 * np.log(3 / 4))
