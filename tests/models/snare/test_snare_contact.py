"""Contact: distance to the pin, the law of the force, balance, and the Jacobian against finite differences."""

# pyright: reportArgumentType=false, reportAttributeAccessIssue=false

import numpy as np
import pytest
from scipy.optimize import minimize_scalar
from scipy.spatial.transform import Rotation

from snarelab.models.snare.bow import give
from snarelab.models.snare.contact import CONTACT_SIZE, MOST_CONTACTS, add_pin_contact, find_contacts
from snarelab.models.snare.contact_jacobian import turn_column
from snarelab.models.snare.crossing import find_crossings
from snarelab.models.snare.cubic import combine, first_weights, weights
from snarelab.models.snare.ends import REACTION
from snarelab.models.snare.forces import system_forces, system_jacobian
from snarelab.models.snare.law import force, hertz_overlap, law_constants, powers
from snarelab.models.snare.line import LINE_SIZE
from snarelab.models.snare.parameters import SnareParameters
from snarelab.models.snare.pin import distance, pin_cylinders, surface
from snarelab.models.snare.settled import settled

P = SnareParameters(bending_damping=0.0)
"""Damping in bending has a file of its own, and gives its Jacobian by rates alone."""
N = 10
SIZE = P.cable_length / N


def test_distance_to_a_cylinder_is_that_to_its_nearest_point():
    """Against the nearest of a dense cloud of points on the surface."""
    cylinder = np.array([0.01, -0.03, 0.0])
    angle = np.linspace(0, 2 * np.pi, 300, endpoint=False)
    around = np.column_stack([np.zeros_like(angle), np.cos(angle), np.sin(angle)])
    side = [[x, 0, 0] + 0.01 * around for x in np.linspace(-0.03, 0, 200)]
    ends = [[x, 0, 0] + r * around for x in (-0.03, 0.0) for r in np.linspace(0, 0.01, 100)]
    cloud = np.concatenate(side + ends)
    rng = np.random.default_rng(1)
    for point in rng.uniform([-0.05, -0.03, -0.03], [0.02, 0.03, 0.03], (60, 3)):
        found = distance(cylinder, tuple(point))
        if found > 1e-3:
            assert found == pytest.approx(np.min(np.linalg.norm(cloud - point, axis=1)), abs=3e-5)
            gap, normal, *_ = surface(cylinder, tuple(point))
            assert gap == found
            # the normal is the gradient of the distance
            gradient = [
                (distance(cylinder, tuple(point + step)) - distance(cylinder, tuple(point - step))) / 2e-7
                for step in 1e-7 * np.eye(3)
            ]
            assert np.allclose(normal, gradient, atol=1e-6)


def touching_state(n_pin, overlap=1.0e-4, turn=(0.0, 0.3, 0.2), seed=0):
    """Cables at rest, and a pin that overlaps the first; all moving at random."""
    rng = np.random.default_rng(seed)
    nodes = settled(P, N)
    rotation = Rotation.from_rotvec(turn)
    axis = rotation.as_matrix()[:, 0]
    tangent = nodes[0, 5, 1] / np.linalg.norm(nodes[0, 5, 1])
    out = np.cross(axis, tangent)
    foot = nodes[0, 5, 0] + 0.003 * tangent + out / np.linalg.norm(out) * (P.pin_radius + P.cable_radius - overlap)
    foot = foot + 0.12 * axis
    quaternion = np.roll(rotation.as_quat(), 1)
    reference = np.concatenate([nodes.ravel(), np.concatenate([foot, quaternion])[:n_pin]])
    pin, euler = np.zeros((6, 3)), np.zeros((2, 4))
    pin[0], pin[3:], euler[0] = foot, rotation.as_matrix(), quaternion
    pin[1:3] = rng.normal(size=(2, 3)) * 0.05
    fittings = rng.normal(size=(8, 3))
    fittings /= np.linalg.norm(fittings, axis=1, keepdims=True)
    no_line = np.zeros(LINE_SIZE)
    fixed = (reference, N, SIZE, n_pin, pin_cylinders(P), law_constants(P), P.cable_radius, 0.1, 0.0, no_line)
    moving = (pin, euler, np.zeros((MOST_CONTACTS, CONTACT_SIZE)), np.zeros((12, 5)), fittings)
    return np.zeros_like(reference), rng.normal(size=reference.shape) * 0.05, fixed, moving


def differences(q, v, fixed, moving, of):
    step = 1e-8 if of == "q" else 1e-6
    columns = []
    for change in step * np.eye(len(q)):
        a = (change, 0) if of == "q" else (0, change)
        up = system_forces(q + a[0], v + a[1], fixed, moving)
        columns.append((up - system_forces(q - a[0], v - a[1], fixed, moving)) / (2 * step))
    return -np.array(columns).T


def apart(given, found, parts):
    """Worst difference of two matrices, block by block: each in shares of its own largest entry."""
    blocks = [np.ix_(rows, columns) for rows in parts for columns in parts]
    return max(np.max(np.abs(given[b] - found[b])) / np.max(np.abs(found[b])) for b in blocks)


def dense(triplets, n):
    matrix = np.zeros((n, n))
    np.add.at(matrix, (triplets[:, 0].astype(int), triplets[:, 1].astype(int)), triplets[:, 2])
    return matrix


@pytest.mark.parametrize("n_pin", [0, 3, 7])
def test_jacobian_is_the_derivative_of_the_forces(n_pin):
    q, v, fixed, moving = touching_state(n_pin)
    positions = fixed[0][: 66 * 3].reshape(-1, 3)
    assert find_contacts(positions, N, SIZE, fixed[4], moving[0], fixed[5], P.cable_radius, moving[2]) == 1
    project = np.eye(len(q))
    if n_pin == 7:  # Euler parameters stay of unit length: only changes across them mean something
        project[-4:, -4:] -= np.outer(moving[1][0], moving[1][0])
    # Cables, the pin's place and its attitude: an entry of one is tens of times smaller than one of another.
    parts = [part for part in np.split(np.arange(len(q)), [198, 201]) if len(part)]
    # Second derivatives of the bow are left out. Here the pin pushes with 670 N; under 10 N they are a tenth of that.
    for of, factors, worst in (("q", (1.0, 0.0), 1e-2), ("v", (0.0, 1.0), 2e-5)):
        given = dense(system_jacobian(q, v, fixed, moving, *factors), len(q)) @ project
        found = differences(q, v, fixed, moving, of) @ project
        assert apart(given, found, parts) < worst


def test_jacobian_of_a_pin_that_turns_about_its_own_axis():
    """The contact stays as it is, so that its stiffness hides neither friction nor the moment's turning with the pin.

    A term of the wrong sign is under a thousandth of the largest entry of the attitude's own block.
    """
    q, v, fixed, moving = touching_state(7)
    axis, euler = moving[0][3:, 0].copy(), moving[1][0]
    way = np.zeros_like(q)
    way[-4:] = [np.dot(turn_column(euler, k), axis) / 4 for k in range(4)]  # ė of an angular velocity: G Gᵀ = 4
    step = 1e-5  # an angle: where the contact does not feel it, rounding asks for a larger one than elsewhere
    ahead, behind = (system_forces(q + sign * step * way, v, fixed, moving) for sign in (1, -1))
    found = (behind - ahead) / (2 * step)
    given = dense(system_jacobian(q, v, fixed, moving, 1.0, 0.0), len(q)) @ way
    for part in np.split(np.arange(len(q)), [198, 201]):
        # each part of the column by its own largest entry
        assert np.max(np.abs(given[part] - found[part])) < 1e-5 * np.max(np.abs(found[part]))


def contact_energy(q, v, fixed, moving):
    """Stored in the contacts with the pin [J], without friction and damping."""
    positions = (fixed[0] + q)[: 66 * 3].reshape(-1, 3)
    contacts = moving[2]
    count = find_contacts(positions, N, SIZE, fixed[4], moving[0], fixed[5], P.cable_radius, contacts)
    law = fixed[5]
    assert count
    return sum(powers(law, c[3], c[4], (0.0, 0.0, 1.0), (0.0, 0.0, 0.0))[0] for c in contacts[:count])


@pytest.mark.parametrize("overlap", [6e-5, 1e-4, 3e-4])
def test_the_contacts_force_is_the_slope_of_its_energy(overlap):
    """Pressed with up to 5 kN, between two nodes of a cable that is bent and pulled: the docking's preload."""
    _, v, fixed, moving = touching_state(0, overlap)
    smooth = law_constants(P.with_values(friction=0.0, contact_damping=0.0, cable_pretension=2000.0))
    fixed = (*fixed[:5], smooth, *fixed[6:])
    positions, still = fixed[0].reshape(-1, 3), np.zeros((66, 3))
    forces = np.zeros((66, 3))
    push, _ = add_pin_contact(positions, still, N, SIZE, fixed[4], moving[0], smooth, P.cable_radius, moving[2], forces)
    rng = np.random.default_rng(0)
    size = np.linalg.norm(push)
    for _ in range(5):
        way = rng.normal(size=(66, 3)) * np.tile([[1e-3], [0.05]], (33, 1))
        ahead, behind = (contact_energy(sign * 1e-4 * way.ravel(), v, fixed, moving) for sign in (1, -1))
        assert np.sum(forces * way) == pytest.approx((behind - ahead) / 2e-4, abs=2e-5 * size * 1e-3)


def crossing_state():
    """The first two cables moved so that they cross with a small overlap; no pin near."""
    q, v, fixed, moving = touching_state(0)
    nodes = fixed[0].reshape(3, N + 1, 2, 3).copy()
    one, two = nodes[0, 4:6].reshape(4, 3), nodes[1, 6:8].reshape(4, 3)
    across = np.cross(combine(first_weights(0.4, SIZE), one), combine(first_weights(0.7, SIZE), two))
    apart = across / np.linalg.norm(across) * (2 * P.cable_radius - 1e-4)
    here = np.array(combine(weights(0.4, SIZE), one)) - apart
    nodes[1, :, 0] += here - combine(weights(0.7, SIZE), two)
    moving[0][0] = [1.0, 1.0, 1.0]
    return q, v, (nodes.ravel(), *fixed[1:]), moving


def test_jacobian_of_crossing_cables():
    q, v, fixed, moving = crossing_state()
    assert find_crossings(fixed[0].reshape(-1, 3), N, SIZE, P.cable_radius, moving[3]) == 1
    # What differs by position is the cables' own bow, not the crossing.
    for of, factors, worst in (("q", (1.0, 0.0), 5e-4), ("v", (0.0, 1.0), 1e-6)):
        given = dense(system_jacobian(q, v, fixed, moving, *factors), len(q))
        found = differences(q, v, fixed, moving, of)
        assert np.max(np.abs(given - found)) < worst * np.max(np.abs(found))


def test_contact_balances_force_and_moment():
    """On cables (as forces on r and couples through r'), pin and bearings together: nothing is left over."""
    q, v, fixed, moving = touching_state(7)
    fixed = (*fixed[:-3], 0.0, 2e-3, np.zeros(LINE_SIZE))
    forces = system_forces(q, v, fixed, moving)
    on_nodes, on_pin = forces[:198].reshape(-1, 3), forces[198:]
    coordinates = fixed[0][:198].reshape(-1, 3)
    assert np.abs(on_nodes[0::2].sum(axis=0) + on_pin[:3]).max() < 1e-10 * np.abs(on_pin).max()
    e = moving[1][0]
    turn = 2 * np.array([[-e[1], e[0], -e[3], e[2]], [-e[2], e[3], e[0], -e[1]], [-e[3], -e[2], e[1], e[0]]])
    moment = turn @ on_pin[3:] / 4 + np.cross(fixed[0][198:201], on_pin[:3])  # G Gᵀ = 4
    moment += np.cross(coordinates, on_nodes).sum(axis=0) + moving[4][REACTION]
    assert np.abs(moment).max() < 1e-10 * np.abs(on_pin).max()


def test_the_contact_is_where_the_cable_is_nearest():
    """Under a light touch; what a push and the cable's own bow move it by has a file of its own."""
    _, _, fixed, moving = touching_state(0, overlap=4e-5)
    positions = fixed[0].reshape(-1, 3)
    assert find_contacts(positions, N, SIZE, fixed[4], moving[0], fixed[5], P.cable_radius, moving[2]) == 1
    first, part, fraction, gap, _ = moving[2][0]
    element = positions[int(first) : int(first) + 4]

    def from_axis(x):
        point = np.array(combine(weights(x, SIZE), element)) - moving[0][0]
        axis = moving[0][3:, 0]
        return np.linalg.norm(point - (point @ axis) * axis)

    best = minimize_scalar(from_axis, bounds=(0, 1), method="bounded", options={"xatol": 1e-12})
    assert part == 0
    assert fraction == pytest.approx(best.x, abs=5e-4)
    assert gap == pytest.approx(best.fun - P.pin_radius - P.cable_radius, abs=5e-7)


def test_law_is_hertz_with_coulomb_and_never_pulls():
    law = law_constants(P)
    n = (0.0, 0.0, 1.0)
    still = force(law, -3e-6, 0.0, n, (0.0, 0.0, 0.0))
    assert still == pytest.approx((0, 0, P.hertz_stiffness * 3e-6**1.5))
    sliding = force(law, -3e-6, 0.0, n, (0.05, 0.0, 0.0))
    assert sliding[0] == pytest.approx(-P.friction * still[2], rel=1e-4)  # slip velocity is 0.4 % of the slip
    assert force(law, -3e-6, 0.0, n, (0.0, 0.0, 5.0)) == pytest.approx((0, 0, 0))  # leaving fast
    assert force(law, -3e-6, 0.0, n, (0.0, 0.0, -0.1))[2] == pytest.approx(1.1 * still[2])
    stored, damped, rubbed = powers(law, -3e-6, 0.0, n, (0.05, 0.0, -0.1))
    assert stored == pytest.approx(0.4 * P.hertz_stiffness * 3e-6**2.5)
    assert damped == pytest.approx(0.1 * still[2] * 0.1)
    assert rubbed == pytest.approx(P.friction * 1.1 * still[2] * 0.05, rel=1e-4)


def test_overlap_shares_out_between_hertz_and_the_element():
    law = law_constants(P)
    soft = give(law, 0.5, SIZE)
    # a beam clamped at both ends under a load in its middle: l³/(192 EI)
    assert soft == pytest.approx(SIZE**3 / (192 * P.bending_stiffness))
    x = hertz_overlap(law, -5e-6, soft)
    assert x + soft * P.hertz_stiffness * x**1.5 == pytest.approx(5e-6, rel=1e-13)
    assert give(law, 0.0, SIZE) == 0
