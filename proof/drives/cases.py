"""The cases: which there are, how each is drawn, and what is written of it. All follows from seed and number."""

import copy
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .concealed import Made, TooMuch
from .faults import FAULTS
from .laws import Friction
from .loop import TICK
from .motions import KINDS, STILL, disturbance, motion, scale
from .nameless import NAMELESS, lawless
from .places import joint
from .plant import Logger, Planned, Plant, recorded, rms
from .robots import Rng, believed, random_robot
from .springs import NAMES, SPRINGS, makers

CLEAN, SINGLE, PAIR, LAWLESS, FAULTY = "clean", "single", "pair", "nameless", "faulty"
GROUPS = (CLEAN, SINGLE, PAIR, LAWLESS, FAULTY)
DECK = (*[CLEAN] * 25, *[SINGLE] * 10, *[PAIR] * 8, *[LAWLESS] * 4, *[FAULTY] * 3)
"""Fifty cases: 50, 20, 16, 8 and 6 %. A third of those with something in them have two to four effects."""

SIZES = (0.5, 1.0, 2.0, 4.0)
RECORDINGS = {"train": 20.0, "hold": 12.0, "third": 12.0}  # s
RATES = (100.0, 125.0, 200.0, 250.0, 500.0)  # Hz
BITS = (13, 21)
MOST_ASTRAY = 0.3
"""An arm that strays further from its motion [rad] has lost its servo: another case is drawn."""

ATTEMPTS = 1000
TWIN = "twin"
"""Folder, in a case's, of the same arm with nothing concealed in it: recordings to fit and to score."""

BACKGROUND = ("inertia_error", "com_offset", "payload_mass")
"""Names that are true of a case besides: links whose numbers are 1 to 3 % off. Bristles, where the model has none."""


@dataclass(frozen=True)
class Plan:
    """A case before it is drawn: its group, the kind of its disturbance, and (name, size) of what it conceals."""

    group: str
    disturbance: str
    concealed: tuple[tuple[str, float], ...]


def planned(seed: int, count: int) -> list[Plan]:
    """The first ``count`` cases of a seed, the same however many follow."""
    ones = {
        SINGLE: endless(seed, 1, [(name, size) for name in NAMES for size in SIZES]),
        LAWLESS: endless(seed, 2, [(name, size) for name in NAMELESS for size in (2.0, 4.0)]),
        FAULTY: endless(seed, 8, [(name, 0.0) for name in FAULTS]),
    }
    kinds = {group: endless(seed, 3 + k, KINDS) for k, group in enumerate(GROUPS)}
    pairs = np.random.default_rng([seed, 0, 9])
    plans = []
    for group in dealt(seed, DECK, count):
        one = ones.get(group)
        concealed = _several(pairs) if group == PAIR else (next(one),) if one else ()
        plans.append(Plan(group, next(kinds[group]), concealed))
    return plans


def _several(rng: Rng) -> tuple[tuple[str, float], ...]:
    """Two to four effects, each of a size of its own."""
    several = int(rng.integers(2, 5))
    names = rng.choice(NAMES, several, replace=False).tolist()
    while len(set(names) & set(SPRINGS)) > 1:  # each would be sized by both
        names = rng.choice(NAMES, several, replace=False).tolist()
    return tuple((name, float(rng.choice((1.0, 2.0, 4.0)))) for name in names)


def dealt(seed: int, deck: Sequence[str], count: int) -> list[str]:
    """Groups of the first cases of a seed: a deck after another, each shuffled, so that shares hold from one on."""
    found: list[str] = []
    while len(found) < count:
        rng = np.random.default_rng([seed, 0, 10 + len(found)])
        found += [deck[int(k)] for k in rng.permutation(len(deck))]
    return found[:count]


def endless(seed: int, stream: int, items: Sequence):
    """All items in a random order, then again in another."""
    rng = np.random.default_rng([seed, 1, stream])
    while True:
        for k in rng.permutation(len(items)):
            yield items[int(k)]


@dataclass(frozen=True, eq=False)
class Case:
    """A case that was drawn: recordings by name, each column by name; model and URDF as text; and the answer.

    ``twin``: the recordings to fit and to score, and the model, with nothing concealed; empty where nothing is.
    """

    recordings: Mapping[str, Mapping[str, NDArray]]
    model: str
    urdf: str
    truth: Mapping[str, Any]
    twin: Mapping[str, Mapping[str, NDArray]]
    twin_model: str

    def write(self, folder: Path) -> None:
        """All files; ``truth.json`` last, so that a folder with one is whole."""
        write_arm(folder, self.urdf, self.model, self.recordings)
        if self.twin:
            write_arm(folder / TWIN, self.urdf, self.twin_model, self.twin)
        part = folder / "truth.json.part"
        part.write_text(json.dumps(self.truth, indent=1) + "\n", encoding="utf-8")
        part.replace(folder / "truth.json")


def write_arm(folder: Path, urdf: str, model: str, recordings: Mapping[str, Mapping[str, NDArray]]) -> None:
    """URDF, model and recordings."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "arm.urdf").write_text(urdf, encoding="utf-8")
    (folder / "arm.toml").write_text(model, encoding="utf-8")
    for name, columns in recordings.items():
        table = np.column_stack(list(columns.values()))
        np.savetxt(folder / f"{name}.csv", table, "%.9g", ",", header=",".join(columns), comments="")


def draw(plan: Plan, seed: int, number: int) -> Case:
    """The case of this plan and number, redrawn where hardware has no such effect, or the servo does not hold it."""
    for attempt in range(ATTEMPTS):
        try:
            return _drawn(plan, seed, number, np.random.default_rng([seed, 2, number, attempt]))
        except TooMuch:
            continue
    raise RuntimeError(f"case {number} ({plan}): no such case in {ATTEMPTS} attempts")


def _drawn(plan: Plan, seed: int, number: int, rng: Rng) -> Case:
    bare, motions = background(rng)
    m = Planned.of(bare, motions["train"])
    total = rms(m.torque)
    # What no model explains: as large, against its joint's torque, as on machines (issue 32's second table).
    level = total * np.exp(rng.uniform(np.log(0.015), np.log(0.05), len(total)))
    joints = rng.permutation(len(total))
    if len(plan.concealed) > len(joints):
        raise TooMuch("more effects than joints")
    plant, concealed = bare, []
    for k, (name, size) in enumerate(() if plan.group == FAULTY else plan.concealed):
        # The bodies as they are with what is concealed already.
        along = Planned.of(plant, motions["train"]) if concealed else m
        spot = int(joints[k])
        if plan.group == LAWLESS:
            made = lawless(motions["train"])[name](along, spot, float(size * level[spot]), rng)
        else:
            made = makers(motions["train"])[name](along, spot, size * level, rng)
        if any(joint(made.at) == joint(other.at) for _, _, other in concealed):
            raise TooMuch("two effects at one joint")
        plant = made.plant
        concealed.append((name, size, made))
    return _recorded(plan, seed, number, plant, bare, motions, level, concealed, rng)


def background(rng: Rng) -> tuple[Plant, dict[str, tuple[NDArray, NDArray, NDArray]]]:
    """An arm with nothing missing but bristles and the URDF's errors, and its asked motions by recording."""
    robot = random_robot(rng)
    n = len(robot.links)
    nominal = believed(robot, rng)
    travel, speed = (np.array([getattr(link, x) for link in robot.links]) for x in ("travel", "speed"))
    motions = {name: motion(rng, length, travel, speed) for name, length in RECORDINGS.items()}
    nothing = Friction(np.zeros(n, dtype=np.int64), *(np.full(n, x) for x in (0.0, 0.0, 1.0, 1.0)))
    zero = np.zeros(n)
    bare = Plant(robot, nominal, nothing, zero, 1.0, 0.0, zero, 1.0, 1.0)
    m = Planned.of(bare, motions["train"])
    weight = 9.81 * sum(link.mass for link in robot.links) * sum(link.length for link in robot.links)
    peak = np.maximum(np.abs(m.load).max(axis=0), 3e-3 * weight)
    own = np.maximum(np.ptp(m.load, axis=0), 3e-3 * weight) / np.maximum(np.ptp(m.qdd, axis=0), 1e-9)
    rotor = rng.uniform(0.02, 0.3, n) * np.minimum(own, peak / np.abs(m.qdd).max(axis=0))
    levels = peak * np.exp(rng.uniform(np.log(0.04), np.log(0.25), n))
    friction = Friction(
        rng.integers(0, 3, n),
        levels,
        levels * rng.uniform(0.2, 1.5, n) / speed,
        travel * np.exp(rng.uniform(np.log(2e-4), np.log(1.5e-3), n)),
        speed * rng.uniform(0.05, 0.3, n),
    )
    plant = Plant(
        robot,
        nominal,
        friction,
        rotor,
        bandwidth=float(rng.uniform(2.5, 5.0)),
        ahead=float(rng.choice([1.0, 1.0, -1.0])),
        limit=(peak + 3.0 * levels) * rng.uniform(1.5, 2.5, n),
        lag=float(np.exp(rng.uniform(np.log(5e-4), np.log(4e-3)))),
        count=2.0 * np.pi / 2.0**23,
    )
    return plant, motions


def _recorded(
    plan: Plan,
    seed: int,
    number: int,
    plant: Plant,
    bare: Plant,
    motions: Mapping[str, tuple[NDArray, NDArray, NDArray]],
    level: NDArray,
    concealed: Sequence[tuple[str, float, Made]],
    rng: Rng,
) -> Case:
    rate, bits, n = float(rng.choice(RATES)), int(rng.integers(*BITS)), len(level)
    memory = scale(rng, plan.disturbance)
    noise = level * rng.uniform(0.05, 0.3)
    speeds, step = bool(rng.random() < 0.25), 2.0 * np.pi / 2.0**bits
    rough, jitter = float(rng.uniform(0.0, 0.5)), float(rng.uniform(0.0, 0.02))
    recordings, twin, limited = {}, {}, 0.0

    def reading(arm: Plant, asked: tuple[NDArray, NDArray, NDArray], pushes: NDArray, rng: Rng) -> dict[str, NDArray]:
        nonlocal limited
        true = arm.simulate(asked, pushes)
        if not np.all(np.isfinite(true)) or np.abs(true[:, 0] - asked[0]).max() > MOST_ASTRAY:
            raise TooMuch("the servo loses the arm")
        if arm is plant:
            limited = max(limited, float(np.mean(np.abs(true[:, 3]) > 0.98 * arm.limit)))
        found = recorded(true, arm.sensors, Logger(rate, step, rough, jitter), noise, rng)
        if speeds:
            first, stride = round(STILL / TICK), round(1.0 / (rate * TICK))
            qd = true[first::stride, 1]
            qd = qd + 2e-3 * rms(qd) * rng.standard_normal(qd.shape)
            found |= {f"qd.joint{k + 1}": qd[:, k] for k in range(n)}
        return found

    for name, asked in motions.items():
        pushes = level * disturbance(rng, plan.disturbance, memory, len(asked[0]), n)
        same = copy.deepcopy(rng)
        recordings[name] = reading(plant, asked, pushes, rng)
        if concealed and name != "hold":
            twin[name] = reading(bare, asked, pushes, same)
    if plan.group == FAULTY:
        fault, where, chance = FAULTS[plan.concealed[0][0]], int(rng.integers(1, n)), int(rng.integers(2**31))
        recordings = {part: fault(c, where, np.random.default_rng(chance)) for part, c in recordings.items()}
    bristles = bool(rng.integers(2))
    known = ["viscous_friction", "coulomb_friction", "rotor_inertia", *(["presliding_hysteresis"] if bristles else [])]
    hidden = {(name, made.at) for _, _, made in concealed for name in made.hides}
    joints = [f"joint{k + 1}" for k in range(n)]
    places = [(e, j) for e in known for j in joints]
    values = {
        name: dict(zip(joints, array.tolist(), strict=True))
        for name, array in (
            ("coulomb_friction.level", plant.friction.level),
            ("viscous_friction.coefficient", plant.friction.viscous),
            ("rotor_inertia.inertia", plant.rotor),
        )
    }
    truth = {
        "generator": "drives",
        "seed": seed,
        "case": number,
        "group": plan.group,
        "disturbance": {"kind": plan.disturbance, "scale": memory if np.isfinite(memory) else None},
        "disturbance_rms": dict(zip(joints, level.tolist(), strict=True)),
        "noise_rms": dict(zip(joints, noise.tolist(), strict=True)),
        "effects": [
            {
                "name": name if plan.group != LAWLESS else "",
                "law": name,
                "at": made.at,
                "size": size,
                "channel": f"tau.joint{made.channel + 1}",
                "raw_rms": made.raw,
                "values": dict(made.values),
                "coordinates": made.note,
            }
            for name, size, made in concealed
        ],
        "fault": plan.concealed[0][0] if plan.group == FAULTY else "",
        "background": [*BACKGROUND, *([] if bristles else ["presliding_hysteresis"])],
        "known": values,
        "joints": n,
        "mass": sum(link.mass for link in plant.robot.links),
        "rate": rate,
        "bits": bits,
        "rough": rough,
        "jitter": jitter,
        "limited": limited,
    }
    model, whole = model_text([x for x in places if x not in hidden]), model_text(places)
    return Case(recordings, model, plant.nominal.urdf(), truth, twin, whole)


def model_text(effects: Sequence[tuple[str, str]], more: str = "") -> str:
    """A model file of effects, each (name, place)."""
    listed = ", ".join(f'{{name = "{e}", at = "{at}"}}' for e, at in effects)
    return f'name = "arm"\nsystem = "arm"\nurdf = "arm.urdf"\n{more}effects = [{listed}]\n'
