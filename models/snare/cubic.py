"""The cable's own interpolation: r(s) is a cubic on each element, from position and slope dr/ds at its two nodes.

Shape functions of the ANCF cable element (Berzeri and Shabana 2000; Li et al. 2.1), with ξ = s/l on an element of
length l: N = (1 − 3ξ² + 2ξ³, l(ξ − 2ξ² + ξ³), 3ξ² − 2ξ³, l(ξ³ − ξ²)). An element is given as its (4, 3) array of
position, slope, position, slope; `first` and `second` are derivatives by arc length s.
"""

import numpy as np

from .vector import compiled

MASS_POINTS = np.array(
    [
        [0.5 + 0.5 * x, 0.5 * w]
        for x, w in zip(*np.polynomial.legendre.leggauss(4), strict=True)
    ]
)  # fmt: skip
"""ξ and weight of Gauss's four points, exact for products of two cubics."""


@compiled
def weights(fraction, size):
    """N at ξ."""
    x = fraction
    return (1 - 3 * x * x + 2 * x * x * x, size * x * (1 - x) ** 2, x * x * (3 - 2 * x), size * x * x * (x - 1))


@compiled
def first_weights(fraction, size):
    """dN/ds at ξ."""
    x = fraction
    return (6 * x * (x - 1) / size, 1 - 4 * x + 3 * x * x, 6 * x * (1 - x) / size, x * (3 * x - 2))


@compiled
def second_weights(fraction, size):
    """d²N/ds² at ξ."""
    x = fraction
    return (
        (12 * x - 6) / (size * size),
        (6 * x - 4) / size,
        (6 - 12 * x) / (size * size),
        (6 * x - 2) / size,
    )


@compiled
def third_weights(size):
    """d³N/ds³, the same everywhere."""
    return (12 / size**3, 6 / size**2, -12 / size**3, 6 / size**2)


@compiled
def combine(n, element):
    """Σ N_a q_a of a (4, 3) element."""
    return (
        n[0] * element[0, 0] + n[1] * element[1, 0] + n[2] * element[2, 0] + n[3] * element[3, 0],
        n[0] * element[0, 1] + n[1] * element[1, 1] + n[2] * element[2, 1] + n[3] * element[3, 1],
        n[0] * element[0, 2] + n[1] * element[1, 2] + n[2] * element[2, 2] + n[3] * element[3, 2],
    )
