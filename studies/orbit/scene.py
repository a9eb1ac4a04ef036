"""A capture in orbit in 3-D: base, arm, the snare at its tip, pin and target."""

from collections.abc import Sequence

import numpy as np
from pydrake.geometry import Box, Cylinder, Sphere
from scipy.spatial.transform import Rotation

from ...models.floating.dynamics import link_origins, tip_pose
from ...models.floating.space_arm import BASE_LENGTH, BASE_RADIUS
from ...models.inertia import Array
from ...models.snare.parameters import SnareParameters
from ...report.playback import Playback
from ...report.snare_scene import CABLES, KNOB, PIN, RINGS
from .docked import DockingRun
from .setting import TARGET_SIDE, OrbitCapture, Setting

_ARM, _BASE, _TARGET = "#0072B2", "#9AA3AB", "#C9B37A"
_PER_SECOND = 15


def orbit_scene(
    start: Setting, capture: OrbitCapture, snare: SnareParameters, frames: Sequence[tuple[float, Array]]
) -> Playback:
    """The scene in the world; ``frames`` are times and the cables' nodes (3, n_nodes, 3) at them, see `co_simulate`."""
    scene, p = Playback(_PER_SECOND), snare
    times = np.arange(0.0, capture.times[-1], 1 / _PER_SECOND)
    rows = np.searchsorted(capture.times, times)
    tip, pin, base, q = (x[rows] for x in (capture.tip, capture.pin, capture.base, capture.q))
    arm = start.arm
    on_base = np.concatenate([link_origins(arm, q), tip_pose(arm, q).translation[:, None]], axis=1)
    chain = base[:, :1, :][:, 0, None] + np.einsum("nij,nkj->nki", base[:, 3:], on_base)
    scene.body("base", Cylinder(BASE_RADIUS, BASE_LENGTH), _BASE, 0.6)
    along_x = Rotation.from_euler("y", 90, degrees=True)
    scene.move("base", times, base[:, 0], _quaternions(base, along_x))
    scene.curve("arm", 0.09, times, chain[:, :-1], _ARM)
    scene.curve("wrist", 0.05, times, chain[:, -2:], _ARM)
    for i in range(chain.shape[1] - 1):
        scene.body(f"joints/{i + 1}", Sphere(0.16), RINGS)
        scene.move(f"joints/{i + 1}", times, chain[:, i])
    for name, x in (("fixed", 0.0), ("rotating", p.ring_distance)):
        scene.body(f"rings/{name}", Cylinder(p.ring_radius, 0.002), RINGS, 0.25)
        scene.move(f"rings/{name}", times, tip[:, 0] + x * tip[:, 3:, 0], _quaternions(tip, along_x))
    moments = np.array([time for time, _ in frames])
    nodes = np.array([points for _, points in frames])
    for cable, colour in enumerate(CABLES):
        scene.curve(f"cables/{cable}", p.cable_radius, moments, nodes[:, cable], colour)
    neck = p.pin_length - p.knob_length
    for name, radius, low, high, colour in (
        ("pin/shaft", p.pin_radius, 0.0, neck, PIN),
        ("pin/knob", p.knob_radius, neck, p.pin_length, KNOB),
    ):
        scene.body(name, Cylinder(radius, high - low), colour)
        scene.move(name, times, pin[:, 0] - 0.5 * (low + high) * pin[:, 3:, 0], _quaternions(pin, along_x))
    if start.case == "hover":
        scene.body("target", Box(TARGET_SIDE, TARGET_SIDE, TARGET_SIDE), _TARGET, 0.5)
        scene.move("target", times, pin[:, 0] + 0.5 * TARGET_SIDE * pin[:, 3:, 0], _quaternions(pin))
    side = tip[0, 3:] @ np.array([-0.35, 0.45, 0.45])
    scene.camera(tip[0, 0] + side, tip[0, 0] + 0.06 * tip[0, 3:, 0])
    return scene


PHASES = {
    "CLOSE": "blue", "SETTLE": "sky blue", "SNUG": "grey", "SLIDE": "green", "PULL": "yellow", "SEAT": "orange",
    "BACK_OFF": "brown", "PRELOAD": "vermilion", "LATCH": "purple", "LATCHED": "black",
}  # fmt: skip
"""Colour of the ball that shows the program's state; any other state is red."""
_COLOURS = {
    "blue": "#0072B2", "sky blue": "#56B4E9", "grey": "#9AA3AB", "green": "#009E73", "yellow": "#F0E442",
    "orange": "#E69F00", "brown": "#8C564B", "vermilion": "#D55E00", "purple": "#CC79A7", "black": "#000000",
    "red": "#CC1111",
}  # fmt: skip


def add_phases(scene: Playback, docked: DockingRun) -> None:
    """Show the program's state as a ball above the carriage, one colour a state."""
    capture = docked.capture
    times = np.arange(0.0, capture.times[-1], 1 / _PER_SECOND)
    rows = np.searchsorted(capture.times, times)
    place = capture.tip[rows, 0] + 0.28 * capture.tip[rows, 5]
    begins = np.array([begin for _, begin, _ in docked.whole.phases])
    now = np.searchsorted(begins, times, side="right") - 1
    names = np.array([PHASES.get(state, "red") for state, _, _ in docked.whole.phases])[now]
    for colour in dict.fromkeys(names.tolist()):
        scene.body(f"state/{colour}", Sphere(0.02), _COLOURS[colour])
        scene.move(f"state/{colour}", times, place)
        scene.show(f"state/{colour}", times, names == colour)


def _quaternions(frames: Array, turned: Rotation | None = None) -> Array:
    turn = Rotation.from_matrix(frames[:, 3:])
    return (turn * turned if turned else turn).as_quat(scalar_first=True)
