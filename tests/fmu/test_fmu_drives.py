"""Drives and integrators of the self-contained arm: springs, sharp friction, orders, sensors, inputs that move."""

import numpy as np
import pytest

from bench.fmu_models import made_slave, write_model
from snarelab.errors import InputError
from snarelab.fmu.export import model_equations
from snarelab.models.model_file import load_model


def pendulum(folder, effects, values, name="pendulum"):
    """One joint about z at rest, without gravity: inertia I. Returns the model file and I."""
    path = write_model(folder, name, 1, effects, values, seed=2, gravity=(0, 0, 0))
    tree = load_model(path).tree
    return path, float(tree.joints[0].axis @ _tensor(tree.links[0].phi) @ tree.joints[0].axis)


def _tensor(phi):
    return np.array([[phi[4], phi[5], phi[6]], [phi[5], phi[7], phi[8]], [phi[6], phi[8], phi[9]]])


def test_springy_joint_rings_as_two_inertias_do(tmp_path):
    """Motor J and link I on a spring k: after a push they ring at sqrt(k (1/I + 1/J)), and their mean moves on."""
    values = {"joint_elasticity.joint1.stiffness": 400.0, "joint_elasticity.joint1.damping": 0.0}
    values |= {"rotor_inertia.joint1.inertia": 0.5}
    path, inertia = pendulum(tmp_path, '["joint_elasticity", "rotor_inertia"]', values)
    s = made_slave(tmp_path, model_equations(load_model(path)), **{"start.qd.joint1": 1.0})
    frequency = np.sqrt(400.0 * (1 / inertia + 1 / 0.5))
    share = 0.5 / (0.5 + inertia)  # link and motor start at the same speed: nothing rings
    s.step(0.5)
    assert s.get(["q.joint1"])[0] == pytest.approx(0.5, abs=1e-9)
    s.close()
    s = made_slave(tmp_path, model_equations(load_model(path)), **{"tau.joint1": 2.0})
    s.step(0.3)
    t = 0.3
    mean = 2.0 / (0.5 + inertia) * t**2 / 2
    ringing = 2.0 / 0.5 * (1 - np.cos(frequency * t)) / frequency**2
    assert s.get(["q.joint1"])[0] == pytest.approx(mean + (1 - share) * ringing, rel=1e-6)
    assert s.get(["q_link.joint1"])[0] == pytest.approx(mean - share * ringing, rel=1e-6)
    s.close()


def test_springy_joint_without_a_motor_is_refused(tmp_path):
    values = {"joint_elasticity.joint1.stiffness": 400.0, "joint_elasticity.joint1.damping": 0.0}
    path, _ = pendulum(tmp_path, '["joint_elasticity"]', values)
    with pytest.raises(InputError, match=r"rotor_inertia.*--inverse"):
        model_equations(load_model(path))


def test_sharp_friction_holds_a_joint_at_rest_and_stops_it(tmp_path):
    """Coulomb friction that turns over at 0.3 mrad/s: the linearly implicit integrator is chosen; nothing chatters."""
    values = {"coulomb_friction.joint1.level": 5.0, "speed_scale.joint1": 1.0}
    path, inertia = pendulum(tmp_path, '["coulomb_friction"]', values)
    equations = model_equations(load_model(path))
    assert equations.stiff
    s = made_slave(tmp_path, equations, **{"start.qd.joint1": 0.5, "tau.joint1": 1.0})
    stop = 0.5 * inertia / (5.0 - 1.0)
    for _ in range(round(stop / 1e-3) + 200):
        s.step(1e-3)
    creep = 3e-4 * np.arctanh(1.0 / 5.0)
    assert s.get(["qd.joint1"])[0] == pytest.approx(creep, rel=1e-6)
    assert s.get(["q.joint1"])[0] == pytest.approx(0.5 * stop / 2, abs=2e-4)
    s.close()


def test_the_implicit_integrator_is_of_order_four(tmp_path):
    """Fixed steps, since the tolerance is out of reach: a pendulum with a moving torque, against DOP853."""
    values = {"viscous_friction.joint1.coefficient": 2.0}
    path = write_model(
        tmp_path, "swing", 2, '["viscous_friction"]', values | {"viscous_friction.joint2.coefficient": 1.0}, seed=4
    )
    equations = model_equations(load_model(path), stiff=True)
    ends = []
    for tolerance in (1e-4, 1e-6, 1e-8, 1e-12):
        s = made_slave(tmp_path, equations, version=2, **{"solver.tolerance": tolerance, "tau.joint1": 5.0})
        for _ in range(4):
            s.step(0.1)
        ends.append(s.get(["q.joint1", "q.joint2"]))
        s.close()
    errors = [np.abs(end - ends[-1]).max() for end in ends[:-1]]
    assert errors[0] < 1e-3
    assert errors[1] < 1e-5
    assert errors[2] < 2e-7


def test_sensors_read_beside_the_truth(tmp_path):
    values = {
        "sensor_delay.q.joint1.delay": 0.01,
        "sensor_bias.tau.joint1.offset": 0.4,
        "sensor_gain.tau.joint1.error": 0.1,
    }
    effects = '[{ name = "sensor_delay", at = "q.joint1" }, { name = "sensor_gain", at = "tau.joint1" }, "sensor_bias"]'
    path, _ = pendulum(tmp_path, effects, values)
    s = made_slave(tmp_path, model_equations(load_model(path)), **{"start.qd.joint1": 1.0, "tau.joint1": 0.0})
    assert s.get(["sensor.tau.joint1"])[0] == pytest.approx(0.4)
    s.step(0.5)
    q, reading = s.get(["q.joint1", "sensor.q.joint1"])
    assert q == pytest.approx(0.5, abs=1e-6)
    assert q - reading == pytest.approx(0.01, abs=1e-6)  # 10 ms late at 1 rad/s
    s.set({"tau.joint1": 3.0})
    assert s.get(["sensor.tau.joint1"])[0] == pytest.approx(3.0 * 1.1 + 0.4)
    s.close()


@pytest.mark.parametrize("stiff", [False, True])
def test_input_derivatives_move_the_inputs_within_a_step(tmp_path, stiff):
    """A torque that ramps up over one long step: q = rate t³ / (6 inertia), and the input stands at the ramp's end."""
    path, inertia = pendulum(tmp_path, "[]", {})
    s = made_slave(tmp_path, model_equations(load_model(path), stiff=stiff), 2, **{"tau.joint1": 1.0})
    for k in (1, 2):
        s.fmu.setRealInputDerivatives([s.references["tau.joint1"]], [1], [4.0])
        s.step(0.25)
        t = 0.25 * k
        wanted = (1.0 * t**2 / 2 + 4.0 * t**3 / 6) / inertia
        q, qdd, tau = s.get(["q.joint1", "qdd.joint1", "tau.joint1"])
        assert q == pytest.approx(wanted, rel=1e-6)
        assert tau == pytest.approx(1.0 + 4.0 * t)
        assert qdd == pytest.approx(tau / inertia)
    s.step(0.25)  # no derivative given: held again
    assert s.get(["tau.joint1"])[0] == pytest.approx(3.0)
    with pytest.raises(Exception, match=r"(?i)error"):
        s.fmu.setRealInputDerivatives([s.references["tau.joint1"]], [2], [4.0])
    s.close()
