"""The master beyond accuracy: energy, step control, rollback, failures, the record."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from snarelab.cosim.master import Master
from snarelab.cosim.participant import StepError, Variable
from snarelab.cosim.participants.formula import Formula
from snarelab.cosim.participants.oscillator import LeftOscillator, RightOscillator
from snarelab.cosim.participants.program import Program
from snarelab.cosim.step_control import StepControl
from snarelab.cosim.system import PowerBond, System
from snarelab.errors import InputError

CONNECTIONS = [("right.force", "left.force"), ("left.x", "right.x_left"), ("left.v", "right.v_left")]


def oscillators(**options):
    return System({"left": LeftOscillator(), "right": RightOscillator()}, CONNECTIONS, **options)


def formula(inputs, outputs, function, depends=True):
    """Outputs without units, each a function of all inputs."""
    on = tuple(inputs) if depends else None
    variables = [Variable(name, "input", "") for name in inputs]
    variables += [Variable(name, "output", "", depends=on) for name in outputs]
    return Formula(variables, lambda u, _: function(*u))


def wall(position, speed):
    """A stiff unilateral contact, force over penetration to the 1.5 with damping."""
    return 1e4 * (-position) ** 1.5 * (1 - 0.3 * speed) if position < 0 else 0.0


def impact(**options):
    """A mass of 1 kg that flies into a wall 0.5 m away at 0.1 m/s and bounces off."""
    return System(
        {"mass": LeftOscillator(), "wall": formula(["x", "v"], ["force"], wall)},
        [("wall.force", "mass.force"), ("mass.x", "wall.x"), ("mass.v", "wall.v")],
        parameters={"mass.stiffness": 0.0, "mass.position": 0.5, "mass.speed": -0.1},
        **options,
    )


@pytest.fixture(scope="module")
def bounced():
    def rates(_, z):
        return [z[1], wall(z[0], z[1])]

    return solve_ivp(rates, (0, 10), [0.5, -0.1], "DOP853", rtol=1e-10, atol=1e-13, max_step=0.01, dense_output=True)


def distance(run, exact):
    return np.abs(run.recording["mass.x [m]"].to_numpy() - exact.sol(run.recording["time"].to_numpy())[0]).max()


# Energy


@pytest.mark.parametrize("scheme", ["jacobi", "gauss_seidel"])
def test_residual_is_the_energy_that_the_whole_system_has_gained(scheme):
    """Both halves conserve energy, so what the sum of all energies gains is made by the coupling."""
    bond = PowerBond("spring", "spring.force", "mass.v")

    def energy(run):
        x, v, f = (run[name].to_numpy() for name in ("mass.x [m]", "mass.v [m/s]", "spring.force [N]"))
        return 5.0 * x**2 + 0.5 * v**2 + f**2 / 6.0  # 10 N/m to the ground, 3 N/m coupling, 1 kg

    class Spring(LeftOscillator):
        """A spring that integrates the speed of its end."""

        variables = (
            *LeftOscillator.variables[:5],
            Variable("v", "input", "m/s"),
            Variable("force", "output", "N"),
            Variable("power", "output", "W"),
        )

        def _equations(self, values):
            return np.zeros((2, 2)), np.array([[1.0], [0.0]]), np.array([[-3.0, 0.0, 0.0], [0.0, 0.0, 0.0]])

    system = System(
        {"mass": LeftOscillator(), "spring": Spring()},
        [("spring.force", "mass.force"), ("mass.v", "spring.v")],
        parameters={"spring.position": 0.0},
        bonds=[bond],
    )
    run = Master(system, 2e-3, scheme=scheme, hold="constant").run(5.0)
    gained = energy(run.recording)[-1] - energy(run.recording)[0]
    assert abs(gained) > 1e-3  # a held force is visible
    # Inside a step power is taken by the trapezoidal rule: an error of H², 1e-6 of what is exchanged.
    assert run.residual["spring"] == pytest.approx(gained, abs=2e-5 * run.exchanged["spring"])
    assert float(run.recording["residual.spring [J]"][-1]) == run.residual["spring"]


def test_iterated_midpoint_makes_no_energy_in_contact():
    bond = PowerBond("contact", "wall.force", "mass.v")
    explicit, implicit = (Master(impact(bonds=[bond]), 2e-3, iterate=i).run(10.0) for i in (False, True))
    assert abs(explicit.residual["contact"]) > 1e-7
    assert abs(implicit.residual["contact"]) < 1e-11


# Step control


@pytest.mark.parametrize("options", [{}, {"scheme": "gauss_seidel"}, {"iterate": True}])
def test_controlled_steps_are_as_exact_with_a_tenth_of_the_steps(bounced, options):
    fixed = Master(impact(), 4e-3, **options).run(10.0)
    control = StepControl(1e-3, magnitudes={"wall.force": 1.0}, smallest=1e-5, largest=0.1)
    controlled = Master(impact(), 1e-3, control=control, **options).run(10.0)
    assert distance(controlled, bounced) < distance(fixed, bounced)
    assert controlled.steps + controlled.rejected < fixed.steps / 5


def test_first_contact_is_rejected_and_repeated_and_logged():
    control = StepControl(1e-2, magnitudes={"wall.force": 1.0}, smallest=1e-5, largest=0.1)
    run = Master(impact(), 1e-3, control=control).run(10.0)
    assert run.rejected == len(run.log) >= 1
    assert 4.8 < run.log[0].time < 5.0  # at 0.1 m/s the wall, 0.5 m away, is reached after 5 s
    assert "rejected: inputs off by" in str(run.log[0])
    assert float(run.recording["time"][-1]) == pytest.approx(10.0, abs=1e-9)


def test_magnitudes_may_be_given_for_many_outputs_at_once():
    found = StepControl(magnitudes={"*.x": 2.0, "right.force": np.inf}).given_magnitudes(("a.x", "a.v", "right.force"))
    np.testing.assert_array_equal(found, [2.0, 0.0, np.inf])


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"tolerance": 0.0}, "tolerance 0.0 must be positive"),
        ({"smallest": 0.0}, r"smallest step 0.0 s must be positive, at most inf s"),
        ({"smallest": 0.2, "largest": 0.1}, r"smallest step 0.2 s must be positive, at most 0.1 s"),
    ],
)
def test_step_control_that_leaves_no_step_is_refused(options, words):
    with pytest.raises(InputError, match=words):
        StepControl(**options)


def test_a_magnitude_is_positive():
    with pytest.raises(InputError, match=r"magnitude -1\.0 of a\.x must be positive"):
        StepControl(magnitudes={"a.x": -1.0}).given_magnitudes(("a.x",))


@pytest.mark.parametrize(
    ("error", "degree", "rejected", "size"),
    [
        (0.0, 1, False, 0.02),  # twice at most
        (0.09, 1, False, 0.02),
        (0.36, 1, False, 0.015),  # 0.9 / 0.6
        (0.9**3, 2, False, 0.01),
        (0.36, 1, True, 0.01),  # no larger after a rejected one
        (4.0, 1, True, 0.0045),
        (1e6, 0, True, 0.002),  # a fifth at least
    ],
)
def test_next_size_follows_the_order_of_the_error(error, degree, rejected, size):
    """0.9 (1 / error)^(1 / (degree + 1)) of the step, between a fifth of it and twice it."""
    assert StepControl().next_size(0.01, error, degree, rejected) == pytest.approx(size, rel=1e-12)
    assert StepControl(smallest=0.012, largest=0.013).next_size(0.01, error, degree, rejected) == pytest.approx(
        min(max(size, 0.012), 0.013), rel=1e-12
    )


def test_smallest_step_is_accepted_and_logged():
    control = StepControl(1e-6, magnitudes={"wall.force": 1.0}, smallest=5e-3, largest=0.1)
    run = Master(impact(), 5e-3, control=control).run(6.0)
    assert any("accepted at the smallest step" in event.text for event in run.log)
    assert np.diff(run.recording["time"]).min() > 4.9e-3 or run.recording["time"][-1] == 6.0


# Rollback


PARTICIPANTS = {
    "left": (LeftOscillator, 1),
    "right": (RightOscillator, 2),
    "formula": (lambda: Formula([Variable("u", "input", ""), Variable("y", "output", "")], lambda u, _: 3 * u), 1),
    "program": (
        lambda: Program(
            [Variable("u", "input", ""), Variable("y", "output", "")],
            lambda t, u, x, p: (np.sin(x) + u, x + u * t),
            7e-4,
            [0.1],
        ),
        1,
    ),
}


@pytest.mark.parametrize("name", PARTICIPANTS)
def test_restore_and_repeat_is_bitwise(name):
    make, n_inputs = PARTICIPANTS[name]
    participant, other = make(), make()
    rng = np.random.default_rng(5)
    participant.initialize()
    other.initialize()

    def go_on(which, start):
        generator, shown = np.random.default_rng(8), []
        for k in range(20):
            which.set_inputs(generator.normal(size=n_inputs))
            which.step(start + k * 1e-3, 1e-3)
            shown.append(which.outputs())
        return np.array(shown)

    for k in range(10):
        participant.set_inputs(rng.normal(size=n_inputs))
        participant.step(k * 1e-3, 1e-3)
    state = participant.save()
    first = go_on(participant, 0.01)
    participant.restore(state)
    np.testing.assert_array_equal(go_on(participant, 0.01), first)
    other.restore(state)
    np.testing.assert_array_equal(go_on(other, 0.01), first)


# Running and recording


def test_stepping_by_hand_is_the_same_as_one_run():
    whole = Master(oscillators(), 1e-2).run(0.5)
    master = Master(oscillators(), 1e-2)
    reached = [master.step() for _ in range(50)]
    assert whole.recording.equals(master.result().recording)
    np.testing.assert_array_equal(reached, whole.recording["time"][1:])


def test_last_step_is_cut_to_end_on_time_and_a_run_can_go_on():
    master = Master(oscillators(), 3e-3)
    assert float(master.run(0.1).recording["time"][-1]) == pytest.approx(0.1, abs=1e-15)
    run = master.run(0.2)
    assert master.time == pytest.approx(0.2, abs=1e-15)
    assert run.steps == 68
    with pytest.raises(InputError, match="give a later one"):
        master.run(0.1)


def test_ten_thousand_steps_do_not_drift_off_the_clock():
    run = Master(oscillators(), 1e-3).run(10.0)
    np.testing.assert_array_equal(run.recording["time"], np.arange(10001) * 1e-3)


def test_failing_step_is_named_and_what_there_was_is_kept():
    def breaks(time, u, x, p):
        if time > 0.5:
            raise ZeroDivisionError("division by zero")
        return u, x

    part = Program([Variable("u", "input", ""), Variable("y", "output", "")], breaks, 0.1)
    master = Master(System({"control": part}, parameters={"control.u": 1.0}), 0.1)
    with pytest.raises(
        StepError, match=r"control: ZeroDivisionError: .* step from 0\.5 s; last good step ended at 0\.5 s"
    ):
        master.run(1.0)
    assert len(master.result().recording["time"]) == 6


@pytest.mark.parametrize("scheme", ["jacobi", "gauss_seidel"])
def test_failing_formula_is_named_too(scheme):
    def root(x):
        if x < 0.5:
            raise ValueError("math domain error")
        return x

    parts = {"mass": LeftOscillator(), "part": formula(["x"], ["y"], root)}
    master = Master(System(parts, [("mass.x", "part.x")], parameters={"mass.force": 0.0}), 0.01, scheme=scheme)
    with pytest.raises(StepError, match=r"^part: ValueError: math domain error.*; last good step ended at 0\.33 s$"):
        master.run(1.0)  # cos(sqrt(10) t) is a half at 0.331 s
    assert float(master.result().recording["mass.x [m]"].min()) >= 0.5


def test_diverging_run_is_one_clear_error():
    system = oscillators(parameters={"right.coupling_stiffness": 1e9})
    with pytest.raises(StepError, match="smaller steps; last good step"), np.errstate(all="ignore"):
        Master(system, 0.1).run(100.0)


def test_columns_of_the_recording_are_signals_where_they_can_be():
    variables = [Variable("u", "input", ""), Variable("q.elbow", "output", "deg"), Variable("level", "output", "1")]
    joint = Formula(variables, lambda u, _: (u[0], u[0]))
    run = Master(System({"arm": joint}, parameters={"arm.u": 180.0}), 0.1).run(0.2)
    assert list(run.recording.data_vars) == ["q.elbow", "arm.level"]
    assert float(run.recording["q.elbow"][0]) == 0.0  # nothing was set yet, and no feed-through is declared
    assert float(run.recording["q.elbow"][-1]) == pytest.approx(np.pi)


def test_program_keeps_its_own_period_whatever_the_macro_step():
    def counted(step):
        calls = []
        part = Program([Variable("y", "output", "")], lambda t, u, x, p: calls.append(t) or ([t], x), 0.02)
        Master(System({"p": part}), step).run(0.1)
        return calls

    for step in (0.001, 0.005, 0.02, 0.05):
        np.testing.assert_allclose(counted(step), [0.02, 0.04, 0.06, 0.08, 0.1], atol=1e-12)


def test_a_failed_iteration_leaves_everybody_at_the_last_good_step():
    def breaks(x, v):
        if x < 0.2:
            raise ValueError("too close")
        return 0.0 * v

    parts = {"mass": LeftOscillator(), "part": formula(["x", "v"], ["force"], breaks)}
    joined = [("part.force", "mass.force"), ("mass.x", "part.x"), ("mass.v", "part.v")]
    master = Master(System(parts, joined), 0.01, iterate=True)
    with pytest.raises(StepError, match="too close"):
        master.run(1.0)
    mass = master.system.participants["mass"]
    assert master.value("mass.x") == mass.outputs()[mass.names("output").index("x")]


class Bare(LeftOscillator):
    """Takes derivatives, and notes what it is told of a step."""

    input_order = 2

    def __init__(self):
        super().__init__()
        self.told = []

    def set_inputs(self, values):
        self.told.append("inputs")
        super().set_inputs(values)

    def set_input_derivatives(self, first, second):
        self.told.append("derivatives")


@pytest.mark.parametrize(("hold", "told"), [("midpoint", False), ("constant", True), ("linear", True)])
def test_who_takes_derivatives_is_told_none_of_the_middle_of_a_step(hold, told):
    """Without them inputs are the middle's: where a body will be is then half a step ahead, not a whole one."""
    mass = Bare()
    Master(System({"left": mass, "right": RightOscillator()}, CONNECTIONS), 0.01, hold=hold).run(0.05)
    assert ("derivatives" in mass.told) == told
