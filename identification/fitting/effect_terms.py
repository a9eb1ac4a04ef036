"""One effect's law along recorded motion: value, derivative by its parameters, and what it does to what it acts on."""

from collections.abc import Callable
from typing import cast

import numpy as np
from numpy.typing import NDArray
from scipy.signal import fftconvolve

from ...models.axes import Place, place
from ...models.effect import Effect
from ...models.hidden_state import evaluate_law, rows
from ...models.model import PlacedEffect
from ...models.rig.points import far_end
from ...models.rig.rig import Rig
from ...models.tree import Tree
from .experiment import Experiment
from .floating_terms import base_signals
from .rig_terms import rig_signals, rig_terms

Array = NDArray[np.float64]

_RESPONSE = 512
"""Samples of a sensor's impulse response that are kept; a delay of 0.2 s at 1 kHz rings out well inside it."""


def contributions(
    experiment: Experiment,
    tree: Tree,
    placed: PlacedEffect,
    joint: int,
    load: Array,
    reading: Array,
    speed_scale: float,
    parameters: Array,
    early_alone: bool,
    bare: bool = False,
) -> tuple[list[tuple[int, Array, Array]], Array | None, Callable[[Array], Array] | None]:
    """What one placed effect adds to the torque channels.

    Parameters
    ----------
    experiment : Experiment
        n samples, J joints.
    tree : Tree
    placed : PlacedEffect
    joint : int
        The joint of the effect's place; of an axis, the first.
    load, reading : array (n, J)
        Rigid-body torque, and torque before a sensor effect [N·m or N].
    speed_scale : float
        The place's peak speed in the training recordings [rad/s or m/s].
    parameters : array (p,)
        All of the effect's parameters.
    early_alone : bool
        Whether a late encoder makes its own channel early, and that alone.
    bare : bool
        Leave out the derivative by the parameters of an effect with hidden states: (n, 0).

    Returns
    -------
    terms : list of (channel, values (n,), derivative by parameters (n, p))
    by_load : array (n,) or None
        Derivative of the torque at the place by the load there.
    passed : callable or None
        For a sensor effect: what it makes of columns (n, k) of the channel.
    """
    effect, motion = placed.effect, experiment.motion
    if effect.at == "link":
        own = slice(10 * joint, 10 * joint + 10)
        change, by_parameter = _link_change(effect, tree, joint, parameters)
        columns = experiment.regressor[:, :, own]
        return [(c, columns[:, c] @ change, columns[:, c] @ by_parameter) for c in range(columns.shape[1])], None, None
    if effect.at in ("sling", "boom"):
        read = rig_signals(experiment, cast(Rig, tree), effect, placed.at)
        values, by_parameter, _ = _by_segment(experiment, effect, read, parameters, bare)
        return rig_terms(experiment, cast(Rig, tree), effect, placed.at, values, by_parameter), None, None
    if effect.at == "base":
        values, by_parameter, _ = _by_segment(experiment, effect, base_signals(experiment), parameters, bare)
        # What the effect gives to the base, nothing else has to supply.
        return [(c, -values[:, c], -by_parameter[:, c]) for c in rows(effect)], None, None
    here = place(tree, tree.joints[joint].name if effect.at == "sensor" else placed.at)
    own, reading = here.load(load), reading[:, joint]
    signals = {
        "q": here.coordinate(motion.q),
        "qd": here.coordinate(motion.qd),
        "qdd": here.coordinate(motion.qdd),
        "load": own,
        "value": reading,
        "time": experiment.elapsed,
        "temperature": motion.temperature[:, joint],
        "speed_scale": np.full(len(load), speed_scale),
    }
    names = [j.name for j in tree.joints]
    for k, other in enumerate(effect.others, 1):
        i = names.index(other)
        signals |= {f"q_of_{k}": motion.q[:, i], f"qd_of_{k}": motion.qd[:, i]}
    if effect.at == "sensor":
        # Against the motion that a late position encoder reads, all that the joint's motion causes is early: time runs
        # backwards.
        encoder = placed.at.startswith("q.")
        direction = slice(None, None, -1) if encoder else slice(None)

        def sensed(value: Array) -> tuple[Array, Array, Array | None]:
            inputs = signals | {"value": value}
            found, by, by_value = _by_segment(experiment, effect, inputs, parameters, bare, direction)
            return found[:, 0] - value, by[:, 0], by_value

        if encoder and not early_alone:
            change, by, by_value = sensed(reading - own)
            moved = [sensed(x[:, joint]) for x in (motion.q, motion.qd, motion.qdd)]
            terms = _along(experiment, joint, *(np.stack(x, 1) for x in list(zip(*moved, strict=True))[:2]))
            terms[joint] = (joint, terms[joint][1] + change, terms[joint][2] + by)
        else:
            change, by, by_value = sensed(reading)
            terms = [(joint, change, by)]
        return terms, None, _passed(experiment, effect, parameters, by_value, direction)
    if effect.states:
        signals["inertia"] = here.inertia(experiment.mass_matrix)
    values, by_parameter, by_load = _by_segment(experiment, effect, signals, parameters, bare)
    if effect.at == "slide":
        return rig_terms(experiment, cast(Rig, tree), effect, placed.at, values, by_parameter), None, None
    if effect.acts_on == "torque":
        return _felt(here, values[:, 0], by_parameter[:, 0]), None if by_load is None else by_load[:, 0, 0], None
    return _along(experiment, joint, values, by_parameter), None, None


def _felt(here: Place, values: Array, by_parameter: Array) -> list[tuple[int, Array, Array]]:
    """What joints feel of a torque (n,) at a place, and of its derivative (n, p)."""
    if here.alone is not None:
        return [(here.alone, values, by_parameter)]
    return [(int(c), here.along[c] * values, here.along[c] * by_parameter) for c in here.channels]


def _along(experiment: Experiment, joint: int, values: Array, by_parameter: Array) -> list[tuple[int, Array, Array]]:
    """What a change of a joint's position, rate and acceleration (n, 3) adds to every channel, to first order."""
    by_position, by_rate = experiment.tangent
    paths = np.stack([by_position[:, :, joint], by_rate[:, :, joint], experiment.mass_matrix[:, :, joint]], 2)
    return [
        (c, np.einsum("nd,nd->n", paths[:, c], values), np.einsum("nd,ndp->np", paths[:, c], by_parameter))
        for c in range(paths.shape[1])
    ]


def _link_change(effect: Effect, tree: Tree, link: int, parameters: Array) -> tuple[Array, Array]:
    """Change of a link's inertial parameters (10,) and its derivative by the effect's parameters (10, p)."""
    phi = tree.links[link].phi
    found = evaluate_law(effect, {"phi": phi[None], "tip": far_end(tree, link)[None]}, parameters)
    return found.values[0] - phi, found.by_parameter[0]


def _passed(
    experiment: Experiment, effect: Effect, parameters: Array, by_value: Array | None, direction: slice
) -> Callable[[Array], Array]:
    """What a sensor makes of any column of its channel: a gain, or its impulse response."""
    segments = experiment.motion.segments
    if effect.states:
        response = _impulse_response(effect, parameters, experiment.motion.period)
        return lambda columns: np.concatenate([_causal(columns[s][direction], response)[direction] for s in segments])
    gain = np.ones(1) if by_value is None else by_value[:, 0, 0]
    return lambda columns: gain[:, None] * columns


def _by_segment(
    experiment: Experiment,
    effect: Effect,
    signals: dict[str, Array],
    parameters: Array,
    bare: bool,
    direction: slice = slice(None),
) -> tuple[Array, Array, Array | None]:
    """The law over all samples; one with hidden states starts afresh, at rest, in every segment."""
    period = experiment.motion.period
    if not effect.states:
        return evaluate_law(effect, signals, parameters, period)
    parts = []
    for segment in experiment.motion.segments:
        inputs = {name: x[segment][direction] for name, x in signals.items()}
        found = evaluate_law(effect, inputs, parameters, period, bare=bare)
        parts.append([x[direction] for x in found if x is not None])
    values, by_parameter, *by_load = (np.concatenate(x) for x in zip(*parts, strict=True))
    return values, by_parameter, by_load[0] if by_load else None


def _impulse_response(effect: Effect, parameters: Array, period: float) -> Array:
    """Reading of a linear sensor for a unit impulse (m,); found from the law itself."""
    impulse = np.zeros(_RESPONSE)
    impulse[1] = 1.0
    response = evaluate_law(effect, {"value": impulse}, parameters, period).values[1:, 0]
    last = np.flatnonzero(np.abs(response) > 1e-9)
    return response[: last[-1] + 1] if len(last) else response[:1]


def _causal(columns: Array, response: Array) -> Array:
    """Columns (n, k) through a causal filter that has seen the first row for ever."""
    lead = np.repeat(columns[:1], len(response) - 1, axis=0)
    return fftconvolve(np.concatenate([lead, columns]), response[:, None], mode="valid", axes=0)
