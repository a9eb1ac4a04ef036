"""Seat or jam from random starts, by our docking and by MuJoCo's: ``python bench/docking_seats.py --count 50``.

A body of 90 kg is pushed along the axis by 20 N from starts inside the grooves' mouth, under friction from 0.05 to 0.6.
The limit of jamming (0.318 at 45°) is a limit for each contact that may be last; starts whose friction is within `BAND`
of it are left out: there the law of sliding decides. Printed: in how many both engines say the same; of those that
seat in both, the pose; and of all, the impulse of the contacts on the body in the second after its first touch.

That impulse is MuJoCo's own contact forces, summed step by step, against what our body's momentum lacks. Over a longer
time it would say nothing: a body that rests again has got back from its contacts just what pushed it. Every start done
is a line of ``build/bench/docking_seats.jsonl`` and is not done again.
"""

import argparse
import json
import os
import sys
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

os.environ |= dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")

sys.path.append(str(Path(__file__).resolve().parents[1]))

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from bench.concealing import append
from bench.docking_mujoco import ANGLES, Truth, harden, mj, mjcf
from snarelab.models.docking.body import BodyRun, DockingBody
from snarelab.models.docking.closed_forms import jamming_friction
from snarelab.models.docking.parameters import DockingParameters

Array = NDArray[np.float64]

ROOT = Path(__file__).resolve().parents[1]
MASS, INERTIA, FORCE = 90.0, (25.0, 60.0, 60.0), 20.0
DURATION, SHORT = 25.0, 2.0
BAND = 0.06
"""Of friction about the limit of jamming."""
TOUCH = 1e-3
"""An impulse above this is a touch [N·s]."""
SEATED = 1e-4
"""A ball that is nearer to its seat than this sits [m]."""
AFTER = (0.1, 0.5, 1.0)
"""How long after its first touch each engine's impulse is taken [s]."""
P = DockingParameters()
DEAD = DockingParameters(restitution=0.05, restitution_speed=2e-3)
"""For impulses, in both engines contacts that swallow their impacts: the laws of a bounce differ, and ours has its
closed form."""


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

    def impulse_after(self, wait: float) -> Array:
        """What the contacts have given a while [s] after the first touch (3,) [N·s]."""
        first = int(np.argmax(np.linalg.norm(self.impulse, axis=1) > TOUCH))
        return np.array([np.interp(self.time[first] + wait, self.time, x) for x in self.impulse.T])


def pushed_by_us(run: BodyRun, force: float) -> Pushed:
    """Our body's: the contacts gave what its momentum has and the push did not give."""
    impulse = MASS * run.velocity - np.outer(run.time, [force, 0.0, 0.0])
    return Pushed(run.time, run.place, run.quaternion, impulse, np.linalg.norm(run.off, axis=2).max(axis=1))


def push(truth: Truth, force: float, duration: float, place: Array, turn: Rotation, step: float = 1e-4) -> Pushed:
    """Push a free body of ``truth``'s mass along the axis by a force [N]; carriage, cables and mount are idle."""
    loose = replace(truth, mount=(0.0, 0.0), turning=(0.0, 0.0), knob=5.0, ring=1.0, slack=100.0, dry=0.0, front=-1.0)
    model = mj.MjModel.from_xml_string(mjcf(loose, place, turn, 0.0, step))
    harden(model, loose)
    data = mj.MjData(model)
    body = mj.mj_name2id(model, mj.mjtObj.mjOBJ_BODY, "effector")
    data.xfrc_applied[body, 0] = force
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


def compare(body: DockingBody, friction: float, place: Array, turn: Rotation) -> dict[str, Any]:
    """One start in both engines."""
    truth = Truth(friction=friction, mass=MASS, inertia=INERTIA, edge=P.edge, stiffness=P.stiffness)

    def both(parameters: DockingParameters, damping: float, duration: float) -> tuple[Pushed, Pushed]:
        run = body.run(
            parameters.with_values(friction=friction), duration, place, turn.as_quat(scalar_first=True),
            wrench=[FORCE, 0, 0, 0, 0, 0], longest=2e-3,
        )  # fmt: skip
        return pushed_by_us(run, FORCE), push(replace(truth, damping=damping), FORCE, duration, place, turn)

    ours, theirs = both(P, truth.damping, DURATION)
    dead = both(DEAD, 1.0, SHORT)
    turned = (
        Rotation.from_quat(ours.quaternion[-1], scalar_first=True)
        * Rotation.from_quat(theirs.quaternion[-1], scalar_first=True).inv()
    )
    pairs = [(dead[0].impulse_after(wait), dead[1].impulse_after(wait)) for wait in AFTER]
    return {
        "friction": friction, "ours": bool(ours.off[-1] < SEATED), "mujoco": bool(theirs.off[-1] < SEATED),
        "left": [float(ours.off[-1]), float(theirs.off[-1])],
        "pose": float(np.linalg.norm(ours.place[-1] - theirs.place[-1])), "turn": float(turned.magnitude()),
        "impulses": [[own.tolist(), other.tolist()] for own, other in pairs],
        "impulse": [float(np.linalg.norm(own - other) / np.linalg.norm(own)) for own, other in pairs],
    }  # fmt: skip


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
    given = parser.parse_args()
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
    apart = [np.array([row["impulse"][k] for row in rows]) for k in range(len(AFTER))]
    print(
        f"agree in {sum(row['ours'] == row['mujoco'] for row in rows)} of {len(rows)}; {len(both)} seat, pose within "
        f"{1e6 * max((row['pose'] for row in both), default=0.0):.1f} um; impulse "
        + ", ".join(
            f"{wait:g} s after the first touch: median {100 * np.median(x):.2g} %, at most {100 * x.max():.2g} %, "
            f"{(x <= 0.03).sum()} within 3 %"
            for wait, x in zip(AFTER, apart, strict=True)
        )
    )
    return 0


if __name__ == "__main__":
    sys.exit(main())
