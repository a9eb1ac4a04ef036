"""Forward dynamics of an arm with elastic links: MuJoCo with springs inside the links, and rest under gravity."""

# pyright: reportAttributeAccessIssue=false

from dataclasses import replace

import mujoco
import numpy as np
import pytest

from bench.arm import length_axes, random_arm
from bench.fmu_models import Slave, everywhere, write_model
from bench.parts import Beam
from snarelab.errors import InputError
from snarelab.fmu.build import write_fmu
from snarelab.fmu.export import model_equations
from snarelab.models.beam import length_axes as own_axes
from snarelab.models.model_file import load_model

SEED, N, ROTOR = 4, 3, 0.3
SPRINGS = {"torsion": (700.0, 3.0), "bending": (1500.0, 3.0)}


def elastic(folder, torsion=(), bending=(), more=""):
    """A model whose links have springs, and whose motors have inertia."""
    listed, values = ['"rotor_inertia"'], everywhere("rotor_inertia", "inertia", [ROTOR] * N)
    for kind, links in (("torsion", torsion), ("bending", bending)):
        for link in links:
            listed.append(f'{{ name = "link_{kind}", at = "{link}" }}')
            values |= dict(
                zip((f"link_{kind}.{link}.{x}" for x in ("stiffness", "damping")), SPRINGS[kind], strict=True)
            )
    return load_model(write_model(folder, "arm", N, f"[{', '.join(listed)}{more}]", values, seed=SEED))


def hinged(beams):
    """The same arm in MuJoCo: model, data, and where its joints and hinges stand."""
    arm = random_arm(np.random.default_rng(SEED), N)
    rotors = dict.fromkeys(arm.joints, f'armature="{ROTOR}"')
    text = arm.mjcf(attributes=rotors, turns={link: beam.hinges for link, beam in beams.items()})
    model = mujoco.MjModel.from_xml_string(text)
    joints = [model.joint(j).dofadr[0] for j in arm.joints]
    hinges = {link: [model.joint(f"{link}_turn{k}").dofadr[0] for k in b.hinges] for link, b in beams.items()}
    ends = {f"link{k}": link.origin for k, link in enumerate(arm.links)}
    return model, mujoco.MjData(model), joints, hinges, ends


def test_accelerations_of_two_twisting_links_are_mujocos(tmp_path):
    """Turns of any size: each is about one axis, which both engines have alike."""
    equations = model_equations(elastic(tmp_path, ("link1", "link2")), stiff=True)
    stiffness, damping = SPRINGS["torsion"]
    beam = Beam(torsion=stiffness, damping=damping)
    model, data, joints, hinges, _ = hinged({"link1": beam, "link2": beam})
    order = [joints[0], *hinges["link1"], joints[1], *hinges["link2"], joints[2]]
    rng = np.random.default_rng(0)
    p = equations.starts("parameter")
    for _ in range(5):
        q, qd, tau = rng.normal(size=5), rng.normal(size=5), 10 * rng.normal(size=3)
        data.qpos[order], data.qvel[order] = q, qd
        data.qfrc_applied[joints] = tau
        mujoco.mj_forward(model, data)
        u = np.zeros(len(equations.starts("input")))
        u[:3] = tau
        rate = np.array(equations.functions["rate"](0, np.concatenate([q, qd]), u, p)).ravel()
        np.testing.assert_allclose(rate[5:], data.qacc[order], rtol=1e-5, atol=1e-5)


def test_accelerations_of_a_bending_link_are_mujocos_for_small_turns(tmp_path):
    equations = model_equations(elastic(tmp_path, (), ("link1",)), stiff=True)
    stiffness, damping = SPRINGS["bending"]
    model, data, joints, hinges, ends = hinged({"link1": Beam(bending=stiffness, damping=damping)})
    end = ends["link1"]
    turn = (length_axes(end) @ own_axes(end))[1:, 1:]  # from our axes across to the hinges'
    rng = np.random.default_rng(0)
    p = equations.starts("parameter")
    for _ in range(5):
        q, qd, small, tau = rng.normal(size=3), rng.normal(size=3), 1e-4 * rng.normal(size=(2, 2)), rng.normal(size=3)
        data.qpos[joints], data.qvel[joints] = q, qd
        data.qpos[hinges["link1"]], data.qvel[hinges["link1"]] = turn @ small[0], turn @ small[1]
        data.qfrc_applied[joints] = tau
        mujoco.mj_forward(model, data)
        u = np.zeros(len(equations.starts("input")))
        u[:3] = tau
        x = np.concatenate([q[:1], small[0], q[1:], qd[:1], small[1], qd[1:]])
        second = np.array(equations.functions["rate"](0, x, u, p)).ravel()[5:]
        np.testing.assert_allclose(second[[0, 3, 4]], data.qacc[joints], rtol=1e-4, atol=1e-4)
        np.testing.assert_allclose(turn @ second[1:3], data.qacc[hinges["link1"]], rtol=1e-4, atol=1e-4)


def test_an_fmu_starts_where_its_springs_carry_the_weight_and_falls_as_mujocos_arm_does(tmp_path):
    """Half a second without drives, from rest."""
    first = [0.4, -0.7, 0.5]
    equations = model_equations(elastic(tmp_path, ("link2",), ("link1",)))
    path = write_fmu(equations, tmp_path / "x.fmu", 2)
    s = Slave(path, tmp_path / "x", {f"start.q.joint{k}": x for k, x in enumerate(first, 1)})
    turns = ["turn.link1.bending1", "turn.link1.bending2", "turn.link2.torsion"]
    sag = np.array(s.get(turns))
    beams = {"link1": Beam(bending=SPRINGS["bending"][0], damping=3.0), "link2": Beam(SPRINGS["torsion"][0], None, 3.0)}
    model, data, joints, hinges, ends = hinged(beams)
    end = ends["link1"]
    turn = (length_axes(end) @ own_axes(end))[1:, 1:]
    data.qpos[joints] = first
    mujoco.mj_inverse(model, data)  # torque that holds all still, so minus it is what the weight does to the springs
    held = data.qfrc_inverse
    bent, twisted = (-held[hinges[k]] / SPRINGS[x][0] for k, x in (("link1", "bending"), ("link2", "torsion")))
    np.testing.assert_allclose(sag, [*(turn.T @ bent), *twisted], rtol=1e-6)
    data.qpos[hinges["link1"]], data.qpos[hinges["link2"]] = turn @ sag[:2], sag[2:]
    model.opt.timestep, model.opt.integrator = 1e-4, mujoco.mjtIntegrator.mjINT_RK4
    for _ in range(10):
        s.step(0.05)
        for _ in range(500):
            mujoco.mj_step(model, data)
    np.testing.assert_allclose(s.get(["q.joint1", "q.joint2", "q.joint3"]), data.qpos[joints], atol=2e-5)
    s.close()


def test_a_spring_about_the_next_joints_axis_needs_its_motors_inertia(tmp_path):
    model = elastic(tmp_path, ("link1",), ("link1",))  # all axes: the next joint's is among them
    model_equations(model)
    values = {key: 0.0 if key == "rotor_inertia.joint2.inertia" else x for key, x in model.values.items()}
    with pytest.raises(InputError, match=r"link1 turns about the axis of joint2.*rotor_inertia.joint2.inertia"):
        model_equations(replace(model, values=values))


def test_springs_in_links_beside_an_effect_along_an_axis_are_refused(tmp_path):
    more = ', { name = "viscous_friction", at = "joint1+joint2" }'
    path = tmp_path / "arm.toml"
    elastic(tmp_path, ("link1",), (), more)
    with path.open("a") as file:
        file.write('"viscous_friction.joint1+joint2.coefficient" = 1.0\n')
    with pytest.raises(InputError, match=r"joint1\+joint2 acts along an axis, and link_torsion.link1.*--inverse"):
        model_equations(load_model(path))
