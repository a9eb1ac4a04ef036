"""Base and arm in one vector of coordinates, as a monolithic capture has them: where tip and pin are and go.

Coordinates c (6 + J,): the base's position, three turns Rx Ry Rz, then the joints. A frame on the tree has the twist
J(c) ċ in the world, linear before angular; `TreeFrames` writes pose and J of the tip and of the arm's mount.
"""

import casadi as ca
import numpy as np

from ..compiled import SampleFunction
from ..floating import symbols
from ..floating.arm import FloatingArm
from ..inertia import Array
from ..rotation import turn


class TreeFrames:
    """Compiled kinematics of an arm; raises InputError as `SampleFunction` does.

    Parameters
    ----------
    arm : FloatingArm
    """

    def __init__(self, arm: FloatingArm) -> None:
        """Write and compile."""
        n_joints = arm.n_joints
        c = ca.SX.sym("c", 6 + n_joints)
        place, q = c[:3], c[6:]
        turns = [turn(axis, c[3 + i]) for i, axis in enumerate(np.eye(3))]
        axes = ca.horzcat(ca.DM([1, 0, 0]), turns[0][:, 1], (turns[0] @ turns[1])[:, 2])
        rotation = turns[0] @ turns[1] @ turns[2]
        tip = symbols.tip(arm, q)
        mount_turn, mount_place = (ca.DM(part) for part in arm.mount or (np.eye(3), np.zeros(3)))
        outputs = []
        for turned, point, by_joints in (
            (tip.rotation, tip.translation, tip.by_joints[3:, :]),
            (mount_turn, mount_place, ca.SX(3, n_joints)),
            (ca.DM.eye(3), ca.DM.zeros(3), ca.SX(3, n_joints)),
        ):
            position = place + rotation @ point
            spin = ca.horzcat(ca.SX(3, 3), axes, rotation @ by_joints)
            outputs += [position, rotation @ turned, ca.vertcat(ca.jacobian(position, c), spin)]
        self._function = SampleFunction(ca.Function("frames", [c], [ca.densify(x) for x in ca.cse(outputs)]))

    def __call__(self, coordinates: Array, rates: Array) -> tuple[tuple[Array, Array], ...]:
        """Of tip, mount and base: the frame (6, 3; position, velocity, angular velocity, rotation) and J (6, 6 + J)."""
        shown = self._function(coordinates[None])
        found = []
        for k in range(3):
            position, rotation, jacobian = (part[0] for part in shown[3 * k : 3 * k + 3])
            frame = np.empty((6, 3))
            frame[0], frame[1:3], frame[3:] = position[:, 0], (jacobian @ rates).reshape(2, 3), rotation
            found.append((frame, jacobian))
        return tuple(found)
