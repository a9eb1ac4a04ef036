"""Who is asked in which order, and algebraic loops."""

from typing import Any

import numpy as np
import pytest

from snarelab.cosim.feedthrough import FeedThrough
from snarelab.cosim.master import Master
from snarelab.cosim.participant import StepError, Variable
from snarelab.cosim.participants.formula import Formula
from snarelab.cosim.participants.oscillator import LeftOscillator
from snarelab.cosim.system import Connection, System
from snarelab.errors import InputError


def formula(inputs, outputs, function, depends=True):
    """Outputs without units, each a function of all inputs."""
    on = tuple(inputs) if depends else None
    variables = [Variable(name, "input", "") for name in inputs]
    variables += [Variable(name, "output", "", depends=on) for name in outputs]
    return Formula(variables, lambda u, _: function(*u))


@pytest.mark.parametrize("declared", [True, False])
@pytest.mark.parametrize("scheme", ["jacobi", "gauss_seidel"])
def test_chain_of_formulas_is_settled_in_its_own_order(scheme, declared):
    """d = -(c) = -(2 b) = -(2 (x + 1)), whatever order the participants are given in."""
    system = System(
        {
            "d": formula(["c"], ["d"], lambda c: -c, declared),
            "c": formula(["b"], ["c"], lambda b: 2 * b, declared),
            "b": formula(["x"], ["b"], lambda x: x + 1, declared),
            "mass": LeftOscillator(),
        },
        [("c.c", "d.c"), ("b.b", "c.b"), ("mass.x", "b.x")],
        parameters={"mass.force": 0.0},
    )
    run = Master(system, 0.01, scheme=scheme).run(0.5).recording
    np.testing.assert_array_equal(run["d.d"], -2 * (run["mass.x [m]"] + 1))


def test_two_visits_where_participants_feed_each_other_without_a_loop():
    """a.second = b.out + 1 = (a.first * 3) + 1 with a.first = x: a, b, a."""
    variables = [
        Variable("x", "input", ""),
        Variable("y", "input", ""),
        Variable("first", "output", "", depends=("x",)),
        Variable("second", "output", "", depends=("y",)),
    ]
    both = Formula(variables, lambda u, _: (u[0], u[1] + 1))
    system = System(
        {"a": both, "b": formula(["x"], ["out"], lambda x: 3 * x), "mass": LeftOscillator()},
        [("mass.x", "a.x"), ("a.first", "b.x"), ("b.out", "a.y")],
        parameters={"mass.force": 0.0},
    )
    master = Master(system, 0.01)
    run = master.run(0.2)
    np.testing.assert_array_equal(run.recording["a.second"], 3 * run.recording["mass.x [m]"] + 1)
    assert run.loops == ()


def loop(gain):
    """y = gain·z + x, z = y: y = x / (1 - gain)."""
    return System(
        {
            "one": formula(["z", "x"], ["y"], lambda z, x: gain * z + x),
            "two": formula(["y"], ["z"], lambda y: y),
            "mass": LeftOscillator(),
        },
        [("two.z", "one.z"), ("mass.x", "one.x"), ("one.y", "two.y")],
        parameters={"mass.force": 0.0},
    )


@pytest.mark.parametrize("gain", [0.5, -3.0, 20.0])
def test_algebraic_loop_is_solved_also_where_plain_iteration_diverges(gain):
    run = Master(loop(gain), 0.01).run(0.3)
    np.testing.assert_allclose(run.recording["one.y"], run.recording["mass.x [m]"] / (1 - gain), rtol=1e-10)
    assert run.loops == ("one.y -> two.z",)


def test_algebraic_loop_is_refused_by_name():
    with pytest.raises(InputError, match=r"algebraic loop one\.y -> two\.z"):
        Master(loop(0.5), 0.01, solve_loops=False)


def test_algebraic_loop_without_solution_is_one_clear_error():
    with pytest.raises(StepError, match=r"algebraic loop one\.y -> two\.z at 0 s"):
        Master(loop(1.0), 0.01)


def test_a_loop_that_ran_away_after_it_was_solved_is_no_solution():
    """y = g y + x; with g = 1 once x fell below 0.99 nothing solves it, and at 1e16 a double does not see the rest."""
    one = formula(["z", "x"], ["y"], lambda z, x: (0.5 if x > 0.99 else 1.0) * z + x)
    system = System(
        {"one": one, "two": formula(["y"], ["z"], lambda y: y), "mass": LeftOscillator()},
        [("two.z", "one.z"), ("mass.x", "one.x"), ("one.y", "two.y")],
        parameters={"mass.force": 0.0},
    )
    with pytest.raises(StepError, match=r"algebraic loop one\.y -> two\.z at .* ran away to"):
        Master(system, 0.01).run(0.1)


def test_unknown_feed_through_is_found_by_moving_inputs():
    system = System(
        {"force": formula(["x"], ["f"], lambda x: -x, depends=False), "mass": LeftOscillator()},
        [("mass.x", "force.x"), ("force.f", "mass.force")],
    )
    for participant in system.participants.values():
        participant.initialize()
    assert FeedThrough(system).order == [0]


def order_of(participants, connections):
    """Names of who is asked, in order; loops by their outputs."""
    system = System(participants, connections, parameters={"mass.force": 0.0} if "mass" in participants else {})
    for participant in system.participants.values():
        participant.initialize()
    feed = FeedThrough(system)
    asked: list[Any] = [feed.names[visit] if isinstance(visit, int) else visit for visit in feed.order]
    return asked, feed


def test_who_feeds_several_is_asked_once_and_before_all_of_them():
    """Levels: base follows the mass; both left and right follow base; top follows left, and the mass as well."""
    asked, feed = order_of(
        {
            "top": formula(["a", "b"], ["y"], lambda a, b: a + b),
            "right": formula(["a"], ["y"], lambda a: a),
            "left": formula(["a"], ["y", "z"], lambda a: (a, a)),
            "base": formula(["a"], ["y"], lambda a: a),
            "mass": LeftOscillator(),
        },
        [("mass.x", "base.a"), ("base.y", "left.a"), ("base.y", "right.a"), ("left.z", "top.a"), ("mass.v", "top.b")],
    )
    assert asked[0] == "base"
    assert sorted(asked[1:3]) == ["left", "right"]
    assert asked[3:] == ["top"]
    assert sorted(feed.names[i] for i in feed.wholly) == ["base", "left", "right", "top"]


def test_nobody_is_asked_where_nothing_follows_at_once_or_a_factor_is_none():
    spring = formula(["a"], ["y"], lambda a: a)
    assert (
        order_of({"mass": LeftOscillator(), "spring": spring}, [Connection("mass.x", "spring.a", factor=0.0)])[0] == []
    )
    assert order_of({"mass": LeftOscillator()}, [])[0] == []


def test_an_output_that_needs_nothing_can_be_asked_for_before_the_rest_is_known():
    """One output follows the input and one does not: the participant as a whole does not wait for it."""
    variables = [
        Variable("a", "input", ""),
        Variable("y", "output", "", depends=("a",)),
        Variable("z", "output", "", depends=()),
    ]
    both = Formula(variables, lambda u, _: (u[0], 1.0))
    asked, feed = order_of({"both": both, "mass": LeftOscillator()}, [("mass.x", "both.a")])
    assert asked == ["both"]
    assert feed.wholly == set()


def test_a_loop_stands_in_its_place_and_names_its_outputs_once():
    asked, feed = order_of(
        {
            "after": formula(["a"], ["y"], lambda a: a),
            "one": formula(["z", "x"], ["y"], lambda z, x: 0.5 * z + x),
            "two": formula(["y"], ["z"], lambda y: y),
            "mass": LeftOscillator(),
        },
        [("two.z", "one.z"), ("mass.x", "one.x"), ("one.y", "two.y"), ("one.y", "after.a")],
    )
    assert feed.loops == ["one.y -> two.z"]
    assert asked[1:] == ["after"]
    assert [feed.names[i] for i in asked[0].participants] == ["one", "two"]
    assert [feed.names[i] for i in feed.wholly] == ["after"]


def test_an_output_that_follows_its_own_input_is_a_loop_by_itself():
    """y = x + y/2: y = 2 x."""
    own = formula(["y", "x"], ["out"], lambda y, x: 0.5 * y + x)
    system = System(
        {"own": own, "mass": LeftOscillator()},
        [("own.out", "own.y"), ("mass.x", "own.x")],
        parameters={"mass.force": 0.0},
    )
    run = Master(system, 0.01).run(0.1)
    assert run.loops == ("own.out",)
    np.testing.assert_allclose(run.recording["own.out"], 2 * run.recording["mass.x [m]"], rtol=1e-10)


def test_a_loop_that_loses_its_solution_is_told_with_the_end_of_the_step():
    """Against its own sign once cos(sqrt(10) t) < 0.99, from t = 0.0448 s on; steps end at 0.04 and 0.05 s."""
    system = System(
        {
            "one": formula(["z", "x"], ["y"], lambda z, x: 0.5 * z + x if x > 0.99 else (1.0 if z < 0 else -1.0)),
            "two": formula(["y"], ["z"], lambda y: y),
            "mass": LeftOscillator(),
        },
        [("two.z", "one.z"), ("mass.x", "one.x"), ("one.y", "two.y")],
        parameters={"mass.force": 0.0},
    )
    with pytest.raises(StepError, match=r"one\.y -> two\.z at 0\.05 s"):
        Master(system, 0.01).run(0.1)


@pytest.mark.parametrize(
    ("function", "start", "maximum", "answers"),
    [
        (lambda a, b: (a, b), (0.0, 0.0), np.inf, [[True, False], [False, True]]),
        (lambda a, b: (max(a, 0.5), 1.0), (0.0, 0.0), np.inf, [[True, False], [False, False]]),  # by 1, not by 0.001
        (lambda a, b: (max(a, 2.5), 1.0), (2.0, 0.0), np.inf, [[True, False], [False, False]]),  # by its own size
        (lambda a, b: (max(a, 2.5), b), (2.0, 0.0), 2.4, [[False, False], [False, True]]),  # not beyond its bound
    ],
)
def test_inputs_are_moved_a_little_and_by_their_size_inside_their_bounds(function, start, maximum, answers):
    variables = [Variable(n, "input", "", s, maximum=maximum) for n, s in zip("ab", start, strict=True)]
    variables += [Variable(n, "output", "", depends=None) for n in ("y", "z")]
    given = {"it.a": start[0], "it.b": start[1]}
    system = System({"it": Formula(variables, lambda u, _: function(*u))}, [], parameters=given)
    it = system.participants["it"]
    it.initialize()
    it.set_inputs(np.array([7.0, 8.0]))
    np.testing.assert_array_equal(FeedThrough(system)._moved(0), answers)
    np.testing.assert_array_equal(it.save(), [7.0, 8.0])  # put back


@pytest.mark.parametrize(
    ("error", "when", "said"),
    [
        (StepError("it: stuck"), "", "it: stuck"),
        (StepError("formula: stuck"), "the step from 1 s", "it: stuck, in the step from 1 s"),
        (StepError("stuck in the step from 1 s"), "the step from 1 s", "it: stuck in the step from 1 s"),
        (ValueError("stuck"), "", "it: ValueError: stuck"),
    ],
)
def test_a_failure_is_told_once_by_its_name_and_its_time(error, when, said):
    system = System({"it": formula(["a"], ["y"], lambda a: a)}, [], parameters={"it.a": 0.0})
    assert str(FeedThrough(system).failure(0, error, when)) == said


def test_whatever_an_asked_participant_raises_is_told_under_its_name():
    """1/0 where the formula is asked what it shows at first."""
    system = System({"it": formula(["a"], ["y"], lambda a: 1.0 / float(a))}, [], parameters={"it.a": 0.0})
    system.participants["it"].initialize(0.0)
    with pytest.raises(StepError, match=r"^it: ZeroDivisionError: float division by zero$"):
        FeedThrough(system).ask(0, np.zeros(1))
