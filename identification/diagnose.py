"""From joint-space recordings to a verdict: read, check, decide by one evidence, and say it in words."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from ..models.effects import effects
from ..models.hidden_state import prepare
from ..models.model import Model, effect_on
from ..models.rigid_body import RigidBody
from .answer import report_on
from .arms.kind import ArmFit, ArmRecordings
from .checks.run import early_checks, run_checks
from .data_fault import contradict, data_fault
from .decision.decide import Decision, decide
from .diagnosis import Diagnosis, Step
from .empirical import empirical_laws
from .empirical_answer import with_laws
from .fitting.base_parameters import base_parameters
from .fitting.constants import notes_on, settled, with_constants
from .fitting.experiment import Experiment, load_experiments, scales, with_silence
from .fitting.fit import Fit, channel_rms
from .fitting.friction_curve import friction_curves
from .fitting.held_out import demand_apart
from .fitting.recorded import read_all, with_recorded_joints
from .identify import inertial_values, physical
from .links.answer import with_links
from .links.diagnose import diagnose_links
from .search.refit import without
from .search.rest import fitted
from .simulated import demand_one_process, simulated_kind


@dataclass(frozen=True)
class Answer:
    """A diagnosis, and the model with what it found."""

    diagnosis: Diagnosis
    model: Model


def diagnose(
    model: Model,
    recordings: Sequence[str | Path],
    holdout: str | Path | Sequence[str | Path],
    *,
    progress: Callable[[str], None] = lambda _: None,
    seed: int = 0,
    jobs: int | None = None,
    anyway: bool = False,
) -> Answer:
    """Find, name, add and confirm the physics that a model leaves out.

    Parameters
    ----------
    model : Model
    recordings : sequence of path
        Fitted and searched.
    holdout : path, or sequence of them
        Confirm what the others named; nothing is fitted to them, and no search sees them.
    progress : callable
        Told in a few words what is under way.
    seed : int
        Of random starts.
    jobs : int or None
        Processes in which captures are simulated; None: one a core, at most four. For captures only.
    anyway : bool
        Go on where recordings and model contradict each other; else the verdict is ``data_fault``.

    Raises
    ------
    InputError
        Whatever is wrong with the recordings, a holdout that is one of them, or ``jobs`` for another system.
    """
    held = demand_apart(recordings, holdout)
    simulated = simulated_kind(model.tree)
    if simulated is not None:
        return Answer(*simulated.diagnose(model, recordings, held, progress=progress, jobs=jobs))
    demand_one_process(model, jobs)
    progress("reading and conditioning the recordings")
    prepare(effect_on(effect, model.tree) for effect in effects().values())
    read = read_all(model, [*recordings, *held])
    model = with_recorded_joints(model, read)
    body = RigidBody(model.tree)
    checks = early_checks(model, read)
    if contradict(checks) and not anyway:
        return Answer(data_fault(model, checks), model)
    given = model
    count = len(recordings)
    model, read, said = with_constants(model, read, count)
    train = with_silence(load_experiments(model, recordings, body, datasets=read[:count]))
    band = min(e.motion.band for e in train)
    locked = with_silence(load_experiments(model, held, body, band, datasets=read[count:]))
    checks = run_checks(model, read, [*train, *locked], checks, progress)
    at_links = any(str(name).startswith("q_link.") for d in read for name in d.data_vars)
    del read  # as recorded they are a tenth of all memory, where they came fast
    if contradict(checks) and not anyway:
        return Answer(data_fault(model, checks, [*train, *locked]), given)
    base = base_parameters(body) if model.inertia == "free" else None
    decided = decide(ArmRecordings(model, base, scales(train), train, locked, seed), progress)
    final = decided.best.last.fit
    final, inertia = physical(final, fitted(final.assembly, train))
    steps = _steps(decided, final, train, locked)
    diagnosis = report_on(model, decided, final, steps, train, locked)
    told, laws = empirical_laws(decided, final, train, locked)
    if laws:
        progress("fitting tables to nameless curves")
        told, inertia = physical(told, fitted(told.assembly, train))
        diagnosis = with_laws(diagnosis, model, decided, final, told, laws, train, locked)
        final = told
        model = replace(model, values={**model.values, **{k: v for law in laws for k, v in law.values.items()}})
    values = {**model.values, **final.assembly.values(final.theta), **inertial_values(model, inertia)}
    of_links = tuple(p for p in model.effects if p.at.startswith("q_link."))
    after = replace(model, effects=(*final.assembly.placed, *of_links), values=values)
    if at_links:  # without a second encoder anywhere, they need not be read again
        compared = diagnose_links(
            model, recordings, held, body, final.assembly, final.theta, scales(train), band, progress=progress
        )
        if compared is not None:
            diagnosis, after = with_links(diagnosis, after, compared)
    notes = (*model.tree.notes, *said, *notes_on(final), *diagnosis.notes)
    curves = tuple(friction_curves(final, train))
    return Answer(replace(diagnosis, checks=checks, notes=notes, curves=curves), settled(after))


def _steps(
    decided: Decision[ArmFit], final: Fit, train: Sequence[Experiment], locked: Sequence[Experiment]
) -> tuple[Step, ...]:
    """Relative misfit after each effect is added, all parameters fitted again on the training recordings."""

    def line(label: str, own: Fit) -> Step:
        pair = [channel_rms(own.assembly, e, own.theta) for e in (train, locked)]
        relative = [float(np.sqrt(np.mean((rms / measured) ** 2))) for rms, measured in pair]
        return Step(label, relative[0], relative[1])

    steps = [line("model as given", decided.found.first.fit)]
    names = list(dict.fromkeys(n.placed.effect.name for n in decided.best.names))
    for k, name in enumerate(names):
        later = [n.placed.key for n in decided.best.names if n.placed.effect.name in names[k + 1 :]]
        own = without(final, later, train, decided.found.first.fit) if later else final
        at = [n.placed.at for n in decided.best.names if n.placed.effect.name == name]
        steps.append(line(f"+ {name} at {', '.join(at)}", own))
    return tuple(steps)
