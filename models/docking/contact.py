"""Force of one contact of the docking: linear spring with Hunt and Crossley's damping, friction by a bristle.

With δ the overlap, w the ball's velocity against the flank and w_t its tangential part:

    N = k δ (1 + D δ̇), never negative,      F_t = −μ N (z/z_b + d ż),      ż = w_t − α(|z|) z (z·w_t)⁺/|z|²,

with z_b the breakaway distance. α grows from 0 at 70 % of z_b to 1 at z_b, so that what rests stays where
it is, however long it rests (Dupont et al. 2002, single-state elastoplastic friction): a regularised Coulomb law creeps
under the preload. Out of contact the bristle straightens within `RELAX`.

Without other forces a body that hits at v leaves at e v with (Hunt and Crossley 1975, integrated without their
approximation)

    ln((1 + D v)/(1 − e D v)) = D v (1 + e).
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import casadi as ca
import numpy as np
from scipy.optimize import brentq

from ..effects.docking_friction import EFFECT as FRICTION

Rub = Callable[[ca.SX, ca.SX], ca.SX]
"""Friction (2,) [N] from a flank's normal force [N] and presliding as a share of the breakaway distance (2,)."""
ELASTIC = 0.7
"""Share of the breakaway distance below which nothing slides; chosen."""
RELAX = 0.01
"""Time constant of a bristle out of contact [s]; chosen."""


class ContactForce(NamedTuple):
    """Normal force [N]; tangential force along both tangents [N]; the bristle's rates; stored energy [J] and power
    lost in damping and in friction [W]."""

    normal: ca.SX
    tangential: ca.SX
    rate: ca.SX
    stored: ca.SX
    damped: ca.SX
    rubbed: ca.SX


def damping_number(restitution: float) -> float:
    """D v of the law for a restitution e in (0, 1) at the speed v of approach."""
    e = restitution

    def number(w: float) -> float:
        return -np.expm1(-w) / e  # 1 − e D v = exp(−w)

    # Near w = 0 all terms of first order cancel: the root at zero is left out by beginning at the next term's size.
    w: Any = brentq(lambda w: np.log1p(number(w)) + w - number(w) * (1 + e), 1e-5 * (1 - e), 3 + (1 + e) / e)
    return number(float(w))


def contact(
    gap: ca.SX, approach: ca.SX, slip: ca.SX, bristle: ca.SX, p: dict[str, ca.SX], rub: Rub | None = None
) -> ContactForce:
    """Write the law out.

    Parameters
    ----------
    gap, approach : SX
        Distance, negative in contact [m], and −its rate [m/s].
    slip, bristle : SX (2,)
        w_t [m/s] and z [m] along both tangents.
    p : dict
        ``stiffness`` [N/m], ``damping`` D [s/m], ``friction``, ``breakaway`` [m], ``bristle_damping`` d [s/m].
    rub : callable, optional
        Law in place of `docking_friction` with coefficient ``friction``.
    """
    overlap = ca.fmax(-gap, 0.0)
    spring = p["stiffness"] * overlap
    normal = ca.fmax(spring * (1 + p["damping"] * approach), 0.0)
    size = ca.sqrt(ca.dot(bristle, bristle) + 1e-30)
    bent = ca.fmin(ca.fmax((size / p["breakaway"] - ELASTIC) / (1 - ELASTIC), 0.0), 1.0)
    sliding = bent * bent * (3 - 2 * bent)
    along = ca.fmax(ca.dot(bristle, slip), 0.0) / (size * size)
    held = slip - sliding * along * bristle
    rate = ca.if_else(gap < 0, held, -bristle / RELAX)
    presliding = bristle / p["breakaway"] + p["bristle_damping"] * held
    own = {"normal_force": normal, "presliding": presliding}
    tangential = -(rub(normal, presliding) if rub else FRICTION.law(own, {"coefficient": p["friction"]}))
    return ContactForce(
        normal,
        tangential,
        rate,
        0.5 * spring * overlap,
        (normal - spring) * approach,
        -ca.dot(tangential, slip),
    )
