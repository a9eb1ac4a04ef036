"""A position or a torque that counts the other way round."""

import numpy as np

from ..case import CheckCase
from ..finding import Kind
from ..reading import Reading


def readings(case: CheckCase) -> list[Reading]:
    """Each torque reversed, each encoder, and all torques together."""
    n, found = len(case.joints), []
    for j in case.doubtful:
        for family, field, words in (("tau", "torque_factor", "torque"), ("q", "factor", "encoder")):
            name, turned = f"{family}.{case.joints[j]}", np.ones(n)
            turned[j] = -1.0
            made = case.reading(
                "sign", [name], f"{name} has the wrong sign: the {words} is reversed", [case.mends.scaled(name, -1.0)]
            )
            found.append(made.but(**{field: turned}))
    if n > 1:
        names = [f"tau.{joint}" for joint in case.joints]
        made = case.reading(
            "sign",
            names,
            "all torques have the wrong sign: they are what the arm does to its drives",
            [case.mends.scaled(name, -1.0) for name in names],
        )
        found.append(made.but(torque_factor=-np.ones(n)))
    return found


KIND = Kind("sign", "a column counts the other way round", readings)
