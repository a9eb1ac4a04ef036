"""Drives with a spring or with play, sized in the simulated closed loop: their torque depends on how the link swings.

The motor turns with its own inertia and carries the encoder; the spring hands its torque to the link.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.signal import butter, sosfiltfilt

from .bodies import Bodies, inertias_along, torques
from .concealed import LAWS, Made, Maker, TooMuch, place
from .loop import TICK
from .motions import STILL
from .plant import Planned, Plant, rms
from .robots import Rng

BAND = 15.0
"""Torque above this [Hz] does not count towards a spring's size: disturbances have little there."""

CLOSE, TRIES = 0.03, 14


def excess(plant: Plant, motion: tuple[NDArray, NDArray, NDArray]) -> tuple[Planned, NDArray]:
    """The motor's true motion, and what its torque has besides that of a rigid arm which moves like it, below `BAND`.

    Both (n_samples, n) at 250 Hz.
    """
    true = plant.simulate(motion, np.zeros_like(motion[0]))
    q, qd, qdd = (true[:, k] for k in range(3))
    if not np.all(np.isfinite(q)) or np.abs(q - motion[0]).max() > 0.5:
        raise TooMuch("the servo loses the arm")
    rigid = torques(Bodies.of(plant.robot.model()), q.copy(), qd.copy(), qdd.copy()) + plant.rotor * qdd
    low = butter(4, BAND, fs=1.0 / TICK, output="sos")
    change = sosfiltfilt(low, true[:, 3] - true[:, 4] - rigid, axis=0)
    first = round(STILL / TICK)
    kept = [np.ascontiguousarray(x[first::4]) for x in (q, qd, qdd, change)]
    return Planned.along(plant, 4 * TICK, *kept[:3]), kept[3]


def _found(
    built: Callable[[float], Plant], low: float, high: float, motion: tuple[NDArray, NDArray, NDArray], wanted: NDArray
) -> tuple[float, int, float]:
    """Number between ``low`` and ``high`` (the effect grows with it) whose effect has the wanted size, by bisection."""

    def size(x: float) -> tuple[float, int, float]:
        m, change = excess(built(x), motion)
        shares = rms(m.left(change)) / wanted
        channel = int(np.argmax(shares))
        return float(shares[channel]), channel, float(rms(change[:, channel]))

    if size(low)[0] > 1.0 or size(high)[0] < 1.0:
        raise TooMuch("no spring that hardware has is of this size")
    least, most = np.log(low), np.log(high)
    for _ in range(TRIES):
        x = float(np.exp(0.5 * (least + most)))
        share, channel, raw = size(x)
        if abs(share - 1.0) < CLOSE:
            return x, channel, raw
        least, most = (least, np.log(x)) if share > 1.0 else (np.log(x), most)
    raise TooMuch("no spring that hardware has is of this size")


def _link_inertia(m: Planned, k: int) -> float:
    """What a locked motor's spring has to swing: of the bodies from link k on [kg·m²], on average."""
    matrices = inertias_along(Bodies.of(m.plant.robot.model()), np.ascontiguousarray(m.q[::25]))
    return float(matrices[:, k, k].mean())


def elasticity(motion: tuple[NDArray, NDArray, NDArray]) -> Maker:
    """A spring and a damper; locked frequencies from 4 to 40 Hz."""

    def make(m: Planned, k: int, wanted: NDArray, rng: Rng) -> Made:
        inertia, ratio = _link_inertia(m, k), float(rng.uniform(0.03, 0.15))

        def numbers(softness: float) -> tuple[float, float, float]:
            stiffness = (2.0 * np.pi / softness) ** 2 * inertia
            return stiffness, 2.0 * ratio * float(np.sqrt(stiffness * inertia)), 0.0

        def built(softness: float) -> Plant:
            return replace(m.plant, springs={**m.plant.springs, k: numbers(softness)})

        lowest = max(4.0, 1.6 * m.plant.bandwidth)
        softness, channel, raw = _found(built, 1.0 / 40.0, 1.0 / lowest, motion, wanted)
        values = {"stiffness": numbers(softness)[0]}
        return Made(built(softness), place(k), channel, raw, values)

    return make


def backlash(motion: tuple[NDArray, NDArray, NDArray]) -> Maker:
    """A stiff drive (12 to 25 Hz locked) with play."""

    def make(m: Planned, k: int, wanted: NDArray, rng: Rng) -> Made:
        inertia = _link_inertia(m, k)
        stiffness = (2.0 * np.pi * float(rng.uniform(12.0, 25.0))) ** 2 * inertia
        damping = 2.0 * float(rng.uniform(0.1, 0.25)) * float(np.sqrt(stiffness * inertia))

        def built(gap: float) -> Plant:
            return replace(m.plant, springs={**m.plant.springs, k: (stiffness, damping, gap)})

        gap, channel, raw = _found(built, 2e-4, 0.05, motion, wanted)
        return Made(built(gap), place(k), channel, raw, {"gap": gap})

    return make


def makers(motion: tuple[NDArray, NDArray, NDArray]) -> dict[str, Maker]:
    """Every effect with a name, by it; ``motion`` at the servo's ticks is what springs are sized along."""
    return {**LAWS, "joint_elasticity": elasticity(motion), "backlash": backlash(motion)}


SPRINGS = ("joint_elasticity", "backlash")
NAMES = (*LAWS, *SPRINGS)
