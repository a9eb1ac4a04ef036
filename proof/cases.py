"""The cases of the proof: which there are, how each is drawn, its sealed answer, and its recordings.

A case is a random robot, its friction, disturbances, noise, motions and what it conceals. All of it follows from
(seed, number, attempt), so that answers need not lie on a disk to be scored later.
"""

from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bench.concealed import Concealed, Maker, Planned, Rng, TooMuch
from bench.lugre import LuGre
from bench.motion import Motion, fourier_motion, point_to_point_motion
from bench.mujoco_plant import Servo, write_csv
from bench.parts import Disturbance

from .concealed import MAKERS, with_mass
from .model_text import model_text
from .outside import OUTSIDE
from .plant import ProofPlant, band_rms, floor, record
from .robots import N_JOINTS, by_joint, random_friction, random_robot

RATE = 250.0  # Hz
TRAIN, HOLDOUT, THIRD = 20.0, 12.0, 12.0  # s
RECORDINGS = ("train.csv", "hold.csv", "third.csv")
"""One to fit, one to confirm by, and one that nothing is given until the score."""

SIZES = (0.5, 1.0, 2.0, 4.0)
BANDS = np.arange(2.0, 62.0, 2.0)
"""Edges [Hz] below which a case's floor is noted."""

MOST_ASTRAY = 0.1
"""A recording whose arm strays this far from its motion [rad] is no recording of it: another arm is drawn."""

RATTLING, RATTLE_SHARE, RATTLE_NOISES = 20.0, 0.25, 10.0
"""A torque that has more than this share of its energy above this frequency [Hz], and there this many times its noise,
is a servo's limit cycle: on another arm it would have been tuned again, and another arm is drawn."""

PAIRS = (
    ("stribeck_friction", "harness_stiffness"),
    ("load_dependent_friction", "torque_ripple"),
    ("asymmetric_friction", "payload_mass"),
    ("position_dependent_friction", "sensor_gain"),
    ("rotor_inertia", "sensor_bias"),
    ("quadratic_friction", "com_offset"),
    ("viscous_friction", "sensor_delay"),
    ("coulomb_friction", "joint_elasticity"),
)
DECOYS = ("com_offset", "com_offset", "inertia_error", "inertia_error", "joint_elasticity", "joint_elasticity")
WRONG = ("link too light", "link too light", "link too heavy", "free inertia", "free inertia", "friction values")
SKEWED = ("position late", "position late")
CLEAN, SWALLOWED = 20, 4

ROUND = (
    *(("single", (name,), size) for name in MAKERS for size in SIZES),
    *(("clean", (), 0.0) for _ in range(CLEAN)),
    *(("pair", pair, 2.0) for pair in PAIRS),
    *(("decoy", (name,), 2.0) for name in DECOYS),
    *(("outside", (name,), size) for name in OUTSIDE for size in (2.0, 4.0)),
    *(("wrong", (name,), 2.0) for name in WRONG),
    *(("sensor", (name,), 2.0) for name in SKEWED),
    *(("swallowed", ("load_dependent_friction",), 2.0) for _ in range(SWALLOWED)),
)
"""One round of cases: (group, what is concealed, size as a multiple of the disturbance's RMS)."""


Logged = Callable[[str, Mapping[str, NDArray]], Mapping[str, NDArray]]
"""What is written of a recording, by its name (of `RECORDINGS`) and what the sensors read."""


@dataclass(frozen=True)
class Truth:
    """One right name and its place. ``also``: what hides there with it; two such names together are right as well."""

    name: str
    at: str
    also: tuple[str, ...] = ()


@dataclass(frozen=True)
class Answer:
    """What is sealed of a case.

    ``channels``: where each concealed effect shows most. ``floor``: RMS [T] of what no model explains of a channel of
    the third recording below each band.
    """

    case: int
    group: str
    kinds: tuple[str, ...]
    size: float
    truths: tuple[Truth, ...]
    value: tuple[float, ...]
    disturbance: float
    noise: float
    joints: int
    channels: tuple[str, ...]
    floor: Mapping[str, tuple[float, ...]]

    def to_json(self) -> dict[str, Any]:
        """Plain values."""
        return asdict(self)


@dataclass(frozen=True, eq=False)
class Case:
    """A case before it is recorded: the plant, its motions, the model's text, the answer.

    ``twin`` and ``twin_model``: the same arm with nothing concealed, and a model that knows its friction.
    """

    plant: ProofPlant
    motions: tuple[Motion, Motion, Motion]
    model: str
    answer: Answer
    hidden: tuple[Concealed, ...]
    planned: tuple[Planned, ...]
    noise: tuple[Rng, Rng, Rng] = field(repr=False)
    twin: ProofPlant
    twin_model: str

    def write(self, folder: Path, logged: Logged = lambda _, read: read) -> None:
        """Record it: model, URDF and recordings (`RECORDINGS`), each as ``logged`` makes them of what sensors read.

        Raises ValueError where the arm cannot be recorded.
        """
        folder.mkdir(parents=True, exist_ok=True)
        (folder / "arm.urdf").write_text(self.plant.arm.urdf())
        (folder / "arm.toml").write_text(self.model)
        lengths = (TRAIN, HOLDOUT, THIRD)
        for motion, length, rng, name in zip(self.motions, lengths, self.noise, RECORDINGS, strict=True):
            recording = record(self.plant, motion, length, RATE, rng)
            q = np.column_stack([recording[f"q.{joint}"] for joint in self.plant.arm.joints])
            astray = float(np.abs(q - motion(recording["time"])[0]).max())
            if astray > MOST_ASTRAY:
                raise ValueError(f"the arm strays {astray:.2g} rad from its motion")
            for joint in self.plant.arm.joints:
                if rattles(recording[f"tau.{joint}"], self.answer.noise):
                    raise ValueError(f"the servo of {joint} rattles")
            write_csv(folder / name, logged(name, recording))


def rattles(torque: NDArray, noise: float) -> bool:
    """Whether a servo is in a limit cycle: its torque (n_samples,) [T] is fast, and far stronger than its noise [T]."""
    slow = band_rms(torque[:, None] - torque.mean(), RATE, RATTLING)[0]
    whole = float(np.std(torque))
    return bool(whole**2 - slow**2 > max(RATTLE_SHARE * whole**2, (RATTLE_NOISES * noise) ** 2))


def planned_cases(count: int, seed: int) -> list[tuple[str, tuple[str, ...], float]]:
    """Group, kinds and size of each of ``count`` cases; a round in a random order, then the next."""
    order: list[int] = []
    for k in range(-(-count // len(ROUND))):
        order += np.random.default_rng([seed, k]).permutation(len(ROUND)).tolist()
    return [ROUND[i] for i in order[:count]]


def draw(
    plan: tuple[str, tuple[str, ...], float],
    seed: int,
    number: int,
    attempt: int,
    outside: Mapping[str, Maker] = OUTSIDE,
) -> Case:
    """The case of this number, the same each time; redrawn where hardware has no such effect on such an arm.

    ``outside``: laws without a name by what they are.
    """
    rng = np.random.default_rng([seed, number, attempt])
    while True:
        try:
            return _drawn(plan, number, rng, outside)
        except (TooMuch, ValueError):
            continue


def planned_case(plan: tuple[str, tuple[str, ...], float], seed: int, number: int, attempt: int) -> Case | None:
    """One attempt at a case, whose arm does not depend on the size; or None where hardware has no such effect on it."""
    try:
        return _drawn(plan, number, np.random.default_rng([seed, number, attempt]), OUTSIDE)
    except (TooMuch, ValueError):
        return None


def _drawn(plan: tuple[str, tuple[str, ...], float], number: int, rng: Rng, outside: Mapping[str, Maker]) -> Case:
    group, kinds, size = plan
    n = int(rng.choice(N_JOINTS))
    arm = random_robot(rng, n)
    rms, noise = float(rng.uniform(0.15, 0.5)), float(rng.uniform(0.02, 0.2))
    motions = (
        fourier_motion(arm, rng, TRAIN, terms=int(rng.integers(4, 8)), highest=float(rng.uniform(0.5, 0.9)), share=0.9),
        point_to_point_motion(arm, rng, HOLDOUT, slowest=0.3, share=0.9),
    )
    states = motions[0](np.arange(0.0, TRAIN, 1.0 / RATE))
    peak = np.abs(Planned(arm, 0, LuGre(1.0), *states, 1.0 / RATE).torque()).max(axis=0)
    friction = random_friction(rng, arm, peak)
    spots = [int(k) for k in rng.permutation(n)[: len(kinds)]]
    planned = tuple(Planned(arm, k, friction[arm.joints[k]], *states, 1.0 / RATE) for k in spots)
    makers = outside if group == "outside" else MAKERS
    hidden = [_make(group, kind, m, size * rms, rng, makers) for kind, m in zip(kinds, planned, strict=True)]
    laws, parts = dict(friction), {}
    for made, m in zip(hidden, planned, strict=True):
        if made.law:
            laws[m.name] = made.law
        for name, value in made.plant.items():
            parts[name] = parts.get(name, {}) | value if isinstance(value, dict) else value
    disturbance = Disturbance(rms, float(rng.uniform(0.2, 1.0)), float(rng.uniform(10.0, 15.0)))
    twin = ProofPlant(
        arm,
        friction=friction,
        disturbance=dict.fromkeys(arm.joints, disturbance),
        encoder_step=by_joint(arm, 2.0 * np.pi / 2 ** int(rng.integers(23, 26))),
        tau_noise=by_joint(arm, noise),
        # Long arms couple their joints, and bear a slower servo.
        servo=Servo(bandwidth=float(rng.uniform(3.0, 5.0)) * min(1.0, 3.5 / n)),
    )
    plant = replace(twin, friction=laws, **parts)
    # Drawn last, so that a case is what it was before there was a third: sums of sines, or moves with stops.
    if rng.random() < 0.5:
        terms, highest = int(rng.integers(4, 8)), float(rng.uniform(0.5, 0.9))
        last = fourier_motion(arm, rng, THIRD, terms=terms, highest=highest, share=0.9)
    else:
        last = point_to_point_motion(arm, rng, THIRD, slowest=0.3, share=0.9)
    noises = (rng.spawn(1)[0], rng.spawn(1)[0], rng.spawn(1)[0])
    lowest = floor(plant, THIRD, RATE, noises[2])
    by_band = np.array([band_rms(lowest, RATE, band) for band in BANDS])
    truths = () if group in ("clean", "wrong", "outside") else tuple(map(_truth, kinds, hidden))
    answer = Answer(
        number,
        group,
        kinds,
        size,
        truths,
        tuple(float(h.value) for h in hidden),
        rms,
        noise,
        n,
        tuple(f"tau.{arm.joints[int(np.argmax(shows(m, h)))]}" for m, h in zip(planned, hidden, strict=True)),
        {f"tau.{joint}": tuple(float(f"{x:.5g}") for x in by_band[:, k]) for k, joint in enumerate(arm.joints)},
    )
    secret = {(name, m.name) for h, m in zip(hidden, planned, strict=True) for name in h.unknown}
    model, twin_model = model_text(kinds, hidden, plant, secret), model_text((), hidden, twin, ())
    return Case(plant, (*motions, last), model, answer, tuple(hidden), planned, noises, twin, twin_model)


def _make(group: str, kind: str, m: Planned, rms: float, rng: Rng, makers: Mapping[str, Maker]) -> Concealed:
    if group == "wrong":
        return _wrong(kind, m, rms, rng)
    if group == "sensor":
        x = m.amount(np.gradient(m.smooth_torque, m.period), rms, 0.03)
        return Concealed(f"q.{m.name}", x, plant={"q_delay": {m.name: x}})
    made = makers[kind](m, rms, rng)
    if group == "decoy" and not _shows_elsewhere(m, made):
        raise TooMuch("shows most at its own joint")
    if group == "swallowed":
        raw = made.value * np.abs(m.torque()[:, m.joint])
        if np.sqrt(np.mean(raw**2)) < np.sqrt(2.0) * rms:
            raise TooMuch("refitted friction takes less than half of its energy")
    return made


def _wrong(kind: str, m: Planned, rms: float, rng: Rng) -> Concealed:
    """Nothing but a number of the model that is wrong: a link's mass, every link's, or the model's friction values."""
    link, arm = f"link{m.joint + 1}", m.arm
    if kind == "friction values":
        return Concealed(m.name, 0.0)
    if kind == "free inertia":
        for k, factor in enumerate(rng.uniform(0.8, 1.2, len(arm.links))):
            arm = with_mass(arm, k, float(factor))
        return Concealed(link, 0.2, plant={"real": arm})
    # A factor on the whole link is linear in torque.
    sign = 1.0 if kind == "link too light" else -1.0
    x = sign * m.amount(m.torque(with_mass(arm, m.joint, 2.0)) - m.torque(), rms, 0.6)
    return Concealed(link, x, plant={"real": with_mass(arm, m.joint, 1.0 + x)})


def shows(m: Planned, made: Concealed) -> NDArray:
    """RMS of an effect at every joint (n_joints,) [T], before friction took its part; 1 and 0 where it has one."""
    load, parts = m.torque(), made.plant
    if "com_offset" in parts:
        changed = m.torque(m.arm.with_com_offset(made.at, parts["com_offset"][made.at])) - load
    elif "payload" in parts:
        changed = m.torque(m.arm.with_payload(parts["payload"].mass, parts["payload"].point)) - load
    elif "real" in parts:
        changed = m.torque(parts["real"]) - load
    elif "elasticity" in parts and not parts["elasticity"][m.name].gap:
        twist = np.zeros_like(m.q)
        twist[:, m.joint] = load[:, m.joint] / parts["elasticity"][m.name].stiffness
        changed = load - m.torque(q=m.q - twist)
    else:
        return np.eye(len(m.arm.links))[m.joint]
    return np.sqrt(np.mean(changed**2, axis=0))


def _shows_elsewhere(m: Planned, made: Concealed) -> bool:
    size = shows(m, made)
    return bool(np.delete(size, m.joint).max() > 1.3 * size[m.joint])


def _truth(kind: str, made: Concealed) -> Truth:
    if kind in SKEWED:
        return Truth("sensor_delay", made.at)
    return Truth(kind, made.at, tuple(name for name in made.unknown if name != kind))
