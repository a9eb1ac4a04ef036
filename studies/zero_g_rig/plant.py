"""The rig as it really is: an Exudyn model that writes recordings, and shares no dynamics with the tool.

The arm is Exudyn's kinematic tree; each boom is cut at its middle by three springs (twist, two bendings). At every
step the tree's poses give the slings' and the slides' forces, which Exudyn carries to the joints. A stiff position
servo drives each joint; recorded are the encoders' and the torque sensors' readings, with noise and a quantum.
"""

# pyright: reportAttributeAccessIssue=false, reportArgumentType=false, reportCallIssue=false
# (Exudyn's compiled module has names that pyright does not see)
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from ...models.exudyn_build import exudyn as exu
from ...models.exudyn_build import items
from .arm import GRAVITY, Arm, Boom, RigLink, shift
from .slide import Slide
from .suspension import Slings, Suspension

Array = NDArray[np.float64]
Motion = Callable[[Array], tuple[Array, Array]]
"""Time [s] (n,) to wanted position and rate, each (n, n_joints) [rad, rad/s]."""

PERIOD = 5e-3
"""[s] Of the integration; at 1 ms torques differ by less than 0.03 % of their peak."""

SERVO_DAMPING = 0.03
"""[s] Derivative over proportional gain."""

SETTLE = 6.0
"""[s] Before the recording starts, for the booms to come to rest in the slings."""

_JOINT = {"x": exu.JointType.RevoluteX, "y": exu.JointType.RevoluteY, "z": exu.JointType.RevoluteZ}


@dataclass(frozen=True)
class Sensors:
    """Quantum and RMS noise of the joints' encoders [rad] and torque sensors [N·m]; drift of each torque (n_joints,).

    A torque reads drift · (t / duration) more at time t, all the way through.
    """

    encoder_step: float = 2.0 * np.pi / 2**24
    encoder_noise: float = 2e-7
    torque_step: float = 0.1
    torque_noise: float = 0.5
    torque_drift: Sequence[float] = ()


@dataclass(frozen=True, eq=False)
class Plant:
    """An arm in its slings.

    ``servo`` is each position loop's stiffness [N·m/rad]; ``gravity`` in [m/s²].
    """

    arm: Arm
    slide: Slide | None
    suspension: Suspension
    sensors: Sensors = field(default_factory=Sensors)
    servo: float = 2e8
    gravity: float = GRAVITY


@dataclass(frozen=True, eq=False)
class RigRecord:
    """What was measured, and what only the plant knows; n samples.

    Parameters
    ----------
    time : array (n,)
    q, tau : array (n, n_joints)
        Readings [rad, N·m].
    tension : array (n, n_units)
        [N], without noise.
    true_q, true_qd, true_tau : array (n, n_joints)
    friction : array (n, n_contacts)
        Force at each slide contact [N].
    twist : array (n, n_booms)
        [rad]
    """

    time: Array
    q: Array
    tau: Array
    tension: Array
    true_q: Array
    true_qd: Array
    true_tau: Array
    friction: Array
    twist: Array


class _Tree:
    """The kinematic tree: which of its coordinates are joints, and on which of its bodies a point of a link sits."""

    def __init__(self, arm: Arm) -> None:
        self.joints: list[int] = []
        self.twists: list[int] = []
        self.flexible: list[tuple[int, float, float]] = []  # coordinate, spring, damping time
        self.kinds, self.offsets, self.masses, self.coms, self.inertias = [], [], [], [], []
        self._parts: list[list[tuple[int, Array]]] = []  # of each link: body, its origin in the link's frame
        reach = np.zeros(3)
        for link in arm.links:
            inner, outer = (link, None) if link.boom is None else _halves(link, link.boom)
            self.joints.append(self._add(link.axis, link.offset - reach, inner))
            self._parts.append([(self.joints[-1], np.zeros(3))])
            reach = np.zeros(3)
            if outer is not None and link.boom is not None:
                boom, reach = link.boom, link.boom.cut
                self.twists.append(self._add("x", reach, None))
                self._add("y", np.zeros(3), None)
                last = self._add("z", np.zeros(3), outer)
                springs = (boom.torsion, boom.bending, boom.bending)
                self.flexible += [(self.twists[-1] + k, s, boom.damping) for k, s in enumerate(springs)]
                self._parts[-1].append((last, reach))

    def _add(self, axis: str, offset: Array, body: RigLink | None) -> int:
        self.kinds.append(_JOINT[axis])
        self.offsets.append(offset)
        self.masses.append(0.0 if body is None else body.mass)
        self.coms.append(np.zeros(3) if body is None else body.com)
        self.inertias.append(np.zeros((3, 3)) if body is None else body.inertia)
        return len(self.kinds) - 1

    def place(self, link: int, point: Array) -> tuple[int, Array]:
        """Body that carries a point of a link, and the point in that body's frame."""
        body, origin = self._parts[link][0]
        for part, cut in self._parts[link][1:]:
            if point[0] > cut[0]:
                body, origin = part, cut
        return body, point - origin


def _halves(link: RigLink, boom: Boom) -> tuple[RigLink, RigLink]:
    """Inner and outer part of a link with a boom; the outer one's frame starts at the cut."""
    mass, half = boom.mass / 2, boom.length / 2
    middle = boom.cut + np.array([half / 2, 0.0, 0.0])
    across = mass * (half**2 / 12 + boom.radius**2 / 2)
    tube = np.diag([mass * boom.radius**2, across, across])
    rest = link.mass - mass
    com = (link.mass * link.com - mass * middle) / rest
    inertia = link.inertia - tube - shift(mass, middle - link.com) - shift(rest, com - link.com)
    return RigLink(link.axis, link.offset, rest, com, inertia), RigLink("z", boom.cut, mass, middle - boom.cut, tube)


def simulate(plant: Plant, motion: Motion, duration: float, rate: float = 100.0, seed: int = 0) -> RigRecord:
    """Run the rig through a motion and record it.

    Parameters
    ----------
    plant : Plant
    motion : Motion
        Starts at rest at time 0.
    duration, rate : float
        [s], samples a second (200 or a divisor of it).
    seed : int
        Of the sensors' noise.

    Raises
    ------
    RuntimeError
        Exudyn could not integrate.
    """
    run = _Run(plant, motion, duration, rate, seed)
    run.go()
    return run.record()


class _Run:
    """One simulation: the tree, the slings and the slides, and what is logged on the way."""

    def __init__(self, plant: Plant, motion: Motion, duration: float, rate: float, seed: int) -> None:
        arm = plant.arm
        self._plant, self._tree, self._rng = plant, _Tree(arm), np.random.default_rng(seed)
        tree = self._tree
        n = len(tree.kinds)
        points = [(u.link, u.point) for u in arm.units] + [(c.link, c.point) for c in arm.contacts]
        placed = [tree.place(*p) for p in points]
        self._bodies = sorted({body for body, _ in placed})
        self._index = np.array([self._bodies.index(body) for body, _ in placed])
        self._points = np.array([p for _, p in placed])
        self._units = len(arm.units)
        self._gather = np.zeros((n, len(placed)))
        self._gather[[body for body, _ in placed], np.arange(len(placed))] = 1.0
        self._slide_setup()
        self._steps = round((duration + SETTLE) / PERIOD)
        self._before = round(SETTLE / PERIOD)
        self._every = round(1.0 / (rate * PERIOD))
        time = PERIOD * (np.arange(self._steps + 1) - self._before)
        self._wanted = motion(np.clip(time, 0.0, None))
        self._count = -1
        self._log: list[tuple[Array, ...]] = []
        self._build(n)

    def _slide_setup(self) -> None:
        """Own-axis radius and tangent of each contact, in the frame of the body that carries it."""
        arm = self._plant.arm
        axes = np.array([[1.0, 0, 0] if arm.links[c.link].axis == "x" else [0, 0, 1.0] for c in arm.contacts])
        across = np.cross(axes.reshape(-1, 3), np.array([c.point for c in arm.contacts]).reshape(-1, 3))
        self._radius = np.sqrt((across**2).sum(1))
        self._tangent = across / self._radius[:, None]
        self._sliding = np.array([c.link for c in arm.contacts], int)
        self._bristles = np.zeros(len(arm.contacts))
        self._force = np.zeros(len(arm.contacts))

    def _build(self, n: int) -> None:
        tree, plant = self._tree, self._plant
        exu.config.printToConsole = False  # it warns of what user functions cost
        self._container = exu.SystemContainer()
        self._mbs = self._container.AddSystem()
        zeros = [0.0] * n
        node = self._mbs.AddNode(
            items.NodeGenericODE2(
                referenceCoordinates=zeros,
                initialCoordinates=zeros,
                initialCoordinates_t=zeros,
                numberOfODE2Coordinates=n,
            )
        )
        spring, damper, self._hold, self._turn = np.zeros((4, n))
        spring[tree.joints], damper[tree.joints] = plant.servo, SERVO_DAMPING * plant.servo
        self._hold[tree.twists] = [link.boom.misfit for link in plant.arm.links if link.boom is not None]
        for k, stiffness, damping in tree.flexible:
            spring[k], damper[k] = stiffness, damping * stiffness
        nothing = exu.Vector3DList([[0.0, 0.0, 0.0]] * n)
        self._object = self._mbs.AddObject(
            items.ObjectKinematicTree(
                nodeNumber=node,
                gravity=[0.0, 0.0, -plant.gravity],
                jointTypes=tree.kinds,
                linkParents=list(range(-1, n - 1)),
                jointTransformations=exu.Matrix3DList([np.eye(3)] * n),
                jointOffsets=exu.Vector3DList([list(x) for x in tree.offsets]),
                linkInertiasCOM=exu.Matrix3DList(tree.inertias),
                linkCOMs=exu.Vector3DList([list(x) for x in tree.coms]),
                linkMasses=tree.masses,
                jointPControlVector=spring,
                jointDControlVector=damper,
                jointPositionOffsetVector=list(self._hold),
                jointVelocityOffsetVector=zeros,
                linkForces=nothing,
                linkTorques=nothing,
            )
        )
        kinds = exu.OutputVariableType
        self._sensors = [
            [
                self._mbs.AddSensor(
                    items.SensorKinematicTree(
                        objectNumber=self._object,
                        linkNumber=b,
                        localPosition=[0.0, 0.0, 0.0],
                        outputVariableType=kind,
                        writeToFile=False,
                    )
                )
                for b in self._bodies
            ]
            for kind in (kinds.Position, kinds.RotationMatrix)
        ]
        self._mbs.SetPreStepUserFunction(self._before_step)
        self._mbs.Assemble()

    def _poses(self) -> tuple[Array, Array]:
        position, rotation = (np.array([self._mbs.GetSensorValues(k) for k in sensors]) for sensors in self._sensors)
        return position, rotation.reshape(-1, 3, 3)

    def _before_step(self, mbs: exu.MainSystem, _: float) -> bool:
        """Forces for the coming step, at the end of which Exudyn balances them: from where the arm will then be."""
        self._count += 1
        position, rotation = self._poses()
        turned = rotation[self._index]
        points = position[self._index] + np.einsum("kij,kj->ki", turned, self._points)
        if self._count == 0:
            weight = np.array([u.weight for u in self._plant.arm.units])
            self._slings = Slings(self._plant.suspension, weight, points[: self._units])
            self._were, self._slid = points, np.zeros(len(self._tree.joints))
        points, self._were = 2 * points - self._were, points
        system = mbs.systemData
        coordinates, rates = system.GetODE2Coordinates(), system.GetODE2Coordinates_t()
        q, qd = coordinates[self._tree.joints], rates[self._tree.joints]
        after = self._count - self._before
        if after >= 0 and after % self._every == 0:
            ahead, faster = self._hold[self._tree.joints] - q, self._turn[self._tree.joints] - qd
            tau = self._plant.servo * (ahead + SERVO_DAMPING * faster)
            twist = coordinates[self._tree.twists]
            self._log.append((tau, self._slings.tension, q, qd, self._force, twist))
        force = np.empty_like(points)
        force[: self._units], points[: self._units] = self._slings.step(points[: self._units], PERIOD)
        if self._plant.slide is not None:
            speed = (2 * qd - self._slid)[self._sliding] * self._radius
            self._slid = qd
            self._bristles, self._force = self._plant.slide.step(self._bristles, speed, PERIOD)
        force[self._units :] = -self._force[:, None] * np.einsum("kij,kj->ki", turned[self._units :], self._tangent)
        moment = points[:, [1, 2, 0]] * force[:, [2, 0, 1]] - points[:, [2, 0, 1]] * force[:, [1, 2, 0]]
        # As measured against a textbook case (Exudyn 1.13): the tree takes a body's wrench about the world's origin,
        # and with the other sign.
        mbs.SetObjectParameter(self._object, "linkForces", exu.Vector3DList((-self._gather @ force).tolist()))
        mbs.SetObjectParameter(self._object, "linkTorques", exu.Vector3DList((-self._gather @ moment).tolist()))
        self._command()
        return True

    def _command(self) -> None:
        """Position and rate that Exudyn's own loop holds over the coming step.

        The servo sees the motor's resolver, before a gear of high ratio: it is stiff, and the link-side encoders'
        noise does not go round. The loop is integrated with the arm, so that its stiffness does not set the step.
        """
        wanted, rate = (w[min(self._count + 1, self._steps)] for w in self._wanted)
        self._hold[self._tree.joints], self._turn[self._tree.joints] = wanted, rate
        self._mbs.SetObjectParameter(self._object, "jointPositionOffsetVector", self._hold)
        self._mbs.SetObjectParameter(self._object, "jointVelocityOffsetVector", self._turn)

    def go(self) -> None:
        """Integrate; generalised-alpha with numerical damping above the booms' modes."""
        settings = exu.SimulationSettings()
        settings.timeIntegration.numberOfSteps = self._steps
        settings.timeIntegration.endTime = self._steps * PERIOD
        settings.timeIntegration.verboseMode = 0
        settings.timeIntegration.newton.useModifiedNewton = True
        settings.timeIntegration.generalizedAlpha.spectralRadius = 0.9
        settings.solution.file.write = False
        settings.linearSolver.solverType = exu.LinearSolverType.EXUdense
        self._mbs.SolveDynamic(settings)

    def record(self) -> RigRecord:
        """What was logged, through the torque sensors."""
        tau, tension, q, qd, friction, twist = (np.array(column) for column in zip(*self._log, strict=True))
        sensors, rng = self._plant.sensors, self._rng
        time = np.arange(len(q)) * self._every * PERIOD
        read = q + sensors.encoder_noise * rng.standard_normal(q.shape)
        read = np.round(read / sensors.encoder_step) * sensors.encoder_step
        drift = np.asarray(sensors.torque_drift or np.zeros(q.shape[1]))
        seen = tau + sensors.torque_noise * rng.standard_normal(tau.shape) + np.outer(time / time[-1], drift)
        if sensors.torque_step:
            seen = np.round(seen / sensors.torque_step) * sensors.torque_step
        return RigRecord(time, read, seen, tension, q, qd, tau, friction, twist)
