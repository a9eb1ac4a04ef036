"""What tables for nameless physics change in a diagnosis: errors, steps, the law itself, and a sentence."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ..models.effect import written_unit
from ..models.empirical import NAME, table_values
from ..models.model import Model
from ..models.table import UNITS
from ..models.tree import Joint
from .answer import channel_fits, moved, traces
from .arms.kind import ArmFit
from .decision.decide import Decision
from .diagnosis import Diagnosis, EmpiricalTable, Finding, Step
from .empirical import EmpiricalLaw
from .fitting.experiment import Experiment
from .fitting.fit import Fit, channel_rms
from .reliability import of_name
from .wording import from_to, listed


def with_laws(
    diagnosis: Diagnosis,
    model: Model,
    decided: Decision[ArmFit],
    named: Fit,
    final: Fit,
    laws: Sequence[EmpiricalLaw],
    train: Sequence[Experiment],
    held: Sequence[Experiment],
) -> Diagnosis:
    """The diagnosis of the fit with names alone, told of the fit with tables beside them.

    ``effects`` lists the tables' laws where nothing has a name; the verdict stays what it is.
    """
    pairs = [channel_rms(f.assembly, held, f.theta) for f in (named, final)]
    joints = [j.name for j in final.assembly.tree.joints]
    findings, tables, sentences, steps = [], [], [], list(diagnosis.steps)
    for law in laws:
        c = joints.index(law.at)
        unit = written_unit("T", final.assembly.tree.joints[c].kind)
        over = listed([t.words for t in law.tables])
        fall = from_to(*(float(rms[c] / measured[c]) for rms, measured in pairs))
        evidence = f"A table over {over} at {law.at} stands for what has no name there: held-out error {fall}."
        sentences.append(evidence)
        tables += [
            EmpiricalTable(
                law.at,
                t.over,
                t.times,
                tuple(np.array(k) for k in t.knots),
                table_values(t, law.at, law.values),
                table_values(t, law.at, law.values, "std."),
                unit,
                tuple(_unit(x, law.at, final.assembly.tree.joints) for x in t.over),
            )
            for t in law.tables
        ]
        gain = max(r.gain for r in decided.left.curves if r.channel == c)
        names = tuple(dict.fromkeys(name for t in law.tables for name in t.over))
        before, after = (float(rms[c]) for rms, _ in pairs)
        explained = max(0.0, 1 - (after / before) ** 2)
        probability = of_name(gain, law.sure, explained)
        findings.append(Finding(NAME, law.at, law.sure, probability, {}, evidence, (), gain, explained, names))
    relative = [
        float(np.sqrt(np.mean((rms / measured) ** 2)))
        for rms, measured in (channel_rms(final.assembly, e, final.theta) for e in (train, held))
    ]
    steps.append(Step(f"+ {NAME} at {', '.join(law.at for law in laws)}", relative[0], relative[1]))
    first = decided.best.found.first.fit
    return replace(
        diagnosis,
        sentence=" ".join([diagnosis.sentence, *sentences]),
        effects=tuple(findings) if diagnosis.verdict == "unknown_effect" else diagnosis.effects,
        moved=moved(first, final),
        fit=channel_fits(model, first, final, train, held),
        traces=traces(first, final, train, held),
        steps=tuple(steps),
        empirical=tuple(tables),
    )


def _unit(coordinate: str, at: str, joints: Sequence[Joint]) -> str:
    """Unit of a table's coordinate, of whichever joint it belongs to."""
    what, _, other = coordinate.partition(" of ")
    joint = next(j for j in joints if j.name == (other or at))
    return written_unit(UNITS[what], joint.kind)
