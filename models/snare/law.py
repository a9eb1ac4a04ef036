"""Force of a contact: Hertz with Hunt and Crossley's damping, and Coulomb friction made smooth at zero slip.

With δ the overlap, w the cable's velocity against the other body, w_t its tangential part, n the normal to the cable:

    f = K x^1.5 (1 + c δ̇), never negative,      F = f (n − μ w_t/√(w_t² + v_s²)).

Hertz: K x^1.5 (Li et al. eq. 19). Their damping C δ̇ pulls at first touch and at release; Hunt and Crossley (1975)
let it grow with the overlap instead, so that the force starts and ends at zero. Below the slip velocity v_s friction
acts as a stiff damper: a cable at rest creeps by v_s at most.

A cubic cannot follow the kink in curvature that a load between its nodes makes. The deflection that it lacks is that of
a beam of one element's length l clamped at both ends, e f with e = l³ξ³(1 − ξ)³/(3EI); the nodes themselves are right.
So e works in series with Hertz: δ = x + e K x^1.5 (`bow` has what a curved element takes from e). The cable's damping
τ EI κ̇ acts in that deflection as well, e ḟ τ; as long as ḟ is slow to τ, that is a force τ e k² δ̇ beside the others,
with k the stiffness of Hertz and e in series. Without it impacts keep too much speed.
"""

from math import sqrt

import numpy as np

from .parameters import SnareParameters
from .vector import add, add_scaled, compiled, dot, scale

DAMPING = 5
"""Entry of `law_constants`."""


def law_constants(parameters: SnareParameters) -> np.ndarray:
    """K [N/m^1.5], c [s/m], μ, v_s [m/s], 1/(3EI) [1/(N·m²)], and τ EI of `damping` [N·m²·s], EA [N], prestrain:
    shape (8,).
    """
    p = parameters
    stiffness = p.bending_stiffness
    return np.array(
        [
            p.hertz_stiffness,
            p.contact_damping,
            p.friction,
            p.slip_velocity,
            1 / (3 * stiffness),
            p.bending_damping * stiffness,
            p.axial_stiffness,
            p.prestrain,
        ]
    )


@compiled
def hertz_overlap(law, gap, soft):
    """x of δ = x + e K x^1.5 [m]; Newton from above, where the left side is convex."""
    x = -gap
    for _ in range(30):
        root = sqrt(x)
        step = (x + soft * law[0] * root * x + gap) / (1.0 + 1.5 * soft * law[0] * root)
        x -= step
        if step < 1e-15 * x:
            break
    return x


@compiled
def hertz_push(law, gap, soft):
    """f = K x^1.5 [N], and how it grows with the overlap, e in series [N/m]."""
    x = hertz_overlap(law, gap, soft)
    root = sqrt(x)
    slope = 1.5 * law[0] * root
    return law[0] * root * x, slope / (1.0 + soft * slope)


@compiled
def lag(law, x, soft):
    """τ e k² [N·s/m]."""
    slope = 1.5 * law[0] * sqrt(x)
    series = slope / (1.0 + soft * slope)
    return 3 * law[4] * law[5] * soft * series * series


@compiled
def force(law, gap, soft, n, w):
    """F on the cable [N] at a gap < 0 [m], with the element's own e."""
    x = hertz_overlap(law, gap, soft)
    approach = -dot(n, w)
    normal_force = max(law[0] * sqrt(x) * x * (1.0 + law[1] * approach) + lag(law, x, soft) * approach, 0.0)
    slip = add_scaled(w, approach, n)
    size = sqrt(dot(slip, slip) + law[3] * law[3])
    return scale(normal_force, add_scaled(n, -law[2] / size, slip))


@compiled
def powers(law, gap, soft, n, w):
    """Energy stored in the overlap [J]; power lost in contact damping and in friction [W], both ≥ 0."""
    x = hertz_overlap(law, gap, soft)
    stiff = law[0] * sqrt(x) * x
    approach = -dot(n, w)
    normal_force = max(stiff * (1.0 + law[1] * approach) + lag(law, x, soft) * approach, 0.0)
    slip = add_scaled(w, approach, n)
    size = sqrt(dot(slip, slip) + law[3] * law[3])
    stored = 0.4 * stiff * x + 0.5 * soft * stiff * stiff
    return stored, (normal_force - stiff) * approach, normal_force * law[2] * dot(slip, slip) / size


@compiled
def force_change(law, gap, soft, n, w, gap_change, soft_change, n_change, w_change):
    """First-order change of `force` with changes of gap, e, normal and velocity."""
    x = hertz_overlap(law, gap, soft)
    stiff = law[0] * sqrt(x) * x
    approach = -dot(n, w)
    share, slow = 1.0 + law[1] * approach, lag(law, x, soft)
    normal_force = stiff * share + slow * approach
    if normal_force <= 0.0:
        return (0.0, 0.0, 0.0)
    slope = 1.5 * law[0] * sqrt(x)
    x_change = -(gap_change + stiff * soft_change) / (1.0 + soft * slope)
    approach_change = -dot(n_change, w) - dot(n, w_change)
    normal_change = slope * share * x_change + (stiff * law[1] + slow) * approach_change
    slip = add_scaled(w, approach, n)
    size = sqrt(dot(slip, slip) + law[3] * law[3])
    direction = scale(1.0 / size, slip)
    slip_change = add_scaled(add_scaled(w_change, approach_change, n), approach, n_change)
    turn = scale(1.0 / size, add_scaled(slip_change, -dot(direction, slip_change), direction))
    along = add_scaled(n, -law[2], direction)
    return add(scale(normal_change, along), scale(normal_force, add_scaled(n_change, -law[2], turn)))
