"""An encoder whose zero is not the robot's file's."""

import numpy as np

from ..case import CheckCase
from ..finding import Kind
from ..reading import Reading

STARTS = 8
"""Angles round the circle from which the zero of a rotary joint is sought."""

WORTH = 3.0
"""Log evidence that the zero nearest by an eighth of that circle must gain to be sought more finely."""

LEAST = 0.02
"""[rad] Zeros nearer than this are a matter of calibration, and explained by a centre of mass as well."""


def readings(case: CheckCase) -> list[Reading]:
    """Each rotary joint's zero that fits the torques best; sliding joints have none."""
    found = []
    for j in case.doubtful:
        joint = case.tree.joints[j]
        if joint.kind == "prismatic":
            continue
        offset = _best(case, j)
        if abs(offset) < LEAST:
            continue
        name, shift = f"q.{joint.name}", np.zeros(len(case.joints))
        shift[j] = offset
        text = f"the zero of {name} is off by {offset:+.3g} rad ({np.degrees(offset):+.3g}°)"
        made = case.reading("encoder_offset", [name], text, [case.mends.shifted(name, offset)])
        found.append(made.but(offset=shift, free=1))
    return found


def _best(case: CheckCase, j: int) -> float:
    """Zero of a joint [rad] by the evidence without bounds: the best of a circle, then of ever finer steps, at last the
    peak of the parabola through the best and its neighbours."""

    def value(offset: float) -> float:
        shift = np.zeros(len(case.joints))
        shift[j] = offset
        return case.grounds.fit(case.reading("", (), "", ()).but(offset=shift), bounded=False).value

    grid = np.linspace(-np.pi, np.pi, STARTS, endpoint=False)
    values = {float(x): value(float(x)) for x in grid}
    best, step = max(values, key=lambda x: values[x]), 2 * np.pi / STARTS
    for halving in range(6):
        step /= 2.0
        for x in (best - step, best + step):
            values[x] = value(x)
        best = max((best - step, best, best + step), key=lambda x: values[x])
        if halving == 1 and values[best] < values[0.0] + WORTH:
            return 0.0
    below, above = value(best - step), value(best + step)
    if (bend := below + above - 2.0 * values[best]) < 0:
        best += 0.5 * step * (below - above) / bend
    return float((best + np.pi) % (2 * np.pi) - np.pi)


KIND = Kind("encoder_offset", "an encoder's zero is not the robot's file's", readings)
