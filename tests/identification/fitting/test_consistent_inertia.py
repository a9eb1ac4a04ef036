"""Consistent inertia against closed forms, and against a search over log-Cholesky parameters."""

import numpy as np
import pytest
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from snarelab.errors import InputError
from snarelab.identification.fitting.base_parameters import base_parameters
from snarelab.identification.fitting.consistent_inertia import consistent_inertia
from snarelab.models.inertia import from_central, from_pseudo_inertia, is_physical, pseudo_inertia
from snarelab.models.rigid_body import RigidBody
from snarelab.models.tree import Joint, Link, Tree


def arm(*joints, gravity=(0.0, 0.0, -9.81)):
    """Base parameters of a chain of joints given as (kind, roll-pitch-yaw, translation), each about or along z."""
    made = tuple(
        Joint(
            f"joint{i}",
            kind,
            np.array([0.0, 0.0, 1.0]),
            i - 1,
            Rotation.from_euler("xyz", turn).as_matrix(),
            np.array(to),
        )
        for i, (kind, turn, to) in enumerate(joints)
    )
    links = tuple(Link(f"link{i}", np.zeros(10)) for i in range(len(joints)))
    return base_parameters(RigidBody(Tree("arm", made, links, np.array(gravity))))


PLANAR = arm(("revolute", (0, 0, 0), (0.0, 0.0, 0.0)), ("revolute", (0, 0, 0), (0.5, 0.0, 0.0)))
SLIDE = arm(("prismatic", (0, 0, 0), (0.0, 0.0, 0.0)))
SIX = arm(
    ("revolute", (0, 0, 0), (0.0, 0.0, 0.6)),
    ("revolute", (-np.pi / 2, 0, 0), (0.0, 0.2, 0.0)),
    ("revolute", (0, 0, 0), (0.4, 0.0, -0.1)),
    ("prismatic", (-np.pi / 2, 0, 0), (0.1, 0.4, 0.0)),
    ("revolute", (0.5, 0.3, 0), (0.0, 0.1, 0.0)),
    ("revolute", (-np.pi / 2, 0, 0), (0.0, 0.0, 0.2)),
)


def random_bodies(rng, n_links):
    bodies = []
    for _ in range(n_links):
        second = rng.normal(size=(3, 3)) * 0.2
        second = second @ second.T + 1e-3 * np.eye(3)
        inertia = np.trace(second) * np.eye(3) - second
        bodies.append(from_central(rng.uniform(0.5, 5), rng.normal(size=3) * 0.2, inertia))
    return np.concatenate(bodies)


def random_information(rng, n_base):
    """Correlated, and of standard deviations four decades apart."""
    spread = 10 ** rng.uniform(-2, 2, n_base)
    mixed = rng.normal(size=(n_base, n_base))
    return (mixed @ mixed.T + 0.1 * np.eye(n_base)) * np.outer(spread, spread)


def assert_positive_definite(phi):
    for link in phi.reshape(-1, 10):
        np.linalg.cholesky(pseudo_inertia(link))
        assert is_physical(link)


@pytest.mark.parametrize("base", [SLIDE, PLANAR, SIX])
@pytest.mark.parametrize("seed", range(6))
def test_what_bodies_can_have_is_kept(base, seed):
    rng = np.random.default_rng(seed)
    n_base, n_standard = base.matrix.shape
    truth, nominal = random_bodies(rng, n_standard // 10), random_bodies(rng, n_standard // 10)
    information = random_information(rng, n_base)
    beta = base.matrix @ truth
    found = consistent_inertia(base, beta, information, nominal)
    gap = beta - found.beta_consistent
    assert gap @ information @ gap < 1e-20 * (beta @ information @ beta)
    np.testing.assert_allclose(found.beta_consistent, base.matrix @ found.phi)
    assert not found.changed
    assert_positive_definite(found.phi)


def test_nominal_that_fits_is_returned():
    nominal = random_bodies(np.random.default_rng(0), 6)
    found = consistent_inertia(SIX, SIX.matrix @ nominal, np.eye(len(SIX.columns)), nominal)
    np.testing.assert_allclose(found.phi, nominal, rtol=1e-9, atol=1e-12)


def test_what_data_do_not_show_is_the_nearest_to_the_nominal():
    """No other body with the same beta has a smaller divergence: tr(P inv(Q)) - log det(P inv(Q))."""
    rng = np.random.default_rng(2)
    truth, nominal = random_bodies(rng, 6), random_bodies(rng, 6)
    found = consistent_inertia(SIX, SIX.matrix @ truth, np.eye(len(SIX.columns)), nominal)

    def divergence(phi):
        ratios = [
            pseudo_inertia(own) @ np.linalg.inv(pseudo_inertia(believed))
            for own, believed in zip(phi.reshape(-1, 10), nominal.reshape(-1, 10), strict=True)
        ]
        return sum(np.trace(r) - np.linalg.slogdet(r)[1] for r in ratios)

    _, _, rows = np.linalg.svd(SIX.matrix)
    unseen = rows[len(SIX.columns) :]
    least = divergence(found.phi)
    assert least < divergence(truth)
    for _ in range(50):
        direction = 1e-4 * unseen.T @ rng.normal(size=len(unseen))
        assert divergence(found.phi + direction) > least


@pytest.mark.parametrize("seed", range(8))
def test_planar_arm_is_projected_onto_its_cone(seed):
    """Closed form: the nearest point of a second-order cone.

    With gravity along both axes the base parameters are J1 = Izz1 + l² m2, mx2, my2, J2 = Izz2, and bodies have them
    where J1 >= l² m2 and J2 m2 >= mx2² + my2² for some m2, so where s >= |v| with s = (J1 + J2) / 2 and
    v = ((J1 - J2) / 2, l mx2, l my2). Information (1, 2 l², 2 l², 1) makes misfit twice the squared distance in (s, v).
    """
    length, weight = 0.5, 1e4
    rng = np.random.default_rng(seed)
    v = rng.normal(size=3)
    s = rng.uniform(-0.5, 0.9) * np.linalg.norm(v)
    beta = np.array([s + v[0], v[1] / length, v[2] / length, s - v[0]])
    information = weight * np.diag([1, 2 * length**2, 2 * length**2, 1])
    assert [name for _, name, _ in PLANAR.names] == ["Izz", "mx", "my", "Izz"]
    found = consistent_inertia(PLANAR, beta, information, random_bodies(rng, 2))
    on_cone = (s + np.linalg.norm(v)) / 2 * np.array([1, *(v / np.linalg.norm(v))])
    expected = [on_cone[0] + on_cone[1], on_cone[2] / length, on_cone[3] / length, on_cone[0] - on_cone[1]]
    np.testing.assert_allclose(found.beta_consistent, expected, atol=1e-3 * np.abs(expected).max())
    np.testing.assert_allclose(found.misfit, weight * (np.linalg.norm(v) - s) ** 2, rtol=1e-3)
    assert found.changed
    assert_positive_definite(found.phi)


def test_body_with_negative_mass_becomes_the_nearest_physical():
    """A search over log-Cholesky parameters (Rucker & Wensing 2022), blind to cones, finds no nearer body."""
    rng = np.random.default_rng(4)
    nominal = random_bodies(rng, 6)
    wrong = nominal.copy()
    wrong[50:60] *= -0.3
    information = random_information(rng, len(SIX.columns))
    beta = SIX.matrix @ wrong
    found = consistent_inertia(SIX, beta, information, nominal)
    assert found.changed
    assert_positive_definite(found.phi)
    root = np.linalg.cholesky(information)
    lower = np.tril_indices(4, -1)

    def bodies(parameters):
        made = []
        for own in parameters.reshape(-1, 10):
            factor = np.diag(np.exp(own[:4]))
            factor[lower] = own[4:]
            made.append(from_pseudo_inertia(factor @ factor.T))
        return np.concatenate(made)

    factors = [np.linalg.cholesky(pseudo_inertia(link)) for link in nominal.reshape(-1, 10)]
    start = np.concatenate([[*np.log(np.diag(f)), *f[lower]] for f in factors])
    search = least_squares(lambda p: root.T @ (beta - SIX.matrix @ bodies(p)), start, x_scale="jac", max_nfev=60)
    assert found.misfit < 2 * search.cost * (1 + 1e-4)
    assert found.misfit > 0.9 * 2 * search.cost


@pytest.mark.parametrize("base", [SLIDE, PLANAR, pytest.param(SIX, marks=pytest.mark.slow)])
@pytest.mark.parametrize("strength", [0.1, 30.0])
def test_noisy_data_are_fitted_at_least_as_well_as_by_the_true_links(base, strength):
    rng = np.random.default_rng(7)
    n_base, n_standard = base.matrix.shape
    for _ in range(4):
        truth, nominal = random_bodies(rng, n_standard // 10), random_bodies(rng, n_standard // 10)
        information = random_information(rng, n_base)
        noise = strength * np.linalg.solve(np.linalg.cholesky(information).T, rng.normal(size=n_base))
        found = consistent_inertia(base, base.matrix @ truth + noise, information, nominal)
        assert found.misfit <= 1.02 * (noise @ information @ noise)
        assert_positive_definite(found.phi)


def test_slide_of_negative_mass_has_next_to_none():
    nominal = random_bodies(np.random.default_rng(0), 1)
    found = consistent_inertia(SLIDE, [-4.0], [[25.0]], nominal)
    assert 0 < found.beta_consistent[0] < 1e-5
    assert found.misfit == pytest.approx(25 * 4.0**2, rel=1e-5)
    assert found.changed


def test_misfit_within_noise_is_no_change():
    nominal = random_bodies(np.random.default_rng(0), 1)
    # 95 % of noise lies within 1.96 standard deviations of no mass
    assert not consistent_inertia(SLIDE, [-1.9], [[1.0]], nominal).changed
    assert consistent_inertia(SLIDE, [-2.0], [[1.0]], nominal).changed


def test_links_without_mass_or_thickness_are_made_bodies():
    rng = np.random.default_rng(3)
    truth, nominal = random_bodies(rng, 6), random_bodies(rng, 6)
    nominal[:10] = 0.0
    nominal[10:20] = from_central(2.0, [0.1, 0.0, 0.0], np.zeros((3, 3)))
    nominal[20:30] = from_central(2.0, [0.1, 0.0, 0.0], np.diag([0.1, 0.1, 0.5]))
    for believed in (nominal, np.zeros(60)):
        beta = SIX.matrix @ truth
        found = consistent_inertia(SIX, beta, np.eye(len(beta)), believed)
        np.testing.assert_allclose(found.beta_consistent, beta, rtol=0, atol=1e-10)
        assert_positive_definite(found.phi)


def test_information_of_very_unlike_strength_is_no_trouble():
    rng = np.random.default_rng(6)
    truth, nominal = random_bodies(rng, 6), random_bodies(rng, 6)
    beta = SIX.matrix @ truth
    axes = np.linalg.qr(rng.normal(size=(len(beta), len(beta)))).Q
    information = axes @ np.diag(np.logspace(-6, 6, len(beta))) @ axes.T
    found = consistent_inertia(SIX, beta, information, nominal)
    np.testing.assert_allclose(found.beta_consistent, beta, rtol=0, atol=1e-6)


def test_directions_without_information_are_free():
    rng = np.random.default_rng(5)
    nominal = random_bodies(rng, 6)
    beta = SIX.matrix @ nominal
    beta[7] = -1e6
    information = random_information(rng, len(beta))
    information[7], information[:, 7] = 0.0, 0.0
    found = consistent_inertia(SIX, beta, information, nominal)
    np.testing.assert_allclose(found.phi, nominal, rtol=1e-7, atol=1e-9)
    assert not found.changed


def test_without_information_the_links_are_the_nominal_ones():
    nominal = random_bodies(np.random.default_rng(5), 1)
    found = consistent_inertia(SLIDE, [-1e6], [[0.0]], nominal)
    np.testing.assert_allclose(found.phi, nominal)
    np.testing.assert_allclose(found.beta_consistent, SLIDE.matrix @ nominal)
    assert not found.changed


@pytest.mark.parametrize(("beta", "information", "nominal", "words"), [
    ([1.0, 2.0], [[1.0]], np.ones(10), r"beta has shape \(2,\)"),
    ([1.0], [[np.nan]], np.ones(10), r"information has shape \(1, 1\); give \(1, 1\), all finite"),
    ([1.0], [[-1.0]], np.ones(10), "information: not symmetric and positive"),
    ([1.0], [[1.0]], np.ones(20), "phi_nominal has shape"),
])  # fmt: skip
def test_unusable_input_is_refused(beta, information, nominal, words):
    with pytest.raises(InputError, match=words):
        consistent_inertia(SLIDE, beta, information, nominal)
