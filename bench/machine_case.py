"""One random arm that conceals one mechanism of ``machine_effects`` or none: drawn, recorded in MuJoCo, diagnosed."""

import time
import zlib
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bench.arm import Arm, random_arm
from bench.concealed import FRICTION, Planned, Rng
from bench.lugre import LuGre
from bench.machine_effects import ENTRIES, STEP, Hidden
from bench.machine_parts import Push
from bench.motion import Motion, fourier_motion, point_to_point_motion
from bench.mujoco_plant import CONTROL_RATE, Plant, simulate, write_csv
from bench.parts import Servo
from proof.cases import MOST_ASTRAY, RATE, rattles
from proof.drives.motions import COLOURED, WANDERING, disturbance, scale
from snarelab.identification.diagnose import diagnose
from snarelab.identification.diagnosis import Diagnosis
from snarelab.models.model_file import load_model

TRAIN, HOLDOUT, SETTLE = 20.0, 14.0, 1.0  # s
SIZE = 2.0
"""Of what is concealed, as a multiple of the disturbance's RMS."""

WANDER = 0.2
"""Share of the disturbance's variance that wanders; the rest has a short memory."""

FRICTION_SHARE, FRICTION_LEVELS = (0.06, 0.3), (0.5, 8.0)  # of a joint's peak torque; N·m
AMBIENT, THERMOMETER = (18.0, 24.0), 0.05  # °C, K

ALONE, CLASS, AMONG, ELSEWHERE, WRONG, NOTHING = "alone", "in class", "among others", "elsewhere", "wrong", "nothing"
OUTCOMES = (ALONE, CLASS, AMONG, ELSEWHERE, WRONG, NOTHING)
"""Named alone at the right place; the same for classes that hold it; named there beside wrong names; named, but not
there; only wrong names; no name."""

Named = Sequence[Mapping[str, Any]]


@dataclass(frozen=True, eq=False)
class Case:
    """A case that is not recorded yet."""

    plant: Plant
    motions: tuple[Motion, Motion]
    hidden: Hidden
    rms: float
    noise: float
    rng: Rng

    @property
    def model(self) -> str:
        """Text of the model file: all joints have friction, and nothing of what is concealed."""
        effects = ", ".join(f'"{name}"' for name in FRICTION)
        text = f'name = "arm"\nsystem = "arm"\nurdf = "arm.urdf"\neffects = [{effects}]\n'
        for k, (axis, along) in enumerate(self.hidden.axes.items()):
            factors = ", ".join(f"{joint} = {factor}" for joint, factor in along.items())
            text += ("[axes]\n" if k == 0 else "") + f"{axis} = {{ {factors} }}\n"
        return text

    def write(self, folder: Path) -> None:
        """Model, URDF, ``train.csv`` and ``hold.csv``; ValueError where the arm does not do what it was told."""
        folder.mkdir(parents=True, exist_ok=True)
        (folder / "arm.urdf").write_text(self.plant.arm.urdf())
        (folder / "arm.toml").write_text(self.model)
        ambient = float(self.rng.uniform(*AMBIENT))
        for name, motion, seconds in zip(("train", "hold"), self.motions, (TRAIN, HOLDOUT), strict=True):
            push = Push(self.disturbance(seconds))
            plant = replace(self.plant, mechanisms=(*self.plant.mechanisms, push))
            recording = simulate(plant, motion, seconds, RATE, self.rng, timestep=STEP, settle=SETTLE)
            self.check(recording, motion)
            if self.hidden.heating:
                at = ((recording["time"] + SETTLE) / STEP).round().astype(int)
                theta = np.array(self.hidden.heating.theta)[at]
                noise = THERMOMETER * self.rng.standard_normal(len(at))
                recording[f"temp.{self.hidden.heating.joint}"] = ambient + theta + noise
            write_csv(folder / f"{name}.csv", recording)

    def disturbance(self, seconds: float) -> NDArray:
        """Of the RMS asked for, at the servo's instants (n_instants, n_joints)."""
        size = round((SETTLE + seconds) * CONTROL_RATE) + 1, len(self.plant.arm.links)
        parts = [disturbance(self.rng, kind, scale(self.rng, kind), *size) for kind in (COLOURED, WANDERING)]
        both = np.sqrt(1.0 - WANDER) * parts[0] + np.sqrt(WANDER) * parts[1]
        return self.rms * both / np.sqrt(np.mean(both**2, axis=0))

    def check(self, recording: Mapping[str, NDArray], motion: Motion) -> None:
        """Refuse a recording of an arm that strays from its motion, or whose servo is in a limit cycle."""
        planned = motion(recording["time"])[0]
        for k, joint in enumerate(self.plant.arm.joints):
            if np.abs(recording[f"q.{joint}"] - planned[:, k]).max() > MOST_ASTRAY:
                raise ValueError(f"{joint} strays")
            if rattles(recording[f"tau.{joint}"], self.noise):
                raise ValueError(f"the servo of {joint} rattles")


def draw(entry: str, seed: int, attempt: int) -> Case:
    """The case of an entry and a seed; ValueError where hardware has no such effect on the arm of this attempt."""
    rng = np.random.default_rng([seed, zlib.crc32(entry.encode()), attempt])
    n, rms, noise = int(rng.integers(3, 5)), float(rng.uniform(0.2, 0.4)), float(rng.uniform(0.05, 0.15))
    arm, chosen = random_arm(rng, n), int(rng.integers(n))
    motions = fourier_motion(arm, rng, TRAIN), point_to_point_motion(arm, rng, HOLDOUT, slowest=0.3)
    states = motions[0](np.arange(0.0, TRAIN, 1.0 / RATE))
    laws = _friction(arm, rng, np.abs(Planned(arm, 0, LuGre(1.0), *states, 1.0 / RATE).torque()).max(axis=0))
    planned = Planned(arm, chosen, laws[arm.joints[chosen]], *states, 1.0 / RATE)
    hidden = ENTRIES[entry].make(planned, SIZE * rms, rng)
    plant = Plant(
        arm,
        friction=laws,
        encoder_step={joint: 2.0 * np.pi / 2 ** int(rng.integers(17, 21)) for joint in arm.joints},
        tau_noise=dict.fromkeys(arm.joints, noise),
        servo=Servo(bandwidth=float(rng.uniform(3.0, 5.0)) * min(1.0, 3.5 / n)),
        **hidden.plant,
    )
    return Case(plant, motions, hidden, rms, noise, rng)


def _friction(arm: Arm, rng: Rng, peak: NDArray) -> dict[str, LuGre]:
    """A share of each joint's ``peak`` torque (n_joints,), so that its servo can hold it."""
    levels = np.clip(peak * np.exp(rng.uniform(*np.log(FRICTION_SHARE), size=len(peak))), *FRICTION_LEVELS)
    return {
        joint: LuGre(level=x, viscous=x * float(rng.uniform(0.4, 1.0)))
        for joint, x in zip(arm.joints, levels.tolist(), strict=True)
    }


def record(entry: str, seed: int, folder: Path) -> Case:
    """Write the first attempt that can be recorded."""
    attempt = 0
    while True:
        try:
            case = draw(entry, seed, attempt)
            case.write(folder)
            return case
        except ValueError:
            # No hardware, an arm too slow for the time it has, or one that its servo cannot hold: another arm.
            attempt += 1


def run_case(
    entry: str, seed: int, folder: Path, diagnosed: Callable[[Path], Diagnosis] | None = None
) -> dict[str, Any]:
    """Record a case and score its diagnosis; all that is worth keeping as plain values."""
    start = time.perf_counter()
    case = record(entry, seed, folder)
    found = (diagnosed or _diagnosed)(folder)
    named = [
        {
            "name": e.name,
            "at": e.at,
            "probability": e.probability,
            "class": [[r.name, r.at] for r in e.rivals if not r.separable],
            "parameters": {name: value.value for name, value in e.parameters.items()},
        }
        for e in found.effects
    ]
    return {
        "effect": entry,
        "seed": seed,
        "outcome": outcome(case.hidden.truths, named),
        "verdict": found.verdict,
        "truths": [list(truth) for truth in case.hidden.truths],
        "named": named,
        "value": case.hidden.value,
        "disturbance": case.rms,
        "joints": len(case.plant.arm.links),
        "seconds": round(time.perf_counter() - start, 1),
    }


def _diagnosed(folder: Path) -> Diagnosis:
    return diagnose(load_model(folder / "arm.toml"), [folder / "train.csv"], folder / "hold.csv").diagnosis


def outcome(truths: Sequence[tuple[str, str]], named: Named) -> str:
    """Which of `OUTCOMES` it is to name these where those are true."""
    if not named:
        return NOTHING
    told = [(e["name"], e["at"]) for e in named]
    classes = [{pair, *map(tuple, e["class"])} for pair, e in zip(told, named, strict=True)]
    if Counter(told) == Counter(truths):
        return ALONE
    if len(classes) == len(truths) and _paired(list(truths), classes):
        return CLASS
    if any(t in c for t in truths for c in classes):
        return AMONG
    if any(name == pair[0] for name, _ in truths for c in classes for pair in c):
        return ELSEWHERE
    return WRONG


def _paired(truths: list[tuple[str, str]], classes: list[set]) -> bool:
    """Whether each truth has a class of its own that holds it."""
    if not truths:
        return True
    return any(truths[0] in c and _paired(truths[1:], classes[:k] + classes[k + 1 :]) for k, c in enumerate(classes))
