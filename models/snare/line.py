"""The line that a target hangs from, where its hang point has play.

The line's top sits in a hole of radius c, without friction. While the target is less than c to the side the line
hangs upright and pulls nowhere sideways; beyond, it swings about the hole's edge. With d the horizontal distance from
under the middle of the hole, h the height, k, c_l and l₀ the line's stiffness, damping and free length:

    V = k (l − l₀)²/2,    l = √(h² + s(d)²),    f = −∂V/∂u − c_l l̇ ∂l/∂u,    u = (d, h).

s is the dead zone max(d − c, 0) of Nordin and Gutman (2002), rounded over a tenth of c so that f has a slope.
"""

from math import sqrt

from .vector import add_scaled, compiled, dot, scale, subtract

STIFFNESS, FREE_LENGTH, CLEARANCE, DOWN, TOP, LOCAL, DAMPING = 0, 1, 2, slice(3, 6), slice(6, 9), slice(9, 12), 12
LINE_SIZE = 13
"""A line is one row of 13 numbers: k [N/m], l₀ [m], c [m], unit vector down, top in the world [m], where on the target
it holds [m], and c_l [N·s/m]; k = 0 where Exudyn holds the target."""

TAUT = 1e6
"""Stiffness of a pendulum's line with play [N/m]: 25 kg stretch it by 0.25 mm."""
ROUNDED = 0.1
"""Share of the clearance over which the dead zone's corner is rounded."""


@compiled
def beyond(distance, clearance):
    """s(d) [m] and ds/dd."""
    width = ROUNDED * clearance
    root = sqrt((distance - clearance) ** 2 + width * width)
    at_rest = sqrt(clearance * clearance + width * width) - clearance
    return 0.5 * (distance - clearance + root - at_rest), 0.5 * (1.0 + (distance - clearance) / root)


@compiled
def line_pull(line, point, velocity):
    """Force on the target at the hang point (3,) [N], there and at this velocity; energy of the line [J]; and ∂l/∂u."""
    down = (line[3], line[4], line[5])
    from_top = subtract(point, (line[6], line[7], line[8]))
    height = dot(from_top, down)
    aside = add_scaled(from_top, -height, down)
    distance = sqrt(dot(aside, aside))
    past, slope = beyond(distance, line[2])
    length = sqrt(height * height + past * past)
    sideways = past * slope / distance if distance > 1e-12 else 0.0
    longer = add_scaled(scale(height / length, down), sideways / length, aside)
    stretch = length - line[1]
    tension = line[0] * stretch + line[12] * dot(longer, velocity)
    return scale(-tension, longer), 0.5 * line[0] * stretch * stretch, longer


@compiled
def line_slope(line, point, velocity, slopes):
    """Fill ∂f/∂u (3, 3) [N/m] by central differences; ∂f/∂u̇ is −c_l (∂l/∂u)(∂l/∂u)ᵀ."""
    step = 1e-7
    for k in range(3):
        shift = (step if k == 0 else 0.0, step if k == 1 else 0.0, step if k == 2 else 0.0)
        ahead, _, _ = line_pull(line, add_scaled(point, 1.0, shift), velocity)
        behind, _, _ = line_pull(line, add_scaled(point, -1.0, shift), velocity)
        for i in range(3):
            slopes[i, k] = (ahead[i] - behind[i]) / (2 * step)
