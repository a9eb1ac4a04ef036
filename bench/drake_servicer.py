"""A servicer in Drake that records: hub, arm of two joints, and a sloshing mass or a reaction wheel in the hub.

Whatever is in the hub is a body of its own on joints and springs. The hub has that much less, so that the whole is the
hub of the model file while nothing in it moves.
"""

# pyright: reportAttributeAccessIssue=false, reportArgumentType=false, reportCallIssue=false
# (Drake's type stubs want a scalar for the shape of an array, and a System for what a builder hands back)
from dataclasses import dataclass

import numpy as np
import xarray as xr
from pydrake.math import RigidTransform
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import (
    FixedOffsetFrame,
    PrismaticJoint,
    PrismaticSpring,
    RevoluteJoint,
    RevoluteSpring,
    RotationalInertia,
    SpatialInertia,
    UnitInertia,
)
from pydrake.systems.analysis import ResetIntegratorFromFlags, Simulator
from pydrake.systems.controllers import PidController
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import (
    Adder,
    ConstantVectorSource,
    LogVectorOutput,
    MatrixGain,
    Multiplexer,
    Saturation,
    TrajectorySource,
)
from pydrake.trajectories import PiecewisePolynomial

from snarelab.models.model_file import load_model
from snarelab.recordings import write_recording

PERIOD, DURATION, REST = 0.02, 45.0, 2.0
URDF = """<robot name="servicer">
<link name="hub"><inertial><origin xyz="0.1 0 0.05"/><mass value="400"/>
<inertia ixx="90" iyy="120" izz="100" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="shoulder" type="revolute"><parent link="hub"/><child link="upper"/><origin xyz="0.6 0.2 0.1"/>
<axis xyz="0 0 1"/><limit lower="-3" upper="3" effort="100" velocity="2"/></joint>
<link name="upper"><inertial><origin xyz="0.6 0 0"/><mass value="20"/>
<inertia ixx="0.3" iyy="2.5" izz="2.5" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="elbow" type="revolute"><parent link="upper"/><child link="fore"/><origin xyz="1.2 0 0"/>
<axis xyz="0 1 0"/><limit lower="-3" upper="3" effort="100" velocity="2"/></joint>
<link name="fore"><inertial><origin xyz="0.5 0 0"/><mass value="15"/>
<inertia ixx="0.2" iyy="1.4" izz="1.4" ixy="0" ixz="0" iyz="0"/></inertial></link></robot>"""
MASS, CENTRE, MOMENTS = 400.0, np.array([0.1, 0.0, 0.05]), np.diag([90.0, 120.0, 100.0])
NOISE = {"q": 1e-6, "tau": 0.02, "vel": 2e-6, "omega": 2e-6}
WHEEL_PLACE, WHEEL_MASS, SLIP = np.array([-0.2, 0.1, -0.3]), 5.0, 1e-3


@dataclass(frozen=True)
class Tank:
    """A mass on springs: along some axes, or as a pendulum of some length [m] that hangs along z."""

    mass: float
    place: tuple[float, float, float]
    frequency: float
    damping: float
    axes: str = "xyz"
    pendulum: float = 0.0


@dataclass(frozen=True)
class Wheel:
    """A reaction wheel; ``torque`` is the amplitude of what its motor is told, a sine of 40 s [N·m]."""

    axis: int
    inertia: float
    viscous: float
    coulomb: float
    torque: float = 0.0


def record(path, seed, tank=None, wheel=None, noise=1.0):
    """Servo both joints along sines after a rest, and write the recording; ``noise`` is times `NOISE`."""
    builder, plant = DiagramBuilder(), MultibodyPlant(0.0)
    builder.AddSystem(plant)
    plant.mutable_gravity_field().set_gravity_vector([0.0, 0.0, 0.0])
    base, arm, inside = (plant.AddModelInstance(name) for name in ("base", "arm", "inside"))
    hub = plant.AddRigidBody("hub", base, _hub(tank, wheel))
    upper = plant.AddRigidBody("upper", arm, _inertia(20.0, [0.6, 0, 0], np.diag([0.3, 2.5, 2.5])))
    fore = plant.AddRigidBody("fore", arm, _inertia(15.0, [0.5, 0, 0], np.diag([0.2, 1.4, 1.4])))
    joints = [
        _joint(plant, RevoluteJoint, "shoulder", hub, [0.6, 0.2, 0.1], upper, [0, 0, 1], arm),
        _joint(plant, RevoluteJoint, "elbow", upper, [1.2, 0, 0], fore, [0, 1, 0], arm),
    ]
    for joint in joints:
        plant.AddJointActuator(joint.name(), joint)
    if tank is not None:
        _fill(plant, hub, inside, tank)
    if wheel is not None:
        axis = np.eye(3)[wheel.axis]
        spun = plant.AddRigidBody("wheel", inside, _inertia(WHEEL_MASS, [0, 0, 0], wheel.inertia * _disc(axis, 1.0)))
        bearing = _joint(plant, RevoluteJoint, "wheel", hub, WHEEL_PLACE, spun, axis, inside, damping=wheel.viscous)
        plant.AddJointActuator("wheel", bearing)
    plant.Finalize()
    servo = builder.AddSystem(PidController([300.0, 300.0], [0.0, 0.0], [150.0, 150.0]))
    _servo(builder, plant, arm, servo, seed)
    told = _motor(builder, plant, inside, wheel) if wheel is not None else None
    states, drives = (
        LogVectorOutput(x, builder, PERIOD) for x in (plant.get_state_output_port(), servo.get_output_port())
    )
    simulator = Simulator(builder.Build())
    ResetIntegratorFromFlags(simulator, "runge_kutta5", 0.05).set_target_accuracy(1e-7)
    simulator.Initialize()
    simulator.AdvanceTo(DURATION)
    context = simulator.get_context()
    time, state = states.FindLog(context).sample_times(), states.FindLog(context).data()
    q, v = state[: plant.num_positions()], state[plant.num_positions() :]
    columns = {}
    for joint, torque in zip(joints, drives.FindLog(context).data(), strict=True):
        columns |= {f"q.{joint.name()}": q[joint.position_start()], f"tau.{joint.name()}": torque}
    first, moving = hub.floating_positions_start(), hub.floating_velocities_start_in_v()
    columns |= {f"quat.hub.{a}": q[first + k] for k, a in enumerate("wxyz")}
    columns |= {f"pos.hub.{a}": q[first + 4 + k] for k, a in enumerate("xyz")}
    columns |= {f"omega.hub.{a}": v[moving + k] for k, a in enumerate("xyz")}
    columns |= {f"vel.hub.{a}": v[moving + 3 + k] for k, a in enumerate("xyz")}
    if wheel is not None and told is not None and wheel.torque:
        columns[f"torque.wheels.{'xyz'[wheel.axis]}"] = -told.FindLog(context).data()[0]
    rng = np.random.default_rng([seed, 1])
    noisy = {
        n: ("time", x + noise * NOISE.get(n.split(".")[0], 0.0) * rng.normal(size=len(x))) for n, x in columns.items()
    }
    write_recording(xr.Dataset(noisy, coords={"time": time}), path)
    return path


def model(folder, text="", base="hub"):
    """Model of the servicer with nothing inside its hub, as a file in a folder."""
    (folder / "servicer.urdf").write_text(URDF, encoding="utf-8")
    path = folder / "servicer.toml"
    path.write_text(f'system = "free_floating_arm"\nurdf = "servicer.urdf"\nbase = "{base}"\n{text}', encoding="utf-8")
    return load_model(path)


def _inertia(mass, centre, moments):
    diagonal, products = np.diag(moments), moments[[0, 0, 1], [1, 2, 2]]
    return SpatialInertia.MakeFromCentralInertia(mass, centre, RotationalInertia(*diagonal, *products))


def _about_origin(mass, place):
    return mass * (place @ place * np.eye(3) - np.outer(place, place))


def _disc(axis, along):
    """Inertia of a flat disc whose own about its axis is 1, or ``along``."""
    return 0.6 * (np.eye(3) - np.outer(axis, axis)) + along * np.outer(axis, axis)


def _hub(tank, wheel):
    """The model's hub less what is inside it; a wheel's inertia about its own axis is none of the model's."""
    mass, first, second = MASS, MASS * CENTRE, MOMENTS + _about_origin(MASS, CENTRE)
    if tank is not None:
        place = np.array(tank.place)
        mass, first = mass - tank.mass, first - tank.mass * place
        second = second - _about_origin(tank.mass, place)
    if wheel is not None:
        mass, first = mass - WHEEL_MASS, first - WHEEL_MASS * WHEEL_PLACE
        second = second - _about_origin(WHEEL_MASS, WHEEL_PLACE) - wheel.inertia * _disc(np.eye(3)[wheel.axis], 0.0)
    return _inertia(mass, first / mass, second - _about_origin(mass, first / mass))


def _joint(plant, kind, name, parent, place, child, axis, instance, **how):
    at = plant.AddFrame(FixedOffsetFrame(f"{name}_place", parent.body_frame(), RigidTransform(place), instance))
    return plant.AddJoint(kind(name, at, child.body_frame(), axis, **how))


def _fill(plant, hub, inside, tank):
    """The mass on a chain of joints with springs and dampers, massless up to the last."""
    w, hanging = 2 * np.pi * tank.frequency, np.array([0.0, 0.0, -tank.pendulum])
    stiffness = tank.mass * w**2 * (tank.pendulum**2 if tank.pendulum else 1.0)
    kind, spring = (RevoluteJoint, RevoluteSpring) if tank.pendulum else (PrismaticJoint, PrismaticSpring)
    carrier, place = hub, np.array(tank.place) - hanging
    axes = tank.axes[:2] if tank.pendulum else tank.axes
    for k, axis in enumerate(axes):
        last = k == len(axes) - 1
        point = SpatialInertia(tank.mass if last else 0.0, hanging, UnitInertia.PointMass(hanging), True)
        body = plant.AddRigidBody(f"tank_{axis}", inside, point)
        how = {"damping": 2 * tank.damping * stiffness / w}
        joint = _joint(plant, kind, f"tank_{axis}", carrier, place, body, np.eye(3)["xyz".index(axis)], inside, **how)
        plant.AddForceElement(spring(joint, 0.0, stiffness))
        carrier, place = body, np.zeros(3)


def _servo(builder, plant, arm, servo, seed):
    rng = np.random.default_rng(seed)
    periods, phases = rng.uniform(5, 9, (2, 2)), rng.uniform(0, 2 * np.pi, (2, 2))
    time = np.arange(0.0, DURATION + 0.05, 0.05)
    begun = np.clip((time - REST) / 3, 0, 1)
    slow = begun**3 * (10 - 15 * begun + 6 * begun**2)
    target = slow[:, None] * np.sum([0.5, 0.3] * np.sin(2 * np.pi * time[:, None, None] / periods + phases), axis=2)
    wanted = builder.AddSystem(Multiplexer([2, 2]))
    path = builder.AddSystem(TrajectorySource(_curve(time, target)))
    builder.Connect(path.get_output_port(), wanted.get_input_port(0))
    builder.Connect(builder.AddSystem(ConstantVectorSource([0.0, 0.0])).get_output_port(), wanted.get_input_port(1))
    builder.Connect(wanted.get_output_port(), servo.get_input_port_desired_state())
    builder.Connect(plant.get_state_output_port(arm), servo.get_input_port_estimated_state())
    builder.Connect(servo.get_output_port(), plant.get_actuation_input_port(arm))


def _motor(builder, plant, inside, wheel):
    """What the motor is told, and Coulomb friction beside it; logs what it is told."""
    time = np.arange(0.0, DURATION + 0.5, 0.5)
    told = builder.AddSystem(TrajectorySource(_curve(time, wheel.torque * np.sin(2 * np.pi * time[:, None] / 40))))
    slope = builder.AddSystem(MatrixGain(np.array([[0.0, -wheel.coulomb / SLIP]])))
    friction = builder.AddSystem(Saturation([-wheel.coulomb], [wheel.coulomb]))
    both = builder.AddSystem(Adder(2, 1))
    builder.Connect(plant.get_state_output_port(inside), slope.get_input_port())
    builder.Connect(slope.get_output_port(), friction.get_input_port())
    builder.Connect(told.get_output_port(), both.get_input_port(0))
    builder.Connect(friction.get_output_port(), both.get_input_port(1))
    builder.Connect(both.get_output_port(), plant.get_actuation_input_port(inside))
    return LogVectorOutput(told.get_output_port(), builder, PERIOD)


def _curve(time, values):
    still = np.zeros((values.shape[1], 1))
    return PiecewisePolynomial.CubicWithContinuousSecondDerivatives(time, values.T, still, still)
