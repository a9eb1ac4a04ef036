"""Model files of a suspension rig: the built-in one, slings of one's own, and every mistake in one line."""

import numpy as np
import pytest
from refusal import refusal

from bench.arm import random_arm
from snarelab.models.effects import get_effect
from snarelab.models.inertia import to_central
from snarelab.models.model import places
from snarelab.models.model_file import load_model
from snarelab.models.model_write import save_model
from snarelab.models.rig.rig import Rig

BUILT_IN = 'system = "zero_g_rig"\n'
OWN = BUILT_IN + 'urdf = "arm.urdf"\n'
SLINGS = """
[slings]
"root" = { body = "link1" }
"near end" = { body = "link2", point = [0.1, 0, 0.2], weight = 12, hardware = 4.5, slide = [[0, 1, 0.5], [1, -1, 0]] }
"far" = { body = "link2", point = [0.3, 0.0, 0.2] }
"""


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "arm.urdf").write_text(random_arm(np.random.default_rng(0), 2).urdf())
    return tmp_path


def load(folder, text):
    (folder / "rig.toml").write_text(text, encoding="utf-8")
    return load_model(folder / "rig.toml")


def refused(folder, text, *words):
    refusal(lambda: load(folder, text), folder / "rig.toml", *words)


def test_the_built_in_rig_needs_no_urdf(folder):
    model = load(folder, BUILT_IN + 'effects = ["slide_friction", "sling_tension_error", "link_torsion"]\n')
    assert isinstance(model.tree, Rig)
    assert model.urdf is None
    assert [p.at for p in model.effects if p.effect.name == "slide_friction"] == [f"joint{j}" for j in range(1, 8)]
    # The first sling holds the link that only the vertical joint 1 moves: its tension turns nothing.
    assert [p.at for p in model.effects if p.effect.at == "sling"] == [f"sling{k}" for k in range(2, 11)]
    assert [p.at for p in model.effects if p.effect.at == "boom"] == [f"link{k}" for k in range(1, 7)]


def test_slings_of_ones_own(folder):
    rig = load(folder, OWN + SLINGS).tree
    assert isinstance(rig, Rig)
    root, near, far = rig.slings
    (mass1, com1, _), (mass2, _, _) = (to_central(link.phi) for link in rig.links)
    np.testing.assert_allclose(root.point, com1)
    assert (root.weight, root.hardware, root.slide.shape) == (pytest.approx(9.81 * mass1), 0.0, (0, 3))
    assert (near.link, near.weight, near.hardware, near.tension) == (1, 12.0, 4.5, 16.5)
    np.testing.assert_array_equal(near.slide, [[0, 1, 0.5], [1, -1, 0]])
    assert far.weight == pytest.approx(9.81 * mass2 - 12.0)
    assert places(get_effect("slide_friction"), rig) == ("joint2",)


@pytest.mark.parametrize(
    "text", [OWN + 'effects = ["suspension_sway"]\n' + SLINGS, BUILT_IN + 'effects = ["slide_friction"]\n']
)
def test_what_is_saved_reads_back(folder, text):
    model = load(folder, text)
    (folder / "deep").mkdir()
    save_model(model, folder / "deep" / "again.toml", "note")
    again = load_model(folder / "deep" / "again.toml")
    assert isinstance(again.tree, Rig)
    assert isinstance(model.tree, Rig)
    assert [p.key for p in again.effects] == [p.key for p in model.effects]
    for a, b in zip(again.tree.slings, model.tree.slings, strict=True):
        assert (a.name, a.link, a.weight, a.hardware) == (b.name, b.link, b.weight, b.hardware)
        np.testing.assert_array_equal(a.point, b.point)
        np.testing.assert_array_equal(a.slide, b.slide)


def test_gravity_elsewhere(folder):
    moon = load(folder, BUILT_IN + "gravity = [0.0, 0.0, -1.62]\n").tree
    assert isinstance(moon, Rig)
    assert sum(s.weight for s in moon.slings) == pytest.approx(1.62 * 570.0)


SLING = '[slings]\n"a" = { body = "link2"'


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (OWN, ("[slings] is missing",)),
        (OWN + "slings = 3\n", ("[slings] is missing",)),
        (BUILT_IN + SLINGS, ("[slings] belong to", "URDF of your own")),
        ('urdf = "arm.urdf"\n' + SLINGS, ("[slings] belong to", "zero_g_rig")),
        (OWN + '[slings]\n"a" = 3\n', ("[slings] a = 3", "body", "link1, link2")),
        (OWN + '[slings]\n"a" = { body = "link9" }\n', ("link9", "link1, link2")),
        (OWN + SLING + ", mass = 3 }\n", ("[slings] a has 'mass'", "body, point, weight, hardware, slide")),
        (OWN + SLING + ", point = [1, 2] }\n", ("point = [1, 2]", "three numbers")),
        (OWN + SLING + ", slide = [[1, 2, nan]] }\n", ("slide = [[1, 2, nan]]", "list of points")),
        (OWN + SLING + ", weight = -1 }\n", ("weight = -1", "zero or more")),
        (OWN + SLING + ", hardware = true }\n", ("hardware = True", "zero or more")),
        (OWN + SLING + ', weight = 1e6 }\n"b" = { body = "link2" }\n', ("1e+06 N", "'link2', which weighs", "'b'")),
        (OWN + '[slings]\n"joint1" = { body = "link1" }\n', ("'joint1'", "rename it")),
        (OWN + "gravity = [0.0, 1.0, -9.81]\n" + SLINGS, ("gravity is [0.0, 1.0, -9.81]", "along z")),
        (BUILT_IN + "gravity = [0.0, 0.0, 0.0]\n", ("gravity is [0.0, 0.0, 0.0]", "along z")),
        (BUILT_IN + 'effects = [{ name = "sling_tension_error", at = "sling1" }]\n', ("'sling1'", "sling2, sling3")),
        ('urdf = "arm.urdf"\neffects = ["slide_friction"]\n', ("slide_friction acts at a slide", "has none")),
        (BUILT_IN + '[signals]\n"tension.sling11" = "cell"\n', ("tension.sling11", "no such sling", "tension.sling10")),
    ],
)
def test_a_mistake_is_named(folder, text, words):
    refused(folder, text, *words)


def test_a_contact_on_the_axis_is_refused(folder):
    axis = load(folder, 'urdf = "arm.urdf"\n').tree.joints[1].axis.tolist()
    refused(folder, OWN + SLING + f", slide = [{axis}] }}\n", "on the axis of joint 'joint2'", "beside the axis")
