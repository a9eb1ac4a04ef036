"""What a cubic lacks: the bow of a beam between two nodes, as if it were clamped there.

Between nodes a beam of curvature κ in tension N, pushed by f at s = a, bows by w beyond the cubic of its nodes:
EI w'''' = (N − EI κ²) κ + f δ(s − a), with w = w' = 0 at both. Where it is touched, with n the normal there,

    w(a) = e f + b,    e = a³(l − a)³/(3 EI l³),    b = (N − EI κ²) (n · r''_m) B,    B = a²(l − a)²/(24 EI).

The push shortens the element as well, and so lowers N by f k B n · r''_m, with k = EA/((1 + g) l); that takes
k (B n · r''_m)² from e. And the energy of a curved cubic, summed at the element's points (Simpson's three for tension,
Gauss's two for bending), differs from that of an elastica through the same nodes by

    ΔU = −l⁵ (12 EI σ t − 10 EI σ³ + (3 N t − 4 N σ²)/2 + N² σ/EI)/1440,    σ = |r''_m|², t = |r'''|²,

up to terms in l⁷; m is the element's middle. The terms in N are ½ EA l ((ε − c)²/(1 + g) − ε²), with the mean strain ε
by Simpson's rule, c = l⁴ (3 t − 4 σ²)/2880, g = EA l⁴ σ/(720 EI) and N = EA (ε − c)/(1 + g). Derived here by expansion
for small l; the tests hold it against elements so short that it does not matter.
"""

import numpy as np

from .cubic import combine, first_weights, second_weights, third_weights
from .vector import compiled, dot, length

AXIAL, PRESTRAIN = 6, 7
"""Entries of `law.law_constants`: EA [N], and the strain that stands for a pretension."""
TRIPLETS_PER_ELEMENT = 144
"""Written by `add_bow_jacobian`."""


@compiled
def give(law, fraction, size):
    """e at ξ [m/N]."""
    return law[4] * (size * fraction * (1.0 - fraction)) ** 3


@compiled
def give_change(law, fraction, size):
    """de/ds at ξ [1/N]."""
    return 3 * law[4] * (size * fraction * (1.0 - fraction)) ** 2 * (1.0 - 2 * fraction)


@compiled
def give_bend(law, fraction, size):
    """d²e/ds² at ξ [1/(N·m)]."""
    part, turn = fraction * (1.0 - fraction), 1.0 - 2 * fraction
    return 6 * law[4] * size * part * (turn * turn - part)


@compiled
def bow_shape(law, fraction, size):
    """B at ξ [m²/N], and dB/ds [m/N]."""
    part = size * size * fraction * (1.0 - fraction)
    return law[4] / 8 * part * part, law[4] / 4 * part * size * (1.0 - 2 * fraction)


@compiled
def strains(law, element, size, strain_of, bend_of, change_of):
    """ε with the prestrain, σ [1/m²] and t [1/m⁴]; fills their gradients by the element's coordinates, (4, 3) each."""
    n2, n3 = second_weights(0.5, size), third_weights(size)
    bend, change = combine(n2, element), combine(n3, element)
    strain = law[PRESTRAIN] - 1.0
    strain_of[:] = 0.0
    for i in range(3):
        share = 4 / 6 if i == 1 else 1 / 6
        n1 = first_weights(0.5 * i, size)
        tangent = combine(n1, element)
        stretch = length(tangent)
        strain += share * stretch
        for a in range(4):
            for k in range(3):
                strain_of[a, k] += share * n1[a] * tangent[k] / stretch
    for a in range(4):
        for k in range(3):
            bend_of[a, k] = 2 * bend[k] * n2[a]
            change_of[a, k] = 2 * change[k] * n3[a]
    return strain, dot(bend, bend), dot(change, change)


@compiled
def softening(law, size, bend):
    """dg/dσ [m²], and g where |r''_m|² is `bend`."""
    slope = law[AXIAL] * size**4 * law[4] / 240
    return slope, slope * bend


@compiled
def pull_of(law, size, strain, bend, change):
    """N [N]."""
    missing = size**4 * (3 * change - 4 * bend * bend) / 2880
    return law[AXIAL] * (strain - missing) / (1 + softening(law, size, bend)[1])


@compiled
def lateral_pull(law, element, size, gradient):
    """N − EI κ² of an element [N], and k [N/m]; fills the gradient of the first (4, 3)."""
    bend_of, change_of = np.empty((4, 3)), np.empty((4, 3))
    strain, bend, change = strains(law, element, size, gradient, bend_of, change_of)
    pull, bending = pull_of(law, size, strain, bend, change), 1 / (3 * law[4])
    slope, soft = softening(law, size, bend)
    stiffness = law[AXIAL] / (1 + soft)
    by_change = -stiffness * size**4 / 960
    by_bend = stiffness * size**4 * bend / 360 - pull * slope / (1 + soft) - bending
    for a in range(4):
        for k in range(3):
            gradient[a, k] = stiffness * gradient[a, k] + by_bend * bend_of[a, k] + by_change * change_of[a, k]
    return pull - bending * bend, stiffness / size


@compiled
def stiffness_change(law, element, size):
    """−dk/dσ [N·m]."""
    bend = combine(second_weights(0.5, size), element)
    slope, soft = softening(law, size, dot(bend, bend))
    return law[AXIAL] * slope / (size * (1 + soft) ** 2)


@compiled
def bow_energy(law, element, size):
    """ΔU [J]."""
    scratch = np.empty((3, 4, 3))
    strain, bend, change = strains(law, element, size, scratch[0], scratch[1], scratch[2])
    pull, bending = pull_of(law, size, strain, bend, change), 1 / (3 * law[4])
    tension = 0.5 * size / law[AXIAL] * (pull * pull * (1 + softening(law, size, bend)[1]) - (law[AXIAL] * strain) ** 2)
    return tension - size**5 * bending * (12 * bend * change - 10 * bend**3) / 1440


@compiled
def add_bow(positions, n_elements, size, law, forces):
    """Add −∂ΔU/∂q of all cables to the forces on their nodes."""
    strain_of, bend_of, change_of = np.empty((4, 3)), np.empty((4, 3)), np.empty((4, 3))
    bending, factor = 1 / (3 * law[4]), size**5 / 1440
    for first_row in range(0, positions.shape[0] - 2, 2):
        if (first_row // 2 + 1) % (n_elements + 1) == 0:
            continue
        element = positions[first_row : first_row + 4]
        strain, bend, change = strains(law, element, size, strain_of, bend_of, change_of)
        pull = pull_of(law, size, strain, bend, change)
        by_strain = size * (law[AXIAL] * strain - pull)
        by_bend = factor * (bending * (12 * change - 30 * bend * bend) - 4 * pull * bend + pull * pull / bending)
        by_change = factor * (12 * bending * bend + 1.5 * pull)
        for a in range(4):
            for k in range(3):
                forces[first_row + a, k] += (
                    by_strain * strain_of[a, k] + by_bend * bend_of[a, k] + by_change * change_of[a, k]
                )


@compiled
def add_bow_jacobian(positions, n_elements, size, law, factor, triplets, count):
    """Append the triplets of factor ∂²ΔU/∂q², as far as Newton's method needs them; returns the new count.

    Left out are what is of second order in σ and t, and how ε turns: both far below the element's own stiffness.
    """
    gradients = np.empty((3, 4, 3))
    by_strain, by_bend, by_change = gradients[0].reshape(12), gradients[1].reshape(12), gradients[2].reshape(12)
    n2, n3 = second_weights(0.5, size), third_weights(size)
    bending, twice = 1 / (3 * law[4]), size**5 / 720
    for first_row in range(0, positions.shape[0] - 2, 2):
        if (first_row // 2 + 1) % (n_elements + 1) == 0:
            continue
        element = positions[first_row : first_row + 4]
        strain, bend, change = strains(law, element, size, gradients[0], gradients[1], gradients[2])
        pull = pull_of(law, size, strain, bend, change)
        slope, soft = softening(law, size, bend)
        stiffness = law[AXIAL] / (1 + soft)
        with_strain = size * (stiffness - law[AXIAL])
        with_bend = size * (stiffness * size**4 * bend / 360 - pull * slope / (1 + soft))
        with_change = -stiffness * size**5 / 960
        once_bend = bending * (12 * change - 30 * bend * bend) - 4 * pull * bend + pull * pull / bending
        once_change = 12 * bending * bend + 1.5 * pull
        for i in range(12):
            for j in range(12):
                value = by_strain[i] * (
                    with_strain * by_strain[j] + with_bend * by_bend[j] + with_change * by_change[j]
                )
                value += by_strain[j] * (with_bend * by_bend[i] + with_change * by_change[i])
                if i % 3 == j % 3:
                    value -= twice * (once_bend * n2[i // 3] * n2[j // 3] + once_change * n3[i // 3] * n3[j // 3])
                triplets[count, 0] = 3 * first_row + i
                triplets[count, 1] = 3 * first_row + j
                triplets[count, 2] = factor * value
                count += 1
    return count
