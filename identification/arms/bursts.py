"""Bursts of an arm's residual beside all that was found."""

from collections.abc import Sequence
from typing import Any

from ..decision.selection import Selection
from ..evidence.members import Members
from ..fitting.experiment import Experiment
from ..nuisance.bursts import Bursts, ChannelResidual, bursts


def bursts_of(found: Selection[Any], train: Sequence[Experiment], held: Sequence[Experiment]) -> dict[int, Bursts]:
    """Of every channel, beside all that a search found."""
    evidence, on = found.weighed.evidence, found.search.on
    members = Members(on, [(s.taken.item, s.taken.size) for s in found.slots])
    mean = [(s.taken.item, members.of(s.taken.item)) for s in found.slots]
    always = on.beside(mean)
    told: dict[int, Bursts] = {}
    for c in range(len(evidence.channels[0])):
        parts, plain = [], found.weighed.noises[c].plain
        for i, e in enumerate([*train, *held]):
            own = evidence.channels[i][c]
            left = own.residual - own.columns @ always[own.index]
            for item, amplitudes in mean:
                left = left - evidence.contribution(i, c, evidence.items[item], amplitudes)
            step, run = e.motion.period * e.motion.thinning, found.weighed.runs[i][c]
            # What comes and goes may be a vibration's; in units of that it would not.
            k = own.covariance if plain is found.weighed.noises[c] else plain.covariance(run)
            parts.append(ChannelResidual(left, left * k.solve(left), run.settles == 0, step))
        one = bursts(parts[: len(train)], parts[len(train) :])
        if one is not None:
            told[c] = one
    return told
