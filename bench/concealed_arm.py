"""One random arm that conceals one effect or none, recorded in MuJoCo and diagnosed: what tests of the search draw.

LuGre friction, disturbances and noise; the concealed effect is sized to 0.5 to 4 times the disturbance, in torque that
the known friction cannot pose as.
"""

import re
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np

from bench.arm import random_arm
from bench.concealed import MAKERS, Concealed, Planned
from bench.lugre import LuGre
from bench.motion import fourier_motion, point_to_point_motion
from bench.mujoco_plant import Plant, simulate, write_csv
from bench.parts import Disturbance
from snarelab.identification.diagnose import diagnose
from snarelab.models.model_file import load_model

RATE = 200.0  # Hz
TRAIN, HOLDOUT = 18.0, 10.0  # s
SIZES = (0.5, 4.0)  # multiples of the disturbance's RMS
KINDS = (*MAKERS, "", "", "")
"""One round of cases; an empty name conceals nothing."""


def run_case(seed: int, number: int, seconds: float = TRAIN, holdout: float = HOLDOUT) -> dict[str, Any]:
    """Build, record and diagnose one case; all that is worth knowing of it as plain values."""
    start, kind = time.perf_counter(), KINDS[number % len(KINDS)]
    rng = np.random.default_rng([seed, number])
    with tempfile.TemporaryDirectory() as name:
        record, true, diagnosis = _diagnosed(Path(name), kind, rng, seconds, holdout)
    explained = {(c.name, c.at): c.explained for c in diagnosis.candidates}
    named = []
    for e in diagnosis.effects:
        answers = [(e.name, e.at), *((r.name, r.at) for r in e.rivals if not r.separable)]
        named.append(
            {
                "name": e.name,
                "at": e.at,
                "margin": e.margin,
                "right": any(a in true for a in answers),
                "right_name": any(a[0] == t[0] for a in answers for t in true),
                "right_place": any(_joint(a[1]) == _joint(t[1]) for a in answers for t in true),
                "explained": explained.get((e.name, e.at), 0.0),
                "parameters": {k: v.value for k, v in e.parameters.items()},
            }
        )
    if kind:
        outcome = "found" if any(e["right"] for e in named) else "wrong name" if named else "missed"
    else:
        outcome = "quiet" if diagnosis.verdict == "adequate" else "false alarm"
    seconds = round(time.perf_counter() - start, 1)
    return {"case": number, "kind": kind, "outcome": outcome, **record, "named": named, "seconds": seconds}


def _diagnosed(folder: Path, kind: str, rng: np.random.Generator, seconds: float, holdout: float):
    """Record one arm in ``folder`` and diagnose it: (facts, right answers, diagnosis)."""
    while True:
        try:
            plant, hidden, motions, facts = _drawn(kind, rng, seconds, holdout)
            break
        except ValueError:  # an arm too slow for the time it has, or an effect too large for hardware
            continue
    (folder / "arm.urdf").write_text(plant.arm.urdf())
    known = [(e, j) for e in hidden.knows for j in plant.arm.joints if j != hidden.at or e not in hidden.unknown]
    listed = ", ".join(f'{{name = "{e}", at = "{j}"}}' for e, j in known)
    (folder / "arm.toml").write_text(f'name = "arm"\nsystem = "arm"\nurdf = "arm.urdf"\neffects = [{listed}]\n')
    write_csv(folder / "train.csv", simulate(plant, motions[0], seconds, RATE, rng))
    write_csv(folder / "hold.csv", simulate(plant, motions[1], holdout, RATE, rng))
    diagnosis = diagnose(load_model(folder / "arm.toml"), [folder / "train.csv"], folder / "hold.csv").diagnosis
    true = {(name, hidden.at) for name in (kind, *hidden.unknown)} if kind else set()
    return facts | {"verdict": diagnosis.verdict}, true, diagnosis


def _drawn(kind: str, rng: np.random.Generator, seconds: float, holdout: float):
    """A random plant, what it conceals, its two motions, and the facts worth a record."""
    n, disturbance = int(rng.integers(2, 4)), float(rng.uniform(0.2, 0.4))
    arm, chosen = random_arm(rng, n), int(rng.integers(n))
    motions = fourier_motion(arm, rng, seconds), point_to_point_motion(arm, rng, holdout, slowest=0.3)
    levels = np.sort(rng.uniform(2.0, 8.0, n))[::-1]
    viscous = levels * rng.uniform(0.4, 1.0, n)
    laws = {j: LuGre(level=float(x), viscous=float(v)) for j, x, v in zip(arm.joints, levels, viscous, strict=True)}
    size = float(np.exp(rng.uniform(*np.log(SIZES))))
    hidden = Concealed("", 0.0)
    if kind:
        states = motions[0](np.arange(0.0, seconds, 1 / RATE))
        planned = Planned(arm, chosen, laws[arm.joints[chosen]], *states, 1 / RATE)
        hidden = MAKERS[kind](planned, size * disturbance, rng)
    if hidden.law:
        laws[hidden.at] = hidden.law
    plant = Plant(
        arm,
        friction=laws,
        encoder_step=dict.fromkeys(arm.joints, 2 * np.pi / 2**20),
        tau_noise=dict.fromkeys(arm.joints, float(rng.uniform(0.05, 0.15))),
        disturbance=dict.fromkeys(arm.joints, Disturbance(disturbance)),
        **hidden.plant,
    )
    facts = {"at": hidden.at, "value": hidden.value, "size": size, "disturbance": disturbance, "joints": n}
    return plant, hidden, motions, facts


def _joint(place: str) -> int:
    """Number of the joint that a place belongs to: joint2, link2 and tau.joint2 are one."""
    return int(re.findall(r"\d+", place)[-1])
