"""Reading a URDF: what is taken, and every refusal in one line that names its mend."""

import re
from typing import Any

import numpy as np
import pytest
from refusal import refusal

from snarelab.errors import InputError
from snarelab.models.inertia import is_physical, to_central
from snarelab.models.rigid_body import RigidBody
from snarelab.models.tree import Joint, Link, Tree
from snarelab.models.urdf import load_urdf

BALL = '<inertial><mass value="2"/><inertia ixx="0.1" ixy="0" ixz="0" iyy="0.1" iyz="0" izz="0.1"/></inertial>'


def link(name, content=BALL):
    return f'<link name="{name}">{content}</link>'


def joint(name, parent, child, kind="revolute", content='<axis xyz="0 0 1"/>'):
    return f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>{content}</joint>'


def inertial(mass="2", *, rpy="0 0 0", xyz="0 0 0", **moments: Any):
    given = {"ixx": 0.1, "ixy": 0, "ixz": 0, "iyy": 0.1, "iyz": 0, "izz": 0.1} | moments
    tensor = " ".join(f'{key}="{value}"' for key, value in given.items())
    return f'<inertial><origin xyz="{xyz}" rpy="{rpy}"/><mass value="{mass}"/><inertia {tensor}/></inertial>'


def load(folder, body, **options):
    path = folder / "arm.urdf"
    path.write_text(f'<?xml version="1.0"?>\n<robot name="arm">{body}</robot>')
    return load_urdf(path, **options)


TWO = link("base") + link("arm") + link("tip") + joint("a", "base", "arm", content='<axis xyz="0 1 0"/>{}')
TWO += joint("b", "arm", "tip", content='<origin xyz="0 0 1"/><axis xyz="0 1 0"/>{}')
ONE_JOINT = link("base") + link("arm") + joint("hinge", "base", "arm")


def test_a_tree_with_branches_and_welds(tmp_path):
    tree = load(
        tmp_path,
        link("base", "")
        + link("left")
        + link("right")
        + link("flange", "")
        + link("tool", inertial("3", xyz="0 0 0.5"))
        + joint("swing", "base", "left", "continuous", '<axis xyz="0 2 0"/>')
        + joint("weld", "left", "flange", "fixed", '<origin xyz="1 0 0"/>')
        + joint(
            "slide", "flange", "right", "prismatic", '<origin xyz="0 1 0"/><limit lower="-1" upper="2" velocity="3"/>'
        )
        + joint("grip", "left", "tool", "fixed", '<origin xyz="0 0 1"/>'),
        gravity=(0, 0, -1.62),
    )
    assert [j.name for j in tree.joints] == ["swing", "slide"]
    assert [j.kind for j in tree.joints] == ["revolute", "prismatic"]
    assert [j.parent for j in tree.joints] == [-1, 0]
    assert [body.name for body in tree.links] == ["left", "right"]
    assert tree.n_joints == 2
    np.testing.assert_array_equal(tree.gravity, [0, 0, -1.62])
    np.testing.assert_allclose(tree.joints[0].axis, [0, 1, 0])
    np.testing.assert_allclose(tree.joints[1].axis, [1, 0, 0])  # URDF's default
    np.testing.assert_allclose(tree.joints[1].translation, [1, 1, 0])
    assert (tree.joints[0].lower, tree.joints[0].upper, tree.joints[0].speed) == (-np.inf, np.inf, np.inf)
    assert (tree.joints[1].lower, tree.joints[1].upper, tree.joints[1].speed) == (-1.0, 2.0, 3.0)
    mass, com, _ = to_central(tree.links[0].phi)  # 2 kg at the origin, 3 kg at (0, 0, 1.5)
    assert mass == 5.0
    np.testing.assert_allclose(com, [0, 0, 0.9])
    # 0.1 each, and 3 kg at 1.5 m, about the link frame
    np.testing.assert_allclose(tree.links[0].phi[4:], [6.95, 0, 0, 6.95, 0, 0.2], atol=1e-12)
    assert tree.phi.shape == (20,)


def test_a_turned_inertial_frame(tmp_path):
    turned = inertial(rpy=f"0 0 {np.pi / 2}", ixx=0.1, iyy=0.2, izz=0.25)
    tree = load(tmp_path, link("base") + link("arm", turned) + joint("hinge", "base", "arm"))
    np.testing.assert_allclose(tree.links[0].phi[4:], [0.2, 0, 0, 0.1, 0, 0.25], atol=1e-15)


def test_roll_then_pitch_then_yaw_about_fixed_axes(tmp_path):
    turned = inertial(rpy=f"{np.pi / 2} 0 {np.pi / 2}", ixx=0.1, iyy=0.2, izz=0.25)
    # roll takes y to z and z to -y; yaw then takes x to y and -y to x: axes x, y, z end as y, z, x
    tree = load(tmp_path, link("base") + link("arm", turned) + joint("hinge", "base", "arm"))
    np.testing.assert_allclose(tree.links[0].phi[[4, 7, 9]], [0.25, 0.1, 0.2], atol=1e-15)


def test_shapes_meshes_and_extensions_do_not_matter(tmp_path, capfd, caplog):
    mesh = '<visual><geometry><mesh filename="package://absent/a.stl"/></geometry></visual>'
    odd = '<axis xyz="0 0 1" odd="1"/><dynamics damping="-1"/><drake:rotor_inertia value="1"/><unknown/>'
    tree = load(
        tmp_path,
        link("world", "")
        + link("arm", BALL + mesh + mesh.replace("visual", "collision"))
        + joint("hinge", "world", "arm", content=odd)
        + "<transmission/><gazebo/><drake:collision_filter_group/>",
    )
    assert tree.n_joints == 1
    assert capfd.readouterr() == ("", "")
    assert not caplog.records


def test_a_massless_link_may_carry_a_mass(tmp_path):
    body = link("base") + link("wrist", "") + link("tool")
    tree = load(tmp_path, body + joint("a", "base", "wrist") + joint("b", "wrist", "tool"))
    np.testing.assert_array_equal(tree.links[0].phi, np.zeros(10))


REFUSED = {
    "no mass at all": (
        link("base") + link("arm", "") + joint("a", "base", "arm"),
        "joint 'a' moves no mass: link 'arm'",
    ),
    "nothing moves": (link("base") + link("arm") + joint("a", "base", "arm", "fixed"), "no joint moves"),
    "floating": (link("base") + link("arm") + joint("a", "base", "arm", "floating"), "joint 'a' is of type 'floating'"),
    "planar": (link("base") + link("arm") + joint("a", "base", "arm", "planar"), "joint 'a' is of type 'planar'"),
    "ball": (link("base") + link("arm") + joint("a", "base", "arm", "ball"), "allowed are revolute, continuous"),
    "screw": (ONE_JOINT + '<drake:joint name="s" type="screw"/>', "<drake:joint> is not supported"),
    "mimic in a ring": (
        TWO.format('<mimic joint="b"/>', '<mimic joint="a"/>'),
        "joint 'a' mimics joints that mimic it in turn",
    ),
    "a joint behind a mimic": (
        TWO.format("", '<mimic joint="a"/>') + link("far") + joint("c", "tip", "far"),
        "joint 'c' hangs behind 'b', which mimics 'a'",
    ),
    "mimic text": (TWO.format("", '<mimic joint="a" multiplier="x"/>'), "joint 'b': mimic multiplier is 'x'; give a"),
    "two roots": (ONE_JOINT + link("stray"), "root links are ['base', 'stray']"),
    "no links": ("", "root links are []"),
    "closed loop": (
        ONE_JOINT + link("rod") + joint("b", "base", "rod") + joint("c", "rod", "arm"),
        "link 'arm' hangs on joints 'hinge' and 'c'",
    ),
    "ring apart": (
        ONE_JOINT
        + link("x")
        + link("y")
        + link("z")
        + joint("b", "x", "y")
        + joint("c", "y", "z")
        + joint("d", "z", "x"),
        "loops",
    ),
    "unknown link": (ONE_JOINT.replace('parent link="base"', 'parent link="bass"'), "Could not find link named 'bass'"),
    "name twice": (ONE_JOINT + link("rod") + joint("hinge", "arm", "rod"), "joint name 'hinge' is given twice"),
    "zero axis": (ONE_JOINT.replace("0 0 1", "0 0 0"), "'hinge' axis is zero"),
    "axis text": (ONE_JOINT.replace("0 0 1", "0 z 1"), "joint 'hinge': axis xyz is '0 z 1'; give 3 finite numbers"),
    "crossed limits": (
        link("base") + link("arm") + joint("a", "base", "arm", content='<limit lower="1" upper="-1"/>'),
        "joint 'a' has limits",
    ),
    "mass missing": (ONE_JOINT.replace('<mass value="2"/>', ""), "link 'base': mass value is None"),
    "mass NaN": (ONE_JOINT.replace('value="2"', 'value="nan"'), "link 'base': mass value is 'nan'"),
    "mass negative": (ONE_JOINT.replace('value="2"', 'value="-2"'), "link 'base' has mass -2 kg"),
    "inertia without mass": (
        TWO.format("", "").replace('value="2"', 'value="0"', 2),
        "link 'arm' has mass 0 kg and an inertia",
    ),
    "moment missing": (ONE_JOINT.replace('ixy="0" ', ""), "link 'base': ixy is None; give 1 finite number"),
    "macros": (ONE_JOINT + '<xacro:include filename="b"/>', "expand it first"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_refusals_are_one_line_that_names_the_file(tmp_path, case):
    body, words = REFUSED[case]
    refusal(lambda: load(tmp_path, body), tmp_path / "arm.urdf", words)


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (None, "no such file"),
        ("<robot name='a'><link", "not XML"),
        ("MZ\x90", "not XML"),
        ("", "not XML"),
        ("<sdf/>", "root element is <sdf>"),
    ],
)
def test_files_that_are_no_urdf(tmp_path, content, words):
    path = tmp_path / "arm.urdf"
    if content is not None:
        path.write_text(content)
    with pytest.raises(InputError, match=words) as caught:
        load_urdf(path)
    assert str(path) in str(caught.value)


def test_a_folder_is_no_urdf(tmp_path):
    with pytest.raises(InputError, match="cannot be read"):
        load_urdf(tmp_path)


@pytest.mark.parametrize("gravity", [(0, 0), (0, 0, np.nan)])
def test_gravity_has_three_finite_numbers(tmp_path, gravity):
    with pytest.raises(InputError, match="three finite numbers"):
        load(tmp_path, ONE_JOINT, gravity=gravity)


def test_an_impossible_inertia_is_refused_with_one_that_can_be_pasted(tmp_path):
    # Link 2 of the ETS-VII arm as published, in an inertial frame turned on the link.
    moments: dict[str, Any] = {"ixx": 0.102, "ixy": 0.0, "ixz": -0.00214, "iyy": 3.378, "iyz": 0.0, "izz": 3.752}
    body = link("base") + "{}" + joint("hinge", "base", "boom")
    with pytest.raises(InputError, match="link 'boom' has an inertia that no body can have") as caught:
        load(tmp_path, body.format(link("boom", inertial("22.45", rpy="0.3 0.2 -1", **moments))))
    message = str(caught.value)
    matrix = np.array([[0.102, 0.0, -0.00214], [0.0, 3.378, 0.0], [-0.00214, 0.0, 3.752]])
    for moment in np.linalg.eigvalsh(matrix):
        assert f"{moment:.6g}" in message
    pasted: dict[str, Any] = {key: float(value) for key, value in re.findall(r'(i[xyz]{2})="([^"]+)"', message)}
    tree = load(tmp_path, body.format(link("boom", inertial("22.45", rpy="0.3 0.2 -1", **pasted))))
    assert is_physical(tree.links[0].phi)
    # one inequality is violated: a third of the excess from each principal moment
    small, middle, large = np.linalg.eigvalsh(matrix)
    mended = [[pasted["ixx"], pasted["ixy"], pasted["ixz"]], [0, pasted["iyy"], pasted["iyz"]], [0, 0, pasted["izz"]]]
    third = (large - small - middle) / 3
    expected = [small + third, middle + third, large - third]
    np.testing.assert_allclose(np.linalg.eigvalsh(mended, UPLO="U"), expected, rtol=1e-9)


def test_bodies_are_judged_as_they_move(tmp_path):
    bad = inertial(izz=0.3)
    on_base = load(tmp_path, link("base", bad) + link("arm") + joint("a", "base", "arm"))
    assert "the inertia of 'base' is one that no body can have; no joint feels it" in on_base.notes[0]
    small = bad.replace('value="2"', 'value="0.1"')
    welded = load(tmp_path, ONE_JOINT + link("tip", small) + joint("weld", "arm", "tip", "fixed"))
    assert "the inertia of 'tip' is one" in welded.notes[0]  # 0.2, 0.2, 0.4: the sum is a disc
    worse = inertial(izz=0.4)
    worse = inertial(izz=0.4)
    with pytest.raises(InputError, match=r'link .arm. has an inertia.*inertia_fix = "nearest"'):
        load(tmp_path, ONE_JOINT + link("tip", worse) + joint("weld", "arm", "tip", "fixed"))
    mended = load(tmp_path, ONE_JOINT + link("tip", worse) + joint("weld", "arm", "tip", "fixed"), fix="nearest")
    assert is_physical(mended.links[0].phi)
    assert mended.notes[0].startswith("inertia_fix: 'arm' had an inertia")


def test_a_joint_that_moves_no_mass_is_held(tmp_path):
    body = link("base") + link("arm") + link("tip", "") + joint("a", "base", "arm") + joint("b", "arm", "tip")
    tree = load(tmp_path, body)
    assert [j.name for j in tree.joints] == ["a"]
    assert tree.weightless == ("b",)
    assert "'b' moves no mass and is held" in tree.notes[0]


def test_a_mimic_follows_its_leader(tmp_path):
    """Two rods in one plane, the second turned by minus twice the first's angle plus 0.3: by hand."""
    tree = load(tmp_path, TWO.format("", '<mimic joint="a" multiplier="-2" offset="0.3"/>'))
    assert [j.name for j in tree.joints] == ["a"]
    assert [f.joint.name for f in tree.followers] == ["b"]
    assert tree.phi.shape == (20,)
    q, qd, qdd = 0.4, 0.7, -1.1
    body = RigidBody(tree)
    # Each ball has 0.1 kg·m² and lies on its own joint; the second, of 2 kg, turns at qd - 2 qd on a 1 m arm.
    inertia = 0.1 + 0.1 * (1 - 2) ** 2 + 2 * 1.0
    expected = inertia * qdd - 2 * 9.81 * np.sin(q)
    np.testing.assert_allclose(body.torque([[q]], [[qd]], [[qdd]]), [[expected]], rtol=1e-12)
    np.testing.assert_allclose(body.regressor([[q]], [[qd]], [[qdd]])[0, 0] @ tree.phi, expected, rtol=1e-12)
    np.testing.assert_allclose(body.mass_matrix([[q]]), [[[inertia]]], rtol=1e-12)


def test_a_chain_of_mimics_and_one_whose_leader_is_not_there(tmp_path):
    far = link("far") + joint("c", "tip", "far", content='<mimic joint="b" multiplier="3" offset="1"/>')
    tree = load(tmp_path, TWO.format("", '<mimic joint="a" multiplier="2" offset="0.5"/>') + far)
    assert [(f.joint.name, f.leader, f.multiplier, f.offset) for f in tree.followers] == [
        ("b", 0, 2.0, 0.5),
        ("c", 0, 6.0, 2.5),
    ]
    alone = load(tmp_path, TWO.format("", '<mimic joint="nobody"/>'))
    assert [j.name for j in alone.joints] == ["a", "b"]
    assert "joint 'b' mimics 'nobody', which is no joint that moves" in alone.notes[0]


def test_held_joints_stand_where_they_are_said_to(tmp_path):
    """Holding is the whole tree with that joint still, at other joints."""
    text = TWO.format("", "") + link("far") + joint("c", "tip", "far", "prismatic", '<origin xyz="0 0.2 0.5"/>')
    whole, held = load(tmp_path, text), load(tmp_path, text, held={"b": 0.7})
    assert [j.name for j in held.joints] == ["a", "c"]
    q, qd, qdd = np.random.default_rng(0).normal(size=(3, 1, 2))
    full = [np.array([[x[0, 0], still, x[0, 1]]]) for x, still in ((q, 0.7), (qd, 0.0), (qdd, 0.0))]
    theirs = RigidBody(whole).torque(*full)[:, [0, 2]]
    np.testing.assert_allclose(RigidBody(held).torque(q, qd, qdd), theirs, rtol=1e-12)
    only = load(tmp_path, text, moving=["c"])
    assert [j.name for j in only.joints] == ["c"]
    with pytest.raises(InputError, match=r"joint 'd' is not one that moves \(a, b, c\)"):
        load(tmp_path, text, held={"d": 0.0})
    with pytest.raises(InputError, match="all 3 joints are held"):
        load(tmp_path, text, held={"a": 0.0, "b": 0.0, "c": 0.0})


def test_a_negative_moment_is_named(tmp_path):
    with pytest.raises(InputError, match=r"-0\.1 is negative"):
        load(tmp_path, link("base") + link("arm", inertial(iyy=-0.1)) + joint("a", "base", "arm"))


def tree_of(parent=-1, axis=(0.0, 0.0, 1.0), n_links=1):
    hinge = Joint("a", "revolute", np.array(axis), parent, np.eye(3), np.zeros(3))
    return Tree("t", (hinge,), (Link("b", np.zeros(10)),) * n_links, np.zeros(3))


@pytest.mark.parametrize(
    ("fault", "words"),
    [
        ({"parent": 0}, "order parents before"),
        ({"axis": (0, 0, 2)}, "length 1"),
        ({"n_links": 2}, "one link per joint"),
    ],
)
def test_a_tree_built_by_hand_is_checked(fault, words):
    tree_of()
    with pytest.raises(InputError, match=words):
        tree_of(**fault)


def test_a_condition_that_fails_in_drake_is_a_refusal(tmp_path, monkeypatch):
    """Drake's own checks would end the process: its bindings raise SystemExit for them."""

    class Failing:
        def __init__(self, _plant):
            pass

        def AddModelsFromString(self, _text, _kind):
            raise SystemExit("condition '!name.empty()' failed.")

    monkeypatch.setattr("pydrake.multibody.parsing.Parser", Failing)
    (tmp_path / "arm.urdf").write_text(
        '<robot name="arm"><link name="base"/><link name="tip"/><joint name="j" type="revolute"><parent link="base"/>'
        '<child link="tip"/><axis xyz="0 0 1"/></joint></robot>'
    )
    with pytest.raises(InputError, match=r"Drake cannot read it: condition '!name.empty\(\)' failed"):
        load_urdf(tmp_path / "arm.urdf")
