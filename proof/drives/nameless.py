"""Laws that have no name in the tool's vocabulary, or had none when they were made: ``unknown_effect`` is right.

Sized by what is left of each beside a fit of the named laws that come nearest at its joint, so that none is a name in
disguise: level, viscous and quadratic friction, load, rotor inertia, harness, bias and drift.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from .concealed import Made, TooMuch, law_torque, place
from .laws import CHATTER, CUT_OFF, DETENT, DRIVING, IRON, SEAL, TOOTH, TWO_ANGLES, TWO_SPEEDS, WARMING
from .plant import Law, Planned, remainder, rms
from .robots import Rng

Lawless = Callable[[Planned, int, float, Rng], Made]
CLOSE, TRIES = 0.05, 12


def beside_names(m: Planned, k: int, torque: NDArray) -> float:
    """RMS [N·m] of what the nearest named laws leave of a torque (n_samples,) at joint k."""
    q, qd, qdd, load = m.q[:, k], m.qd[:, k], m.qdd[:, k], m.load[:, k]
    sign, time = np.sign(qd), m.period * np.arange(len(q))
    near = [np.ones_like(q), time, q, qd, qdd, sign, qd * np.abs(qd), load, np.abs(load) * sign, np.abs(sign)]
    return float(rms(remainder(torque, near)))


def _scaled(m: Planned, k: int, wanted: float, law: Law, note: str) -> Made:
    torque = law_torque(m, law)
    size = wanted / beside_names(m, k, torque)
    raw = float(size * rms(torque))
    if not raw <= 0.8 * rms(m.torque[:, k]):
        raise TooMuch(f"an RMS of {raw:.3g} N·m would be needed")
    plant = replace(m.plant, laws=(*m.plant.laws, replace(law, size=size)))
    return Made(plant, place(k), k, raw, note=note)


def _other(m: Planned, k: int) -> int:
    return k - 1 if k else 1


def _two_angles(m: Planned, k: int, wanted: float, rng: Rng) -> Made:
    o = _other(m, k)
    waves = float(rng.uniform(2.0, 4.0) / np.ptp(m.q[:, o]))
    law = Law(TWO_ANGLES, k, 1.0, (waves, float(rng.uniform(-1.0, 1.0)), float(rng.uniform(-0.5, 0.5))), other=o)
    return _scaled(m, k, wanted, law, f"q.{place(k)}, q.{place(o)}")


def _two_speeds(m: Planned, k: int, wanted: float, rng: Rng) -> Made:
    o = _other(m, k)
    return _scaled(m, k, wanted, Law(TWO_SPEEDS, k, 1.0, other=o), f"qd.{place(k)}, qd.{place(o)}")


def _driving(m: Planned, k: int, wanted: float, rng: Rng) -> Made:
    edges = (0.05 * float(rms(m.load[:, k])), 0.02 * float(np.abs(m.qd[:, k]).max()))
    made = _scaled(m, k, wanted, Law(DRIVING, k, 1.0, edges), f"load.{place(k)}, qd.{place(k)}")
    if made.plant.laws[-1].size > 0.7:
        raise TooMuch("a gear that loses more than 70 % when it drives")
    return made


def _warming(m: Planned, k: int, wanted: float, rng: Rng) -> Made:
    numbers = (float(rng.uniform(3.0, 9.0)), 0.5 * float(np.abs(m.qd[:, k]).max()))
    made = _scaled(m, k, wanted, Law(WARMING, k, 1.0, numbers), f"time, qd.{place(k)}")
    # What warmth takes was there when cold.
    level = m.plant.friction.level.copy()
    level[k] += made.plant.laws[-1].size
    plant = replace(made.plant, friction=m.plant.friction._replace(level=level))
    return replace(made, plant=plant)


def _tooth(m: Planned, k: int, wanted: float, rng: Rng) -> Made:
    q = m.q[:, k]
    wide = float(np.ptp(q) * rng.uniform(0.03, 0.08))
    law = Law(TOOTH, k, 1.0, (float(np.quantile(q, rng.uniform(0.3, 0.7))), wide, float(rng.uniform(4.0, 9.0)) / wide))
    return _scaled(m, k, wanted, law, f"q.{place(k)}")


def _detent(m: Planned, k: int, wanted: float, rng: Rng) -> Made:
    travel = float(np.ptp(m.q[:, k]))
    poles = 2.0 * np.pi * float(rng.uniform(3.0, 8.0)) / travel
    width, phase, share = travel * rng.uniform(0.06, 0.2), rng.uniform(0.0, 6.0), rng.uniform(0.4, 0.8)
    numbers = (float(width), poles, float(phase), float(share))
    return _scaled(m, k, wanted, Law(DETENT, k, 1.0, numbers), f"q.{place(k)}, its past")


def _seal(m: Planned, k: int, wanted: float, rng: Rng) -> Made:
    q = m.q[:, k]
    low = float(np.quantile(q, rng.uniform(0.25, 0.5)))
    numbers = (low, low + float(np.ptp(q) * rng.uniform(0.15, 0.3)), 0.01 * float(np.ptp(q)))
    return _scaled(m, k, wanted, Law(SEAL, k, 1.0, numbers), f"q.{place(k)}, qd.{place(k)}")


def _iron(m: Planned, k: int, wanted: float, rng: Rng) -> Made:
    """Needs ``size`` times more than it gives, as far as that is above a knee."""
    top = float(np.abs(m.torque[:, k]).max())
    made = _scaled(m, k, wanted, Law(IRON, k, 1.0, (top * float(rng.uniform(0.3, 0.55)),)), f"tau.{place(k)}")
    law = made.plant.laws[-1]
    if law.size > 1.5:
        raise TooMuch("a motor that gives 40 % of what its current says")
    # Of what is logged above the knee, this share is not given.
    share = law.size / (1.0 + law.size)
    limit = m.plant.limit.copy()
    limit[k] *= 1.0 + law.size
    return replace(made, plant=replace(made.plant, laws=(*m.plant.laws, replace(law, size=share)), limit=limit))


def cut_off(motion: tuple[NDArray, NDArray, NDArray]) -> Lawless:
    """The logged torque is what was asked for. In closed loop more is asked for, the less is given: sized there."""

    def make(m: Planned, k: int, wanted: float, rng: Rng) -> Made:
        top = float(np.abs(m.torque[:, k]).max())
        least, most = 0.45 * top, top
        for _ in range(TRIES):
            limit = 0.5 * (least + most)
            plant = replace(m.plant, laws=(*m.plant.laws, Law(CUT_OFF, k, 1.0, (limit,))))
            true = plant.simulate(motion, np.zeros_like(motion[0]))
            logged = true[::4, 3, k]
            cut = np.sign(logged) * np.maximum(np.abs(logged) - limit, 0.0)
            size = beside_names(m, k, cut) if np.all(np.isfinite(cut)) else np.inf
            if abs(size / wanted - 1.0) < CLOSE:
                return Made(plant, place(k), k, float(rms(cut)), note=f"tau.{place(k)}")
            least, most = (limit, most) if size > wanted else (least, limit)
        raise TooMuch("no limit that lets the arm follow is of this size")

    return make


def _chatter(m: Planned, k: int, wanted: float, rng: Rng) -> Made:
    top = float(np.abs(m.qd[:, k]).max())
    law = Law(CHATTER, k, 1.0, (float(rng.uniform(2.0, 7.0)), top * float(rng.uniform(0.3, 0.6)), 0.15 * top))
    return _scaled(m, k, wanted, law, f"qd.{place(k)}, time")


LAWLESS: dict[str, Lawless] = {
    "hose over two joints": _two_angles,
    "wrist whose bevels press each other": _two_speeds,
    "gear that costs only when it drives": _driving,
    "grease that warms": _warming,
    "damaged tooth": _tooth,
    "detent with hysteresis": _detent,
    "one-way seal": _seal,
    "iron that saturates": _iron,
    "chatter in a range of speeds": _chatter,
}

LIMITED = "motor limit that is not logged"
NAMELESS = (*LAWLESS, LIMITED)

NAMED_SINCE = {
    "gear that costs only when it drives": "gear_efficiency",
    "grease that warms": "heating_friction",
    "iron that saturates": "motor_saturation",
    LIMITED: "motor_saturation",
}
"""Laws that the vocabulary got a name for after they were made: that name, at their place, is right as well."""


def lawless(motion: tuple[NDArray, NDArray, NDArray]) -> dict[str, Lawless]:
    """Every law without a name, by what it is; ``motion`` at the servo's ticks is what a limit is sized along."""
    return {**LAWLESS, LIMITED: cut_off(motion)}
