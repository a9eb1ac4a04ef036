"""ETS-VII, the satellite with an arm of six joints that flew from 1997 to 1999, with its parameters as published.

Published with the inertias of links 2, 3 and 5 that no body can have: the largest principal moment exceeds the sum of
the other two. They are kept, since the studies that used them did; `FloatingArm.projected` gives the nearest inertias
that bodies can have, which lowers the peak base rate of the published run by 0.1 %.

Source: Dimitrov, bMSd, model_ETS7.m ("exact model of ETS VII"), after Yoshida (2003), Engineering Test Satellite VII
flight experiments for space robot dynamics and control, IJRR 22(5).
"""

import numpy as np
from scipy.spatial.transform import Rotation

from ..inertia import from_central
from ..tree import Joint, Link, Tree
from .arm import FloatingArm

_BASE = (2552.0, [6206.0, 3541.0, 7087.0, 48.16, 78.52, -29.22])

# mass; joint from the parent's centre of mass; centre of mass from the joint; roll, pitch, yaw of the joint's frame on
# the parent's as quarter turns; inertia about the centre of mass xx, yy, zz, xy, xz, yz
_LINKS = (
    (35.01, (-0.785, -0.295, 1), (0, 0, 0.175), (0, 0, 0), (1.218, 0.5132, 1.692, -0.07309, 0.00071, 0.1132)),
    (22.45, (0, 0.275, 0.175), (0.435, 0, 0), (-1, 0, -1), (0.102, 3.378, 3.752, 0, -0.00214, 0)),
    (21.89, (0.435, 0, 0), (0.315, 0, 0.275), (0, 0, 1), (0.4327, 2.266, 2.528, 0, -0.6328, 0)),
    (16.54, (0.315, 0, 0), (0, 0, -0.1335), (0, 0, -1), (0.3878, 0.3963, 0.07271, 0, 0.01675, 0)),
    (26.00, (0, 0, -0.1335), (0, 0, 0.1385), (1, 1, 0), (0.5727, 0.5987, 0.129, 0, -0.2313, 0)),
    (18.49, (0, 0, 0.1385), (0, 0, 0.266), (2, 1, 0), (0.165, 0.241, 0.259, 0.000781, -0.0145, -0.000137)),
)
_TIP = 0.266
"""End effector beyond the last link's centre of mass, along z [m]."""


def ets_vii(projected: bool = False) -> FloatingArm:
    """Base of 2552 kg at its centre of mass, arm of 140.38 kg; the tip is the end effector.

    ``projected``: links 2, 3 and 5 with the nearest inertias that bodies can have, instead of the published ones.
    """
    joints, links = [], []
    parent_com = np.zeros(3)
    for i, (mass, to_joint, com, quarters, moments) in enumerate(_LINKS):
        # exact quarter turns: rounded cosines would leave crumbs in every product
        rotation = np.round(Rotation.from_euler("XYZ", 90.0 * np.array(quarters), degrees=True).as_matrix())
        place = parent_com + np.array(to_joint, float)
        joints.append(Joint(f"joint{i + 1}", "revolute", np.array([0.0, 0.0, 1.0]), i - 1, rotation, place))
        links.append(Link(f"link{i + 1}", from_central(mass, com, _matrix(moments))))
        parent_com = np.array(com, float)
    tree = Tree("ets_vii", tuple(joints), tuple(links), np.zeros(3))
    base = from_central(_BASE[0], np.zeros(3), _matrix(_BASE[1]))
    tip = parent_com + np.array([0.0, 0.0, _TIP])
    arm = FloatingArm(tree, base, len(links) - 1, tip_translation=tip, as_published=True)
    return arm.projected() if projected else arm


def _matrix(moments: tuple[float, ...] | list[float]) -> np.ndarray:
    xx, yy, zz, xy, xz, yz = moments
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
