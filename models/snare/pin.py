"""Distance of a point to the pin: a shaft and a knob, each a round cylinder with flat ends (Li et al., figure 4).

Seen along a radius, a cylinder is a rectangle; outside it the nearest point lies on its side, on an end, or on its rim.
With the outward normal n at an angle θ from the radius, t in that plane across n, and τ around the axis,

    H = ∂n/∂y = κ t tᵀ + (cos θ/ρ) τ τᵀ,

κ being 1/distance at the rim and 0 elsewhere.
"""

from math import sqrt

import numpy as np

from .parameters import SnareParameters
from .vector import compiled


def pin_cylinders(parameters: SnareParameters) -> np.ndarray:
    """Radius, lower and upper end along x in the target's frame [m], of shaft and knob: shape (2, 3)."""
    p = parameters
    return np.array(
        [
            [p.pin_radius, p.knob_length - p.pin_length, 0.0],
            [p.knob_radius, -p.pin_length, p.knob_length - p.pin_length],
        ]
    )


@compiled
def distance(cylinder, y):
    """Distance from a cylinder's surface to the point y in the target's frame [m]; negative inside."""
    radial = sqrt(y[1] * y[1] + y[2] * y[2]) - cylinder[0]
    axial = max(cylinder[1] - y[0], y[0] - cylinder[2])
    if radial > 0.0 and axial > 0.0:
        return sqrt(radial * radial + axial * axial)
    return max(radial, axial)


@compiled
def surface(cylinder, y):
    """Distance, normal n, κ, t, cos θ/ρ, τ at the point y, all in the target's frame."""
    rho = max(sqrt(y[1] * y[1] + y[2] * y[2]), 1e-12)
    outward = (0.0, y[1] / rho, y[2] / rho)
    around = (0.0, -y[2] / rho, y[1] / rho)
    radial = rho - cylinder[0]
    side = -1.0 if cylinder[1] - y[0] > y[0] - cylinder[2] else 1.0
    axial = max(cylinder[1] - y[0], y[0] - cylinder[2])
    if radial > 0.0 and axial > 0.0:
        gap = sqrt(radial * radial + axial * axial)
        cosine, sine, bend = radial / gap, side * axial / gap, 1.0 / gap
    elif radial >= axial:
        gap, cosine, sine, bend = radial, 1.0, 0.0, 0.0
    else:
        gap, cosine, sine, bend = axial, 0.0, side, 0.0
    normal = (sine, cosine * outward[1], cosine * outward[2])
    across = (cosine, -sine * outward[1], -sine * outward[2])
    return gap, normal, bend, across, cosine / rho, around
