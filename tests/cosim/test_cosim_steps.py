"""A master's steps counted by hand: when a run ends, what an error is measured by, and what a cut step leaves."""

import numpy as np
import pytest

from snarelab.cosim.iteration import Iteration
from snarelab.cosim.macro_step import AcceptedStep
from snarelab.cosim.master import Master
from snarelab.cosim.participants.oscillator import LeftOscillator, RightOscillator
from snarelab.cosim.step_control import StepControl
from snarelab.cosim.system import System
from snarelab.errors import InputError

LINKS = [("right.force", "left.force"), ("left.x", "right.x_left"), ("left.v", "right.v_left")]


def master(step=0.1, **options):
    return Master(System({"left": LeftOscillator(), "right": RightOscillator()}, LINKS), step, **options)


def outputs(one, **values):
    """The outputs now, with some of them changed by so much."""
    names = one.system.layout.outputs
    changed = np.array([one.value(name) for name in names])
    for name, value in values.items():
        changed[names.index(name.replace("_", ".", 1))] += value
    return changed


@pytest.mark.parametrize(
    ("until", "times"),
    [
        (2.0, [2.0]),
        (2.1, [2.0, 2.1]),
        (2.25, [2.0, 2.1, 2.2, 2.25]),
        (2.2 + 0.9e-10, [2.0, 2.1, 2.2]),  # less than a billionth of a step from it
        (2.2 - 0.9e-10, [2.0, 2.1, 2.2]),
    ],
)
def test_a_run_ends_at_its_time_and_counts_every_step_once(until, times):
    one, seen = master(start=2.0), []
    run = one.run(until, seen.append)
    np.testing.assert_allclose(run.recording["time"], times, rtol=0, atol=1e-12)
    assert seen == pytest.approx(times[1:])
    assert (run.steps, run.evaluations, run.rejected) == (len(times) - 1, len(times) - 1, 0)
    assert one.size == 0.1


@pytest.mark.parametrize("until", [1.999, -1.0, np.inf, np.nan])
def test_a_run_goes_forward_to_a_time_that_comes(until):
    with pytest.raises(InputError, match="the time is 2 s already; give a later one"):
        master(start=2.0).run(until)


@pytest.mark.parametrize("step", [0.0, -0.1, np.inf, np.nan])
def test_a_macro_step_is_positive_and_finite(step):
    with pytest.raises(InputError, match="is not positive"):
        master(step)


@pytest.mark.parametrize(
    ("changed", "error"),
    [
        ({"left_x": 0.3}, 0.3 / 2.0 / 0.1),  # its magnitude is given
        ({"right_force": -0.6}, 0.6 / 3.6 / 0.1),  # -3 N before, -3.6 N now: the larger of the two
        ({"left_v": 0.05}, 10.0),  # from nothing: all of what it is now
        ({"right_x": 5.0}, 0.0),  # nobody reads it
        ({}, 0.0),
        ({"left_x": 0.3, "right_force": -0.9}, 0.9 / 3.9 / 0.1),  # the worst of all
    ],
)
def test_an_error_is_the_worst_miss_of_what_is_coupled_in_tolerances(changed, error):
    """Constant hold: outputs were predicted to stay. Masses stand 1 m apart on 3 N/m."""
    one = master(hold="constant", control=StepControl(0.1, {"left.x": 2.0}))
    assert one._step._error(outputs(one, **changed), 0.1) == pytest.approx(error, rel=1e-12)


def test_the_largest_magnitude_so_far_is_kept():
    """-3 N at first; once 6 N were passed, a miss of 1.2 N is a fifth."""
    one = master(hold="constant", control=StepControl(0.1))
    for change in (9.0, -5.0):
        one._step.remember(AcceptedStep(outputs(one, right_force=change), 0.1, None))
    assert one.value("right.force") == pytest.approx(1.0)
    assert one._step._error(outputs(one, right_force=1.2), 0.1) == pytest.approx(1.2 / 6.0 / 0.1)


def test_what_is_foretold_follows_the_hold_through_the_last_points():
    """Forces of -3, -1 and 5 N at equal steps: the parabola leads to 15 N, the line to 11 N."""
    for hold, forecast in (("constant", 5.0), ("linear", 11.0), ("midpoint", 11.0), ("quadratic", 15.0)):
        one = master(hold=hold, iterate=True)
        for change in (2.0, 6.0):
            one._step.remember(AcceptedStep(outputs(one, right_force=change), 0.1, None))
        at = one.system.layout.outputs.index("right.force")
        assert one._step._predicted(0.1)[at] == pytest.approx(forecast)
        assert one._step._predicted(0.1)[one.system.layout.outputs.index("left.x")] == pytest.approx(1.0)


def test_a_step_that_is_cut_does_not_shorten_the_next_run():
    """All errors are far below 1: the step grows by two each time, 0.01 and 0.02, but for the 0.005 left to 0.035."""
    one = master(0.01, control=StepControl(1e9, largest=0.5))
    run = one.run(0.035)
    np.testing.assert_allclose(run.recording["time"], [0.0, 0.01, 0.03, 0.035], atol=1e-12)
    assert one.size == pytest.approx(0.04)


def test_a_step_that_is_off_is_repeated_shorter_and_at_the_smallest_it_is_taken():
    """No step meets a tolerance of nothing: a fifth of 0.1 s, then the smallest one, which is taken."""
    one = master(0.1, hold="constant", control=StepControl(1e-12, smallest=0.01, largest=0.1))
    run = one.run(0.02)
    np.testing.assert_allclose(run.recording["time"], [0.0, 0.01, 0.02], atol=1e-12)
    texts = [event.text for event in run.log]
    assert run.rejected == 1
    assert "repeated with 0.01 s" in texts[0]
    assert [text.startswith("accepted at the smallest step") for text in texts] == [False, True, True]
    assert run.evaluations == run.steps + run.rejected == 3


@pytest.mark.parametrize(
    ("error", "degree", "rejected", "size"),
    [
        (0.25, 0, False, 0.2),  # 0.36, but never more than twice the last one
        (0.81, 1, False, 0.1),
        (0.729, 2, False, 0.1),
        (4.0, 1, True, 0.045),
        (1e9, 1, True, 0.02),  # a fifth at least
        (1e-9, 1, True, 0.1),  # not larger when it is repeated
        (0.0, 2, False, 0.2),
    ],
)
def test_the_next_step_follows_the_order_of_the_error(error, degree, rejected, size):
    """0.9 of the step at which an error of order degree + 1 would be 1."""
    assert StepControl().next_size(0.1, error, degree, rejected) == pytest.approx(size)


def test_an_iteration_is_counted_and_ends_where_outputs_are_what_was_assumed():
    """Two forces and speeds that follow each other: at least two evaluations a step, and the masses' sum is kept."""
    given = Iteration(tolerance=1e-10)
    one = master(0.05, iterate=given, hold="linear")
    assert one._step._solver is not None
    assert one._step._solver.iteration is given
    run = one.run(0.5)
    assert run.steps == 10
    assert run.evaluations >= 20
    # x1 + x2 swings at sqrt(10) 1/s by itself, whatever the coupling does: cos(sqrt(10) t) to the hold's order.
    total = run.recording["left.x [m]"] + run.recording["right.x [m]"]
    np.testing.assert_allclose(total, np.cos(np.sqrt(10) * run.recording["time"]), atol=5e-3)
