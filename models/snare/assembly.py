"""The snare as Exudyn's items: ANCF cables, ring joints, contact as one generic object, and the target's body.

Coordinates are ordered cable by cable, node by node, (r, r') each; the target's follow. Cables are straight when free
of stress (`strainIsRelativeToReference` = 0): Exudyn's other choice is not frame-indifferent in three dimensions.
Nor is its damping in bending: `damping` takes its place.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any, cast

import numpy as np
from scipy.spatial.transform import Rotation

from ..exudyn_build import exudyn, items
from .contact import CONTACT_SIZE, MOST_CONTACTS
from .drive import PATH_SIZE, Pose, frame_at, ring_ends, ring_motion
from .ends import RING_SPIN
from .forces import MOST_CROSSINGS, system_forces, system_jacobian
from .geometry import N_CABLES
from .law import law_constants
from .line import CLEARANCE, DAMPING, DOWN, FREE_LENGTH, LINE_SIZE, LOCAL, STIFFNESS, TAUT, TOP
from .parameters import SnareParameters
from .pin import pin_cylinders
from .target import Target

Drive = Callable[[float], tuple[float, float]]


@dataclass
class SnareAssembly:
    """The built system, and the arrays through which the compiled functions see it.

    Parameters
    ----------
    parameters : SnareParameters
    target : Target
    nodes : array (3, n_nodes, 2, 3)
        Cables at the start, in the world.
    effector : Pose
        The end effector's at the start.
    drive : callable or None
        Angle and rate of the ring at a time, in place of the parameters' ramp.
    """

    parameters: SnareParameters
    target: Target
    nodes: np.ndarray
    effector: Pose
    drive: Drive | None = None
    container: Any = field(init=False)
    system: Any = field(init=False)

    def __post_init__(self) -> None:
        """Build and assemble."""
        p = self.parameters
        self.n_elements = self.nodes.shape[1] - 1
        self.size = p.cable_length / self.n_elements
        self.n_cable_coordinates = self.nodes.size
        self.n_pin = 0 if self.target.support == "moved" else 7 if self.target.rotates else 3
        self.cylinders = pin_cylinders(p)
        self.law = law_constants(p)
        self.line = np.zeros(LINE_SIZE)
        self.effector_path = np.zeros(PATH_SIZE)
        self.target_path = np.zeros(PATH_SIZE)
        self.pin = target_pose(self.target).frame()
        self.euler = np.zeros((2, 4))
        self.euler[0] = self.target.orientation
        self.ends = np.zeros((6, 3))
        self.end_speeds = np.zeros((6, 3))
        self._placed = np.nan
        self.frame = self.effector.frame()
        tangents = self.nodes[:, [0, -1], 1] @ self.effector.rotation
        self._rest = tangents / np.linalg.norm(tangents, axis=-1, keepdims=True)
        self.container = exudyn.SystemContainer()
        self.system = self.container.AddSystem()
        self._add_cables()
        self._add_target()
        self._add_contact()
        self.system.Assemble()

    def _add_cables(self) -> None:
        self.cable_nodes = [node for cable in self.nodes for node in add_cable(self.system, cable, self.parameters)]
        self._add_ends()

    def _add_ends(self) -> None:
        """Hold the six cable ends on the rings, all with one constraint."""
        system, n = self.system, self.n_elements
        end_nodes = [self.cable_nodes[c * (n + 1) + k] for c in range(N_CABLES) for k in (0, n)]
        carrier = system.AddObject(items.ObjectGenericODE2(nodeNumbers=end_nodes))
        marker = system.AddMarker(items.MarkerObjectODE2Coordinates(objectNumber=carrier))
        jacobian = np.zeros((18, 36))
        for end in range(6):
            jacobian[3 * end : 3 * end + 3, 6 * end : 6 * end + 3] = np.eye(3)
        rows = np.concatenate([6 * end + np.arange(3) for end in range(6)])

        def residual(_system: Any, time: float, _item: int, q: Any, _rates: Any, _level: bool) -> list[float]:
            self.place(time)
            return (np.asarray(q)[rows] - self.ends.ravel()).tolist()  # this marker's q includes the reference

        def derivative(*_: Any) -> Any:
            return jacobian

        self._hold_ends(marker, residual, derivative)

    def _hold_ends(self, marker: Any, residual: Any, derivative: Any) -> None:
        """One constraint of the ends' 18 coordinates at a marker, and the ground that it holds them to."""
        system = self.system
        self.ground = system.AddObject(items.ObjectGround())
        still = system.AddMarker(items.MarkerNodeCoordinates(nodeNumber=system.AddNode(items.NodePointGround())))
        self.ends_object = system.AddObject(
            items.ObjectConnectorCoordinateVector(
                markerNumbers=[still, marker],
                scalingMarker0=np.zeros((18, 1)),
                constraintUserFunction=residual,
                jacobianUserFunction=derivative,
            )
        )

    def ring_at(self, time: float) -> tuple[float, float]:
        """Angle [rad] and rate [rad/s] of the ring at a time [s]."""
        if self.drive is not None:
            return self.drive(time)
        p = self.parameters
        return ring_motion(time, p.ring_rate, p.ring_travel, p.ring_ramp)

    def place(self, time: float) -> None:
        """Bring to a time [s] what moves by itself: end effector, rings, cable ends and their fittings, a moved target.

        Nothing is done where it stands there already: an implicit step asks several times. `lift` makes it ask again.
        """
        if time == self._placed:
            return
        p = self.parameters
        angle, self._ring_rate = self.ring_at(time)
        if not self.n_pin:
            frame_at(self.target_path, time, self.pin)
        frame_at(self.effector_path, time, self.frame)
        radius, distance, direction = p.ring_radius, p.ring_distance, p.ring_direction
        ring_ends(self.frame, radius, distance, direction, angle, self._ring_rate, self.ends, self.end_speeds)
        self._turn_fittings(angle)
        self._placed = time

    def lift(self) -> None:
        """Forget where things were placed, as a path or a frame is another."""
        self._placed = np.nan

    def ring_spin(self) -> tuple[float, float, float]:
        """Angular velocity of the rotating ring in the world [rad/s], where it was placed last."""
        x, y, z = (self.frame[2] + self.parameters.ring_direction * self._ring_rate * self.frame[3:, 0]).tolist()
        return x, y, z

    def _turn_fittings(self, angle: float) -> None:
        """Bring the fittings of the ends to the end effector's frame and the ring's angle [rad]; see `ends`."""
        p, fittings = self.parameters, self.moving[4]
        fittings[RING_SPIN] = self.frame[2]
        if p.end_stiffness > 0:
            turn = Rotation.from_euler("x", p.ring_direction * angle).as_matrix()
            fittings[0:6:2] = self._rest[:, 0] @ self.frame[3:].T
            fittings[1:6:2] = self._rest[:, 1] @ turn.T @ self.frame[3:].T

    def _add_target(self) -> None:
        target, system = self.target, self.system
        if target.support == "moved":
            return
        if target.rotates:
            node = system.AddNode(
                items.NodeRigidBodyEP(
                    referenceCoordinates=[*target.position, *target.orientation],
                    initialVelocities=[*target.velocity, *self._euler_rates()],
                )
            )
            centre = np.asarray(target.centre_of_mass)
            steiner = centre @ centre * np.eye(3) - np.outer(centre, centre)
            inertia = np.asarray(target.inertia) + target.mass * steiner
            body = system.AddObject(
                items.ObjectRigidBody(
                    nodeNumber=node,
                    mass=target.mass,
                    inertia=[inertia[i, j] for i, j in ((0, 0), (1, 1), (2, 2), (1, 2), (0, 2), (0, 1))],
                    centerOfMass=list(target.centre_of_mass),
                )
            )
        else:
            node = system.AddNode(
                items.NodePoint(referenceCoordinates=list(target.position), initialVelocities=list(target.velocity))
            )
            body = system.AddObject(items.ObjectMassPoint(mass=target.mass, nodeNumber=node))
        self.target_node = node
        if target.hangs:
            self._hang(body)
        if target.umbilical > 0:
            self._tether(body)

    def _tether(self, body: int) -> None:
        """An extra cable: a spring from the pin's foot to where it starts."""
        foot = self.system.AddMarker(items.MarkerBodyPosition(bodyNumber=body))
        start = self.system.AddMarker(
            items.MarkerBodyPosition(bodyNumber=self.ground, localPosition=list(self.target.position))
        )
        self.system.AddObject(
            items.CartesianSpringDamper(markerNumbers=[start, foot], stiffness=[self.target.umbilical] * 3)
        )

    def _euler_rates(self) -> np.ndarray:
        a, b, c, d = self.target.orientation
        turn = 0.5 * np.array([[-b, -c, -d], [a, d, -c], [-d, a, b], [c, -b, a]])
        return turn @ self.target.angular_velocity

    def _hang(self, body: int) -> None:
        target, system = self.target, self.system
        rotation = quaternion_matrix(target.orientation)
        local = np.asarray(target.hang_point) if target.rotates else np.zeros(3)
        gravity = np.asarray(target.gravity)
        strength = float(np.linalg.norm(gravity))
        above = np.asarray(target.position) + rotation @ local - target.line_length * gravity / strength
        self.hang_top = above
        self.free_length = target.line_length - target.mass * strength / target.stiffness
        top = system.AddMarker(items.MarkerBodyPosition(bodyNumber=self.ground, localPosition=above.tolist()))
        foot = system.AddMarker(items.MarkerBodyPosition(bodyNumber=body, localPosition=local.tolist()))
        weight = system.AddMarker(items.MarkerBodyMass(bodyNumber=body))
        system.AddLoad(items.LoadMassProportional(markerNumber=weight, loadVector=gravity.tolist()))
        if target.clearance > 0:
            stiffness = TAUT if target.support == "pendulum" else target.stiffness
            self.line[STIFFNESS], self.line[CLEARANCE] = stiffness, target.clearance
            self.line[FREE_LENGTH] = target.line_length - target.mass * strength / stiffness
            self.line[DAMPING] = 0.0 if target.support == "pendulum" else target.damping
            self.line[DOWN], self.line[TOP], self.line[LOCAL] = gravity / strength, above, local
        elif target.support == "pendulum":
            system.AddObject(items.DistanceConstraint(markerNumbers=[top, foot], distance=target.line_length))
        else:
            system.AddObject(
                items.SpringDamper(
                    markerNumbers=[top, foot],
                    stiffness=target.stiffness,
                    damping=target.damping,
                    referenceLength=self.free_length,
                )
            )

    def _add_contact(self) -> None:
        nodes = list(self.cable_nodes) + ([self.target_node] if self.n_pin else [])
        reference = np.concatenate([self.nodes.ravel(), self._target_reference()])
        data = self.system.systemData  # the same state as arrays: lists, as handed over, cost as much as contact

        def forces(_system: Any, time: float, _item: int, _q: Any, _rates: Any) -> list[float]:
            self.place(time)
            state = data.GetODE2Coordinates(), data.GetODE2Coordinates_t()
            return system_forces(*state, self.fixed, self.moving).tolist()  # the engine reads arrays number by number

        def jacobian(
            _system: Any, time: float, _item: int, _q: Any, _rates: Any, factor: float, rate_factor: float
        ) -> exudyn.MatrixContainer:
            self.place(time)
            state = data.GetODE2Coordinates(), data.GetODE2Coordinates_t()
            triplets = system_jacobian(*state, self.fixed, self.moving, factor, rate_factor)
            matrix = exudyn.MatrixContainer()
            matrix.SetWithSparseMatrix(triplets, len(reference), len(reference), useDenseMatrix=False)
            return matrix

        p = self.parameters
        self.reference = reference
        self.fixed = (
            reference, self.n_elements, self.size, self.n_pin, self.cylinders, self.law,
            p.cable_radius, p.end_stiffness, p.end_friction, self.line,
        )  # fmt: skip
        self.moving = (
            self.pin,
            self.euler,
            np.zeros((MOST_CONTACTS, CONTACT_SIZE)),
            np.zeros((MOST_CROSSINGS, 5)),
            np.zeros((8, 3)),
        )
        self.contact_object = self.system.AddObject(
            items.ObjectGenericODE2(
                nodeNumbers=nodes, forceUserFunction=cast(Any, forces), jacobianUserFunction=cast(Any, jacobian)
            )
        )

    def _target_reference(self) -> np.ndarray:
        if self.n_pin == 0:
            return np.zeros(0)
        if self.n_pin == 3:
            return np.array(self.target.position)
        return np.array([*self.target.position, *self.target.orientation])


def add_cable(system: Any, nodes: np.ndarray, parameters: SnareParameters) -> list[int]:
    """Add one cable of ANCF elements to an Exudyn system; returns its nodes' numbers.

    Parameters
    ----------
    system : exudyn.MainSystem
    nodes : array (n_elements + 1, 2, 3)
        Position [m] and slope dr/ds of each node at the start.
    parameters : SnareParameters
    """
    p = parameters
    numbers = [system.AddNode(items.NodePointSlope1(referenceCoordinates=node.ravel().tolist())) for node in nodes]
    for first, second in pairwise(numbers):
        system.AddObject(
            items.ObjectANCFCable(
                length=p.cable_length / (len(nodes) - 1),
                massPerLength=p.mass_per_length,
                bendingStiffness=p.bending_stiffness,
                axialStiffness=p.axial_stiffness,
                axialDamping=p.axial_damping * p.axial_stiffness,
                referenceAxialStrain=-p.prestrain,
                strainIsRelativeToReference=0.0,
                nodeNumbers=[first, second],
                useReducedOrderIntegration=2,
            )
        )
    return numbers


def quaternion_matrix(orientation: Any) -> np.ndarray:
    """Rotation matrix of a quaternion, w first."""
    return Rotation.from_quat(orientation, scalar_first=True).as_matrix()


def target_pose(target: Target) -> Pose:
    """The target's pose and twist at the start."""
    return Pose(
        np.array(target.position),
        quaternion_matrix(target.orientation),
        np.array(target.velocity),
        np.array(target.angular_velocity),
    )
