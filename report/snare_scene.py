"""A recorded capture as a 3-D scene: cables, rings, pin with its knob, and a mark at each contact."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from pydrake.geometry import Cylinder, Sphere
from scipy.interpolate import CubicSpline

from ..models.snare.history import SnareHistory
from ..models.snare.parameters import SnareParameters
from .playback import Playback

CABLES = ("#0072B2", "#009E73", "#56B4E9")
PIN, KNOB, RINGS, CONTACT = "#D55E00", "#E69F00", "#56616B", "#CC1111"
_PIECES = 24
_RING_THICKNESS = 0.003
"""Radius of the drawn rings [m], which are not modelled."""


@dataclass(frozen=True)
class SceneData:
    """What there is to see of a capture.

    Parameters
    ----------
    times : array (n_times,)
        [s]
    target_position, target_quaternion : arrays (n_times, 3) and (n_times, 4)
        Of the pin's foot [m]; w first.
    cables : array (n_times, 3, n_nodes, 3)
        Positions of the cables' nodes [m].
    contact_points : sequence of arrays (n_contacts, 3)
        One entry a time: where the cables touch the pin [m]. Empty where that is not known.
    """

    times: np.ndarray
    target_position: np.ndarray
    target_quaternion: np.ndarray
    cables: np.ndarray
    contact_points: Sequence[np.ndarray] = ()

    @classmethod
    def of(cls, history: SnareHistory) -> "SceneData":
        """Of a run of the snare alone."""
        h = history
        return cls(h.times, h.target_position, h.target_quaternion, h.cables, h.contact_points)


def snare_scene(seen: SceneData, parameters: SnareParameters) -> Playback:
    """The scene, with a snare that stands at the world's origin; its axis points along x.

    Parameters
    ----------
    seen : SceneData
    parameters : SnareParameters
    """
    scene, times, p = Playback(), seen.times, parameters
    along = np.linspace(0, 1, _PIECES + 1)
    for cable, colour in enumerate(CABLES):
        nodes = seen.cables[:, cable]
        smooth = CubicSpline(np.linspace(0, 1, nodes.shape[1]), nodes, axis=1)(along)
        scene.curve(f"cables/{cable}", p.cable_radius, times, smooth, colour)
        for name, end in (("fixed", 0), ("rotating", -1)):
            scene.body(f"ends/{name}/{cable}", Sphere(3 * p.cable_radius), RINGS)
            scene.move(f"ends/{name}/{cable}", times, nodes[:, end])
    turn = np.linspace(0, 2 * np.pi, 73)
    for name, x in (("fixed", 0.0), ("rotating", p.ring_distance)):
        circle = np.stack([np.full_like(turn, x), p.ring_radius * np.cos(turn), p.ring_radius * np.sin(turn)], axis=-1)
        scene.curve(f"rings/{name}", _RING_THICKNESS, 0.0, circle[None], RINGS)
    _add_pin(scene, seen, p)
    _add_contacts(scene, seen)
    scene.camera([-0.2, 0.13, 0.2], [0.06, 0.0, 0.0])
    return scene


def _add_pin(scene: Playback, seen: SceneData, p: SnareParameters) -> None:
    # A cylinder's axis is z, the pin's −x: a quarter turn about y, after which the body is shifted along the pin.
    quarter = np.array([np.sqrt(0.5), 0.0, np.sqrt(0.5), 0.0])
    turns = _product(seen.target_quaternion, quarter)
    neck = p.pin_length - p.knob_length
    for name, radius, low, high, colour in (
        ("pin/shaft", p.pin_radius, 0.0, neck, PIN),
        ("pin/knob", p.knob_radius, neck, p.pin_length, KNOB),
    ):
        scene.body(name, Cylinder(radius, high - low), colour)
        w, x, y, z = seen.target_quaternion.T
        axis = np.stack([w**2 + x**2 - y**2 - z**2, 2 * (x * y + w * z), 2 * (x * z - w * y)], axis=-1)
        scene.move(name, seen.times, seen.target_position - 0.5 * (low + high) * axis, turns)


def _add_contacts(scene: Playback, seen: SceneData) -> None:
    """One mark for each contact that there is at once; hidden, where it was last, while there are fewer."""
    counts = np.array([len(points) for points in seen.contact_points], int)
    for mark in range(counts.max(initial=0)):
        visible = counts > mark
        last = np.maximum.accumulate(np.where(visible, np.arange(counts.size), np.argmax(visible)))
        places = np.array([seen.contact_points[k][mark] for k in last])
        scene.body(f"contacts/{mark}", Sphere(0.006), CONTACT)
        scene.move(f"contacts/{mark}", seen.times, places)
        scene.show(f"contacts/{mark}", seen.times, visible)


def _product(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """Hamilton product of quaternions (n_times, 4) with one (4,), w first."""
    w, v, u = first[:, :1], first[:, 1:], second[1:]
    return np.hstack([w * second[0] - (v @ u)[:, None], w * u + second[0] * v + np.cross(v, u)])
