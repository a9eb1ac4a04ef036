"""Derivatives of the torque of a model with many effects, against differences."""

import numpy as np
from moving_arm import build, jacobian, placed

from snarelab.identification.fitting.base_parameters import base_parameters


def differences(assembly, experiment, theta):
    """Central differences of the torque (n, J, P)."""
    columns = []
    for k, x in enumerate(theta):
        step = np.zeros_like(theta)
        step[k] = 1e-5 * max(abs(x), 1e-2)
        ahead, behind = (assembly.torque(experiment, theta + s) for s in (step, -step))
        columns.append((ahead - behind) / (2 * step[k]))
    return np.stack(columns, axis=2)


def errors(found, wanted):
    """Relative error of each parameter's columns over all samples and channels; some inertias move no joint at all."""
    size = np.linalg.norm(wanted, axis=(0, 1))
    assert np.mean(size > 1e-6) > 0.8
    return np.linalg.norm(found - wanted, axis=(0, 1)) / np.maximum(size, 1e-6)


INSIDE = {
    "delay": 0.011,
    "speed": 0.2,
    "mass": 1.7,
    "x": 0.05,
    "y": -0.03,
    "z": 0.12,
    "coefficient": 0.08,
    "level": 3.0,
    "by_load": 0.08,
}
"""Values away from zero, where every parameter has a say."""

_MANY = """
viscous_friction@joint1 viscous_friction@joint3 coulomb_friction@joint1 stribeck_friction@joint1
asymmetric_friction@joint2 load_dependent_friction@joint2 load_dependent_friction@joint3
position_dependent_friction@joint2 harness_stiffness@joint3 rotor_inertia@joint2 torque_ripple@joint1
presliding_hysteresis@joint3 sensor_gain@tau.joint1 sensor_delay@tau.joint2 sensor_gain@tau.joint2
sensor_bias@tau.joint2 sensor_delay@q.joint3 sensor_drift@tau.joint3
"""
MANY = placed(*(entry.split("@") for entry in _MANY.split()))
LINKS = placed(("payload_mass", "link3"), ("com_offset", "link2"), ("inertia_error", "link1"))


def inside(assembly):
    """A parameter vector strictly between the bounds, with nothing at zero."""
    rng = np.random.default_rng(5)
    start = np.array([INSIDE.get(s.name, 0.0) or s.start for s in assembly.slots])
    start = start + np.where(
        start == 0, rng.uniform(0.05, 0.15, len(start)), 0.1 * start * rng.uniform(-1, 1, len(start))
    )
    return np.clip(start, np.nan_to_num(assembly.low) * 0.999, np.nan_to_num(assembly.high) * 0.999)


def with_by_load(assembly, theta, value):
    """The same, with bristles that carry so much more per load."""
    return np.array([value if s.name == "by_load" else x for s, x in zip(assembly.slots, theta, strict=True)])


def test_derivatives_of_many_effects_at_once(arm, experiment):
    assembly = build(arm, experiment, LINKS + MANY)
    theta = with_by_load(assembly, inside(assembly), 0.0)
    found = errors(jacobian(assembly, experiment, theta), differences(assembly, experiment, theta))
    for slot, error in zip(assembly.slots, found, strict=True):
        assert error < 1e-6, (slot.key, error)


def test_derivatives_with_the_inertia_free(arm, experiment):
    base = base_parameters(arm[1])
    assembly = build(arm, experiment, MANY, base)
    theta = with_by_load(assembly, inside(assembly), 0.0)
    theta[: len(base.columns)] = base.matrix @ arm[0].phi
    assert len(theta) > len(base.columns) > 10
    found = errors(jacobian(assembly, experiment, theta), differences(assembly, experiment, theta))
    for slot, error in zip(assembly.slots, found, strict=True):
        assert error < 1e-6, (slot.key, error)


def test_derivatives_where_bristles_carry_more_under_load(arm, experiment):
    """Exact but for what changes the load, which they follow as they would in motion; in motion they nearly do."""
    assembly = build(arm, experiment, placed(("payload_mass", "link3"), ("presliding_hysteresis", "joint3")))
    theta = with_by_load(assembly, inside(assembly), 0.08)
    most = 1 + 0.08 * np.abs(assembly.evaluate(experiment, theta).load[:, 2])
    assert most.max() > 2 * most.min()
    found = errors(jacobian(assembly, experiment, theta), differences(assembly, experiment, theta))
    for slot, error in zip(assembly.slots, found, strict=True):
        assert error < (0.1 if slot.effect == "payload_mass" else 1e-6), (slot.key, error)


def test_derivatives_behind_a_flexible_joint(arm, experiment):
    """Exact by stiffness and damping, and by all that does not feed the spring.

    Knowingly left out is the twist that more payload would cause: the twist changes the torque by a few parts in a
    hundred here, its change with the payload by no more.
    """
    effects = placed(("joint_elasticity", "joint2"), ("payload_mass", "link3", "x", "y", "z")) + MANY
    assembly = build(arm, experiment, effects)
    theta = inside(assembly)
    for k, slot in enumerate(assembly.slots):
        if slot.effect == "joint_elasticity":
            theta[k] = {"stiffness": 15000.0, "damping": 100.0}[slot.name]
    theta = with_by_load(assembly, theta, 0.0)
    rigid = build(arm, experiment, effects[1:])
    share = np.linalg.norm(assembly.torque(experiment, theta) - rigid.torque(experiment, theta[2:]))
    share /= np.linalg.norm(assembly.torque(experiment, theta))
    assert 1e-3 < share < 0.1
    found = errors(jacobian(assembly, experiment, theta), differences(assembly, experiment, theta))
    for slot, error in zip(assembly.slots, found, strict=True):
        limit = 2 * share if slot.effect == "payload_mass" else 1e-6
        assert error < limit, (slot.key, error, share)


def test_derivative_by_a_free_inertia_behind_a_flexible_joint(arm, experiment):
    """All inertia grown alike: the derivative says that the torque grows alike, and leaves out that the twist does."""
    base = base_parameters(arm[1])
    assembly = build(arm, experiment, placed(("joint_elasticity", "joint2")), base)
    n = len(base.columns)
    theta = np.concatenate([base.matrix @ arm[0].phi, [15000.0, 100.0]])
    more = theta + np.r_[1e-4 * theta[:n], 0.0, 0.0]
    wanted = (assembly.torque(experiment, more) - assembly.torque(experiment, theta)) / 1e-4
    found = jacobian(assembly, experiment, theta)[:, :, :n] @ theta[:n]
    twist = assembly.torque(experiment, theta) - assembly.evaluate(experiment, theta).load
    assert np.linalg.norm(found - wanted) < 1.05 * np.linalg.norm(twist)
    assert np.linalg.norm(twist) < 0.1 * np.linalg.norm(wanted)


def test_residual_is_measured_minus_modelled_in_the_band_with_its_derivatives(arm, experiment):
    base = base_parameters(arm[1])
    for chosen, effects in ((None, LINKS + MANY), (base, MANY), (base, MANY[:4])):
        assembly = build(arm, experiment, effects, chosen)
        for theta in (inside(assembly), 1.01 * inside(assembly)):  # twice: constant columns come from the store then
            residual, blocks = assembly.residual(experiment, theta)
            recorded = experiment.motion
            wanted = recorded.to_band(recorded.tau - assembly.torque(experiment, theta))
            np.testing.assert_allclose(residual, wanted, atol=1e-9)
            dense = np.zeros((*residual.shape, len(theta)))
            for block in blocks:
                for k, i in enumerate(block.index):
                    dense[:, block.channel, i] += block.values[:, k]
            np.testing.assert_allclose(dense, recorded.to_band(jacobian(assembly, experiment, theta)), atol=1e-8)
