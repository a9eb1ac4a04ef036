"""A regressor without its zeros, on a tree with two branches and a follower on one of them."""

import numpy as np
import pytest

from snarelab.models.rigid_body import RigidBody
from snarelab.models.tree import Follower, Joint, Link, Tree

PARENTS, N = (-1, 0, 1, 0, 3), 20
BEYOND = {0: {0, 1, 2, 3, 4, 5}, 1: {1, 2, 5}, 2: {2}, 3: {3, 4}, 4: {4}}
"""Links that a joint moves, by hand: the follower's, number 5, hangs from link 1 and has joint 1 as its leader."""


@pytest.fixture(scope="module")
def tree() -> Tree:
    rng = np.random.default_rng(2)

    def joint(name: str, parent: int) -> Joint:
        axis = rng.normal(size=3)
        return Joint(name, "revolute", axis / np.linalg.norm(axis), parent, np.eye(3), rng.normal(size=3))

    joints = tuple(joint(f"joint{k}", parent) for k, parent in enumerate(PARENTS))
    links = tuple(Link(f"link{k}", np.array([1.0, *rng.normal(size=3), 2, 0, 0, 2, 0, 2])) for k in range(6))
    follower = Follower(joint("finger", 1), 1, 0.5)
    return Tree("tree", joints, links, np.array([0, 0, -9.81]), followers=(follower,))


@pytest.fixture(scope="module")
def motion() -> np.ndarray:
    return np.random.default_rng(3).normal(size=(3, N, 5))


def test_a_joint_feels_the_links_beyond_it(tree):
    assert {c: set(np.flatnonzero(row)) for c, row in enumerate(tree.moves)} == BEYOND


def test_the_columns_of_each_joint_and_link_are_its_own_change_of_torque(tree, motion):
    """Each parameter by itself, through Newton and Euler's recursion."""
    body = RigidBody(tree)
    packed = body.packed_regressor(*motion)
    assert packed.values.shape == (N, 10 * sum(len(x) for x in BEYOND.values()))
    one = np.eye(60)
    q, qd, qdd = motion
    torque = np.stack([body.torque(q, qd, qdd, phi) for phi in one], 2)  # (n, J, 60)
    np.testing.assert_allclose(packed.dense(), torque, atol=1e-11)
    for c, links in BEYOND.items():
        index, columns = packed.of(c)
        assert {int(k) // 10 for k in index} == links
        np.testing.assert_allclose(columns, torque[:, c, index], atol=1e-11)
    for link in range(6):
        found = packed.of_link(link)
        assert [c for c, _ in found] == [c for c in range(5) if link in BEYOND[c]]
        for c, columns in found:
            np.testing.assert_allclose(columns, torque[:, c, 10 * link : 10 * link + 10], atol=1e-11)


@pytest.mark.parametrize("joint", range(5))
def test_coupled_joints_are_those_whose_torque_follows_the_motion_of_a_joint(tree, motion, joint):
    body = RigidBody(tree)
    felt = [x[:, :, joint].any(axis=0) for x in (*body.tangent(*motion), body.mass_matrix(motion[0]))]
    np.testing.assert_array_equal(tree.coupled(joint), np.flatnonzero(np.any(felt, axis=0)))
