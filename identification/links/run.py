"""A link encoder's difference from the motor encoder, modelled along the recorded motion.

What the two encoders of a joint differ by, channel ``q_link.<joint>`` less ``q.<joint>``, is a measurement of its own,
far finer than either position::

    q_link - q = zero of the recording - twist(load) + late(q) - q + error * q + rate * time

with the twist of an elastic drive or of play in the gear under the modelled rigid-body torque (never the measured one,
which carries friction), and the sensors' laws from the vocabulary. Terms of second order, such as a twist that is read
late, are left out. Each recording has a zero of its own: encoders are referenced anew, and a zero explains no motion.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ...models.hidden_state import evaluate_law
from ...models.model import Model, PlacedEffect
from ...models.rigid_body import RigidBody
from ...recordings.condition import Motion, condition
from ..fitting.experiment import Experiment
from ..fitting.recorded import read_motion

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class EncoderPair:
    """One joint in one recording: ``motion.tau`` holds link less motor position, ``load`` (n,) [N·m or N] the modelled
    rigid-body torque, ``inertia`` (n,) the joint's own entry of the mass matrix."""

    motion: Motion
    joint: int
    load: Array
    inertia: Array

    @cached_property
    def measured(self) -> Array:
        """Link less motor position in the analysis band (n_band,)."""
        return self.motion.to_band(self.motion.tau[:, self.joint])

    def term(self, placed: PlacedEffect, parameters: Array) -> tuple[Array, Array]:
        """What an effect adds to the difference (n,), and its derivative by the effect's parameters (n, p)."""
        motion, j, effect = self.motion, self.joint, placed.effect
        q = motion.q[:, j]
        signals = {
            "q": q,
            "qd": motion.qd[:, j],
            "qdd": motion.qdd[:, j],
            "load": self.load,
            "inertia": self.inertia,
            "value": q,
            "time": motion.time - motion.time[0],
            "temperature": motion.temperature[:, j],
            "speed_scale": np.full(len(q), np.max(np.abs(motion.qd[:, j]))),
        }
        # A late motor encoder makes the link's early against it: time runs backwards.
        direction = slice(None, None, -1) if placed.at.startswith("q.") else slice(None)
        parts = []
        for segment in motion.segments:
            inputs = {name: x[segment][direction] for name, x in signals.items()}
            values, by_parameter, _ = evaluate_law(effect, inputs, parameters, motion.period)
            parts.append((values[direction, 0], by_parameter[direction, 0]))
        values, by_parameter = (np.concatenate(x) for x in zip(*parts, strict=True))
        return (values - q if effect.at == "sensor" else values), by_parameter


def load_links(
    model: Model, recordings: Sequence[str | Path], body: RigidBody, band: float
) -> tuple[tuple[str, ...], list[Experiment]]:
    """Joints that have a link-side encoder in every recording, and the recordings with link less motor position in
    place of torque.

    Parameters
    ----------
    model : Model
    recordings : sequence of path
    body : RigidBody
    band : float
        Edge of the analysis band [Hz].

    Raises
    ------
    InputError
        Whatever is wrong with a recording.
    """
    if model.tree.carriers:
        return (), []
    datasets = [read_motion(model, path) for path in recordings]
    # A column that never changes while the joint moves is no encoder.
    joints = tuple(
        j
        for j in model.joints
        if all(f"q_link.{j}" in d and d[f"q_link.{j}"].max() > d[f"q_link.{j}"].min() for d in datasets)
    )
    if not joints:
        return (), []
    made = []
    for d in datasets:
        zero = d[f"q.{model.joints[0]}"] * 0.0
        difference = {f"tau.{j}": d[f"q_link.{j}"] - d[f"q.{j}"] if j in joints else zero for j in model.joints}
        made.append(Experiment(condition(d.assign(difference), model.joints, band), body))
    return joints, made
