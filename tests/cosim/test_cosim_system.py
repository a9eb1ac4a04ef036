"""What is refused before anything runs, and what units do at a connection."""

import pytest

from snarelab.cosim.energy import BondEnergy
from snarelab.cosim.master import Master
from snarelab.cosim.participant import Variable
from snarelab.cosim.participants.oscillator import LeftOscillator, RightOscillator
from snarelab.cosim.participants.program import Program
from snarelab.cosim.step_control import StepControl
from snarelab.cosim.system import Connection, PowerBond, System
from snarelab.cosim.units import conversion
from snarelab.errors import InputError

CONNECTIONS = [("right.force", "left.force"), ("left.x", "right.x_left"), ("left.v", "right.v_left")]


def halves():
    return {"left": LeftOscillator(), "right": RightOscillator()}


def system(connections=CONNECTIONS, **options):
    return System(halves(), connections, **options)


@pytest.mark.parametrize(
    ("source", "target", "factor", "offset"),
    [
        ("deg", "rad", 0.017453292519943295, 0.0),
        ("mm", "m", 1e-3, 0.0),
        ("degC", "K", 1.0, 273.15),
        ("K", "degC", 1.0, -273.15),
        ("degF", "degC", 5 / 9, -160 / 9),
        ("rpm", "rad/s", 0.10471975511965977, 0.0),
        ("", "N", 1.0, 0.0),
        ("N*m", "", 1.0, 0.0),
        ("1", "rad", 1.0, 0.0),
        ("1000.0 * kg*m", "kg*m", 1000.0, 0.0),
        ("Nm", "N*m", 1.0, 0.0),
    ],
)
def test_conversion(source, target, factor, offset):
    assert conversion(source, target) == pytest.approx((factor, offset), rel=1e-12, abs=1e-12)


@pytest.mark.parametrize(("source", "target"), [("N", "m"), ("Hz", "rad/s"), ("rpm", "Hz"), ("frobnicate", "m")])
def test_units_that_do_not_fit(source, target):
    with pytest.raises(InputError, match=r"cannot be read in|unknown to pint"):
        conversion(source, target)


@pytest.mark.parametrize(
    ("connections", "options", "message"),
    [
        ([("right.forc", "left.force")], {}, "nearest output is 'right.force'"),
        ([("right.force", "left.forse")], {}, "nearest input is 'left.force'"),
        ([("rihgt.force", "left.force")], {}, "no participant 'rihgt'; nearest is 'right'"),
        ([("left.force", "left.force")], {}, "'left.force' is an input, not an output"),
        ([("right.force", "left.x")], {}, "'left.x' is an output, not an input"),
        ([*CONNECTIONS, ("right.x", "left.force")], {}, "connected to right.force and right.x; keep one"),
        ([("right.x", "left.force")], {}, "a value in m cannot be read in N"),
        (CONNECTIONS[:1], {}, "input right.x_left is not connected"),
        (CONNECTIONS, {"parameters": {"left.mas": 1.0}}, "nearest parameter is 'left.mass'"),
        (CONNECTIONS, {"parameters": {"left.mass": -1.0}}, "left.mass = -1 is outside"),
        (CONNECTIONS, {"parameters": {"left.force": 1.0}}, "has a value and is connected"),
    ],
)
def test_refused_by_name(connections, options, message):
    with pytest.raises(InputError) as caught:
        system(connections, **options)
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)


def test_every_problem_is_named_at_once():
    with pytest.raises(InputError) as caught:
        system([("right.x", "left.force")], parameters={"left.mass": -1.0})
    assert all(word in str(caught.value) for word in ("cannot be read", "x_left", "v_left", "outside"))


def test_dots_belong_to_variables():
    with pytest.raises(InputError, match="dot in its name"):
        System({"a.b": LeftOscillator()}, parameters={"a.b.force": 0.0})


def test_one_participant_has_one_name():
    twice = LeftOscillator()
    with pytest.raises(InputError, match="under two names"):
        System({"a": twice, "b": twice}, parameters={"a.force": 0.0, "b.force": 0.0})


def test_an_input_may_have_a_value_instead():
    held = System({"left": LeftOscillator()}, parameters={"left.force": 5.0, "left.position": 0.5})
    with Master(held, 1e-3) as master:
        master.run(1.0)  # 10 N/m and 5 N: at rest at 0.5 m
    assert master.value("left.x") == pytest.approx(0.5, abs=1e-12)


def test_units_are_converted_and_factors_applied():
    scale = Program([Variable("in", "input", "mm"), Variable("out", "output", "kN")], lambda t, u, x, p: (u, x), 1e-3)
    chain = System(
        {"left": LeftOscillator(), "scale": scale},
        [Connection("left.x", "scale.in", factor=-2.0, offset=1.0), Connection("scale.out", "left.force", factor=0.0)],
    )
    master = Master(chain, 1e-3, hold="constant")
    master.step()
    assert master.value("scale.out") == pytest.approx(-2.0 * 1000.0 + 1.0)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"scheme": "jacoby"}, "choose jacobi or gauss_seidel"),
        ({"hold": "cubic"}, "choose constant"),
        ({"step": 0.0}, "not positive"),
        ({"control": StepControl(magnitudes={"left.y": 1.0})}, "nearest is"),
    ],
)
def test_options_are_checked(options, message):
    with pytest.raises(InputError, match=message):
        Master(system(), **options)


def test_iteration_and_control_want_rollback():
    class Stuck(LeftOscillator):
        can_restore = False

    stuck = System({"left": Stuck(), "right": RightOscillator()}, CONNECTIONS)
    with pytest.raises(InputError, match="left cannot save and restore"):
        Master(stuck, iterate=True)
    with pytest.raises(InputError, match="left cannot save and restore"):
        Master(stuck, control=StepControl())


def test_step_control_wants_steps_that_may_vary():
    class Rigid(LeftOscillator):
        can_vary_step = False

    rigid = System({"left": Rigid(), "right": RightOscillator()}, CONNECTIONS)
    with pytest.raises(InputError, match="left cannot"):
        Master(rigid, control=StepControl())
    with pytest.raises(InputError, match="give a whole number"):
        Master(rigid, 0.3).run(1.0)


@pytest.mark.parametrize(
    ("bond", "message"),
    [
        (PowerBond("b", "right.force", "left.x"), "is not a power"),
        (PowerBond("b", "right.force", "right.v"), "is not connected to right"),
        (PowerBond("b", "right.torque", "left.v"), "is no output"),
    ],
)
def test_bonds_are_checked(bond, message):
    with pytest.raises(InputError, match=message):
        BondEnergy(system(bonds=[bond]))


def test_unknown_output_asked_for():
    with pytest.raises(InputError, match=r"nearest is 'left\.x'"):
        Master(system()).value("left.xx")
