"""Seat or jam from random starts, by our docking and by MuJoCo's: ``python bench/docking_seats.py --count 50``.

A body of 90 kg is pushed along the axis by 20 N from starts inside the grooves' mouth, under friction from 0.05 to 0.6.
The limit of jamming (0.318 at 45°) is a limit for each contact that may be last; starts whose friction is within `BAND`
of it are left out: there the law of sliding decides. Printed: in how many both engines say the same, and of those that
seat, the seated pose and the impulse. All is in ``build/bench/docking_seats.json``.
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

from bench.docking_mujoco import ANGLES, Truth, harden, mj, mjcf
from snarelab.models.docking.body import DockingBody
from snarelab.models.docking.closed_forms import jamming_friction
from snarelab.models.docking.parameters import DockingParameters

Array = NDArray[np.float64]

ROOT = Path(__file__).resolve().parents[1]
MASS, INERTIA, FORCE, DURATION = 90.0, (25.0, 60.0, 60.0), 20.0, 25.0
BAND = 0.06
"""Of friction about the limit of jamming."""
SEATED = 1e-4
"""A ball that is nearer to its seat than this sits [m]."""
P = DockingParameters()


@dataclass(frozen=True)
class Pushed:
    """A body pushed into the grooves: time (n,) [s], origin (n, 3) [m], quaternion (n, 4), velocity (n, 3) [m/s]; the
    grooves' impulse on it since the start (n, 3) [N·s]; and how far each ball is from its seat in the end (3,) [m]."""

    time: Array
    place: Array
    quaternion: Array
    velocity: Array
    impulse: Array
    off: Array


def push(truth: Truth, force: float, duration: float, place: Array, turn: Rotation, step: float = 1e-4) -> Pushed:
    """Push a free body of ``truth``'s mass along the axis by a force [N]; carriage, cables and mount are idle."""
    loose = replace(truth, mount=(0.0, 0.0), turning=(0.0, 0.0), knob=5.0, ring=1.0, slack=100.0, dry=0.0, front=-1.0)
    model = mj.MjModel.from_xml_string(mjcf(loose, place, turn, 0.0, step))
    harden(model, loose)
    data = mj.MjData(model)
    body = mj.mj_name2id(model, mj.mjtObj.mjOBJ_BODY, "effector")
    balls = [mj.mj_name2id(model, mj.mjtObj.mjOBJ_SITE, f"ball{i}") for i in range(3)]
    data.xfrc_applied[body, 0] = force
    n = round(duration / step)
    rows, six = np.empty((n, 10)), np.empty(6)
    for k in range(n):
        mj.mj_step(model, data)
        mj.mj_objectVelocity(model, data, mj.mjtObj.mjOBJ_XBODY, body, six, 0)
        rows[k] = *data.xpos[body], *data.xquat[body], *six[3:]
    mj.mj_forward(model, data)
    seats = np.array([[0.0, truth.radius * np.cos(a), truth.radius * np.sin(a)] for a in ANGLES])
    time = np.asarray(step * np.arange(1, n + 1), float)
    impulse = truth.mass * rows[:, 7:] - np.outer(time, [force, 0.0, 0.0])
    off = np.linalg.norm(data.site_xpos[balls] - seats, axis=1)
    return Pushed(time, rows[:, :3], rows[:, 3:7], rows[:, 7:], impulse, off)


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
    ours = body.run(
        P.with_values(friction=friction), DURATION, place, turn.as_quat(scalar_first=True),
        wrench=[FORCE, 0, 0, 0, 0, 0], longest=2e-3,
    )  # fmt: skip
    theirs = push(
        Truth(friction=friction, mass=MASS, inertia=INERTIA, edge=P.edge, stiffness=P.stiffness), FORCE, DURATION,
        place, turn,
    )  # fmt: skip
    away = np.linalg.norm(ours.off[-1], axis=1)
    turned = (
        Rotation.from_quat(ours.quaternion[-1], scalar_first=True)
        * Rotation.from_quat(theirs.quaternion[-1], scalar_first=True).inv()
    )
    own = MASS * ours.velocity - np.outer(ours.time, [FORCE, 0.0, 0.0])
    return {
        "friction": friction, "ours": bool(away.max() < SEATED), "mujoco": bool(theirs.off.max() < SEATED),
        "left": [float(away.max()), float(theirs.off.max())],
        "pose": float(np.linalg.norm(ours.place[-1] - theirs.place[-1])), "turn": float(turned.magnitude()),
        "impulse": float(np.linalg.norm(own[-1] - theirs.impulse[-1]) / np.linalg.norm(own[-1])),
    }  # fmt: skip


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=50)
    parser.add_argument("--seed", type=int, default=1)
    given = parser.parse_args()
    rng, body = np.random.default_rng(given.seed), DockingBody(MASS, INERTIA, 1e-6)
    rows = []
    for _ in range(given.count):
        rows.append(compare(body, *start(rng)))
        r = rows[-1]
        print(
            f"friction {r['friction']:.3f}: {'seats' if r['ours'] else 'jams'} / {'seats' if r['mujoco'] else 'jams'}, "
            f"left {1e3 * r['left'][0]:.3f} / {1e3 * r['left'][1]:.3f} mm, impulse {100 * r['impulse']:.2g} %",
            flush=True,
        )
    both = [r for r in rows if r["ours"] and r["mujoco"]]
    found = {
        "agree": sum(r["ours"] == r["mujoco"] for r in rows), "of": len(rows), "seat": len(both),
        "pose": max((r["pose"] for r in both), default=0.0), "impulse": max((r["impulse"] for r in rows), default=0.0),
        "rows": rows,
    }  # fmt: skip
    out = ROOT / "build" / "bench" / "docking_seats.json"
    out.parent.mkdir(parents=True, exist_ok=True)
    out.write_text(json.dumps(found, indent=1))
    print(
        f"agree in {found['agree']} of {found['of']}; {found['seat']} seat, pose within {1e6 * found['pose']:.1f} um, "
        f"impulse within {100 * found['impulse']:.2g} %"
    )
    return 0


if __name__ == "__main__":
    sys.exit(main())
