"""MuJoCo's toolbox as a rival: on an arm that MuJoCo's own laws move, it finds what was put in."""

# pyright: reportAttributeAccessIssue=false
import mujoco
import numpy as np
import pytest

from bench.arm import random_arm
from bench.motion import fourier_motion
from proof.rival_columns import read
from proof.rival_sysid import SOFT, fitted

RATE = 125.0
DAMPING, FRICTION, ROTOR = 1.5, 2.0, 0.3
HEAVY = 1.4
"""Times the last link's mass and inertia in the URDF."""


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Torque from MuJoCo's inverse dynamics of an arm whose last link is heavier than its URDF says; and noise."""
    folder = tmp_path_factory.mktemp("sysid")
    rng = np.random.default_rng(7)
    arm = random_arm(rng, 2)
    (folder / "arm.urdf").write_text(arm.urdf())
    (folder / "arm.toml").write_text('system = "arm"\nurdf = "arm.urdf"\n')
    model = mujoco.MjModel.from_xml_path(str(folder / "arm.urdf"))
    model.opt.timestep = 1e-4
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_LIMIT
    model.dof_damping[:, ...] = DAMPING if model.dof_damping.ndim == 1 else [[DAMPING] + [0.0] * 2]
    model.dof_frictionloss[:], model.dof_armature[:] = FRICTION, ROTOR
    model.dof_solref[:] = [2e-4, 1.0]
    model.body_mass[-1] *= HEAVY
    model.body_inertia[-1] *= HEAVY
    data = mujoco.MjData(model)
    motion = fourier_motion(arm, rng, 10.0, terms=5, highest=0.8, share=0.9)
    time = np.arange(0.0, 10.0, 1.0 / RATE)
    tau = []
    for q, qd, qdd in zip(*motion(time), strict=True):
        data.qpos[:], data.qvel[:], data.qacc[:] = q, qd, qdd
        mujoco.mj_inverse(model, data)
        tau.append(data.qfrc_inverse + 0.02 * rng.standard_normal(2))
    table = np.column_stack([time, motion(time)[0], tau])
    head = ",".join(["time", *(f"q.{j}" for j in arm.joints), *(f"tau.{j}" for j in arm.joints)])
    np.savetxt(folder / "train.csv", table, delimiter=",", header=head, comments="")
    return folder, float(model.body_mass[-1])


def test_sysid_finds_what_its_own_engine_was_given_and_moves_nothing_that_was_right(folder):
    place, mass = folder
    r = read(place, "train.csv")
    found = fitted(place / "arm.urdf", r, np.full(2, 0.02))
    assert found.soft == SOFT[-1]  # of the friction constraint that it was made with, and not MuJoCo's default
    values = {(p.kind, p.joint): p for p in found.parameters}
    for k in range(2):
        assert values["damping", k].found == pytest.approx(DAMPING, rel=0.05)
        assert values["frictionloss", k].found == pytest.approx(FRICTION, rel=0.05)
        assert values["armature", k].found == pytest.approx(ROTOR, rel=0.1)
    assert values["mass", 1].found == pytest.approx(mass, rel=0.02)
    assert values["mass", 1].moved
    left = r.tau - found.torque(found.model, r)
    assert np.sqrt(np.mean(left[5:-5] ** 2)) < 0.2  # of 2 N·m of friction, at whose reversals the filter rings
    named = {
        (e["name"], e["at"]) for e in found.effects([("viscous_friction", "joint1"), ("coulomb_friction", "joint1")])
    }
    assert ("rotor_inertia", "joint1") in named
    assert ("inertia_error", "link2") in named
    assert ("viscous_friction", "joint2") in named
    assert ("viscous_friction", "joint1") not in named
