"""Diagnosis of link-side encoders: search on the training recordings, proof on the held-out one, beside the torques'.

Each step of the search must also make the held-out recording better; of that recording only the encoders' zeros are
taken. What the two kinds of channels say is then put into one answer.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ...models.model import Model, Placed
from ...models.rigid_body import RigidBody
from ...recordings.part import several
from ..fitting.assembly import Assembly
from ..fitting.experiment import Experiment, Scales
from .pair import Pair, PairFit, fit_pair, held_out, load_links, pair_of
from .search import Named, Searched, search_pair, smooth

Array = NDArray[np.float64]

MOST_SEARCHES = 3
"""The first, and two for another explanation of what the held-out recording did not confirm."""

PROVED = 0.05
"""An effect is confirmed if without it, and without what was named after it, the held-out residual energy is so much
higher."""

SMOOTH_BLOCKS = 12


@dataclass(frozen=True)
class Proof:
    """An effect, and the RMS difference left on the held-out recording without it and with it [rad or m]."""

    named: Named
    without: float
    within: float


@dataclass(frozen=True)
class Offset:
    """Constant difference of the zeros, shared by all recordings [rad or m], and the held-out RMS without and with."""

    value: float
    std: float
    without: float
    within: float


@dataclass(frozen=True)
class LinkDiagnosis:
    """One joint's encoders diagnosed.

    Parameters
    ----------
    pair, locked : Pair
        Of the training recordings and the held-out one.
    searched : Searched
        First round's trials, noise and bar.
    steps : tuple of PairFit
        Plain fits: as given, then one for each effect confirmed.
    held : tuple of PairFit
        The same parameters on the held-out recording.
    proofs : tuple of Proof
    offset : Offset or None
    rejected : tuple of Placed
        Passed on the training recordings only.
    nameless : float
        Share of the last residual that smooth curves explain in blocks that they were not fitted to.
    """

    pair: Pair
    locked: Pair
    searched: Searched
    steps: tuple[PairFit, ...]
    held: tuple[PairFit, ...]
    proofs: tuple[Proof, ...]
    offset: Offset | None
    rejected: tuple[Placed, ...]
    nameless: float


def diagnose_links(
    model: Model,
    recordings: Sequence[str | Path],
    holdout: str | Path | Sequence[str | Path],
    body: RigidBody,
    assembly: Assembly,
    theta: Array,
    scales: Mapping[str, Scales],
    band: float,
    *,
    progress: Callable[[str], None] = lambda _: None,
    seed: int = 0,
) -> tuple[tuple[LinkDiagnosis, ...], list[Experiment]]:
    """Diagnose every joint that has a second encoder; nothing where none has.

    Parameters
    ----------
    model : Model
    recordings, holdout : paths
    body : RigidBody
    assembly, theta : Assembly, array (P,)
        Of the torques: their rigid-body part loads the drives.
    scales : mapping of str to Scales
    band : float
        Edge of the analysis band [Hz].
    progress : callable
    seed : int

    Returns
    -------
    diagnoses, and the training recordings with link less motor position in place of torque
    """
    joints, links = load_links(model, recordings, body, band)
    if joints:
        also, locked = load_links(model, several(holdout), body, band)
        joints = tuple(j for j in joints if j in also)
    if not joints:
        return (), []
    answers = []
    for joint in joints:
        progress(f"comparing motor and link encoder of {joint}")
        pairs = [pair_of(joint, model, e, assembly, theta, scales[joint]) for e in (links, locked)]
        answers.append(_diagnose(pairs[0], pairs[1], model, len(joints), seed))
    return tuple(answers), links


def _diagnose(pair: Pair, locked: Pair, model: Model, n_joints: int, seed: int) -> LinkDiagnosis:
    """Search and prove; what the held-out recording does not confirm is barred, and the search goes on without it."""
    places = (pair.joint, f"q.{pair.joint}", f"q_link.{pair.joint}")
    own = ("joint_elasticity", "backlash", "sensor_delay", "sensor_gain", "sensor_drift")
    given = [p for p in model.effects if p.at in places and p.effect.name in own]
    usual = [
        np.array(
            [model.values.get(f"{p.key}.{x.name}", x.zero * pair.scales.of(x.relative_to)) for x in p.effect.parameters]
        )
        for p in given
    ]
    known = {p.key for p in model.effects}
    first, steps, held, proofs = None, [], [], []
    rejected: dict[str, Placed] = {}
    values = np.concatenate([np.zeros(0), *usual])
    for _ in range(MOST_SEARCHES):
        placed = steps[-1].placed if steps else tuple(given)
        if steps:
            values = steps[-1].theta[: len(steps[-1].theta) - len(pair.runs)]
        searched = search_pair(pair, placed, values, n_joints, rejected, seed)
        if first is None:
            first, steps, held = searched, [searched.first], [held_out(pair, locked, searched.first)]
        failed = None
        for named in searched.named:
            now = fit_pair(pair, named.trial.fit.placed, named.trial.fit.theta)
            there = held_out(pair, locked, now)
            if held[-1].energy < (1 + PROVED) * there.energy:
                failed = named.trial.placed
                break
            proofs.append(Proof(named, _rms(held[-1].residual), _rms(there.residual)))
            steps.append(now)
            held.append(there)
        if failed is None:
            break
        rejected[failed.key] = failed
    assert first is not None
    offset = None if f"sensor_bias.q_link.{pair.joint}" in known else _offset(steps[-1], held[-1])
    return LinkDiagnosis(
        pair,
        locked,
        first,
        tuple(steps),
        tuple(held),
        tuple(proofs),
        offset,
        tuple(rejected.values()),
        _nameless(pair, steps[-1]),
    )


def _rms(x: Array) -> float:
    return float(np.sqrt(np.mean(x**2)))


def _offset(found: PairFit, held: PairFit) -> Offset | None:
    """The zero that all recordings share, if it foretells the held-out recording's and stands out of the residual."""
    zeros = found.zeros
    value = float(np.mean(zeros))
    spread = float(np.std(zeros, ddof=1)) if len(zeros) > 1 else 0.0
    variance = held.energy / len(held.residual)
    without, within = (float(np.sqrt(variance + np.mean((held.zeros - x) ** 2))) for x in (0.0, value))
    std = max(spread, _rms(found.residual)) / np.sqrt(len(zeros))
    if abs(value) < 3 * std or without**2 < (1 + PROVED) * within**2:
        return None
    return Offset(value, std, without, within)


def _nameless(pair: Pair, found: PairFit) -> float:
    """Share of the residual that smooth curves explain in blocks that they were not fitted to; 0 where they do not."""
    curves = smooth(pair)
    columns = np.concatenate([found.jacobian, curves - curves.mean(0)], axis=1)
    scale = np.sqrt(np.mean(columns**2, axis=0))
    columns = columns[:, scale > 0] / scale[scale > 0]
    ridge = 1e-3 * np.sqrt(len(columns)) * np.eye(columns.shape[1])
    edges = np.linspace(0, len(columns), SMOOTH_BLOCKS + 1).astype(int)
    left = 0.0
    for a, b in pairwise(edges):
        rest = np.r_[0:a, b : len(columns)]
        padded = np.concatenate([found.residual[rest], np.zeros(len(ridge))])
        weights = np.linalg.lstsq(np.vstack([columns[rest], ridge]), padded, rcond=None)[0]
        left += float(np.sum((found.residual[a:b] - columns[a:b] @ weights) ** 2))
    return max(0.0, 1 - left / found.energy)
