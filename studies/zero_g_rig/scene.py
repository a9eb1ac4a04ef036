"""The rig in 3-D along its recorded motion: the arm, its joints, and each sling with the carriage above it."""

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from pydrake.geometry import Box, Cylinder, Sphere

from ...models.rig.points import far_end, point_motion
from ...models.rig.rig import Rig
from ...report.playback import Playback
from .suspension import Suspension

Array = NDArray[np.float64]

FASTER = 10.0
"""Times the speed of the recording: its joints creep for three minutes."""

_ARM, _JOINT, _SLING, _CARRIAGE = "#0072B2", "#4A5560", "#E69F00", "#9AA3AB"
_PER_SECOND = 15


def rig_scene(rig: Rig, time: Array, q: Array) -> Playback:
    """The scene; time (n,) [s] and q (n, J) as recorded."""
    scene = Playback(_PER_SECOND)
    shown = np.arange(0.0, (time[-1] - time[0]) / FASTER, 1 / _PER_SECOND)
    q = q[np.searchsorted(time - time[0], FASTER * shown)]

    def along(link: int, point: Array) -> Array:
        return point_motion(rig, link, point, q, np.zeros_like(q)).position

    last = rig.n_joints - 1
    chain = [along(k, np.zeros(3)) for k in range(rig.n_joints)] + [along(last, far_end(rig, last))]
    # Joints that share an origin are one point of the line.
    kept = [chain[0], *(b for a, b in pairwise(chain) if np.abs(b - a).max() > 1e-6)]
    scene.curve("arm", 0.08, shown, np.stack(kept, axis=1), _ARM)
    for k, joint in enumerate(rig.joints):
        scene.body(f"joints/{joint.name}", Sphere(0.14), _JOINT)
        scene.move(f"joints/{joint.name}", shown, chain[k])
    up = np.array([0.0, 0.0, Suspension().length])
    for sling in rig.slings:
        hook = along(sling.link, sling.point)
        scene.body(f"slings/{sling.name}", Cylinder(0.015, up[2]), _SLING)
        scene.move(f"slings/{sling.name}", shown, hook + up / 2)
        scene.body(f"carriages/{sling.name}", Box(0.25, 0.25, 0.12), _CARRIAGE)
        scene.move(f"carriages/{sling.name}", shown, hook + up)
    middle = np.mean(kept[len(kept) // 2], axis=0)
    scene.camera(middle + np.array([3.0, -16.0, 9.0]), middle + np.array([0.0, 0.0, 2.5]))
    return scene
