"""Model files, archives and plain stepping for the tests of FMUs."""

import os
import sysconfig
import zipfile
from pathlib import Path
from typing import Any

import numpy as np

from bench.arm import random_arm
from snarelab.fmi.archive import open_fmu
from snarelab.fmu.build import write_fmu


def write_model(folder, name, n_joints, effects, values, seed=3, prismatic=0.0, gravity=(0.0, 0.0, -9.81)):
    """A model file with its URDF; ``values`` by key. Returns its path."""
    arm = random_arm(np.random.default_rng(seed), n_joints, prismatic)
    (folder / f"{name}.urdf").write_text(arm.urdf())
    lines = [
        f'name = "{name}"',
        f'urdf = "{name}.urdf"',
        f"gravity = {[float(g) for g in gravity]}",
        f"effects = {effects}",
        "[parameters]",
    ]
    lines += [f'"{key}" = {float(value)!r}' for key, value in values.items()]
    path = folder / f"{name}.toml"
    path.write_text("\n".join(lines) + "\n")
    return path


def everywhere(effect, parameter, values):
    """Keys of one parameter at joint1, joint2, ..."""
    return {f"{effect}.joint{k}.{parameter}": v for k, v in enumerate(values, 1)}


def tool_environment():
    """Environment for ecospy, whose library needs oneTBB: pip puts that beside the environment's own libraries."""
    return os.environ | {"LD_LIBRARY_PATH": str(Path(sysconfig.get_path("data")) / "lib")}


class Slave:
    """One instance of an FMU through FMPy's bare calls, by variable names; FMI 2 and 3 alike."""

    def __init__(self, path, folder, start=None, start_time=0.0, logged=None):
        """Unpack where that is not done, instantiate, set values and initialise."""
        from fmpy.fmi2 import FMU2Slave, fmi2CallbackFunctions, fmi2CallbackLoggerTYPE
        from fmpy.fmi3 import FMU3Slave

        folder = Path(folder)
        if not (folder / "modelDescription.xml").is_file():
            open_fmu(path, folder)
        from fmpy import read_model_description

        self.description: Any = read_model_description(str(folder), validate=False)
        self.two = self.description.fmiVersion.startswith("2")
        self.references = {v.name: v.valueReference for v in self.description.modelVariables}
        self.outputs = [v.name for v in self.description.modelVariables if v.causality == "output"]
        make: Any = FMU2Slave if self.two else FMU3Slave
        self.fmu: Any = make(
            guid=self.description.guid if self.two else self.description.instantiationToken,
            unzipDirectory=str(folder),
            modelIdentifier=self.description.coSimulation.modelIdentifier,
            instanceName="slave",
        )
        if logged is None:
            self.fmu.instantiate()
        elif self.two:

            def log(environment, name, status, category, message):
                logged.append(message.decode())

            self.callbacks = fmi2CallbackFunctions()
            self.callbacks.logger = fmi2CallbackLoggerTYPE(log)
            self.fmu.instantiate(callbacks=self.callbacks)
        else:
            self.fmu.instantiate(logMessage=lambda environment, status, category, text: logged.append(text.decode()))
        if self.two:
            self.fmu.setupExperiment(startTime=start_time)
            self.fmu.enterInitializationMode()
        else:
            self.fmu.enterInitializationMode(startTime=start_time)
        self.time = start_time
        self.set(start or {})
        self.fmu.exitInitializationMode()

    def set(self, values):
        """Values by name."""
        references = [self.references[name] for name in values]
        (self.fmu.setReal if self.two else self.fmu.setFloat64)(references, [float(v) for v in values.values()])

    def get(self, names=None):
        """Values of names, or of all outputs."""
        references = [self.references[name] for name in (self.outputs if names is None else names)]
        return np.array((self.fmu.getReal if self.two else self.fmu.getFloat64)(references))

    def step(self, size):
        """One communication step [s]."""
        self.fmu.doStep(self.time, size)
        self.time += size

    def save(self):
        """State and time."""
        return self.fmu.getFMUState(), self.time

    def restore(self, state):
        """Back to a saved state."""
        self.fmu.setFMUState(state[0])
        self.time = state[1]

    def derivative(self, unknowns, knowns, seed):
        """Directional derivative."""
        u, k = ([self.references[n] for n in names] for names in (unknowns, knowns))
        return np.array(self.fmu.getDirectionalDerivative(u, k, list(seed)))

    def close(self):
        """Terminate and free."""
        self.fmu.terminate()
        self.fmu.freeInstance()


def made_slave(folder, equations, version: Any = 3, **start):
    """An instance of equations' FMU, written into a folder where it is not yet; start values by name."""
    path = folder / f"{equations.name}{version}.fmu"
    if not path.is_file():
        write_fmu(equations, path, version)
    return Slave(path, folder / f"{equations.name}{version}", start)


def accelerations(folder, equations, q, qd, tau):
    """Joints' accelerations (J,) of an arm's FMU at a position and rate, under a torque, each (J,)."""
    joints = [f"joint{k + 1}" for k in range(len(q))]
    given = {f"{stem}.{j}": x for stem, values in (("start.q", q), ("start.qd", qd), ("tau", tau))
             for j, x in zip(joints, values, strict=True)}  # fmt: skip
    s = made_slave(folder, equations, **given)
    found = s.get([f"qdd.{j}" for j in joints])
    s.close()
    return found


def rewritten(source, target, change):
    """A copy of an archive with ``change(name, bytes)`` applied to each entry; None drops it."""
    with zipfile.ZipFile(source) as old, zipfile.ZipFile(target, "w", zipfile.ZIP_DEFLATED) as new:
        for entry in old.infolist():
            data = change(entry.filename, old.read(entry))
            if data is not None:
                new.writestr(entry.filename, data)
    return target


def redescribed(source, target, change):
    """A copy of an FMU with ``change(text)`` as its model description."""
    named = "modelDescription.xml"
    return rewritten(source, target, lambda name, data: change(data.decode()).encode() if name == named else data)
