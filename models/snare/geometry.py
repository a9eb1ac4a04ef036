"""Where the cables lie before the ring turns: three equally spaced helices between the two rings.

Li et al., section 1.2: seen along the axis, a cable is an arc between two points of the ring 120° apart. Its length
follows from the cable's length Ls and the rings' distance h, l_arc = √(Ls² − h²), its chord from the ring's radius,
l_chord = √3 R. The angle αa that it subtends solves sin(αa/2)/(αa/2) = l_chord/l_arc (Newton), and the arc's centre Oa
lies off the ring's centre by the angle δα = π/3 − αa/2 at the cable's end.

That is the paper's start; where the cables come to rest from there is `settled`.
"""

from dataclasses import dataclass
from math import cos, hypot, pi, sin, sqrt

import numpy as np

from ...errors import InputError
from .parameters import SnareParameters

N_CABLES = 3
START_AZIMUTHS = (2 * pi / 3, 0.0, -2 * pi / 3)
"""Azimuth of each cable's end on the fixed ring, from y towards z [rad] (Li et al.)."""


@dataclass(frozen=True)
class Arc:
    """A cable seen along the axis.

    Parameters
    ----------
    angle, radius : float
        αa [rad] and the arc's own radius [m].
    bulge : float
        How far the arc passes beyond the ring [m]; negative inside it.
    """

    angle: float
    radius: float
    bulge: float


def arc(parameters: SnareParameters) -> Arc:
    """Solve the arc's angle.

    Raises
    ------
    InputError
        Where the cable is shorter than its chord, or so long that it cannot lie inside the ring.
    """
    p = parameters
    chord = sqrt(3) * p.ring_radius
    if p.cable_length <= hypot(p.ring_distance, chord):
        raise InputError(
            f"snare: cable_length is {p.cable_length:g} m, shorter than its chord of "
            f"{hypot(p.ring_distance, chord):.4g} m between the rings; "
            "lengthen the cable, or reduce ring_radius or ring_distance"
        )
    length = sqrt(p.cable_length**2 - p.ring_distance**2)
    ratio = chord / length
    half = sqrt(6 * (1 - ratio))  # from the series of sin x / x; exact for a shallow arc
    for _ in range(50):
        residual = sin(half) / half - ratio
        step = residual / ((cos(half) * half - sin(half)) / half**2)
        half = min(max(half - step, half / 2), (half + pi) / 2)
        if abs(step) < 1e-15 * half:
            break
    radius = length / (2 * half)
    bulge = radius * (1 - cos(half)) - p.ring_radius / 2  # the chord's middle lies R/2 from the axis
    if bulge > p.cable_diameter / 2:
        raise InputError(
            f"snare: ring_radius is {p.ring_radius:g} m, too small for a cable of {p.cable_length:g} m, which would "
            f"bulge {bulge:.3g} m beyond the ring; enlarge the ring or shorten the cable"
        )
    return Arc(2 * half, radius, bulge)


def ring_points(parameters: SnareParameters) -> np.ndarray:
    """Cable ends at the start, in the end effector's frame.

    Returns
    -------
    array (3, 2, 3)
        Cable; fixed, rotating ring; x, y, z [m].
    """
    points = np.zeros((N_CABLES, 2, 3))
    for cable, azimuth in enumerate(START_AZIMUTHS):
        end = azimuth + parameters.ring_direction * 2 * pi / 3
        points[cable, 0, 1:] = parameters.ring_radius * np.array([cos(azimuth), sin(azimuth)])
        points[cable, 1] = [
            parameters.ring_distance,
            parameters.ring_radius * cos(end),
            parameters.ring_radius * sin(end),
        ]
    return points


def helices(parameters: SnareParameters, n_elements: int) -> np.ndarray:
    """Nodes of the three cables at the start, in the end effector's frame.

    Returns
    -------
    array (3, n_elements + 1, 2, 3)
        Cable, node; position [m] and unit tangent; x, y, z.
    """
    shape = arc(parameters)
    ends = ring_points(parameters)
    along = np.linspace(-0.5, 0.5, n_elements + 1) * shape.angle
    slope = parameters.ring_distance / parameters.cable_length  # dx/ds
    nodes = np.zeros((N_CABLES, n_elements + 1, 2, 3))
    for cable, azimuth in enumerate(START_AZIMUTHS):
        middle = azimuth + parameters.ring_direction * pi / 3
        outward = np.array([0.0, cos(middle), sin(middle)])
        across = parameters.ring_direction * np.array([0.0, -sin(middle), cos(middle)])
        centre = (parameters.ring_radius / 2 - shape.radius * cos(shape.angle / 2)) * outward
        arc_points = np.cos(along)[:, None] * outward + np.sin(along)[:, None] * across
        arc_tangents = np.cos(along)[:, None] * across - np.sin(along)[:, None] * outward
        nodes[cable, :, 0] = centre + shape.radius * arc_points
        nodes[cable, :, 0, 0] = np.linspace(0.0, parameters.ring_distance, n_elements + 1)
        nodes[cable, :, 1] = sqrt(1 - slope**2) * arc_tangents
        nodes[cable, :, 1, 0] = slope
        nodes[cable, [0, -1], 0] = ends[cable]
    return nodes
