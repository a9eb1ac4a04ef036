"""Captures behind the one interface: what is asked of the simulation, and what is made of its answers, by hand."""

import numpy as np
import pytest
from captures_by_hand import (
    DAMPING,
    FRICTION,
    PRETENSION,
    STIFFNESS,
    Straight,
    along,
    captures_of,
    key_of,
    model_of,
)

from snarelab.errors import InputError
from snarelab.identification.snare.source import start
from snarelab.identification.sources.fit import forecast
from snarelab.identification.sources.source import ModelPoint
from snarelab.models.effects import get_effect
from snarelab.models.model import PlacedEffect
from snarelab.models.snare.setup import APPLIED

STILL = along(*np.zeros(8))
COURSE = along(*(np.where(np.arange(8) % 2, 1.0, -1.0)))
"""[m] For each unit of friction, back and forth along x."""


def source_of(law=None, key=None, **options):
    runs = Straight(STILL, {key or key_of(FRICTION): COURSE}, law and {key or key_of(FRICTION): law}, **options)
    return runs, captures_of(runs, 0.3 * COURSE)


def with_friction(value):
    return ModelPoint.of([FRICTION], {key_of(FRICTION): value}, 1)


NOTHING = ModelPoint.of([], {}, 1)


@pytest.mark.parametrize(
    ("value", "end"),
    [(0.2, 0.25), (0.02, 0.04), (1.4, 1.05)],
    ids=["a quarter of itself", "a quarter of the least that is tried", "away from the upper bound"],
)
def test_a_slope_is_a_difference_over_a_wide_step(value, end):
    runs, source = source_of()
    at = with_friction(value)
    here = forecast(source, 0, at)
    slopes = source.slopes(0, at, here)
    assert [x[key_of(FRICTION)] for x in runs.asked] == pytest.approx([value, end])
    np.testing.assert_allclose(slopes[:, 0, 0], COURSE[::5, 0], atol=1e-9)
    np.testing.assert_array_equal(slopes[:, 1:3], 0.0)


def test_a_step_is_a_quarter_of_the_way_from_what_the_rope_has():
    """From 1 ms to 5 ms are 4 ms, of which a quarter is 1 ms; at 1 ms it is a quarter of the 2 ms to the first try."""
    runs, source = source_of(key=key_of(DAMPING))
    for value, end in ((5e-3, 6e-3), (1e-3, 1.5e-3)):
        runs.asked.clear()
        at = ModelPoint.of([DAMPING], {key_of(DAMPING): value}, 1)
        source.slopes(0, at, np.zeros_like(source.measured(0)))
        assert [x[key_of(DAMPING)] for x in runs.asked] == pytest.approx([end])


def test_a_step_of_a_stiffness_is_a_quarter_of_itself():
    """How far it is from steel's 1.66e9 is no matter."""
    runs, source = source_of(key=key_of(STIFFNESS))
    source.slopes(0, ModelPoint.of([STIFFNESS], {key_of(STIFFNESS): 4e6}, 1), np.zeros_like(source.measured(0)))
    assert [x[key_of(STIFFNESS)] for x in runs.asked] == pytest.approx([5e6])


def test_a_slope_is_nothing_where_its_end_cannot_be_simulated():
    _, source = source_of(fails=lambda x: x.get(key_of(FRICTION), 0.0) > 0.2)
    at = with_friction(0.2)
    np.testing.assert_array_equal(source.slopes(0, at, forecast(source, 0, at)), 0.0)


def test_a_start_velocity_is_its_own_recordings():
    """Of the second of two captures, 2 mm/s along y a deviation: its own three columns alone, a ramp in one channel."""
    source = captures_of(Straight(STILL, push=2e-3), STILL, STILL, n_train=2)
    at = ModelPoint.of([], {}, source.n_shifts)
    slopes = source.shift_slopes(1, at, forecast(source, 1, at))
    assert slopes.shape[2] == 7
    ramp = 2e-3 * (np.arange(8) + 0.4) * 0.25
    felt = slopes[:, :3, 4:]
    np.testing.assert_allclose(felt - felt[:1], np.multiply.outer(ramp - ramp[0], np.eye(3)), atol=1e-12)
    np.testing.assert_array_equal(slopes[:, :, 1:4], 0.0)


@pytest.mark.parametrize("fails", [lambda _: True, None])
def test_what_cannot_be_simulated_or_is_not_finite_is_no_prediction(fails):
    law = {"law": lambda _: np.nan} if fails is None else {"fails": fails}
    _, source = source_of(**law)
    assert source.predicted(0, with_friction(0.2)) is None
    with pytest.raises(InputError, match=r"0\.csv: the capture cannot be simulated from where the recording starts"):
        forecast(source, 0, with_friction(0.2))


def test_an_amplitude_is_counted_from_what_is_there_without_the_effect():
    """Whatever is tried, a column is what a unit of the parameter changes: in a simulation in proportion, the same."""
    _, source = source_of()
    for v, tried in zip(source.variants(FRICTION), (0.08, 0.25), strict=True):
        assert (dict(v.values), v.amplitudes) == ({key_of(FRICTION): tried}, (key_of(FRICTION),))
        np.testing.assert_allclose(source.columns(0, NOTHING, [v])[0][:, 0, 0], COURSE[::5, 0], atol=1e-9)
    # The rope's own 1 ms is in the simulation already; of 3 and 10 ms it is what is more that counts.
    _, source = source_of(key=key_of(DAMPING), law=lambda x: x - 1e-3)
    for v in source.variants(DAMPING):
        assert v.origin == {key_of(DAMPING): 1e-3}
        np.testing.assert_allclose(source.columns(0, NOTHING, [v])[0][:, 0, 0], COURSE[::5, 0], atol=1e-9)


def test_an_effect_of_a_number_that_is_shifted_counts_from_there():
    """At 3 ms, two deviations more than is said, a column is still what a unit of damping changes."""
    _, source = source_of(key=key_of(DAMPING), law=lambda x: x - 1e-3)
    shifted = ModelPoint((), {}, np.zeros(0), np.array([2.0]))
    for v in source.variants(DAMPING):
        np.testing.assert_allclose(source.columns(0, shifted, [v])[0][:, 0, 0], COURSE[::5, 0], atol=1e-9)


def test_a_contact_that_gives_way_is_a_whole_law_at_each_stiffness():
    """Hertz: 1 N sinks in by k^(-2/3)."""
    _, source = source_of(key=key_of(STIFFNESS), law=lambda k: k ** (-2 / 3))
    for v, tried in zip(source.variants(STIFFNESS), (1e7, 2e6, 3e5), strict=True):
        assert v.amplitudes == ()
        whole = source.columns(0, NOTHING, [v])[0]
        assert whole.shape == (8, 3, 1)
        np.testing.assert_allclose(whole[:, 0, 0], tried ** (-2 / 3) * COURSE[::5, 0], rtol=1e-9)


def test_a_column_that_cannot_be_simulated_is_no_number():
    _, source = source_of(fails=lambda x: x.get(key_of(FRICTION), 0.0) > 0.1)
    first, second = source.variants(FRICTION)
    assert np.isfinite(source.columns(0, NOTHING, [first])[0]).all()
    assert np.isnan(source.columns(0, NOTHING, [second])[0]).all()


def test_what_can_be_missing_are_effects_and_numbers_that_the_file_does_not_give():
    names = {
        given: {p.effect.name for p in captures_of(Straight(STILL), STILL, model=model_of(given)).library([])}
        for given in ((), ("mass", "ring_radius", "pin_radius"))
    }
    effects = set(APPLIED) - {"hang_point_clearance"}  # nothing hangs
    assert names["mass", "ring_radius", "pin_radius"] == effects
    assert names[()] == effects | {"mass", "ring_radius", "pin_radius"}
    source = captures_of(Straight(STILL), STILL)
    assert FRICTION.key not in {p.key for p in source.library([FRICTION])}
    hanging = captures_of(Straight(STILL), STILL, model=model_of(support="spring"))
    assert "hang_point_clearance" in {p.effect.name for p in hanging.library([])}


def test_a_number_of_the_set_up_is_tried_on_either_side_and_counted_from_there():
    source = captures_of(Straight(STILL), STILL, model=model_of(()))
    (mass,) = [p for p in source.library([]) if p.effect.name == "mass"]
    (x,) = mass.effect.parameters
    said = source.setup.target.mass
    assert [next(iter(v.values.values())) for v in source.variants(mass)] == pytest.approx([0.6 * said, 1.6 * said])
    assert (source.origin(mass), source.size(mass, x), x.unit) == (said, pytest.approx(0.4 * said), "kg")
    assert source.bounds(mass, x) == (0.5 * said, 2 * said)


def test_how_a_rope_damps_is_known_to_a_tolerance_unless_an_effect_has_it():
    """One deviation is 1 ms on the rope's 1 ms; less than nothing it is not."""
    runs, source = source_of()
    for shift, damping in ((0.0, None), (1.5, 2.5e-3), (-2.0, 0.0)):
        runs.asked.clear()
        source.predicted(0, ModelPoint((), {}, np.zeros(0), np.array([shift])))
        assert runs.asked[0].get(key_of(DAMPING)) == (None if damping is None else pytest.approx(damping))
    runs.asked.clear()
    source.predicted(0, ModelPoint((DAMPING,), {}, np.array([7e-3]), np.ones(1)))
    assert runs.asked == [{key_of(DAMPING): 7e-3}]


def test_a_model_starts_at_its_values_and_else_at_what_hardware_has():
    """A rope's damping is in every set-up; friction is not."""
    model = model_of(effects=[FRICTION, DAMPING, PRETENSION], values={key_of(PRETENSION): 321.0})
    assert start(model, 1).all_values == pytest.approx(
        {key_of(FRICTION): 0.08, key_of(DAMPING): 1e-3, key_of(PRETENSION): 321.0}
    )


def test_sizes_are_those_of_the_motion_and_a_scale_that_of_its_largest_axis():
    """From 5 m: 3 mm along x and 40 mm along y for half of the time."""
    place = along(*([(5.0, 0.0, 0.0)] * 4 + [(5.003, 0.04, 0.0)] * 4))
    source = captures_of(Straight(STILL), place)
    np.testing.assert_allclose(source.sizes([0])[:2], np.array([3e-3, 0.04]) / np.sqrt(2))
    np.testing.assert_allclose(source.scale(), 0.04 / np.sqrt(2))


def test_nameless_curves_run_over_time_and_where_the_simulated_target_is():
    """What was measured has a gap, and is not asked."""
    place = along(*(np.linspace(0.0, 1.0, 8)))
    measured = place.copy()
    measured[10:15] = np.nan
    source = captures_of(Straight(place), measured, STILL)
    curves = source.curves([0, 1])
    # Along y and z it stands still: no curve runs there.
    assert set(curves) == {(0, "time"), (1, "time"), (2, "time"), (0, "position")}
    for own in curves.values():
        assert [len(x) for x in own] == [8, 8]
        np.testing.assert_array_equal(own[0], own[1])
        assert np.ptp(own[0], axis=0).min() > 0.0


def test_an_effect_that_the_model_has_is_no_candidate_twice():
    source = captures_of(Straight(STILL), STILL)
    other = PlacedEffect(get_effect("umbilical_stiffness"), "target")
    left = {p.key for p in source.library([FRICTION, other])}
    assert not left & {FRICTION.key, other.key}
