"""Whether the closed snare has the pin inside, from the shapes of cables and pin alone."""

from collections.abc import Mapping

import numpy as np
from scipy.spatial.transform import Rotation

from ..models.snare.history import SnareHistory
from ..models.snare.parameters import SnareParameters

_ARC = 16


def encloses(history: SnareHistory, parameters: SnareParameters, time: int = -1) -> bool:
    """Whether the pin runs through the snare at a time; see `runs_through`.

    Parameters
    ----------
    history : SnareHistory
        Of an end effector at the origin.
    parameters : SnareParameters
    time : int
        Index.
    """
    return runs_through(history.cables[0], history.cables[time], *_pin(history, time), parameters)


def runs_through(
    first: np.ndarray, cables: np.ndarray, foot: np.ndarray, axis: np.ndarray, parameters: SnareParameters
) -> bool:
    """Whether the pin runs through the snare: it reaches through the mouth, and the cables wind around it.

    The cables and the rings between them make one closed loop. Seen along the axis it winds once around every point
    that is inside at the start, and this number changes only where a cable passes over the pin: a pin that escapes
    sideways is left with another one.

    Parameters
    ----------
    first, cables : array (3, n_nodes, 3)
        Nodes at the start and now, in the end effector's frame [m].
    foot, axis : array (3,)
        The pin's foot [m], and the direction from there to its tip, in the same frame.
    parameters : SnareParameters
    """
    middle = 0.5 * parameters.ring_distance
    tip = foot + parameters.pin_length * axis
    if not min(foot[0], tip[0]) <= middle <= max(foot[0], tip[0]):
        return False
    towards = round(parameters.ring_direction)
    inside = _winding(closed_loop(first, towards), np.zeros(3), np.array([1.0, 0.0, 0.0]))
    return inside != 0 and _winding(closed_loop(cables, towards), foot, axis) == inside


def radial_error(history: SnareHistory, time: int = -1) -> float:
    """The larger of the two radial displacements of the pin's foot [m]: the paper wants both below 10 mm."""
    foot, _ = _pin(history, time)
    return float(max(abs(foot[1]), abs(foot[2])))


def _pin(history: SnareHistory, time: int) -> tuple[np.ndarray, np.ndarray]:
    turn = Rotation.from_quat(history.target_quaternion[time], scalar_first=True).as_matrix()
    return history.target_position[time], -turn[:, 0]


def closed_loop(cables: np.ndarray, towards: int) -> np.ndarray:
    """Cables (3, n_nodes, 3) joined by arcs of the rings (n, 3); ``towards`` is the ring's direction, 1 or -1.

    Each cable ends where the next begins, before the ring turns.
    """
    parts = []
    for order in range(3):
        cable, following = cables[-towards * order % 3], cables[-towards * (order + 1) % 3]
        start, end = cable[-1], following[0]
        angles = [np.arctan2(p[2], p[1]) for p in (start, end)]
        sweep = (angles[1] - angles[0] + np.pi) % (2 * np.pi) - np.pi
        turned = angles[0] + sweep * np.linspace(0, 1, _ARC)[1:-1]
        radius = np.hypot(start[1], start[2])
        along = np.linspace(start[0], end[0], _ARC)[1:-1]
        parts += [cable, np.column_stack([along, radius * np.cos(turned), radius * np.sin(turned)])]
    return np.vstack(parts)


def _winding(loop: np.ndarray, foot: np.ndarray, axis: np.ndarray) -> int:
    """How often a closed loop (n, 3) winds around a line through ``foot`` along ``axis``, seen along x."""
    on_line = foot + ((loop[:, 0] - foot[0]) / axis[0])[:, None] * axis
    across = loop - on_line
    angles = np.arctan2(across[:, 2], across[:, 1])
    steps: np.ndarray = np.diff(np.append(angles, angles[0]))
    return round(float(np.sum(np.mod(steps + np.pi, 2 * np.pi) - np.pi)) / (2 * np.pi))


def turned(values: Mapping[str, float]) -> Rotation:
    """The target's axes in the end effector's."""
    return Rotation.from_euler("xyz", [values["roll"], values["pitch"], values["yaw"]])
