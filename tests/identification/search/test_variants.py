"""Candidates by hand: which effects are tried where, grids of shapes, sets of columns, and starting values."""

from dataclasses import replace
from types import SimpleNamespace as Made
from typing import Any

import numpy as np
import pytest

from snarelab.identification.fitting.effect_places import EffectTerms
from snarelab.identification.search.candidates import (
    EffectVariant,
    candidate_columns,
    free_parameters,
    library,
    variants,
)
from snarelab.models.effect import Parameter
from snarelab.models.effects import effects, get_effect
from snarelab.models.model import PlacedEffect
from snarelab.models.tree import Joint, Link, Tree

AXIS, TURNS = np.array([0.0, 0.0, 1.0]), np.eye(3)


def variant(name, amplitudes, parameters=None, at="joint1"):
    effect = get_effect(name)
    values = np.zeros(len(effect.parameters)) if parameters is None else np.array(parameters, float)
    size = np.zeros(len(amplitudes))
    return EffectVariant(PlacedEffect(effect, at), values, np.array(amplitudes, int), size, size)


@pytest.mark.parametrize(
    ("name", "amplitudes", "sets"),
    [
        ("viscous_friction", [0], [[0]]),
        ("joint_elasticity", [], [[0]]),  # its whole contribution is the one column
        ("stribeck_friction", [0], [[0]]),
        ("harness_stiffness", [0, 1], [[0], [0, 1]]),  # a torque at zero alone would be a bias
        ("com_offset", [0, 1, 2], [[0], [1], [2], [0, 1], [0, 2], [1, 2], [0, 1, 2]]),
        # A place says nothing without the mass.
        (
            "payload_mass",
            [0, 1, 2, 3],
            [[0], *([0, k] for k in (1, 2, 3)), [0, 1, 2], [0, 1, 3], [0, 2, 3], [0, 1, 2, 3]],
        ),
        # Too many for every set: moments by themselves, and inertias.
        ("inertia_error", range(10), [*([k] for k in range(10)), list(range(10)), [1, 2, 3], [4, 5, 6, 7, 8, 9]]),
        ("wheel_friction", range(6), [list(range(6))]),  # none of them alone
    ],
)
def test_columns_are_tried_alone_and_together_or_in_every_set(name, amplitudes, sets):
    assert [s.tolist() for s in variant(name, list(amplitudes)).subsets()] == sets


@pytest.mark.parametrize(
    ("name", "amplitudes", "parameters", "found", "start"),
    [
        ("stribeck_friction", [0], [0.0, 0.3], [2.5], [2.5, 0.3]),
        ("joint_elasticity", [], [300.0, 2.0], [1.4], [300.0, 2.0]),
        ("payload_mass", [0, 1, 2, 3], [1.0, 0, 0, 0], [2.0, 1.0, -0.4, 0.0], [2.0, 0.5, -0.2, 0.0]),
        ("payload_mass", [0, 1, 2, 3], [1.0, 0, 0, 0], [0.0, 1.0, -0.4, 0.0], [0.0, 1.0, -0.4, 0.0]),  # no mass
        ("harness_stiffness", [0, 1], [0.0, 0.0], [3.0, 6.0], [3.0, 6.0]),
    ],
)
def test_a_start_has_the_amplitudes_found_and_places_by_their_mass(name, amplitudes, parameters, found, start):
    made = variant(name, amplitudes, parameters)
    np.testing.assert_allclose(made.start(np.array(found)), start)
    np.testing.assert_array_equal(made.parameters, parameters)
    assert made.count == len(found)


def test_amplitudes_in_ratio_are_one_column():
    made = replace(variant("com_offset", [0, 2]), together=np.array([2.0, -1.0]))
    assert made.count == 1
    np.testing.assert_array_equal(made.start(np.array([0.3])), [0.6, 0.0, -0.3])


def assembly(**scales) -> Any:
    """Scales by the word that a parameter refers to them; bounds ten times its own."""
    return Made(
        scale=lambda _placed, x: scales.get(x.relative_to, 1.0),
        origin=lambda _placed, x: scales.get("middle", 0.0) if x.relative_to == "place" else 0.0,
        bounds=lambda _placed, x: (10 * x.low, 10 * x.high),
        place_of=lambda _: Made(channels=(1,)),
        joint_of=lambda _: 1,
        tree=None,
    )


def test_a_grid_is_every_combination_of_shapes_in_the_joints_scale():
    found = variants(assembly(rate=2.0), PlacedEffect(get_effect("joint_elasticity"), "joint1"))
    stiffness, damping = (10, 30, 100, 300, 1000, 3000), (0.01, 0.1, 1.0)
    np.testing.assert_allclose([v.parameters for v in found], [(2.0 * k, 2.0 * d) for k in stiffness for d in damping])
    assert {(v.low.tolist()[0], v.high.tolist()[0], len(v.amplitudes)) for v in found} == {(0.0, 1.6, 0)}
    found = variants(assembly(speed=4.0), PlacedEffect(get_effect("stribeck_friction"), "joint1"))
    np.testing.assert_allclose([v.parameters for v in found], [(0.0, 4.0 * x) for x in (0.01, 0.03, 0.1, 0.3)])
    assert [v.amplitudes.tolist() for v in found] == 4 * [[0]]
    assert (found[0].low[0], found[0].high[0]) == (0.0, np.inf)


def test_a_stop_stands_inside_the_travel_on_one_side():
    """Outside it would be a straight line or nothing, and on both sides a spring."""
    found = variants(assembly(place=2.0, middle=7.0), PlacedEffect(get_effect("end_stop"), "joint1"))
    places = [v.parameters[2] for v in found]
    assert 6.0 < min(places) < 6.1
    assert 7.9 < max(places) < 8.0
    assert {tuple(map(tuple, v.subsets())) for v in found} == {((0,), (1,))}


def shape(name, n):
    return Parameter(name, "1", "", grid=tuple(float(k) for k in range(1, n + 1)))


@pytest.mark.parametrize(("sizes", "step"), [((6, 6), 1), ((37,), 2), ((72,), 2), ((73,), 3), ((10, 10), 3)])
def test_a_grid_finer_than_thirty_six_points_is_thinned_evenly(sizes, step):
    effect: Any = Made(parameters=tuple(shape(f"s{k}", n) for k, n in enumerate(sizes)))
    found = variants(assembly(), PlacedEffect(effect, "joint1"))
    whole = list(np.ndindex(*sizes))
    np.testing.assert_allclose([v.parameters - 1 for v in found], whole[::step])


def test_the_place_of_a_mass_has_its_slope_at_one_kilogram():
    (only,) = variants(assembly(), PlacedEffect(get_effect("payload_mass"), "link1"))
    np.testing.assert_array_equal(only.parameters, [1.0, 0.0, 0.0, 0.0])
    assert only.amplitudes.tolist() == [0, 1, 2, 3]
    np.testing.assert_array_equal(only.low, [0.0, -10.0, -10.0, -10.0])
    np.testing.assert_array_equal(only.high, [np.inf, 10.0, 10.0, 10.0])


def test_several_masses_have_slopes_of_all_of_them_and_of_each_alone():
    masses = [Parameter(f"mass_{a}", "kg", "") for a in "xy"]
    places = [Parameter(f"place_{a}", "m", "", grid=(0.0,)) for a in "xy"]
    effect: Any = Made(parameters=(*masses, *places, shape("frequency", 2)))
    found = [v.parameters.tolist() for v in variants(assembly(), PlacedEffect(effect, "base"))]
    wanted = [[1, 1, 0, 0], [1, 0, 0, 0], [0, 1, 0, 0]]
    assert found == [[*row, f] for f in (1.0, 2.0) for row in wanted]


def arm(*given, inertia="fixed", n=2) -> Any:
    """Some joints, and effects as (name, place, held parameters ...)."""
    joints = tuple(Joint(f"joint{k + 1}", "revolute", AXIS, k - 1, TURNS, AXIS) for k in range(n))
    links = tuple(Link(f"link{k + 1}", np.arange(1.0, 11.0)) for k in range(n))
    tree = Tree("arm", joints, links, np.zeros(3))
    placed = tuple(PlacedEffect(get_effect(name), at, tuple(hold)) for name, at, *hold in given)
    return Made(effects=placed, joints=tuple(j.name for j in joints), tree=tree, inertia=inertia)


def keys(model):
    found = [p.key for p in library(model)]
    assert len(found) == len(set(found))
    return set(found)


def test_a_factor_on_the_one_torque_is_none_where_the_inertia_is_identified():
    """It scales the mass and every friction alike; of two joints' torques one is measured against the other."""
    gain, whole = "sensor_gain.tau.joint1", keys(arm(n=1))
    assert whole - keys(arm(n=1, inertia="free")) == {gain, *(k for k in whole if k.endswith("link1"))}
    assert gain in keys(arm(inertia="free"))


def test_every_effect_is_tried_at_every_place_that_has_it_not():
    whole = keys(arm())
    joints = [e for e in effects().values() if e.at == "joint"]
    at_joints = {f"{e.name}.joint{k}" for e in joints if e.neighbours != "only" for k in (1, 2)}
    at_joints |= {f"{e.name}.joint1{sign}joint2" for e in joints if e.neighbours for sign in "+-"}
    at_links = {f"{e.name}.link{k}" for e in effects().values() if e.at == "link" for k in (1, 2)}
    sensors = {f"{e.name}.tau.joint{k}" for e in effects().values() if e.at == "sensor" for k in (1, 2)}
    at_beams = {f"{e.name}.link1" for e in effects().values() if e.elsewhere}  # the last link carries no joint
    assert whole == at_joints | at_links | at_beams | sensors | {"sensor_delay.q.joint1", "sensor_delay.q.joint2"}
    assert keys(arm(inertia="free")) == whole - at_links
    assert keys(arm(("viscous_friction", "joint2"))) == whole - {"viscous_friction.joint2"}


@pytest.mark.parametrize("late", ["sensor_delay.tau.joint1", "sensor_delay.q.joint1", "command_delay.tau.joint1"])
def test_of_a_late_torque_a_late_encoder_and_a_late_drive_one_alone_is_tried(late):
    """Each makes the joint's torque late against its motion, or early."""
    name, _, at = late.partition(".")
    gone = keys(arm()) - keys(arm((name, at)))
    assert gone == {"sensor_delay.tau.joint1", "sensor_delay.q.joint1", "command_delay.tau.joint1"}


def test_slides_of_the_first_joint_are_its_friction():
    gone = keys(arm()) - keys(arm(("slide_friction", "joint1")))
    names = ("makkar_friction", "viscous_friction", "coulomb_friction", "stribeck_friction")
    assert gone == {f"{name}.joint1" for name in names}
    assert keys(arm(("slide_friction", "joint2"))) == keys(arm())


VALUES, COLUMNS = np.array([1.0, 2.0]), np.array([[3.0, 4.0], [5.0, 6.0]])


class Asked:
    """An assembly whose places answer with one channel's term; ``calls`` is what they were asked."""

    def __init__(self) -> None:
        self.calls, self.by_load, self.columns = [], None, COLUMNS

    def assembly(self) -> Any:
        def terms(along: Any, parameters: Any, bare: bool) -> EffectTerms:
            self.calls.append((along, parameters, bare))
            return EffectTerms([(3, VALUES, self.columns)], self.by_load)

        own = assembly()
        own.at = lambda _placed: Made(terms=terms)
        return own


@pytest.fixture
def asked():
    return Asked()


def experiment() -> Any:
    return Made(store={}, to_band=lambda x, channel: 10.0 * x + channel)


def state(**passed) -> Any:
    return Made(load=np.array([[0, 1], [0, 2]]), tau=np.array([[0, 8], [0, 9]]), passed=passed.get("on", {}))


def test_columns_of_the_amplitudes_or_the_whole_law_in_the_band(asked):
    ((channel, found),) = candidate_columns(asked.assembly(), experiment(), state(), variant("harness_stiffness", [1]))
    assert channel == 3
    np.testing.assert_array_equal(found, [[43.0], [63.0]])
    ((_, found),) = candidate_columns(asked.assembly(), experiment(), state(), variant("joint_elasticity", []))
    np.testing.assert_array_equal(found, [[13.0], [23.0]])
    assert [call[-1] for call in asked.calls] == [False, True]  # amplitudes are columns of the law's derivative
    (_, load, reading), parameters, _ = asked.calls[0]
    assert (load[:, 1].tolist(), reading[:, 1].tolist()) == ([1, 2], [8, 9])
    assert parameters.tolist() == [0.0, 0.0]


def test_sensors_that_the_model_has_see_a_joints_torque_but_not_one_anothers_change(asked):
    halved = state(on={3: [lambda x: x / 2, lambda x: x + 1]})
    ((_, found),) = candidate_columns(asked.assembly(), experiment(), halved, variant("harness_stiffness", [0]))
    np.testing.assert_array_equal(found, [[10 * 2.5 + 3], [10 * 3.5 + 3]])
    sensor = variant("sensor_gain", [0], at="tau.joint1")
    ((_, found),) = candidate_columns(asked.assembly(), experiment(), halved, sensor)
    np.testing.assert_array_equal(found, [[33.0], [53.0]])


@pytest.mark.parametrize(
    ("name", "amplitudes", "by_load", "sensed", "asked_twice"),
    [
        ("harness_stiffness", [0], None, False, False),
        ("harness_stiffness", [0], VALUES, False, True),  # it changes with the model
        ("harness_stiffness", [0], None, True, True),
        ("joint_elasticity", [], None, False, True),  # hidden states follow the load
        ("payload_mass", [0], None, False, True),
    ],
)
def test_columns_that_nothing_changes_are_kept(asked, name, amplitudes, by_load, sensed, asked_twice):
    asked.by_load = by_load
    e, own = experiment(), asked.assembly()
    now = state(on={1: [lambda x: x]}) if sensed else state()
    one, two = (candidate_columns(own, e, now, variant(name, amplitudes)) for _ in range(2))
    assert len(asked.calls) == (2 if asked_twice else 1)
    np.testing.assert_array_equal(one[0][1], two[0][1])
    if not asked_twice:
        assert two[0][0] == one[0][0]
        for other in (variant(name, [1]), variant(name, [0], [1.0, 0.0])):
            candidate_columns(own, e, now, other)
        assert len(asked.calls) == 3


def test_parameters_count_if_they_move_the_torque_once_the_amplitudes_are_on(asked):
    model = asked.assembly(), experiment(), state()
    # The spring's rest torque is an amplitude that is not switched on; without a derivative none counts.
    found = free_parameters(*model, variant("harness_stiffness", [0]))
    assert found == ("stiffness",)
    assert asked.calls[0][1].tolist() == [1.0, 0.0]
    assert free_parameters(*model, variant("stribeck_friction", [0])) == ("level", "speed")
    assert free_parameters(*model, variant("joint_elasticity", [])) == ("stiffness", "damping")
    asked.columns = COLUMNS * [1.0, 0.0]
    assert free_parameters(*model, variant("stribeck_friction", [0])) == ("level",)


def test_of_a_series_the_next_term_is_tried_where_there_is_one():
    """At the first joint a second, then a third; at the other the first alone. All terms are one law."""
    ripple = get_effect("torque_ripple")

    def tried(*there):
        found = library(arm(*((name, "joint1") for name in there)))
        return {p.key: p.effect for p in found if p.key.startswith("torque_ripple")}

    assert set(tried()) == {"torque_ripple.joint1", "torque_ripple.joint2"}
    assert set(tried("torque_ripple")) == {"torque_ripple_2.joint1", "torque_ripple.joint2"}
    third = tried("torque_ripple", "torque_ripple_2")
    assert set(third) == {"torque_ripple_3.joint1", "torque_ripple.joint2"}
    assert third["torque_ripple_3.joint1"].law is ripple.law
    assert set(tried("torque_ripple_2")) == {"torque_ripple.joint1", "torque_ripple.joint2"}
    assert "torque_ripple_3.joint1" not in tried("torque_ripple", *(f"torque_ripple_{k}" for k in range(2, 10)))
