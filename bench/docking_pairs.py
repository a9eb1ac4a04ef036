"""MuJoCo's contacts of balls and grooves for a body in flight, with values of their own.

Of a body that flies MuJoCo's contact is softer than of one at rest. Where nothing else moves it a = d a_ref, d the
impedance, so that of the flank's stiffness (1 − d) is left: a twentieth by the usual 0.95. And what slides pushes
itself off, as its cone asks for a_n + R f_n = a_ref + μ |a_t + R_t f_t + b v_t|. With d near 0 R is large, and neither
is left. b, of friction alone, must only be large enough for friction to reach its limit.
"""

from typing import Any

import numpy as np

from bench.docking_mujoco import Truth, mj


def pairs(model: Any, truth: Truth, impedance: float, sliding: float) -> None:
    """Set the values of the contacts that `pairs_of` gave the model.

    Parameters
    ----------
    model
        Compiled from `mjcf` with `pairs_of`.
    truth : Truth
    impedance : float
        d.
    sliding : float
        b, of friction alone [1/s].
    """
    body = mj.mj_name2id(model, mj.mjtObj.mjOBJ_BODY, "effector")
    pace = truth.stiffness * (1 - impedance) * float(model.body_invweight0[body][0])
    model.pair_solref[:] = -pace, -2 * truth.damping * np.sqrt(pace)
    model.pair_solimp[:] = impedance, impedance, 1e-3, 0.5, 2
    model.pair_solreffriction[:] = -1.0, -sliding * impedance  # MuJoCo divides by the impedance


def pairs_of(truth: Truth) -> str:
    """Every ball with every flank and land, for `mjcf`."""
    mu = truth.friction
    return "".join(
        f'<pair geom1="{part}{k}{side}" geom2="ball{i}" condim="3" friction="{mu} {mu} 0 0 0"/>'
        for i in range(3)
        for k in range(3)
        for part in ("flank", "land")
        for side in "+-"
    )
