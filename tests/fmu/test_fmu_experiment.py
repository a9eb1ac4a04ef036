"""What an importer asks for at the start: stop time, as the Reference-FMUs take it, tolerance; parameters' ranges."""

import numpy as np
import pytest

from bench.fmu_models import Slave, everywhere, write_model
from snarelab.fmu.build import write_fmu
from snarelab.fmu.export import export, model_equations
from snarelab.models.model_file import load_model

DISCARD, ERROR = 2, 3


class Bare(Slave):
    """A slave that is not initialised yet."""

    def begin(self, start=None, **experiment):
        """Set up the experiment, values, and initialise."""
        if self.two:
            self.fmu.setupExperiment(startTime=0.0, **experiment)
            self.fmu.enterInitializationMode()
        else:
            self.fmu.enterInitializationMode(startTime=0.0, **experiment)
        self.time = 0.0
        self.set(start or {})
        self.fmu.exitInitializationMode()


def status(call, *arguments):
    """The status of a call that FMPy raises for."""
    try:
        call(*arguments)
    except Exception as error:
        return int(error.status)  # pyright: ignore[reportAttributeAccessIssue]  FMPy's own class
    return 0


def fresh(path, folder, logged=None):
    slave = Bare(path, folder, logged=logged)
    slave.fmu.reset()
    return slave


@pytest.fixture(scope="module", params=[2, 3])
def files(request, tmp_path_factory):
    """An arm with fixed steps, one with error control, and a hosted model."""
    folder = tmp_path_factory.mktemp("files")
    values = everywhere("viscous_friction", "coefficient", [3.0, 2.0])
    model = load_model(write_model(folder, "arm", 2, '["viscous_friction"]', values))
    found = {kind: folder / f"{kind}.fmu" for kind in ("fixed", "stiff", "hosted")}
    write_fmu(model_equations(model, False), found["fixed"], request.param)
    write_fmu(model_equations(model, True), found["stiff"], request.param)
    export("left_oscillator", request.param, found["hosted"])
    return found


@pytest.mark.parametrize("kind", ["fixed", "hosted"])
def test_no_step_goes_past_the_stop_time(files, tmp_path, kind):
    logged = []
    slave = fresh(files[kind], tmp_path / "x", logged)
    slave.begin(stopTime=0.3)
    for _ in range(3):  # 0.1 + 0.1 + 0.1 is a little more than 0.3
        slave.step(0.1)
    assert status(slave.step, 1e-3) == ERROR
    assert any("the stop time is" in line for line in logged)
    slave.close()
    slave = fresh(files[kind], tmp_path / "x")
    slave.begin()
    slave.step(1000.0 if kind == "hosted" else 1.0)
    slave.close()


@pytest.mark.parametrize("experiment", [{"stopTime": -1.0}, {"tolerance": -1e-6}, {"tolerance": float("nan")}])
def test_an_experiment_that_cannot_be_is_refused(files, tmp_path, experiment):
    slave = fresh(files["fixed"], tmp_path / "x")
    assert status(lambda: slave.begin(**experiment)) == ERROR
    slave.fmu.freeInstance()


@pytest.mark.parametrize(
    ("kind", "name", "value"),
    [
        ("fixed", "solver.step", -1.0), ("fixed", "solver.step", 0.0), ("fixed", "solver.step", 2.0),
        ("fixed", "viscous_friction.joint1.coefficient", -1.0), ("stiff", "solver.tolerance", -1.0),
        ("hosted", "mass", 0.0), ("hosted", "stiffness", -1.0),
    ],
)  # fmt: skip
def test_a_parameter_out_of_its_range_is_discarded_and_nothing_changes(files, tmp_path, kind, name, value):
    logged = []
    slave = fresh(files[kind], tmp_path / "x", logged)
    first = next(v.name for v in slave.description.modelVariables if v.causality == "input")
    before = slave.get([first, name]).tolist()
    assert status(slave.set, {first: 7.0, name: value}) == DISCARD
    assert slave.get([first, name]).tolist() == before
    assert any(f"{name} was set to" in line and "give a value from" in line for line in logged)
    slave.begin()
    slave.step(0.1)
    slave.fmu.freeInstance()


def test_a_motion_may_start_beyond_a_joints_limits(files, tmp_path):
    slave = fresh(files["fixed"], tmp_path / "x")
    slave.begin({"start.q.joint1": 50.0})
    assert slave.get(["q.joint1"])[0] == 50.0
    slave.close()


def test_the_tolerance_asked_for_is_the_solvers(files, tmp_path):
    """Errors follow it; it stays within the solver's range; a value that was set there goes before it."""

    def after(start=None, **experiment):
        slave = fresh(files["stiff"], tmp_path / "x")
        slave.begin({"tau.joint1": 20.0, "start.qd.joint2": 3.0, **(start or {})}, **experiment)
        slave.step(1.0)
        found = slave.get(["q.joint1", "q.joint2", "solver.tolerance"])
        slave.close()
        return found

    wanted = after({"solver.tolerance": 1e-12})
    coarse, fine = after(tolerance=1e-3), after(tolerance=1e-9)
    assert (coarse[2], fine[2]) == (1e-3, 1e-9)
    errors = [np.abs(found[:2] - wanted[:2]).max() for found in (coarse, fine)]
    assert errors[1] < 1e-2 * errors[0]
    assert after(tolerance=1e-30)[2] == 1e-12
    assert after({"solver.tolerance": 1e-6}, tolerance=1e-3)[2] == 1e-6
    assert after()[2] == 1e-8
