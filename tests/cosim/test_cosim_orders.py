"""Orders 1, 2 and 3 on two masses made of FMUs that move at the start, and step control's error over its tolerance."""

import pytest

from bench.cosim_orders import error, halves
from bench.two_masses import slopes
from snarelab.cosim.master import Master
from snarelab.cosim.participants.oscillator import LeftOscillator, RightOscillator
from snarelab.cosim.step_control import StepControl
from snarelab.cosim.system import System

LINKS = [("right.force", "left.force"), ("left.x", "right.x_left"), ("left.v", "right.v_left")]


@pytest.fixture(scope="module", params=[2, 3])
def files(request, tmp_path_factory):
    return halves(tmp_path_factory.mktemp("halves"), request.param)


@pytest.mark.parametrize("scheme", ["jacobi", "gauss_seidel"])
@pytest.mark.parametrize(("hold", "expected"), [("constant", 1), ("linear", 2), ("quadratic", 3)])
def test_observed_order(files, hold, expected, scheme):
    """FMI 2.0 takes slopes; FMI 3.0 takes two values a step, with the parabola's first two moments."""
    steps = (0.01, 0.005)
    (found,) = slopes(steps, [error(files, step, hold, scheme) for step in steps])
    assert found == pytest.approx(expected, abs=0.1)


@pytest.mark.parametrize("hold", ["linear", "quadratic"])
def test_step_controls_error_follows_its_tolerance(files, hold):
    tolerances = (1e-2, 1e-3)
    errors = [error(files, 1e-3, hold, control=StepControl(tolerance)) for tolerance in tolerances]
    assert slopes(tolerances, errors)[0] == pytest.approx(1.0, abs=0.15)


class Stuck(LeftOscillator):
    can_restore = False


class Switching(LeftOscillator):
    """A force that jumps with the input: no fixed point."""

    def outputs(self):
        shown = super().outputs()
        return shown + (-1e3 if self._x[2] < 0 else 1e3)


def test_the_start_is_left_as_it_is_where_it_cannot_be_iterated():
    with Master(System({"left": Stuck(), "right": RightOscillator()}, LINKS), 1e-2, hold="quadratic") as master:
        assert master.run(0.1).evaluations == 10
    parts = {"left": LeftOscillator(), "right": RightOscillator()}
    with Master(System(parts, LINKS), 1e-2, hold="quadratic") as master:
        assert 10 < master.run(0.1).evaluations < 15
    parts = {"left": Switching(), "right": RightOscillator()}
    with Master(System(parts, LINKS), 1e-2, hold="quadratic") as master:
        run = master.run(0.1)
    assert run.steps == 10
    assert [event.time for event in run.log] == [0.0]
    assert "the start was not iterated" in str(run.log[0])
