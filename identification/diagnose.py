"""From recordings to a verdict: steps 0 to 6 of a diagnosis, for joint-space recordings.

0 condition · 1 fit the baseline · 2 detect · 3 locate · 4 hypothesise · 5 compare and decide (`search`) · 6 confirm
once, on a recording that nothing before has looked at: an effect stays only if taking it out again makes it worse.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..models.effects import effects
from ..models.hidden_state import prepare
from ..models.model_file import Model
from ..models.rigid_body import RigidBody
from .answer import report_on
from .assembly import Assembly
from .base_parameters import base_parameters
from .diagnosis import Diagnosis, Step
from .experiment import Experiment, demand_apart, demand_torque, load_experiments, scales
from .fit import Fit, channel_rms, fit
from .identify import inertial_values, physical
from .search import Found, Taken, carry, search, without

Array = NDArray[np.float64]

CONFIRM = 0.05
"""An effect is confirmed if the held-out residual energy of its channels rises by this share when it is taken out."""


@dataclass(frozen=True)
class Answer:
    """A diagnosis, and the model with what it found."""

    diagnosis: Diagnosis
    model: Model


def diagnose(
    model: Model,
    recordings: Sequence[str | Path],
    holdout: str | Path,
    *,
    progress: Callable[[str], None] = lambda _: None,
    seed: int = 0,
) -> Answer:
    """Find, name, add and confirm the physics that a model leaves out.

    Parameters
    ----------
    model : Model
    recordings : sequence of path
        Fitted and searched.
    holdout : path
        Opened for the proof only.
    progress : callable
        Told in a few words what is under way.
    seed : int
        Of bootstraps and nulls.

    Raises
    ------
    InputError
        Whatever is wrong with the recordings, or a holdout that is one of them.
    """
    demand_apart(recordings, holdout)
    progress("reading and conditioning the recordings")
    prepare(effects().values())
    body = RigidBody(model.tree)
    train = load_experiments(model, recordings, body)
    band = min(e.motion.band for e in train)
    locked = load_experiments(model, [holdout], body, band)
    demand_torque([*train, *locked])
    base = base_parameters(body) if model.inertia == "free" else None
    found = search(model, base, scales(train), train, progress=progress, seed=seed)
    progress("confirming on the held-out recording")
    confirmed, trials = _confirm(found, train, locked)
    final = found.fit
    for t in found.taken:
        if t not in confirmed:
            assembly = without(final, t.judged.placed)
            final = fit(assembly, train, start=carry(final, assembly), multi_start=False)
    final, inertia = physical(final, train)
    steps = _steps(found, confirmed, final, train, locked)
    diagnosis = report_on(model, found, confirmed, final, trials, steps, train, locked)
    values = {**model.values, **final.assembly.values(final.theta), **inertial_values(model, inertia)}
    return Answer(diagnosis, replace(model, effects=final.assembly.placed, values=values))


def _confirm(
    found: Found, train: Sequence[Experiment], locked: Sequence[Experiment]
) -> tuple[list[Taken], Mapping[str, tuple[float, float]]]:
    """Effects whose removal (all else fitted again) makes the held-out recording worse; errors with and without
    each."""
    with_all, measured = channel_rms(found.fit.assembly, locked, found.fit.theta)
    confirmed, trials = [], {}
    for t in found.taken:
        placed = t.judged.placed
        assembly = without(found.fit, placed)
        again = fit(assembly, train, start=carry(found.fit, assembly), multi_start=False)
        rms, _ = channel_rms(assembly, locked, again.theta)
        c = list(t.judged.channels)
        energy = [float(np.sum((x[c] / measured[c]) ** 2)) for x in (with_all, rms)]
        if energy[1] > (1 + CONFIRM) * energy[0]:
            confirmed.append(t)
        worst = c[int(np.argmax(rms[c] / measured[c] - with_all[c] / measured[c]))]
        trials[placed.key] = (float(with_all[worst] / measured[worst]), float(rms[worst] / measured[worst]))
    return confirmed, trials


def _steps(
    found: Found, confirmed: Sequence[Taken], final: Fit, train: Sequence[Experiment], locked: Sequence[Experiment]
) -> tuple[Step, ...]:
    """Relative misfit after each effect is added, all parameters fitted again on the training recordings."""

    def line(label: str, assembly: Assembly, theta: Array) -> Step:
        pair = [channel_rms(assembly, e, theta) for e in (train, locked)]
        relative = [float(np.sqrt(np.mean((rms / measured) ** 2))) for rms, measured in pair]
        return Step(label, relative[0], relative[1])

    steps = [line("model as given", found.first.assembly, found.first.theta)]
    names = list(dict.fromkeys(t.judged.placed.effect.name for t in confirmed))
    old = final.assembly
    values = old.values(final.theta)
    for k, name in enumerate(names):
        rest = {t.judged.placed.key for t in confirmed if t.judged.placed.effect.name in names[k + 1 :]}
        if rest:
            assembly = Assembly(old.tree, [p for p in old.placed if p.key not in rest], old.base, old.scales, values)
            theta = fit(assembly, train, start=carry(final, assembly), multi_start=False).theta
        else:
            assembly, theta = old, final.theta
        at = [t.judged.placed.at for t in confirmed if t.judged.placed.effect.name == name]
        steps.append(line(f"+ {name} at {', '.join(at)}", assembly, theta))
    return tuple(steps)
