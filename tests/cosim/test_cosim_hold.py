"""Weights of holds, and a sweep's inputs in every order: against polynomials by hand."""

# pyright: reportArgumentType=false

import numpy as np
import pytest

from snarelab.cosim.feedthrough import FeedThrough
from snarelab.cosim.hold import HALVES, HOLDS, Hold, combine, end_weights, hold_named, weights
from snarelab.cosim.participant import Participant, StepError, Variable
from snarelab.cosim.participants.oscillator import LeftOscillator
from snarelab.cosim.sweep import Sweep
from snarelab.cosim.system import System
from snarelab.errors import InputError

H = 0.1
"""[s] The step."""


def test_holds_have_the_degrees_of_their_names():
    assert {name: hold_named(name).degree for name in HOLDS} == {
        "constant": 0,
        "linear": 1,
        "quadratic": 2,
        "midpoint": 1,
    }
    assert [name for name in HOLDS if hold_named(name).middle] == ["midpoint"]
    with pytest.raises(InputError, match=r"hold 'cubic' is unknown; choose constant, linear, quadratic, midpoint"):
        hold_named("cubic")


@pytest.mark.parametrize(
    ("hold", "nodes", "order", "rows"),
    [
        (Hold(0), (0.0,), 0, [[1.0]]),
        (Hold(1), (0.0, -1.0), 0, [[1.5, -0.5]]),  # the line's mean: its middle
        (Hold(1), (1.0, 0.0), 0, [[0.5, 0.5]]),
        (Hold(1), (0.0, -1.0), 1, [[1.0, 0.0], [1 / H, -1 / H]]),
        (Hold(1), (0.0, -2.0), 2, [[1.0, 0.0], [0.5 / H, -0.5 / H]]),  # the step before was twice as long
        (Hold(1, middle=True), (0.0, -1.0), 0, [[1.5, -0.5]]),
        (Hold(1, middle=True), (1.0, 0.0), 2, [[0.5, 0.5]]),
        # f = a + b s + c s² through 0, -1, -2: b = 3/2 f0 - 2 f1 + f2/2, c = (f0 - 2 f1 + f2)/2; mean a + b/2 + c/3.
        (Hold(2), (0.0, -1.0, -2.0), 0, [[23 / 12, -16 / 12, 5 / 12]]),  # Adams and Bashforth's
        (Hold(2), (0.0, -1.0, -2.0), 1, [[1 + 1 / 6, -1 / 3, 1 / 6], [1.5 / H, -2 / H, 0.5 / H]]),
        (
            Hold(2),
            (0.0, -1.0, -2.0),
            2,
            [[1.0, 0.0, 0.0], [1.5 / H, -2 / H, 0.5 / H], [1 / H**2, -2 / H**2, 1 / H**2]],
        ),
        (Hold(2), (1.0, 0.0, -1.0), 0, [[5 / 12, 8 / 12, -1 / 12]]),  # Adams and Moulton's
    ],
)
def test_weights_give_the_polynomials_value_and_derivatives_and_the_mean_of_what_is_not_taken(hold, nodes, order, rows):
    np.testing.assert_allclose(weights(hold, nodes, H, order), rows, rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize("nodes", [(0.0,), (0.0, -1.0), (1.0, 0.0), (0.0, -0.5, -2.0), (1.0, 0.0, -1.5)])
def test_two_halves_have_the_mean_and_the_first_moment_of_the_parabola(nodes):
    """Integrals over the step by Gauss-Legendre, exact here; moments about its start."""
    values = [force(t) for t in nodes]
    parabola = np.polynomial.Polynomial.fit(nodes, values, len(nodes) - 1)
    at, share = np.polynomial.legendre.leggauss(4)
    at, share = (at + 1) / 2, share / 2
    first, second = (float(np.dot(row, values)) for row in weights(Hold(2), nodes, H, HALVES))
    assert (first + second) / 2 == pytest.approx(share @ parabola(at), rel=1e-12)
    assert first / 8 + second * 3 / 8 == pytest.approx(share @ (at * parabola(at)), rel=1e-12)


@pytest.mark.parametrize(
    ("nodes", "expected"),
    [((0.0,), [1.0]), ((0.0, -1.0), [2.0, -1.0]), ((0.0, -1.0, -2.0), [3.0, -3.0, 1.0]), ((1.0, 0.0), [1.0, 0.0])],
)
def test_the_end_of_a_step_is_where_the_polynomial_leads(nodes, expected):
    np.testing.assert_allclose(end_weights(nodes), expected, atol=1e-12)


def test_values_are_combined_newest_first_and_older_ones_without_a_weight_are_left_out():
    values = [np.array([1.0, 10.0]), np.array([2.0, 20.0]), np.array([5.0, 50.0])]
    np.testing.assert_allclose(combine((3.0, -1.0), values), [1.0, 10.0])
    np.testing.assert_allclose(values[0], [1.0, 10.0])  # left as it was


# One sweep


def force(t):
    """A cubic, which no hold has whole."""
    return 4.0 - 7.0 * t + 30.0 * t**2 + 80.0 * t**3


class Pusher(Participant):
    """Shows the force at its own time."""

    variables = (Variable("force", "output", "N"),)
    name = "pusher"

    def initialize(self, time=0.0, parameters=None):
        self._time = time

    def set_inputs(self, values):
        """There is none."""

    def step(self, time, size):
        self._time = time + size

    def outputs(self):
        return np.array([force(self._time)])


def sweep_of(order, hold, sequential, **more):
    """A sweep of a pusher and a free mass of 1 kg, and the place of the force among the outputs."""
    made = {"pusher": Pusher(), "mass": LeftOscillator(), **more}
    system = System({name: made[name] for name in order}, [("pusher.force", "mass.force")])
    for participant in system.participants.values():
        participant.initialize(0.0, {"stiffness": 0.0} if isinstance(participant, LeftOscillator) else {})
    return Sweep(system, HOLDS[hold], FeedThrough(system), sequential), system


T = 0.3
"""[s] When the step starts."""
F0, F1, F2, END = force(T), force(T - H), force(T - 2 * H), force(T + H)


@pytest.mark.parametrize(
    ("hold", "sequential", "first", "known", "mean"),
    [
        ("constant", False, "pusher", 3, F0),
        ("constant", True, "pusher", 3, END),  # it has been there
        ("constant", True, "mass", 3, F0),
        ("midpoint", False, "pusher", 3, 1.5 * F0 - 0.5 * F1),
        ("midpoint", True, "pusher", 3, (END + F0) / 2),
        ("linear", False, "pusher", 1, F0),  # the first step knows no slope
        ("linear", True, "pusher", 1, (END + F0) / 2),  # but that of one who has gone ahead
        ("linear", True, "mass", 3, 1.5 * F0 - 0.5 * F1),
        ("quadratic", False, "mass", 3, (23 * F0 - 16 * F1 + 5 * F2) / 12),
        ("quadratic", True, "pusher", 3, (5 * END + 8 * F0 - F1) / 12),
        ("quadratic", True, "pusher", 2, (5 * END + 8 * F0 - F1) / 12),
        ("quadratic", True, "mass", 2, 1.5 * F0 - 0.5 * F1),
    ],
)
def test_a_participant_is_given_what_is_known_when_it_steps(hold, sequential, first, known, mean):
    """The mass gains the mean of its input times the step; the pusher shows the force at the end."""
    other = {"pusher": "mass", "mass": "pusher"}[first]
    sweep, system = sweep_of((first, other), hold, sequential)
    at = system.layout.outputs.index("pusher.force")
    past = [np.zeros(3) for _ in range(known)]
    for array, value in zip(past, (F0, F1, F2), strict=False):
        array[at] = value
    outputs = dict(zip(system.layout.outputs, sweep(T, H, past, [H, H][: known - 1]), strict=True))
    assert sweep.mean_inputs[0] == pytest.approx(mean, rel=1e-12)
    assert outputs["mass.v"] == pytest.approx(mean * H, rel=1e-12)
    assert outputs["pusher.force"] == pytest.approx(END, rel=1e-12)


@pytest.mark.parametrize("sequential", [False, True])
def test_an_end_that_is_assumed_is_what_the_mass_is_given(sequential):
    """A line from the force now to the 20 N assumed."""
    sweep, system = sweep_of(("mass", "pusher"), "linear", sequential)
    at = system.layout.outputs.index("pusher.force")
    now, ahead = np.zeros(3), np.zeros(3)
    now[at], ahead[at] = F0, 20.0
    sweep(T, H, [now], [], ahead)
    assert sweep.mean_inputs[0] == pytest.approx((F0 + 20.0) / 2, rel=1e-12)


def test_times_of_what_is_known_are_counted_in_steps():
    """Steps of 0.1 s and 0.4 s before one of 0.2 s; as many values as the hold has points."""
    sweep, _ = sweep_of(("pusher", "mass"), "quadratic", False)
    assert sweep.nodes(0.2, [0.1, 0.4]) == pytest.approx((0.0, -0.5, -2.5))
    assert sweep.nodes(0.2, [0.1, 0.4], ahead=True) == pytest.approx((1.0, 0.0, -0.5))
    assert sweep.nodes(0.2, []) == (0.0,)


@pytest.mark.parametrize(
    ("hold", "before", "end", "after"),
    [("constant", [1.0], [1.0], [1.0]), ("midpoint", [1.5, -0.5], [2.0, -1.0], [0.5, 0.5]), ("linear", None, 0, 0)],
)
def test_a_compiled_loop_is_told_the_weights_of_equal_steps_where_no_one_takes_slopes(hold, before, end, after):
    sweep, _ = sweep_of(("pusher", "mass"), hold, True)
    plan = sweep.plan(H)
    if before is None:
        assert plan is None
        return
    assert plan is not None
    for found, expected in ((plan.before, [before]), (plan.end, end), (plan.after, [after])):
        np.testing.assert_allclose(found, expected)
    assert (plan.visits, plan.follow, plan.halves, plan.sequential) == ((), (), (), True)


class Faulty(Pusher):
    """Fails in one of its calls, and counts those that came to their end."""

    def __init__(self, where):
        self.where, self.finished = where, 0

    def begin(self, time, size):
        if self.where == "begin":
            raise ValueError("no grip")

    def finish(self):
        self.finished += 1
        if self.where == "finish":
            raise StepError("faulty: no grip")

    def outputs(self):
        if self.where == "outputs" and self.finished:
            raise KeyError("grip")
        return np.array([1.0])


@pytest.mark.parametrize("sequential", [False, True])
@pytest.mark.parametrize(
    ("where", "words"),
    [
        ("begin", "faulty: ValueError: no grip, in the step from 0.3 s"),
        ("finish", "faulty: no grip, in the step from 0.3 s"),
        ("outputs", "faulty: KeyError: 'grip', in the step from 0.3 s"),
    ],
)
def test_a_failure_is_named_with_its_step_and_everyone_else_comes_to_rest(where, words, sequential):
    first, faulty, last = Faulty("nowhere"), Faulty(where), Faulty("nowhere")
    sweep, _ = sweep_of(("first", "faulty", "last", "pusher", "mass"), "constant", sequential, first=first,
                        faulty=faulty, last=last)  # fmt: skip
    with pytest.raises(StepError) as caught:
        sweep(T, H, [np.zeros(6)], [])
    assert str(caught.value) == words
    assert "grip" in str(caught.value.__cause__)  # whose traceback shows where in the participant it was
    assert first.finished == 1
    assert last.finished == (1 if where != "begin" and not sequential else 0)


@pytest.mark.parametrize(("value", "said"), [(np.nan, "nan"), (np.inf, "inf")])
def test_an_output_that_is_no_number_is_refused_by_name(value, said):
    sweep, system = sweep_of(("pusher", "mass"), "constant", False)
    sweep.check(1.0, np.array([1e300, -1e300, 0.0]))
    outputs = np.array([0.0, value, value])
    with pytest.raises(StepError, match=rf"{system.layout.outputs[1]} is {said} at 1\.25 s; take smaller steps"):
        sweep.check(1.25, outputs)
