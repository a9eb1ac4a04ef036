"""From recordings to a verdict: steps 0 to 6 of a diagnosis, for joint-space recordings.

0 condition · 1 fit the baseline · 2 detect · 3 locate · 4 hypothesise · 5 compare and decide (`search`) · 6 confirm
once, on a recording that nothing before has looked at: an effect stays only if taking it out again makes it worse.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..checks.run import early_checks, run_checks
from ..models.effects import effects
from ..models.hidden_state import prepare
from ..models.model import Model
from ..models.rigid_body import RigidBody
from ..models.snare.setup import SnareTree
from .answer import report_on
from .confirm import confirm
from .data_fault import contradict, data_fault
from .diagnosis import Diagnosis, Step
from .fitting.assembly import Assembly
from .fitting.base_parameters import base_parameters
from .fitting.constants import notes_on, settled, with_constants
from .fitting.experiment import Experiment, demand_apart, load_experiments, scales, with_silence
from .fitting.fit import Fit, channel_rms, fit
from .fitting.recorded import read_all, with_recorded_joints
from .identify import demand_one_process, inertial_values, physical
from .links.answer import with_links
from .links.diagnose import diagnose_links
from .search.choice import Taken
from .search.forward import Found, carry, search
from .search.rest import fitted
from .search.stand_ins import stand_ins

Array = NDArray[np.float64]

SECOND_CHOICES = 2
"""Searches for another explanation of what the held-out recording did not confirm."""


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
    jobs: int | None = None,
    anyway: bool = False,
) -> Answer:
    """Find, name, add and confirm the physics that a model leaves out.

    Parameters
    ----------
    model : Model
    recordings : sequence of path
        Fitted and searched.
    holdout : path
        For the proof only: nothing that is fitted or chosen before step 6 depends on it.
    progress : callable
        Told in a few words what is under way.
    seed : int
        Of bootstraps and nulls.
    jobs : int or None
        Processes in which captures are simulated; None: one a core, at most four. For captures only.
    anyway : bool
        Go on where recordings and model contradict each other; else the verdict is ``data_fault``.

    Raises
    ------
    InputError
        Whatever is wrong with the recordings, a holdout that is one of them, or ``jobs`` for another system.
    """
    demand_apart(recordings, holdout)
    if isinstance(model.tree, SnareTree):
        # Loaded here: numba takes longer to load than a short arm to fit.
        from .snare.diagnose import diagnose_captures

        return Answer(*diagnose_captures(model, recordings, holdout, progress=progress, seed=seed, jobs=jobs))
    demand_one_process(model, jobs)
    progress("reading and conditioning the recordings")
    prepare(effects().values())
    *read, held = read_all(model, [*recordings, holdout])
    model = with_recorded_joints(model, [*read, held])
    body = RigidBody(model.tree)
    checks = early_checks(model, [*read, held])
    if contradict(checks) and not anyway:
        return Answer(data_fault(model, checks), model)
    given = model
    model, (*read, held), said = with_constants(model, [*read, held], len(recordings))
    train = with_silence(load_experiments(model, recordings, body, datasets=read))
    band = min(e.motion.band for e in train)
    locked = with_silence(load_experiments(model, [holdout], body, band, datasets=[held]))
    checks = run_checks(model, [*read, held], [*train, *locked], checks, progress)
    if contradict(checks) and not anyway:
        return Answer(data_fault(model, checks, [*train, *locked]), given)
    base = base_parameters(body) if model.inertia == "free" else None
    best = confirm(search(model, base, scales(train), train, progress=progress, seed=seed), train, locked, progress)
    last, rejected = best, {t.judged.placed.key: t for t in best.rejected}
    for _ in range(SECOND_CHOICES):
        if not last.rejected:
            break
        progress("looking for what else could explain what the held-out recording did not confirm")
        again = search(
            model, base, scales(train), train, before=last.found, barred=rejected, progress=progress, seed=seed
        )
        last = confirm(again, train, locked, progress)
        rejected |= {t.judged.placed.key: t for t in last.rejected}
        if np.sum(np.log(last.final.sigma)) < np.sum(np.log(best.final.sigma)):
            best = last
    confirmed, trials, final = best.confirmed, best.trials, best.final
    doubtful, found = stand_ins(best.found, confirmed, final, train)
    if doubtful:
        gone = {t.judged.placed.key for t in doubtful}
        confirmed = tuple(t for t in confirmed if t.judged.placed.key not in gone)
        assembly = final.assembly.keep([p for p in final.assembly.placed if p.key not in gone], final.theta)
        final = fit(assembly, fitted(assembly, train), start=carry(final, assembly), multi_start=False)
    found = replace(found, taken=(*confirmed, *rejected.values()))
    final, inertia = physical(final, fitted(final.assembly, train))
    steps = _steps(found, confirmed, final, train, locked)
    diagnosis = report_on(model, found, confirmed, doubtful, final, trials, steps, train, locked)
    values = {**model.values, **final.assembly.values(final.theta), **inertial_values(model, inertia)}
    of_links = tuple(p for p in model.effects if p.at.startswith("q_link."))
    after = replace(model, effects=(*final.assembly.placed, *of_links), values=values)
    links, compared = diagnose_links(
        model, recordings, holdout, body, final.assembly, final.theta, scales(train), band, progress=progress, seed=seed
    )
    if links:
        diagnosis, after = with_links(diagnosis, after, links, compared)
    notes = (*model.tree.notes, *said, *notes_on(final), *diagnosis.notes)
    return Answer(replace(diagnosis, checks=checks, notes=notes), settled(after))


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
    for k, name in enumerate(names):
        rest = {t.judged.placed.key for t in confirmed if t.judged.placed.effect.name in names[k + 1 :]}
        if rest:
            assembly = old.keep([p for p in old.placed if p.key not in rest], final.theta)
            theta = fit(assembly, fitted(assembly, train), start=carry(final, assembly), multi_start=False).theta
        else:
            assembly, theta = old, final.theta
        at = [t.judged.placed.at for t in confirmed if t.judged.placed.effect.name == name]
        steps.append(line(f"+ {name} at {', '.join(at)}", assembly, theta))
    return tuple(steps)
