"""What the paper's own data could not have told apart, and which extra measurement would."""

from collections.abc import Sequence
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from ...identification.diagnosis import Diagnosis
from ...models.effects import get_effect
from ...models.model import PlacedEffect, places
from ...models.rig.rig import Rig
from ...report.words import percent
from .stand_ins import StandIns, compare
from .study import Friction

Array = NDArray[np.float64]

NOISE = 0.05
"""[N·m] Of a torque in the analysis band; the same on all channels, so that it weighs nothing but joints' units."""

TWIST, TENSION, PAYLOAD, DRIFT = "a twisted boom", "tension errors", "a payload", "sensor drift"

TOGETHER = "all of these"

MEASUREMENTS = {
    "load cells on the slings": TENSION,
    "the payload weighed": PAYLOAD,
    "the sensors' zeros checked at the end": DRIFT,
}
"""An extra measurement, and the explanation that it rules out."""

SETS = [some for size in range(1, len(MEASUREMENTS)) for some in combinations(MEASUREMENTS, size)]
"""Measurements that leave something to be told apart, single ones first."""

ALIKE = 0.8
"""Two explanations are told apart badly where one can take this share of the other's energy."""


def suspected_boom(rig: Rig, found: Diagnosis) -> str:
    """The boom that a diagnosis calls twisted; where it names none, the one whose twist explains most by itself."""
    torsion = "link_torsion"
    named = [e.at for e in found.effects if e.name == torsion]
    tried = sorted((c for c in found.candidates if c.name == torsion), key=lambda c: -c.explained)
    return [*named, *(c.at for c in tried), *places(get_effect(torsion), rig)][0]


def explanations(rig: Rig, boom: str) -> dict[str, list[PlacedEffect]]:
    """Explanations of what is left on joints 2 and 6, each with the parameters that would be free.

    ``boom`` is the link that may be twisted.
    """

    def placed(name: str, at: str, *free: str) -> PlacedEffect:
        effect = get_effect(name)
        return PlacedEffect(effect, at, tuple(p.name for p in effect.parameters if p.name not in free))

    last = rig.links[-1].name
    return {
        TWIST: [placed("link_torsion", boom, "torque")],
        TENSION: [placed("sling_tension_error", s.name, "share") for s in rig.slings],
        PAYLOAD: [placed("payload_mass", last, "mass"), placed("com_offset", last, "x", "y", "z")],
        DRIFT: [placed("sensor_drift", f"tau.joint{k}", "rate") for k in (2, 6)],
    }


def tell_apart(rig: Rig, friction: Friction, boom: str) -> list[StandIns]:
    """Every pair of explanations, and what all but the first can do together, with and without measurements."""
    named = explanations(rig, boom)
    others = {name: placed for name, placed in named.items() if name != TWIST}
    named[TOGETHER] = [p for placed in others.values() for p in placed]
    for some in SETS:
        known = [MEASUREMENTS[measured] for measured in some]
        named[after(some)] = [p for name, placed in others.items() if name not in known for p in placed]
    return compare(friction.fit, named, friction.experiments, np.full(rig.n_joints, NOISE))


def after(some: Sequence[str]) -> str:
    """What is left of all explanations but the first after some measurements."""
    return f"{TOGETHER}, with {' and '.join(some)}"


def alike_in_words(pairs: Sequence[StandIns]) -> list[str]:
    """One sentence a pair of single explanations that is hard to tell apart, worst first."""
    hard = [p for p in pairs if p.mimicked > ALIKE and TOGETHER not in p.name + p.other]
    return [
        f"{p.other[0].upper()}{p.other[1:]} can pose as {p.name}: {percent(p.mimicked)} of its torque, "
        f"smallest angle {p.angle:.1f} degrees."
        for p in sorted(hard, key=lambda p: -p.mimicked)
    ]


def remedy(pairs: Sequence[StandIns], boom: str) -> str:
    """What torques and joint angles alone could not have settled, and the fewest measurements that would."""
    taken = {p.other: p.mimicked for p in pairs if p.name == TWIST}
    shares = ", ".join(f"{percent(taken[other])} by {other}" for other in (TENSION, PAYLOAD, DRIFT))
    best = [min((some for some in SETS if len(some) == n), key=lambda some: taken[after(some)]) for n in (1, 2)]
    steps = "; ".join(f"{percent(taken[after(some)])} with {' and '.join(some)}" for some in best)
    direct = get_effect("link_torsion").experiment.format(at=boom)
    return (
        f"From torques and joint angles alone, as the paper had them, {TWIST} ({boom}) can be mimicked to {shares}, "
        f"and to {percent(taken[TOGETHER])} by all of these. The best of further measurements leave {steps}. "
        f"What settles it directly: {direct}."
    )
