"""Effects of a suspension rig along recorded motion: what they read, and how what they give reaches the joints."""

import numpy as np
from numpy.typing import NDArray

from ...models.effect import Effect
from ...models.hidden_state import rows
from ...models.rig.kinematics import boom_map, place_map, reached_joints, sling_of
from ...models.rig.points import point_motion
from ...models.rig.rig import Rig
from .experiment import Experiment

Array = NDArray[np.float64]

PLACES = ("sling", "slide", "boom")
"""Kinds of place that only a rig has."""


def rig_signals(experiment: Experiment, rig: Rig, effect: Effect, at: str) -> dict[str, Array]:
    """What a law at a sling or a boom reads, each (n,) or (n, size); a slide's law reads its joint's signals."""
    motion, n = experiment.motion, len(experiment.motion.time)
    if effect.at == "sling":
        sling = sling_of(rig, at)
        key = ("velocity", at)
        if key not in experiment.store:
            found = point_motion(rig, sling.link, sling.point, motion.q, motion.qd)
            experiment.store[key] = found.velocity
        carried = {"weight": np.full(n, sling.weight), "tension": np.full(n, sling.tension)}
        return {"velocity": experiment.store[key], **carried, "time": experiment.elapsed}
    return {"spread": _boom(experiment, rig, at)[1], "time": experiment.elapsed}


def rig_terms(
    experiment: Experiment, rig: Rig, effect: Effect, at: str, values: Array, by_parameter: Array
) -> list[tuple[int, Array, Array]]:
    """Torque on every channel that a law's numbers can reach.

    Parameters
    ----------
    experiment : Experiment
        n samples, J joints.
    rig : Rig
    effect : Effect
    at : str
        Name of its place.
    values : array (n, m)
        What the law gives.
    by_parameter : array (n, m, p)

    Returns
    -------
    list of (channel, values (n,), derivative by parameters (n, p))
    """
    reach, used = _reach(experiment, rig, effect.at, at), list(rows(effect))
    terms = []
    for c in reached_joints(rig, effect.at, at, rows(effect)):
        torque, columns = np.zeros(len(values)), np.zeros((len(values), by_parameter.shape[2]))
        for m in used:
            torque += reach[:, c, m] * values[:, m]
            columns += reach[:, c, m, None] * by_parameter[:, m]
        terms.append((c, torque, columns))
    return terms


def _reach(experiment: Experiment, rig: Rig, kind: str, at: str) -> Array:
    """Drive torque per number that a law gives (n, J, m)."""
    if kind == "boom":
        return _boom(experiment, rig, at)[0]
    key = (kind, at)
    if key not in experiment.store:
        # One joint's samples side by side: they are used joint by joint.
        experiment.store[key] = np.asfortranarray(place_map(rig, kind, at, experiment.motion.q))
    return experiment.store[key]


def _boom(experiment: Experiment, rig: Rig, at: str) -> tuple[Array, Array]:
    """Reach (n, J, 2) and spread (n, 2) of a boom."""
    keys = ("boom", at), ("spread", at)
    if keys[0] not in experiment.store:
        found = boom_map(rig, [link.name for link in rig.links].index(at), experiment.motion.q)
        experiment.store.update(zip(keys, found, strict=True))
    return experiment.store[keys[0]], experiment.store[keys[1]]
