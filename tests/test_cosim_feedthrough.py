"""Who is asked in which order, algebraic loops, and the iteration that solves them."""

import numpy as np
import pytest

from snarelab.cosim.feedthrough import FeedThrough
from snarelab.cosim.iteration import Iteration, NotConverged, QuasiNewton
from snarelab.cosim.master import Master
from snarelab.cosim.participant import StepError, Variable
from snarelab.cosim.participants.formula import Formula
from snarelab.cosim.participants.oscillator import LeftOscillator
from snarelab.cosim.system import System
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


def test_unknown_feed_through_is_found_by_moving_inputs():
    system = System(
        {"force": formula(["x"], ["f"], lambda x: -x, depends=False), "mass": LeftOscillator()},
        [("mass.x", "force.x"), ("force.f", "mass.force")],
    )
    for participant in system.participants.values():
        participant.initialize()
    assert FeedThrough(system).order == [0]


# Iteration


def test_quasi_newton_solves_a_linear_interface_in_its_dimension_plus_two():
    rng = np.random.default_rng(3)
    matrix, shift = rng.normal(size=(4, 4)) * 3, rng.normal(size=4)
    found, count = QuasiNewton(Iteration(tolerance=1e-10)).solve(lambda y: matrix @ y + shift, np.zeros(4), np.ones(4))
    np.testing.assert_allclose(found, np.linalg.solve(np.eye(4) - matrix, shift), rtol=1e-8)
    assert count <= 6


def test_quasi_newton_remembers():
    solver = QuasiNewton(Iteration(tolerance=1e-10))
    matrix = np.array([[0.0, 5.0], [-4.0, 0.0]])
    _, first = solver.solve(lambda y: matrix @ y + 1.0, np.zeros(2), np.ones(2))
    _, second = solver.solve(lambda y: matrix @ y + 2.0, np.zeros(2), np.ones(2))
    assert second < first


def test_quasi_newton_says_when_there_is_no_solution():
    with pytest.raises(NotConverged):
        QuasiNewton(Iteration(limit=10)).solve(lambda y: y + 1.0, np.zeros(1), np.ones(1))
