"""A capture in orbit as one Exudyn system: base, arm, cables, contact and target; what a co-simulation is held against.

Base and arm are Exudyn's own kinematic tree, six joints of which carry the base. Cables end on rings at the tip: their
18 constraints reach into the tree's coordinates. A pin that is fixed to the base gives the contact's wrench to the
tree; a floating target is a rigid body of its own, as in `SnareAssembly`. Joint friction is Makkar's law, rotors add to
the tree's mass matrix.
"""

from collections.abc import Mapping
from typing import Any, cast

import numpy as np

from ...errors import InputError
from ..exudyn_build import exudyn, items
from ..floating.arm import FloatingArm
from ..inertia import Array, to_central
from ..snare.assembly import SnareAssembly
from ..snare.contact import CONTACT_SIZE, MOST_CONTACTS
from ..snare.drive import Pose, ring_ends, ring_motion
from ..snare.ends import REACTION
from ..snare.forces import MOST_CROSSINGS, system_forces, system_jacobian
from ..snare.line import LINE_SIZE
from ..snare.parameters import SnareParameters
from ..snare.target import Target
from .kinematics import TreeFrames


class MonolithicAssembly(SnareAssembly):
    """`SnareAssembly` with base and arm inside; positions are from where the tip starts.

    Parameters
    ----------
    parameters, target, nodes, effector
        As `SnareAssembly` takes them; a ``moved`` target is fixed to the base, at the arm's mount.
    arm : FloatingArm
        Its tip is the end effector.
    start : array (6 + J,)
        Coordinates of base and joints at the start, see `kinematics`.
    friction : mapping of str to float
        Makkar's parameters, the same for each joint.
    rotor : float
        Inertia of each rotor times the square of its gear's ratio [kg·m²].
    """

    def __init__(
        self,
        parameters: SnareParameters,
        target: Target,
        nodes: Array,
        effector: Pose,
        arm: FloatingArm,
        start: Array,
        friction: Mapping[str, float],
        rotor: float,
    ) -> None:
        """Build and assemble; raises InputError for cable ends with a stiffness, which are not modelled here."""
        if parameters.end_stiffness > 0:
            raise InputError(
                f"monolithic capture: end_stiffness is {parameters.end_stiffness:g} N*m/rad; give 0, or co-simulate"
            )
        self.arm, self.start, self.friction, self.rotor = arm, start, friction, rotor
        self.n_tree = len(start)
        self.frames = TreeFrames(arm)
        super().__init__(parameters, target, nodes, effector)

    def _add_ends(self) -> None:
        self._add_tree()
        system, n = self.system, self.n_elements
        end_nodes = [self.cable_nodes[c * (n + 1) + k] for c in range(3) for k in (0, n)]
        carrier = system.AddObject(items.ObjectGenericODE2(nodeNumbers=[*end_nodes, self.tree_node]))
        marker = system.AddMarker(items.MarkerObjectODE2Coordinates(objectNumber=carrier))
        rows = np.concatenate([6 * end + np.arange(3) for end in range(6)])
        matrix = np.zeros((18, 36 + self.n_tree))
        for end in range(6):
            matrix[3 * end : 3 * end + 3, 6 * end : 6 * end + 3] = np.eye(3)
        still = np.zeros(self.n_tree)

        def residual(_system: Any, time: float, _item: int, q: Any, _rates: Any, _level: bool) -> np.ndarray:
            q = np.asarray(q)
            frame, _ = self.frames(q[36:], still)[0]
            return q[rows] - self._ring_ends(frame, time)

        def derivative(_system: Any, time: float, _item: int, q: Any, _rates: Any, _level: bool) -> np.ndarray:
            frame, jacobian = self.frames(np.asarray(q)[36:], still)[0]
            self._ring_ends(frame, time)
            for end, arm in enumerate(self.ends - frame[0]):
                turning = np.cross(jacobian[3:].T, arm).T  # of a unit of each rate: axis x arm
                matrix[3 * end : 3 * end + 3, 36:] = -(jacobian[:3] + turning)
            return matrix

        self._hold_ends(marker, residual, derivative)

    def _ring_ends(self, frame: Array, time: float) -> Array:
        p = self.parameters
        angle, rate = ring_motion(time, p.ring_rate, p.ring_travel, p.ring_ramp)
        ring_ends(frame, p.ring_radius, p.ring_distance, p.ring_direction, angle, rate, self.ends, self.end_speeds)
        self._ring_rate = rate
        return self.ends.ravel()

    def _add_tree(self) -> None:
        """Base and arm, and in their joints friction and rotors."""
        whole, system = self.arm.whole, self.system
        engine: Any = exudyn  # its stubs give the lists no arguments
        kinds = []
        for joint in whole.joints:
            along = int(np.argmax(joint.axis))
            if joint.axis[along] < 1 - 1e-12:
                raise InputError(f"monolithic capture: {joint.name} turns about {joint.axis}; give an axis x, y or z")
            kinds.append(getattr(engine.JointType, f"{joint.kind.title()}{'XYZ'[along]}"))
        bodies = [to_central(link.phi) for link in whole.links]
        self.tree_node = system.AddNode(
            items.NodeGenericODE2(
                numberOfODE2Coordinates=self.n_tree,
                referenceCoordinates=self.start.tolist(),
                initialCoordinates=[0.0] * self.n_tree,
                initialCoordinates_t=[0.0] * self.n_tree,
            )
        )
        system.AddObject(
            items.ObjectKinematicTree(
                nodeNumber=self.tree_node,
                jointTypes=kinds,
                linkParents=[joint.parent for joint in whole.joints],
                jointTransformations=engine.Matrix3DList([joint.rotation for joint in whole.joints]),
                jointOffsets=engine.Vector3DList([joint.translation for joint in whole.joints]),
                linkInertiasCOM=engine.Matrix3DList([inertia for _, _, inertia in bodies]),
                linkCOMs=engine.Vector3DList([centre for _, centre, _ in bodies]),
                linkMasses=[mass for mass, _, _ in bodies],
            )
        )
        rotors = np.diag(np.concatenate([np.zeros(6), np.full(self.n_tree - 6, self.rotor)]))

        def forces(_system: Any, _time: float, _item: int, _q: Any, rates: Any) -> np.ndarray:
            return np.concatenate([np.zeros(6), -makkar(self.friction, np.asarray(rates)[6:])[0]])

        def jacobian(
            _system: Any, _time: float, _item: int, _q: Any, rates: Any, _factor: float, rate_factor: float
        ) -> exudyn.MatrixContainer:
            slope = np.concatenate([np.zeros(6), makkar(self.friction, np.asarray(rates)[6:])[1]])
            matrix = exudyn.MatrixContainer()
            matrix.SetWithDenseMatrix(np.diag(rate_factor * slope), useDenseMatrix=True)
            return matrix

        system.AddObject(
            items.ObjectGenericODE2(
                nodeNumbers=[self.tree_node],
                massMatrix=rotors,
                forceUserFunction=cast(Any, forces),
                jacobianUserFunction=cast(Any, jacobian),
            )
        )

    def tree_state(self) -> tuple[Array, Array]:
        """Coordinates and rates of base and joints now, each (6 + J,)."""
        data, here = self.system.systemData, slice(self.n_cable_coordinates, self.n_cable_coordinates + self.n_tree)
        return data.GetODE2Coordinates()[here] + self.start, data.GetODE2Coordinates_t()[here]

    def others(self, vector: Array) -> Array:
        """Cables and target of a vector of all coordinates."""
        n = self.n_cable_coordinates
        return np.concatenate([vector[:n], vector[n + self.n_tree :]])

    def place(self, time: float) -> None:
        """Bring tip, cable ends, fittings, and a pin that is fixed to the base, to the present state."""
        self._follow(*self.tree_state(), time)
        self._ring_ends(self.frame, time)

    def _follow(self, coordinates: Array, rates: Array, time: float) -> tuple[Array, Array]:
        """Bring pin and fittings to a state of the tree; returns the Jacobians of tip and pin, each (6, 6 + J)."""
        (tip, of_tip), (pin, of_pin), _ = self.frames(coordinates, rates)
        self.frame[:] = tip
        if not self.n_pin:
            self.pin[:] = pin
        self._turn_fittings(self.ring_at(time)[0])
        return of_tip, of_pin

    def _add_contact(self) -> None:
        reference, p = np.concatenate([self.nodes.ravel(), self._target_reference()]), self.parameters
        n, n_cables = len(reference), self.n_cable_coordinates

        def forces(_system: Any, time: float, _item: int, q: Any, rates: Any) -> np.ndarray:
            q, rates = np.asarray(q), np.asarray(rates)
            of_tip, of_pin = self._follow(q[n:] + self.start, rates[n:], time)
            on_others = system_forces(q[:n], rates[:n], self.fixed, self.moving)
            reaction = self.moving[4][REACTION]
            on_tree = of_tip[3:].T @ reaction
            if not self.n_pin:
                pairs = on_others.reshape(-1, 3), (q[:n_cables] + reference).reshape(-1, 3)
                force = pairs[0][0::2].sum(axis=0)  # of the nodes' positions; slopes carry moments alone
                moment = np.cross(pairs[1], pairs[0]).sum(axis=0) + reaction - np.cross(self.pin[0], force)
                on_tree = on_tree - of_pin.T @ np.concatenate([force, moment])
            return np.concatenate([on_others, on_tree])

        def jacobian(
            _system: Any, time: float, _item: int, q: Any, rates: Any, factor: float, rate_factor: float
        ) -> exudyn.MatrixContainer:
            """Of cables and target alone: what the tree's own motion changes in a contact is lost in its mass."""
            q, rates = np.asarray(q), np.asarray(rates)
            self._follow(q[n:] + self.start, rates[n:], time)
            triplets = system_jacobian(q[:n], rates[:n], self.fixed, self.moving, factor, rate_factor)
            matrix = exudyn.MatrixContainer()
            matrix.SetWithSparseMatrix(triplets, n + self.n_tree, n + self.n_tree, useDenseMatrix=False)
            return matrix

        self.reference = reference
        self.fixed = (
            reference, self.n_elements, self.size, self.n_pin, self.cylinders, self.law, p.cable_radius,
            p.end_stiffness, p.end_friction, np.zeros(LINE_SIZE),
        )  # fmt: skip
        self.moving = (
            self.pin, self.euler,
            np.zeros((MOST_CONTACTS, CONTACT_SIZE)), np.zeros((MOST_CROSSINGS, 5)), np.zeros((8, 3)),
        )  # fmt: skip
        nodes = [*self.cable_nodes, *([self.target_node] if self.n_pin else []), self.tree_node]
        self.contact_object = self.system.AddObject(
            items.ObjectGenericODE2(
                nodeNumbers=nodes, forceUserFunction=cast(Any, forces), jacobianUserFunction=cast(Any, jacobian)
            )
        )


def makkar(values: Mapping[str, float], speed: Array) -> tuple[Array, Array]:
    """Makkar's friction torque at joint speeds, and its slope, each of the speeds' shape (Makkar et al. 2005)."""
    total, slope = values["viscous_coefficient"] * speed, np.full_like(speed, values["viscous_coefficient"])
    bump, base = values["stribeck_level"], values["stribeck_speed"]
    for level, width in (
        (bump, base),
        (-bump, base * values["stribeck_ratio"]),
        (values["coulomb_level"], values["coulomb_speed"]),
    ):
        bent = np.tanh(speed / width)
        total, slope = total + level * bent, slope + level / width * (1 - bent**2)
    return total, slope
