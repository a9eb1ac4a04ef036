"""The direction of motion, smooth enough to differentiate and sharp enough to equal a sign."""

import casadi as ca

from ..effect import Symbols

TRANSITION = 3e-4  # share of the joint's peak speed


def direction(s: Symbols) -> ca.SX:
    """tanh(qd / (0.0003 * speed_scale)): the sign of qd, with a finite slope through zero, in [-1, 1].

    ``s["speed_scale"]`` [S/s] is the joint's peak recorded speed, a constant of the model (the same number for every
    recording it is compared with). The transition is fixed, never fitted: a fitted one poses as Stribeck friction.
    Three ten-thousandths of the peak speed lie at or below the velocity noise of encoders, so that the fit sees what
    identification with sign(qd) sees (Janot, Gautier and Brunot, 2019), and beyond 0.12 % of the peak speed the two
    differ by less than 1e-3; a simulation still gets a law it can integrate through rest.
    """
    return ca.tanh(s["qd"] / (TRANSITION * s["speed_scale"]))
