"""Elastic links of an arm without slings: against MuJoCo with springs in the link, and which law a name stands for."""

# pyright: reportAttributeAccessIssue=false

import mujoco
import numpy as np
import pytest
from moving_arm import build, exact, placed
from scipy.integrate import solve_ivp

from bench.arm import random_arm
from bench.parts import Beam
from snarelab.errors import InputError
from snarelab.identification.fitting.experiment import Experiment
from snarelab.identification.fitting.problem import reached
from snarelab.identification.search.candidates import library
from snarelab.models.effects import get_effect
from snarelab.models.model import PlacedEffect, effect_on
from snarelab.models.model_file import load_model
from snarelab.models.model_write import save_model
from snarelab.models.rig.rig import built_in_rig
from snarelab.models.rigid_body import RigidBody
from snarelab.models.urdf import load_urdf

PERIOD = 1e-3  # at which steps of stiff springs are exact enough
TIME = PERIOD * np.arange(1500)
GRAVITY = (0.0, 0.0, -9.81)


def sines(time):
    """Position, speed and acceleration of three joints at a time, each (..., 3)."""
    w = 2 * np.pi * np.array([0.6, 0.9, 0.75])
    angle = w * np.asarray(time)[..., None] + np.array([0.3, 1.2, 2.1])
    return 0.7 * np.sin(angle), 0.7 * w * np.cos(angle), -0.7 * w**2 * np.sin(angle)


class Hinged:
    """MuJoCo's arm of three joints that move in sines, with hinges on springs in link 1, which move as they must."""

    def __init__(self, arm, beam):
        text = arm.mjcf(turns={"link1": beam.hinges}, gravity=GRAVITY)
        self.model = mujoco.MjModel.from_xml_string(text)
        self.data = mujoco.MjData(self.model)
        self.joints = [self.model.joint(j).dofadr[0] for j in arm.joints]
        self.hinges = [self.model.joint(f"link1_turn{k}").dofadr[0] for k in beam.hinges]

    def inverse(self, time, turn, rate, second):
        d = self.data
        for column, own, more in zip((d.qpos, d.qvel, d.qacc), sines(time), (turn, rate, second), strict=True):
            column[self.joints], column[self.hinges] = own, more
        mujoco.mj_inverse(self.model, d)
        return d.qfrc_inverse

    def second(self, time, turn, rate):
        """Acceleration of the hinges that their springs leave without another torque (MuJoCo has these inside)."""
        left = self.inverse(time, turn, rate, 0 * turn)[self.hinges].copy()
        whole, unit = np.zeros((2, len(left), self.model.nv))
        for row, own, hinge in zip(whole, unit, self.hinges, strict=True):
            own[hinge] = 1.0
            mujoco.mj_mulM(self.model, self.data, row, own)
        return -np.linalg.solve(whole[:, self.hinges], left)

    def torque(self):
        """Of the joints along TIME (n, 3), after the springs have settled for ten seconds."""
        m = len(self.hinges)

        def rate(time, x):
            return np.concatenate([x[m:], self.second(time, x[:m], x[m:])])

        run = solve_ivp(rate, (-10.0, TIME[-1]), np.zeros(2 * m), "LSODA", TIME, rtol=1e-9, atol=1e-12)
        found = []
        for time, x in zip(TIME, run.y.T, strict=True):
            found.append(self.inverse(time, x[:m], x[m:], rate(time, x)[m:])[self.joints].copy())
        return np.array(found)


@pytest.fixture(scope="module")
def arm(tmp_path_factory):
    """The bench's arm, its tree, and its motion without noise."""
    drawn = random_arm(np.random.default_rng(3), 3)
    path = tmp_path_factory.mktemp("arm") / "arm.urdf"
    path.write_text(drawn.urdf())
    tree = load_urdf(path, GRAVITY)
    q, qd, qdd = sines(TIME)
    samples = (TIME, q, qd, qdd, np.ones_like(q))
    body = RigidBody(tree)
    return drawn, tree, Experiment(exact(tuple(drawn.joints), PERIOD, 3, samples), body), body.torque(q, qd, qdd)


@pytest.mark.parametrize(("name", "kind"), [("link_torsion", "torsion"), ("link_bending", "bending")])
def test_an_elastic_link_is_mujocos_to_first_order(arm, name, kind):
    """What first order leaves falls with the square of the compliance: its share of the change halves with it."""
    drawn, tree, experiment, rigid = arm
    effect = effect_on(get_effect(name), tree)
    assembly = build((tree, experiment.body), experiment, [PlacedEffect(effect, "link1")])
    shares = []
    for stiffness in (4e3, 8e3):
        damping = 0.02 * stiffness
        wanted = Hinged(drawn, Beam(**{kind: stiffness}, damping=damping)).torque() - rigid
        found = assembly.torque(experiment, np.array([stiffness, damping])) - rigid
        settled = TIME > 0.5
        shares.append(np.sqrt(np.mean((found - wanted)[settled] ** 2) / np.mean(wanted[settled] ** 2)))
    assert shares[1] < 0.05
    assert shares[1] == pytest.approx(shares[0] / 2, rel=0.25)
    assert reached(assembly, assembly.placed[0]) == (0, 1, 2)


def test_a_name_stands_for_the_law_of_the_tree(arm):
    for name in ("link_torsion", "link_bending"):
        effect = get_effect(name)
        assert effect_on(effect, built_in_rig()) is effect
        assert effect_on(effect, arm[1]) is effect.elsewhere
    assert effect_on(get_effect("viscous_friction"), arm[1]) is get_effect("viscous_friction")
    assert placed(("link_torsion", "link1"))[0].key == "link_torsion.link1"


def test_a_model_file_names_a_link_and_is_written_back(tmp_path, arm):
    (tmp_path / "arm.urdf").write_text(arm[0].urdf())
    path = tmp_path / "arm.toml"
    path.write_text(
        'name = "a"\nurdf = "arm.urdf"\neffects = [{ name = "link_torsion", at = "link2" }, "link_bending"]\n'
    )
    model = load_model(path)
    assert [p.key for p in model.effects] == ["link_torsion.link2", "link_bending.link1", "link_bending.link2"]
    assert [p.key for p in library(model) if p.effect.at == "beam"] == ["link_torsion.link1"]
    save_model(model, tmp_path / "again.toml", "")
    assert [p.key for p in load_model(tmp_path / "again.toml").effects] == [p.key for p in model.effects]
    path.write_text(path.read_text().replace('"link2"', '"link3"'))
    with pytest.raises(InputError, match="link_torsion at 'link3'; this model has link1, link2"):
        load_model(path)
