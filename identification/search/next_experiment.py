"""The next experiment: a motion that separates rivals which the recordings do not separate.

T-optimality (Atkinson and Fedorov 1975): of two rivals A and B, both fitted to what there is, the best motion is the
one along which A's torque stays furthest from B's after B has fitted itself to it. Motions are finite Fourier series
(Swevers et al. 1997) that start and end at rest, within the joints' limits of position and speed (where the URDF has
none, within what the recordings have shown); of many drawn at random the best is kept. Its separation is

    s = √(Σ_channels mean(r²)/σ²),

r what B leaves of A's torque in the analysis band, σ what the model leaves of the recordings: 1 is a difference as
large as all that is unexplained today.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from ...errors import InputError
from ...models.effects import get_effect
from ...models.model import Model, PlacedEffect, effect_on
from ...models.rigid_body import RigidBody
from ...models.tree import Joint
from ...recordings.condition import condition
from ..diagnosis import Diagnosis
from ..fitting.assembly import TorqueModel
from ..fitting.base_parameters import base_parameters
from ..fitting.experiment import Experiment, load_experiments, scales
from ..fitting.fit import channel_rms, fit

Array = NDArray[np.float64]

TRIES = 24
"""Motions drawn."""
DURATION = 20.0
"""Of the motion [s]."""
HARMONICS = 5
RAMP = 1.0
"""In which a motion starts from rest, and ends at it [s]."""
SHOWN = 0.995
"""Quantile of the recorded acceleration that counts as shown: peaks of it are noise."""
SPEED_UP = 0.5
"""A motion takes this long at least to its limit of speed [s]; accelerations that were shown are allowed as well."""
PAIRS = 3
"""Rivals considered at most: each doubles the work."""


@dataclass(frozen=True)
class NextExperiment:
    """A motion to record, and what it promises.

    Parameters
    ----------
    motion : xarray.Dataset
        ``time``, ``q`` and ``qd`` of every joint, as a controller can play it.
    pairs : tuple of (str, str)
        What it parts, each as ``effect at place``.
    now, then : float
        Separation of the closest pair along the recordings that there are, and predicted along the motion.
    """

    motion: xr.Dataset
    pairs: tuple[tuple[str, str], ...]
    now: float
    then: float

    @property
    def sentence(self) -> str:
        """What to do, and what it should show."""
        named = "; ".join(f"{a} from {b}" for a, b in self.pairs)
        return (
            f"Next experiment: the motion written parts {named}: they would differ by {self.then:.2g} times what is "
            f"unexplained today, along the recordings so far by {self.now:.2g}."
        )


def next_experiment(
    model: Model,
    diagnosis: Diagnosis,
    recordings: Sequence[str | Path],
    *,
    tries: int = TRIES,
    duration: float = DURATION,
    progress: Callable[[str], None] = lambda _: None,
    seed: int = 0,
) -> NextExperiment | None:
    """Plan the motion that best separates the named effects from their rivals; None where no rival remains.

    Parameters
    ----------
    model : Model
        As the diagnosis left it, with the effects named and values of all parameters.
    diagnosis : Diagnosis
    recordings : sequence of path
        Those that were fitted.
    tries : int
    duration : float
        [s]
    progress : callable
    seed : int

    Raises
    ------
    InputError
        For a system that is no fixed arm.
    """
    if model.system != "arm":
        raise InputError(f"{model.path}: system {model.system!r} has no motion of its own to plan; only an arm has")
    pairs = rivals(model, diagnosis)
    if not pairs:
        return None
    progress("fitting the rivals")
    body = RigidBody(model.tree)
    train = load_experiments(model, recordings, body)
    base = base_parameters(body) if model.inertia == "free" else None
    known = scales(train)
    own = TorqueModel(model.tree, model.effects, base, known, model.values)
    theta = np.array([model.values.get(s.key, s.start) for s in own.slots])
    sigma = channel_rms(own, train, theta)[0] + 1e-12
    others = []
    for named, rival in pairs:
        placed = [p for p in model.effects if p.key != named.key]
        assembly = TorqueModel(model.tree, [*placed, rival], base, known, model.values)
        others.append((assembly, fit(assembly, train, multi_start=True).theta))

    def separation(experiments: Sequence[Experiment]) -> float:
        """Of the closest pair."""
        shown = [replace(e, motion=replace(e.motion, tau=own.torque(e, theta)), store={}) for e in experiments]
        found = []
        for assembly, start in others:
            fitted = fit(assembly, shown, start=start, multi_start=False).theta
            found.append(np.sqrt(np.sum((channel_rms(assembly, shown, fitted)[0] / sigma) ** 2)))
        return float(min(found))

    rng, best = np.random.default_rng(seed), None
    band, rate = train[0].motion.band, 1 / float(np.median(np.diff(train[0].motion.time)))
    for number in range(tries):
        progress(f"next experiment: motion {number + 1} of {tries}")
        motion = random_motion(model.tree.joints, train, duration, rate, rng)
        torque = {f"tau.{j}": ("time", np.zeros(motion.sizes["time"])) for j in model.joints}
        there = Experiment(condition(motion.assign(torque), model.joints, band), body)
        reached = separation([there])
        if best is None or reached > best[1]:
            best = motion, reached
    if best is None:
        raise ValueError("tries must be one at least")
    words = tuple((f"{a.effect.name} at {a.at}", f"{b.effect.name} at {b.at}") for a, b in pairs)
    return NextExperiment(best[0], words, separation(train), best[1])


def rivals(model: Model, diagnosis: Diagnosis) -> list[tuple[PlacedEffect, PlacedEffect]]:
    """Named effects with their inseparable rivals; if there are none, with the likeliest rival."""
    open_, likely = [], []
    for finding in diagnosis.effects:
        if finding.at.startswith("q_link."):
            continue  # of two encoders no torque says which is off
        placed = [p for p in model.effects if (p.effect.name, p.at) == (finding.name, finding.at)]
        for rival in sorted(finding.rivals, key=lambda r: -r.probability):
            # No motion parts an effect from what holds it and more.
            if placed and finding.name not in get_effect(rival.name).contains:
                pair = placed[0], PlacedEffect(effect_on(get_effect(rival.name), model.tree), rival.at)
                (likely if rival.separable else open_).append(pair)
    return open_[:PAIRS] or likely[:1]


def random_motion(
    joints: Sequence[Joint], train: Sequence[Experiment], duration: float, rate: float, rng: np.random.Generator
) -> xr.Dataset:
    """A motion from rest to rest within the limits of every joint, at ``rate`` [Hz]; where it is free it is random."""
    time = np.arange(0.0, duration, 1 / rate)
    rest = np.clip(np.minimum(time, time[-1] - time) / RAMP, 0, 1)
    window = rest**3 * (10 - 15 * rest + 6 * rest**2)
    variables = {}
    for k, joint in enumerate(joints):
        q, qd, qdd = (np.concatenate([getattr(e.motion, s)[:, k] for e in train]) for s in ("q", "qd", "qdd"))
        low = joint.lower if np.isfinite(joint.lower) else float(q.min())
        high = joint.upper if np.isfinite(joint.upper) else float(q.max())
        limited = 0 < joint.speed < np.inf
        speed = joint.speed if limited else float(np.abs(qd).max())
        acceleration = max(float(np.quantile(np.abs(qdd), SHOWN)), speed / SPEED_UP if limited else 0.0)
        frequency = rng.uniform(1.0, 3.0) / duration * np.arange(1, HARMONICS + 1)
        part = rng.normal(size=(2, HARMONICS)) / np.arange(1, HARMONICS + 1) ** rng.uniform(0, 2)
        wave = part[0] @ np.sin(2 * np.pi * np.outer(frequency, time)) + part[1] @ np.cos(
            2 * np.pi * np.outer(frequency, time)
        )
        wave = window * (wave - wave.mean())
        first = np.gradient(wave, time)
        first[[0, -1]] = 0  # the window's slope there; differences over one side do not see it
        second = np.gradient(first, time)
        middle = rng.uniform(0.35, 0.65) * (high - low) + low
        room = min(high - middle, middle - low)
        most = min(room / np.abs(wave).max(), speed / np.abs(first).max(), acceleration / np.abs(second).max())
        amplitude = most * rng.choice([0.3, 0.95, 0.95])
        variables[f"q.{joint.name}"] = ("time", middle + amplitude * wave)
        variables[f"qd.{joint.name}"] = ("time", amplitude * first)
    return xr.Dataset(variables, coords={"time": time}, attrs={"path": "next experiment", "notes": []})
