"""ROS2, the step by which hidden states follow recorded signals.

Verwer, Spee, Blom and Hundsdorfer (1999); Hairer and Wanner, *Solving Ordinary Differential Equations II*, IV.7. It is
of second order and linearly implicit, with the time dependence of the signals u taken into the linearisation::

    (1 - gamma h J) k1 = h rate(x_n, u_n) + gamma h J_u (u_n+1 - u_n)
    (1 - gamma h J) k2 = h rate(x_n + k1, u_n+1) - 2 k1 - gamma h J_u (u_n+1 - u_n)
    x_n+1 = x_n + 3/2 k1 + 1/2 k2

gamma = 1 - 1/sqrt(2) is the more accurate of the two values for which the method is L-stable: a spring or a delay much
faster than the sampling costs nothing and decays at once. A solution that is linear in time is followed exactly.
"""

from collections.abc import Callable
from typing import Any

import casadi as ca
import numpy as np

_GAMMA = 1 - np.sqrt(0.5)


def ros2(f: Callable[[ca.SX, ca.SX], Any], x: ca.SX, u: ca.SX, later: ca.SX, h: ca.SX) -> ca.SX:
    """One step.

    Parameters
    ----------
    f : callable
        Of states and signals: the rate, and its derivatives by states and by signals.
    x, u, later, h : casadi.SX
        States, signals, signals a sample later, and the time between [s].
    """
    here, by_state, by_input = f(x, u)
    matrix = ca.SX.eye(x.numel()) - _GAMMA * h * by_state
    drift = _GAMMA * h * by_input @ (later - u)
    k1 = ca.solve(matrix, h * here + drift)
    k2 = ca.solve(matrix, h * f(x + k1, later)[0] - 2 * k1 - drift)
    return x + 1.5 * k1 + 0.5 * k2
