"""FMUs as participants: built here from C, well and badly behaved, FMI 2.0 and 3.0."""

import gc
import os
import signal
import sys
import time
from typing import Any

import fmpy
import numpy as np
import pytest
from fmpy.validation import validate_fmu

from bench.fmu_models import redescribed
from bench.oscillator_fmu import build
from snarelab.cosim.compiled_loop import compiled_loop
from snarelab.cosim.master import Master
from snarelab.cosim.participant import StepError
from snarelab.cosim.participants.fmu import Fmu
from snarelab.cosim.participants.oscillator import LeftOscillator, RightOscillator
from snarelab.cosim.process import OwnProcess
from snarelab.cosim.step_control import StepControl
from snarelab.cosim.system import System
from snarelab.errors import InputError

CONNECTIONS = [("right.force", "left.force"), ("left.x", "right.x_left"), ("left.v", "right.v_left")]
ERROR, HANG, NAN, KILL, DISCARD, FATAL, END = range(1, 8)

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="the test FMUs are built for Linux")


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    folder = tmp_path_factory.mktemp("fmus")
    return {(side, fmi): build(folder, side, fmi) for side in ("left", "right") for fmi in (2, 3)}


def system(files, fmi, make=Fmu, **options):
    return System({side: make(files[side, fmi]) for side in ("left", "right")}, CONNECTIONS, **options)


def natives():
    return System({"left": LeftOscillator(), "right": RightOscillator()}, CONNECTIONS)


@pytest.mark.parametrize("fmi", [2, 3])
def test_the_test_fmus_are_valid(files, fmi):
    assert [validate_fmu(str(files[side, fmi])) for side in ("left", "right")] == [[], []]


@pytest.mark.parametrize("fmi", [2, 3])
def test_description_becomes_variables(files, fmi):
    right = Fmu(files["right", fmi])
    assert right.names("input") == ("x_left", "v_left")
    assert right.names("output") == ("x", "v", "force")
    units = {v.name: v.unit for v in right.variables}
    assert (units["force"], units["coupling_damping"], units["mass"]) == ("N", "N*s/m", "kg")
    assert {v.name: v.depends for v in right.variables if v.causality == "output"} == {
        "x": (),
        "v": (),
        "force": ("x_left", "v_left"),
    }
    assert right.can_restore
    assert right.can_vary_step


@pytest.mark.parametrize("options", [{}, {"scheme": "gauss_seidel"}, {"iterate": True}, {"control": StepControl(1e-4)}])
@pytest.mark.parametrize("fmi", [2, 3])
def test_fmus_do_what_the_same_model_does_here(files, fmi, options):
    with Master(system(files, fmi), 5e-3, **options) as master:
        ours = master.run(3.0).recording
    native = Master(natives(), 5e-3, **options).run(3.0).recording
    np.testing.assert_allclose(ours["time"], native["time"], rtol=1e-9)
    np.testing.assert_allclose(ours["left.x [m]"], native["left.x [m]"], atol=1e-9)


def test_fmi_2_takes_slopes(files):
    """With the line's slope inside the step the native participant is of order 2, and so is the FMU."""
    with Master(system(files, 2), 5e-3, hold="linear") as master:
        ours = master.run(2.0).recording
    native = Master(natives(), 5e-3, hold="linear").run(2.0).recording
    np.testing.assert_allclose(ours["left.x [m]"], native["left.x [m]"], atol=1e-12)


@pytest.mark.parametrize("hold", ["constant", "midpoint", "linear", "quadratic"])
@pytest.mark.parametrize("scheme", ["jacobi", "gauss_seidel"])
def test_loop_in_c_gives_the_same_bits(files, scheme, hold):
    runs = []
    for compiled in (True, False):
        with Master(system(files, 3), 1e-3, scheme=scheme, hold=hold) as master:
            if not compiled:
                master._loop = False
            runs.append(master.run(0.2505))
            assert (master._loop is False) != compiled
    assert runs[0].recording.equals(runs[1].recording)
    assert (runs[0].steps, runs[0].evaluations) == (runs[1].steps, runs[1].evaluations)
    assert runs[0].steps == 251
    assert runs[0].evaluations - 251 in (range(1, 5) if hold == "quadratic" else [0])  # its start is iterated


def test_fmi_3_takes_halves_where_any_step_is_good(files, tmp_path):
    """An FMU that names a step of its own might not end half of ours; discrete inputs have no parabola."""
    left = files["left", 3]
    assert Fmu(left).can_halve
    assert not Fmu(files["left", 2]).can_halve
    for k, (old, new) in enumerate(
        [
            ('canHandleVariableCommunicationStepSize="true"', 'canHandleVariableCommunicationStepSize="false"'),
            ("<CoSimulation ", '<CoSimulation fixedInternalStepSize="1e-3" '),
            ('causality="input" variability="continuous"', 'causality="input" variability="discrete"'),
        ]
    ):
        other = tmp_path / f"{k}.fmu"
        redescribed(left, other, lambda text, old=old, new=new: text.replace(old, new))
        assert Fmu(left).can_halve
        assert not Fmu(other).can_halve


def test_halves_are_two_steps_on_two_values(files):
    halved, plain = (Fmu(files["left", 3]) for _ in range(2))
    for one in (halved, plain):
        one.initialize(0.0)
    halved.set_input_halves(np.array([2.0]), np.array([-1.0]))
    halved.step(0.0, 0.1)
    for k, force in enumerate((2.0, -1.0)):
        plain.set_inputs(np.array([force]))
        plain.step(0.05 * k, 0.05)
    assert halved.outputs().tobytes() == plain.outputs().tobytes()
    for one in (halved, plain):  # a step on one value is one step again
        one.set_inputs(np.array([0.5]))
        one.step(0.1, 0.1)
    assert halved.outputs().tobytes() == plain.outputs().tobytes()
    for one in (halved, plain):
        one.close()


def test_loop_in_c_is_left_to_what_it_can_do(files):
    with Master(system(files, 2), 1e-3, hold="linear") as master:  # these FMUs take slopes
        assert compiled_loop(master.system, master._sweep, 1e-3) is None
    mixed = System({"left": LeftOscillator(), "right": Fmu(files["right", 2])}, CONNECTIONS)
    with Master(mixed, 1e-3) as master:
        assert compiled_loop(master.system, master._sweep, 1e-3) is None


def test_without_a_compiler_python_does_it(files, monkeypatch):
    monkeypatch.setenv("SNARELAB_CC", "none")
    with Master(system(files, 3), 1e-3) as master, pytest.warns(UserWarning, match="macro steps run in Python"):
        assert master.run(0.01).steps == 10


@pytest.mark.parametrize("fmi", [2, 3])
def test_restore_and_repeat_is_bitwise_also_in_another_instance(files, fmi):
    one, two = Fmu(files["right", fmi]), Fmu(files["right", fmi])

    def go_on(which):
        generator, shown = np.random.default_rng(4), []
        for k in range(50):
            which.set_inputs(generator.normal(size=2))
            which.step(0.01 + k * 1e-3, 1e-3)
            shown.append(which.outputs())
        return np.array(shown)

    for participant in (one, two):
        participant.initialize(0.0, {"mass": 0.7})
    for k in range(10):
        one.set_inputs(np.array([0.1 * k, 1.0]))
        one.step(k * 1e-3, 1e-3)
    state = one.save()
    first = go_on(one)
    one.restore(state)
    np.testing.assert_array_equal(go_on(one), first)
    two.restore(state)
    np.testing.assert_array_equal(go_on(two), first)
    del state
    one.close()
    two.close()


def faulty(files, fmi, fault, make, when=0.5):
    parameters = {"left.fault": fault, "left.fault_time": when}
    return system(files, fmi, make, parameters=parameters)


@pytest.mark.parametrize("compiled", [True, False])
@pytest.mark.parametrize(
    ("fault", "said"),
    [
        (ERROR, "left: fmi3DoStep returned error in the step from 0.5 s (the spring has snapped)"),
        (NAN, "left.x is nan at 0.51 s; take smaller steps"),
        (DISCARD, "left: fmi3DoStep returned discard in the step from 0.5 s"),
        (FATAL, "left: fmi3DoStep returned fatal in the step from 0.5 s (the model is lost)"),
        (END, "left: the FMU asks to end the simulation in the step from 0.5 s"),
    ],
)
def test_failing_fmu_is_named_with_time_and_last_good_step(files, fault, said, compiled):
    with Master(faulty(files, 3, fault, Fmu), 1e-2) as master:
        if not compiled:
            master._loop = False
        with pytest.raises(StepError) as caught:
            master.run(1.0)
        assert str(caught.value) == f"{said}; last good step ended at 0.5 s"
        recording = master.result().recording
    assert len(recording["time"]) == 51
    assert np.isfinite(recording["left.x [m]"]).all()


def test_each_instance_hears_its_own_fmu(files, tmp_path, capsys):
    """FMPy formats the messages of all FMI 2.0 instances of a process for one logger."""
    one, two = (Fmu(files["left", 2], name) for name in ("one", "two"))
    for participant, fault in ((one, FATAL), (two, ERROR)):
        participant.initialize(0.0, {"fault": fault, "fault_time": 0.0})
    with pytest.raises(StepError, match=r"one: .*the model is lost"):
        one.step(0.0, 0.01)
    with pytest.raises(StepError, match=r"two: .*the spring has snapped"):
        two.step(0.0, 0.01)
    del one, two
    gc.collect()
    unpacked = fmpy.extract(str(files["left", 2]), str(tmp_path / "left"))
    description = fmpy.read_model_description(unpacked)
    with pytest.raises(Exception, match="error"):
        fmpy.simulate_fmu(
            unpacked, model_description=description, start_values={"fault": ERROR, "fault_time": 0.0}, stop_time=0.1
        )
    assert "the spring has snapped" in capsys.readouterr().out


def quick(path):
    return OwnProcess(Fmu, path, timeout=0.7)


@pytest.mark.parametrize(
    ("fault", "said"),
    [
        (HANG, "left: gave no answer for 0.7 s in the step from 0.05 s; its process was ended"),
        (KILL, "left: its process was killed by SIGKILL in the step from 0.05 s"),
        (ERROR, "left: fmi2DoStep returned error in the step from 0.05 s (the spring has snapped)"),
    ],
)
def test_hang_and_crash_of_a_participant_in_its_own_process(files, fault, said):
    parts = {"left": quick(files["left", 2]), "right": Fmu(files["right", 2])}
    parameters = {"left.fault": fault, "left.fault_time": 0.05}
    with Master(System(parts, CONNECTIONS, parameters=parameters), 1e-2) as master:
        began = time.monotonic()
        with pytest.raises(StepError) as caught:
            master.run(1.0)
        assert time.monotonic() - began < 20.0
        assert str(caught.value) == f"{said}; last good step ended at 0.05 s"
        assert len(master.result().recording["time"]) == 6
    if fault != ERROR:
        with pytest.raises(StepError, match="its process has ended"):
            parts["left"].step(0.0, 1e-3)


@pytest.mark.parametrize("fmi", [2, 3])
def test_own_process_gives_the_same_bits_rolls_back_and_ends(files, fmi):
    left = OwnProcess(Fmu, files["left", fmi])
    apart = System({"left": left, "right": Fmu(files["right", fmi])}, CONNECTIONS)
    kinds: list[dict[str, Any]] = [{}, {"hold": "quadratic"}, {"iterate": True, "scheme": "gauss_seidel"}]
    for options in kinds:
        ours = Master(apart, 1e-2, **options).run(0.3).recording
        with Master(system(files, fmi), 1e-2, **options) as master:
            assert ours.equals(master.run(0.3).recording)
    number = left._process.pid
    left.close()
    with pytest.raises(ProcessLookupError):
        os.kill(number, signal.SIGTERM)


def test_a_process_that_cannot_start_its_participant_says_why(tmp_path):
    with pytest.raises(InputError, match=r"nothing\.fmu: is not there"):
        OwnProcess(Fmu, tmp_path / "nothing.fmu")


def test_units_of_an_fmu_are_checked_at_connections(files, tmp_path):
    other = build(tmp_path, "left", 2, units={"force": "m"})
    with pytest.raises(InputError, match=r"right\.force -> left\.force: a value in N cannot be read in m"):
        System({"left": Fmu(other), "right": Fmu(files["right", 2])}, CONNECTIONS)


def test_unknown_parameter_is_refused(files):
    with pytest.raises(InputError, match="nearest is 'mass'"):
        Fmu(files["left", 2]).initialize(parameters={"maas": 1.0})


def test_a_text_input_cannot_be_connected_and_needs_not_to_be(files):
    """As Feedthrough of the Reference-FMUs has one."""
    left = Fmu(files["left", 3])
    left.unread = {"note": "String"}
    parts = {"left": left, "right": Fmu(files["right", 3])}
    System(parts, CONNECTIONS)
    with pytest.raises(InputError, match=r"'left\.note' holds String, not a number; nothing can be connected to it"):
        System(parts, [*CONNECTIONS, ("right.x", "left.note")])
