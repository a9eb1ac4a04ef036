"""The cases: which there are, how each is drawn, and what is written of it. All follows from seed and number."""

import copy
import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..drives.cases import TWIN, dealt, endless, model_text, write_arm
from .concealed import NAMES, Concealed, TooMuch
from .laws import Slip
from .machine import Machine, TooSoft
from .motions import STEP, motion
from .outside import FAULTS, OUTSIDE, Outside, lawless
from .residuals import play, residuals, rms
from .robots import ARMS, Rng, load, published, true_arm

CLEAN, SINGLE, PAIR, LAWLESS, FAULTY = "clean", "single", "pair", "nameless", "faulty"
GROUPS = (CLEAN, SINGLE, PAIR, LAWLESS, FAULTY)
DECK = (*[CLEAN] * 20, *[SINGLE] * 12, *[PAIR] * 10, *[LAWLESS] * 5, *[FAULTY] * 3)
"""Fifty cases: 40, 24, 20, 10 and 6 %. A third of those with something in them have two to four effects."""

SIZES = (0.5, 1.0, 2.0, 4.0)
RECORDINGS = {"train": 20.0, "hold": 12.0, "third": 12.0}  # s
RATES = (100, 125, 200, 250, 500)  # Hz
BITS = (12, 24)
LEVEL = (0.01, 0.04)
"""Disturbance below 15 Hz, as a share of its joint's RMS torque."""

FRICTION = (0.05, 0.3)
"""Level of dry friction, as a share of the joint's RMS rigid torque or of a tenth of the largest joint's."""

BACKGROUND = ("inertia_error", "com_offset", "payload_mass")
ATTEMPTS = 500


@dataclass(frozen=True)
class Plan:
    """A case before it is drawn: its group, and (name, size) of what it conceals."""

    group: str
    concealed: tuple[tuple[str, float], ...]


def planned(seed: int, count: int) -> list[Plan]:
    """The first ``count`` cases of a seed, the same however many follow."""
    ones = {
        SINGLE: endless(seed, 1, [(name, size) for name in NAMES for size in SIZES]),
        LAWLESS: endless(seed, 2, [(name, size) for name in OUTSIDE for size in (1.0, 2.0, 4.0)]),
        FAULTY: endless(seed, 3, [(name, 0.0) for name in FAULTS]),
    }
    several = np.random.default_rng([seed, 0, 9])
    plans = []
    for group in dealt(seed, DECK, count):
        one = ones.get(group)
        plans.append(Plan(group, _several(several) if group == PAIR else (next(one),) if one else ()))
    return plans


def _several(rng: Rng) -> tuple[tuple[str, float], ...]:
    """Two to four effects, each of a size of its own."""
    names = rng.choice(list(NAMES), int(rng.integers(2, 5)), replace=False).tolist()
    return tuple((name, float(rng.choice((1.0, 2.0, 4.0)))) for name in names)


def write(
    plan: Plan, seed: int, number: int, folder: Path, outside: Mapping[str, Outside] = OUTSIDE, first: int = 0
) -> int:
    """Draw a case, again where hardware has no such effect, and write it; ``truth.json`` last. The attempt that was
    drawn, of those from ``first`` on; ``outside``: laws without a name by what they are.

    Raises
    ------
    RuntimeError
        No such case in `ATTEMPTS` attempts.
    """
    for attempt in range(first, ATTEMPTS):
        try:
            _write(plan, seed, number, np.random.default_rng([seed, 2, number, attempt]), folder, outside)
        except (TooMuch, TooSoft):
            continue
        return attempt
    raise RuntimeError(f"case {number} ({plan}): no such case in {ATTEMPTS} attempts")


def _write(plan: Plan, seed: int, number: int, rng: Rng, folder: Path, outside: Mapping[str, Outside]) -> None:
    name, path = list(published().items())[int(rng.integers(len(published())))]
    arm = load(path, ARMS[name])
    J = len(arm.joints)
    motions = {part: motion(rng, arm, length) for part, length in RECORDINGS.items()}
    train = motions["train"]
    # What moves the arm, and what its URDF says of it.
    bare = machine = _bare(true_arm(arm, rng), train, rng)
    total = np.sqrt(np.mean(machine.torque(train) ** 2, axis=0))
    level = total * np.exp(rng.uniform(np.log(LEVEL[0]), np.log(LEVEL[1]), J))
    joints, made = rng.permutation(J), []
    for k, (what, size) in enumerate(plan.concealed if plan.group != FAULTY else ()):
        spot = int(joints[k])
        wanted = size * level
        if plan.group == LAWLESS:
            one = lawless(outside[what], machine, train, spot, float(wanted[spot]), rng)
        else:
            one = NAMES[what](machine, train, spot, wanted, rng)
        machine = one.machine
        made.append((what, size, one))
    sources = [residuals()[int(rng.integers(len(residuals())))] for _ in range(J)]
    rate, bits = int(rng.choice(RATES)), int(rng.integers(*BITS))
    count, stride = 2.0 * np.pi / 2.0**bits, round(1.0 / (rate * STEP))
    rough, jitter, speeds = float(rng.uniform(0.0, 0.7)), float(rng.uniform(0.0, 0.02)), bool(rng.random() < 0.25)
    recordings, twin = {}, {}

    def reading(of: Machine, motion: tuple[NDArray, NDArray, NDArray], pushes: NDArray, rng: Rng) -> dict[str, NDArray]:
        q, qd, _ = motion
        tau = of.read(of.torque(motion) + pushes)[::stride]
        seen = of.positions(q)[::stride]
        seen = count * np.round(seen / count + rough * rng.standard_normal(seen.shape))
        time = np.arange(len(tau)) / rate + jitter / rate * rng.standard_normal(len(tau))
        columns = {"time": time - time[0]}
        columns |= {f"q.{j}": seen[:, k] for k, j in enumerate(arm.joints)}
        if speeds:
            noise = 2e-3 * np.sqrt(np.mean(qd**2, axis=0)) * rng.standard_normal(seen.shape)
            columns |= {f"qd.{j}": (qd[::stride] + noise)[:, k] for k, j in enumerate(arm.joints)}
        return columns | {f"tau.{j}": tau[:, k] for k, j in enumerate(arm.joints)}

    for r, (part, along) in enumerate(motions.items()):
        pushes = level * np.stack([play(s, r, 1.0 / STEP, len(along[0]), rng) for s in sources], axis=1)
        same = copy.deepcopy(rng)
        recordings[part] = reading(machine, along, pushes, rng)
        if made and part != "hold":
            twin[part] = reading(bare, along, pushes, same)
    if plan.group == FAULTY:
        fault = FAULTS[plan.concealed[0][0]]
        recordings = {part: fault(c, int(joints[0])) for part, c in recordings.items()}
    known = ["viscous_friction", "coulomb_friction", "rotor_inertia"] + ["presliding_hysteresis"] * int(rng.integers(2))
    hidden = {(law, one.at) for _, _, one in made for law in one.hides}
    places = [(e, j) for e in known for j in arm.joints]
    joined = ", ".join(f'"{j}"' for j in arm.joints)
    rows = f"joints = [{joined}]\n"
    write_arm(folder, arm.urdf, model_text([x for x in places if x not in hidden], rows), recordings)
    if twin:
        write_arm(folder / TWIN, arm.urdf, model_text(places, rows), twin)
    told = {
        "generator": "played",
        "seed": seed,
        "case": number,
        "group": plan.group,
        "robot": name,
        "disturbance": {"kind": "played", "of": [s.machine for s in sources]},
        "disturbance_rms": dict(zip(arm.joints, level.tolist(), strict=True)),
        "effects": [_told(plan, *one) for one in made],
        "fault": plan.concealed[0][0] if plan.group == FAULTY else "",
        "background": [*BACKGROUND, *([] if "presliding_hysteresis" in known else ["presliding_hysteresis"])],
        "known": {
            "coulomb_friction.level": dict(zip(arm.joints, machine.level.tolist(), strict=True)),
            "viscous_friction.coefficient": dict(zip(arm.joints, machine.viscous.tolist(), strict=True)),
            "rotor_inertia.inertia": dict(zip(arm.joints, machine.rotor.tolist(), strict=True)),
        },
        "joints": J,
        "rate": rate,
        "bits": bits,
    }
    part = folder / "truth.json.part"
    part.write_text(json.dumps(told, indent=1) + "\n", encoding="utf-8")
    part.replace(folder / "truth.json")


def _told(plan: Plan, what: str, size: float, one: Concealed) -> dict[str, object]:
    return {
        "name": what if plan.group != LAWLESS else "",
        "law": what,
        "at": one.at,
        "size": size,
        "channel": f"tau.joint{one.channel + 1}",
        "raw_rms": one.raw,
        "values": one.values,
    }


def _bare(arm, train, rng: Rng) -> Machine:
    """An arm with friction and rotors at all joints, and nothing else."""
    J = len(arm.joints)
    load = arm.dynamics().torque(*train)
    own = np.array([rms(x) for x in load.T])
    own = np.maximum(own, 0.1 * own.max() * rng.uniform(0.3, 1.0, J))
    level = own * np.exp(rng.uniform(np.log(FRICTION[0]), np.log(FRICTION[1]), J))
    speed = np.array([np.abs(x).max() for x in train[1].T])
    calm = np.array([rms(x) for x in train[2].T])
    zero: NDArray = np.zeros(J)
    return Machine(
        arm,
        tuple(Slip.draw(rng, float(np.ptp(q))) for q in train[0].T),
        level,
        level * rng.uniform(0.2, 1.5, J) / speed,
        own * rng.uniform(0.02, 0.2, J) / calm,
        gain=np.ones(J),
        offset=zero,
        drift=zero,
        delay=zero,
    )
