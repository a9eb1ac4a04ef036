"""Every effect of the vocabulary in a self-contained FMU, against the same model run natively (`fmu_native`)."""

from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest
from fmu_native import Native, springy

from bench.arm import random_arm
from bench.fmu_models import Slave, write_model
from snarelab.fmu.build import write_fmu
from snarelab.fmu.export import model_equations
from snarelab.models.effects import effects
from snarelab.models.model_file import load_model

DURATION, STEPS = 0.1, 5
BEFORE = 0.4
"""Share of the drive torques that was commanded before the start."""
MAKKAR = {"stribeck_level": 1.0, "stribeck_speed": 0.05, "stribeck_ratio": 4.0, "coulomb_level": 2.0}
MAKKAR |= {"coulomb_speed": 0.08, "viscous_coefficient": 3.0}


class System(NamedTuple):
    """What the FMU of one system starts with; every effect of it is in the model, those not tried at zero."""

    head: str
    cases: dict[str, dict[str, float]]
    start: tuple[list[float], list[float]]
    tau: list[float]
    always: tuple[str, ...] = ()
    wheels: tuple[float, ...] = (0.0, 0.0, 0.0)


SYSTEMS = {
    "arm": System(
        "",
        {
            "viscous_friction": {"coefficient": 4.0},
            "coulomb_friction": {"level": 2.0},
            "asymmetric_friction": {"level_difference": 1.0, "coefficient_difference": 2.0},
            "stribeck_friction": {"level": 1.5, "speed": 0.2},
            "quadratic_friction": {"coefficient": 3.0},
            "makkar_friction": MAKKAR,
            "load_dependent_friction": {"coefficient": 0.1},
            "position_dependent_friction": {"cosine": 1.0, "sine": -0.5, "period": 0.7},
            "presliding_hysteresis": {"level": 2.0, "travel": 0.02},
            "torque_ripple": {"cosine": 0.7, "sine": 0.4, "period": 0.3},
            "harness_stiffness": {"stiffness": 20.0, "torque_at_zero": 1.0},
            "gear_efficiency": {"driving_loss": 0.2, "braking_loss": 0.05},
            "heating_friction": {"fall": 20.0, "time": 2.0},
            "end_stop": {"above": 30.0, "below": 4.0, "where": 0.1},
            "joint_spring": {"stiffness": 8.0, "torque_at_zero": 1.5},
            "rotor_inertia": {"inertia": 0.8},
            "payload_mass": {"mass": 2.0, "x": 0.1, "y": -0.05, "z": 0.02},
            "com_offset": {"x": 0.02, "y": 0.01, "z": -0.01},
            "inertia_error": {"mass": 0.4, "moment_x": 0.05, "inertia_xx": 0.02, "inertia_yz": 0.01},
            "command_delay": {"delay": 0.03},  # at zero it would take a moment yet
            # Sensors change no motion: they stay on.
            "sensor_gain": {"error": 0.05},
            "sensor_bias": {"offset": 0.3},
            "sensor_drift": {"rate": 0.2},
            "sensor_delay": {"delay": 0.01},
            "motor_saturation": {"excess": 0.5, "knee": 3.0, "no_load_speed": 4.0},
        },
        ([0.3, -0.5], [0.9, -0.7]),
        [12.0, -4.0],
        ("command_delay", "sensor_gain", "sensor_bias", "sensor_drift", "sensor_delay", "motor_saturation"),
    ),
    "rig": System(
        'system = "zero_g_rig"',
        {
            "slide_friction": MAKKAR,
            "sling_tension_error": {"share": 0.05, "lag_loss": 4.0},
            "suspension_sway": {"stiffness": 40.0, "lag": 0.3},
            "hang_point_clearance": {"clearance": 0.01},  # at zero its states would be infinitely fast
            "link_torsion": {"torque": 6.0, "radius": 2.0},
            "link_bending": {"torque": -5.0, "radius": 1.5},
            "suspension_stiffness": {"stiffness": 30.0},
        },
        ([0.4, -0.6], [0.5, 0.6]),
        [5.0, -3.0],
        ("hang_point_clearance",),
    ),
    "base": System(
        'system = "free_floating_arm"',
        {
            "external_torque": {"x": 0.4, "y": -0.3, "z": 0.2},
            "flexible_appendage": {"inertia_x": 0.3, "inertia_y": 0.2, "inertia_z": 0.4, "frequency": 1.5},
            "propellant_slosh": {"mass_x": 2.0, "mass_y": 3.0, "mass_z": 1.0, "x": 0.1, "y": 0.2, "frequency": 2.0},
            "wheel_friction": {"loss_x": 0.3, "loss_z": 0.2, "coulomb_y": 0.05, "coulomb_z": 0.02, "inertia": 0.2},
        },
        ([0.3, -0.5], [0.9, -0.7]),
        [4.0, -2.0],
        (),
        (0.5, -0.4, 0.3),
    ),
}
SPRINGS = {"joint_elasticity": {"stiffness": 400.0, "damping": 2.0}}
SPRINGS["backlash"] = SPRINGS["joint_elasticity"] | {"gap": 0.004}
CASES = [(kind, name) for kind, system in SYSTEMS.items() for name in system.cases]
ENDS = [(kind, name) for kind, system in SYSTEMS.items() for name in (*system.cases,)[:: len(system.cases) - 1]]
"""The first and the last effect of each system: FMI 3.0 wraps the same equations, and every effect is in each FMU."""
NARROW = {"sensor_gain": "tau.joint1", "sensor_bias": "tau.joint1", "sensor_drift": "tau.joint2"}
NARROW |= {"sensor_delay": "q.joint2", "command_delay": "tau.joint2", "motor_saturation": "tau.joint1"}


def test_no_effect_of_the_vocabulary_is_left_out():
    on_arms = {name for name, effect in effects().items() if effect.family not in ("snare and contact", "docking")}
    assert {name for _, name in CASES} | set(SPRINGS) == on_arms


class Built:
    """A system's model and equations, and the values that switch one effect on."""

    def __init__(self, folder, kind):
        self.folder, self.system, self.runs = folder, SYSTEMS[kind], {}
        cases, n = self.system.cases, len(self.system.tau)
        arm = random_arm(np.random.default_rng(7), n, 0.0)
        urdf = arm.urdf()
        if kind == "base":  # a root link with mass
            inertial = '<inertial><mass value="30"/><origin xyz="0.05 -0.1 0.08"/>'
            inertial += '<inertia ixx="4" ixy="0.2" ixz="-0.1" iyy="5" iyz="0.3" izz="6"/></inertial>'
            urdf = urdf.replace('<link name="base"/>', f'<link name="base">{inertial}</link>')
        (folder / f"{kind}.urdf").write_text(urdf)
        named = [f'{{ name = "{e}", at = "{NARROW[e]}" }}' if e in NARROW else f'"{e}"' for e in cases]
        lines = [f'name = "{kind}"', self.system.head, f'urdf = "{kind}.urdf"', f"effects = [{', '.join(named)}]"]
        if kind == "rig":
            lines.append("[slings]")
            for k in range(1, n + 1):
                point = [0.1 * k, -0.05, 0.03]
                lines.append(
                    f's{k} = {{ body = "link{k}", point = {point}, slide = [[0.0, 0.2, 0.1], [0.1, -0.2, 0.1]] }}'
                )
        path = folder / f"{kind}.toml"
        path.write_text("\n".join(lines) + "\n")
        self.bare = load_model(path)
        quiet = {f"{p.key}.{x.name}": x.zero for p in self.bare.effects for x in p.effect.parameters}
        quiet |= {f"speed_scale.joint{k}": 500.0 for k in range(1, n + 1)}
        self.values = quiet
        for name in self.system.always:
            self.values = self.values | self.of(name)
        with path.open("a") as file:
            file.write("[parameters]\n" + "".join(f'"{k}" = {float(v)!r}\n' for k, v in self.values.items()))
        self.path, self.equations = path, model_equations(load_model(path), stiff=True)

    def of(self, name):
        """Values of one effect, at every place that it has."""
        given = self.system.cases[name]
        return {f"{p.key}.{x}": v for p in self.bare.effects if p.effect.name == name for x, v in given.items()}

    def fmu(self, version):
        path = self.folder / f"{self.path.stem}{version}.fmu"
        return path if path.is_file() else write_fmu(self.equations, path, version)

    def native(self, name):
        if name not in self.runs:
            self.runs[name] = self._run(name)
        return self.runs[name]

    def _run(self, name):
        model = replace(self.bare, values=self.values | self.of(name))
        system = self.system
        before = [BEFORE * x for x in system.tau]
        return Native(model, {name, *system.always}, system.tau, system.wheels, before).run(*system.start, DURATION)


@pytest.fixture(scope="module")
def built(tmp_path_factory):
    return cache(lambda kind: Built(tmp_path_factory.mktemp(kind), kind))


@pytest.mark.parametrize(("kind", "name", "version"), [(*case, 2) for case in CASES] + [(*case, 3) for case in ENDS])
def test_the_effect_moves_the_fmu_as_it_moves_the_model(built, kind, name, version):
    """Error-controlled steps at 1e-12: sharp friction, |load| and hidden states leave a fixed step at 1e-7."""
    b = built(kind)
    system = b.system
    start = {
        f"start.{x}.joint{k + 1}": v for x, vs in zip(("q", "qd"), system.start, strict=True) for k, v in enumerate(vs)
    }
    tau = {f"tau.joint{k + 1}": v for k, v in enumerate(system.tau)}
    start |= {k: BEFORE * v for k, v in tau.items()} | b.of(name) | {"solver.tolerance": 1e-12}
    if kind == "base":
        start |= {f"torque.wheels.{a}": v for a, v in zip("xyz", system.wheels, strict=True)}
    s = Slave(b.fmu(version), b.folder / f"{kind}{version}", start)
    s.set(tau)
    for _ in range(STEPS):
        s.step(DURATION / STEPS)
    wanted = b.native(name)
    np.testing.assert_allclose(s.get(list(wanted)), list(wanted.values()), rtol=0, atol=1e-9)
    s.close()


def test_each_effect_shows(built):
    """The table above would say nothing of an effect that moves nothing."""
    for kind, system in SYSTEMS.items():
        b = built(kind)
        rest = [b.native(name) for name in system.cases if name not in system.always]
        first = np.array([[x for k, x in run.items() if not k.startswith("sensor")] for run in rest])
        for k, row in enumerate(first):
            assert np.abs(np.delete(first, k, 0) - row).max(axis=1).min() > 1e-6, list(system.cases)[k]


@pytest.mark.parametrize("version", [2, 3])
@pytest.mark.parametrize("name", SPRINGS)
def test_a_springy_drive_moves_motor_and_link(tmp_path, name, version):
    p = SPRINGS[name]
    values = {f"{name}.joint1.{k}": v for k, v in p.items()} | {"rotor_inertia.joint1.inertia": 0.5}
    model = load_model(write_model(tmp_path, "s", 1, f'["{name}", "rotor_inertia"]', values, seed=2, gravity=(0, 0, 0)))
    phi, axis = model.tree.links[0].phi, model.tree.joints[0].axis
    tensor = np.array([[phi[4], phi[5], phi[6]], [phi[5], phi[7], phi[8]], [phi[6], phi[8], phi[9]]])

    def torque(twist, rate):
        half = p.get("gap", 0.0) / 2
        past = (np.hypot(twist - half, 0.05 * half) - np.hypot(twist + half, 0.05 * half)) / 2
        return p["stiffness"] * (twist + past) + p["damping"] * rate

    wanted = springy(axis @ tensor @ axis, 0.5, 3.0, torque, DURATION)
    path: Path = write_fmu(model_equations(model, stiff=True), tmp_path / "s.fmu", version)
    s = Slave(path, tmp_path / "x", {"tau.joint1": 3.0, "solver.tolerance": 1e-12})
    for _ in range(STEPS):
        s.step(DURATION / STEPS)
    np.testing.assert_allclose(s.get(["q.joint1", "q_link.joint1"]), wanted, rtol=0, atol=1e-9)
    s.close()
