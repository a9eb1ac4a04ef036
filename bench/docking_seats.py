"""Seat or jam from random starts, by our docking and by MuJoCo's: ``python bench/docking_seats.py --count 50``.

A body of 90 kg is pushed along the axis by 20 N from starts inside the grooves' mouth, under friction from 0.05 to 0.6.
The limit of jamming (0.318 at 45°) is a limit for each contact that may be last; starts whose friction is within `BAND`
of it are left out: there the law of sliding decides. It is pushed until it rests in both engines. Printed: in how many
both say the same, and of those that seat in both, the pose.

Impulses are compared in flight, without a push: a body that is pushed and rests has got back from its contacts just
what pushed it, whatever they are. From the same starts it flies at 20 mm/s, and MuJoCo's own contact forces, summed
step by step, stand against what our body's momentum has lost, in the first touch and over longer. Both contacts keep
0.9 of the speed with which a flank is met, ours by Hunt and Crossley's law and MuJoCo's by a linear one: the less is
lost, the less the two laws differ at another speed, that of a second ball. In flight MuJoCo's contacts have a low
impedance, and a damping of friction apart from that of the normal direction (`docking_pairs`): with its usual
ones a touch is four times too long, and what slides pushes itself off. ``--flights`` does that alone, with friction and
without any. Every start done is a line of ``build/bench/docking_seats.jsonl`` and is not done again.
"""

import argparse
import json
import os
import sys
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

os.environ |= dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")

sys.path.append(str(Path(__file__).resolve().parents[1]))

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq
from scipy.spatial.transform import Rotation

from bench.concealing import append
from bench.docking_mujoco import ANGLES, Truth, harden, mj, mjcf
from bench.docking_pairs import pairs, pairs_of
from snarelab.models.docking.body import BodyRun, DockingBody
from snarelab.models.docking.closed_forms import jamming_friction
from snarelab.models.docking.parameters import DockingParameters

Array = NDArray[np.float64]

ROOT = Path(__file__).resolve().parents[1]
MASS, INERTIA, FORCE = 90.0, (25.0, 60.0, 60.0), 20.0
DURATION, LONGER, REST = 25.0, 75.0, 2e-5
"""How long a body is pushed [s], and for how long where it still moves then, faster than this [m/s]."""
SPEED, AWAY, FLIGHT, RESTITUTION = 0.02, 0.006, 2.0, 0.9
"""Of a body in flight [m/s], by how much it starts further off [m], for how long [s], and what a contact keeps of the
speed."""
SOFT, SLIDING = 0.01, 1000.0
"""Impedance of MuJoCo's contacts in flight, and the damping of their friction [1/s]: three times what lets friction
reach its limit at 20 mm/s."""
BAND = 0.06
"""Of friction about the limit of jamming."""
TOUCH = 1e-3
"""An impulse above this is a touch [N·s]."""
SEATED = 1e-4
"""A ball that is nearer to its seat than this sits [m]."""
AFTER = (0.05, 0.2, 1.0)
"""How long after its first touch each engine's impulse is taken [s]: the first one is that touch."""
NEAR = 0.03
"""Impulses that differ by less are alike."""
P = DockingParameters()


@dataclass(frozen=True)
class Pushed:
    """A body pushed into the grooves, n times.

    Parameters
    ----------
    time : array (n,)
        [s]
    place, quaternion : array (n, 3), (n, 4)
        Of its origin in the grooves' frame [m].
    impulse : array (n, 3)
        Of the contacts on it since the start [N·s].
    off : array (n,)
        How far that ball is from its seat that is farthest [m].
    """

    time: Array
    place: Array
    quaternion: Array
    impulse: Array
    off: Array

    @property
    def rests(self) -> bool:
        """Whether it has moved at the end, over a tenth of a second, no faster than `REST`."""
        before = np.array([np.interp(self.time[-1] - 0.1, self.time, x) for x in self.place.T])
        return float(np.linalg.norm(self.place[-1] - before)) < 0.1 * REST

    def impulse_after(self, wait: float) -> Array:
        """What the contacts have given a while [s] after the first touch (3,) [N·s]."""
        first = int(np.argmax(np.linalg.norm(self.impulse, axis=1) > TOUCH))
        return np.array([np.interp(self.time[first] + wait, self.time, x) for x in self.impulse.T])


def damping_ratio(restitution: float) -> float:
    """Of a linear contact that never pulls, by what it keeps of the speed, 0.22 or more (Schwager and Pöschel 2007)."""

    def kept(ratio: float) -> float:
        pace = np.sqrt(1 - ratio * ratio)
        return float(np.exp(-ratio / pace * (np.pi - np.arctan2(2 * ratio * pace, 1 - 2 * ratio * ratio))))

    found: Any = brentq(lambda ratio: kept(ratio) - restitution, 1e-3, 0.7)
    return float(found)


def pushed_by_us(run: BodyRun, force: float) -> Pushed:
    """Our body's: the contacts gave what its momentum has gained and the push did not give."""
    impulse = MASS * (run.velocity - run.velocity[0]) - np.outer(run.time, [force, 0.0, 0.0])
    return Pushed(run.time, run.place, run.quaternion, impulse, np.linalg.norm(run.off, axis=2).max(axis=1))


def push(
    truth: Truth, force: float, duration: float, place: Array, turn: Rotation, speed: float = 0.0, soft: float = 0.0,
    step: float = 1e-4,
) -> Pushed:  # fmt: skip
    """Push a free body of ``truth``'s mass along the axis by a force [N], from a speed [m/s].

    Carriage, cables and mount are idle. ``soft`` is an impedance of the contacts instead of the usual one.
    """
    loose = replace(truth, mount=(0.0, 0.0), turning=(0.0, 0.0), knob=5.0, ring=1.0, slack=100.0, dry=0.0, front=-1.0)
    model = mj.MjModel.from_xml_string(mjcf(loose, place, turn, 0.0, step, pairs_of(loose) if soft else ""))
    harden(model, loose)
    if soft:
        pairs(model, loose, soft, SLIDING)
    data = mj.MjData(model)
    body = mj.mj_name2id(model, mj.mjtObj.mjOBJ_BODY, "effector")
    data.xfrc_applied[body, 0], data.qvel[0] = force, speed
    n = round(duration / step)
    rows = np.empty((n, 10))
    for k in range(n):
        mj.mj_step(model, data)
        # Of the mount's slides, which lie along the world's axes: there is no other constraint in them than contacts.
        rows[k] = *data.xpos[body], *data.xquat[body], *data.qfrc_constraint[:3]
    balls = [[truth.seat, truth.radius * np.cos(a), truth.radius * np.sin(a)] for a in ANGLES]
    turns = Rotation.from_quat(rows[:, 3:7], scalar_first=True)
    away = [turns.apply(ball) + rows[:, :3] - [0.0, *ball[1:]] for ball in balls]
    off = np.linalg.norm(away, axis=2).max(axis=0)
    return Pushed(step * np.arange(1.0, n + 1), rows[:, :3], rows[:, 3:7], step * np.cumsum(rows[:, 7:], axis=0), off)


def start(rng: np.random.Generator) -> tuple[float, Array, Rotation]:
    """Friction outside the band, place [m] and turn: inside the mouth, 5 to 12 mm before the seat."""
    limit = jamming_friction(P.flank)
    while True:
        friction = float(rng.uniform(0.05, 0.6))
        if abs(friction - limit) > BAND:
            break
    turn = Rotation.from_rotvec(np.deg2rad([*rng.uniform(-1.0, 1.0, 1), *rng.uniform(-1.5, 1.5, 2)]))
    aside = np.array([-rng.uniform(0.005, 0.012), *rng.uniform(-0.005, 0.005, 2)])
    return friction, aside - turn.apply([P.seat, 0.0, 0.0]), turn


def flight(
    body: DockingBody, parameters: DockingParameters, truth: Truth, place: Array, turn: Rotation
) -> tuple[Pushed, Pushed]:
    """One body in flight in both engines, from further off."""
    off = place - [AWAY, 0.0, 0.0]
    own = parameters.with_values(restitution=RESTITUTION, restitution_speed=SPEED * np.sin(parameters.flank))
    run = body.run(own, FLIGHT, off, turn.as_quat(scalar_first=True), velocity=[SPEED, 0, 0], longest=1e-3)
    other = replace(truth, damping=damping_ratio(RESTITUTION))
    return pushed_by_us(run, 0.0), push(other, 0.0, FLIGHT, off, turn, SPEED, SOFT)


def touches(body: DockingBody, friction: float, place: Array, turn: Rotation) -> dict[str, Any]:
    """Impulses in flight in both engines [N·s], `AFTER` the first touch, and by how much they differ (a share)."""
    own = P.with_values(friction=friction)
    truth = Truth(friction=friction, mass=MASS, inertia=INERTIA, edge=P.edge, stiffness=P.stiffness)
    ours, theirs = flight(body, own, truth, place, turn)
    pairs = [(ours.impulse_after(wait), theirs.impulse_after(wait)) for wait in AFTER]
    return {
        "impulses": [[a.tolist(), b.tolist()] for a, b in pairs],
        "impulse": [float(np.linalg.norm(a - b) / np.linalg.norm(a)) for a, b in pairs],
    }


def compare(body: DockingBody, friction: float, place: Array, turn: Rotation) -> dict[str, Any]:
    """One start in both engines."""
    own = P.with_values(friction=friction)
    truth = Truth(friction=friction, mass=MASS, inertia=INERTIA, edge=P.edge, stiffness=P.stiffness)
    quaternion = turn.as_quat(scalar_first=True)

    def both(duration: float) -> tuple[Pushed, Pushed]:
        run = body.run(own, duration, place, quaternion, wrench=[FORCE, 0, 0, 0, 0, 0], longest=2e-3)
        return pushed_by_us(run, FORCE), push(truth, FORCE, duration, place, turn)

    ours, theirs = both(DURATION)
    if not (ours.rests and theirs.rests):
        ours, theirs = both(LONGER)
    turned = (
        Rotation.from_quat(ours.quaternion[-1], scalar_first=True)
        * Rotation.from_quat(theirs.quaternion[-1], scalar_first=True).inv()
    )
    return {
        "friction": friction, "ours": bool(ours.off[-1] < SEATED), "mujoco": bool(theirs.off[-1] < SEATED),
        "left": [float(ours.off[-1]), float(theirs.off[-1])],
        "pose": float(np.linalg.norm(ours.place[-1] - theirs.place[-1])), "turn": float(turned.magnitude()),
    } | touches(body, friction, place, turn)  # fmt: skip


def line(row: dict[str, Any]) -> str:
    """A start in words."""
    impulses = ", ".join(f"{100 * x:.2g} % after {wait:g} s" for wait, x in zip(AFTER, row["impulse"], strict=True))
    return (
        f"friction {row['friction']:.3f}: {'seats' if row['ours'] else 'jams'} / "
        f"{'seats' if row['mujoco'] else 'jams'}, left {1e3 * row['left'][0]:.3f} / {1e3 * row['left'][1]:.3f} mm, "
        f"impulse {impulses}"
    )


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=50)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--out", type=Path, default=ROOT / "build" / "bench" / "docking_seats.jsonl")
    parser.add_argument("--flights", action="store_true", help="impulses in flight alone, with friction and without")
    given = parser.parse_args()
    if given.flights:
        return flights(given.seed, given.count)
    given.out.parent.mkdir(parents=True, exist_ok=True)
    rows = [json.loads(text) for text in given.out.read_text().splitlines()] if given.out.exists() else []
    rows = [row for row in rows if row["seed"] == given.seed][: given.count]
    rng, body = np.random.default_rng(given.seed), DockingBody(MASS, INERTIA, 1e-6)
    for number in range(given.count):
        drawn = start(rng)
        if number < len(rows):
            continue
        rows.append({"seed": given.seed, "number": number} | compare(body, *drawn))
        append(given.out, rows[-1])
        print(line(rows[-1]), flush=True)
    both = [row for row in rows if row["ours"] and row["mujoco"]]
    print(
        f"agree in {sum(row['ours'] == row['mujoco'] for row in rows)} of {len(rows)}; {len(both)} seat, pose within "
        f"{1e6 * max((row['pose'] for row in both), default=0.0):.1f} um; {apart(rows)}"
    )
    return 0


def flights(seed: int, count: int) -> int:
    """Starts in flight, with the friction drawn and with none."""
    body = DockingBody(MASS, INERTIA, 1e-6)
    for drawn, words in ((True, "friction as drawn"), (False, "no friction")):
        rng = np.random.default_rng(seed)
        starts = [start(rng) for _ in range(count)]
        rows = [touches(body, friction if drawn else 0.0, place, turn) for friction, place, turn in starts]
        print(f"{count} flights, {words}: {apart(rows)}", flush=True)
        for number, (row, (friction, _, turn)) in enumerate(zip(rows, starts, strict=True)):
            if row["impulse"][0] > NEAR:
                way = [float(np.linalg.norm(x)) for x in row["impulses"][0]]
                print(
                    f"  start {number}: {100 * row['impulse'][0]:.2g} %, friction {friction:.3f}, "
                    f"{np.rad2deg(turn.magnitude()):.2g} deg, {way[0]:.3g} and {way[1]:.3g} N s"
                )
    return 0


def apart(rows: Sequence[dict[str, Any]]) -> str:
    """In words, by how much the engines' impulses differ."""
    shares = [np.array([row["impulse"][k] for row in rows]) for k in range(len(AFTER))]
    return "impulse of the first touch " + ", ".join(
        f"{wait:g} s after it began: median {100 * np.median(x):.2g} %, at most {100 * x.max():.2g} %, "
        f"{(x <= NEAR).sum()} within {100 * NEAR:g} %"
        for wait, x in zip(AFTER, shares, strict=True)
    )


if __name__ == "__main__":
    sys.exit(main())
