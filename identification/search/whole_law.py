"""Where a joint has one part of a friction law by name, and could have the whole law: what these recordings can say.

Coulomb friction is named first of all that is left of a curve, by the principle of marginality. If what the curve has
besides would not have been seen even as tall as what is named, the recordings cannot tell the part from the whole.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ...models.effects import effects
from ...models.model import Placed
from ..fitting.experiment import Experiment
from ..fitting.fit import Fit
from .choice import RivalOdds, Taken
from .forward import carry, without
from .screening import Screening


def beside_whole_laws(taken: Taken, final: Fit, closing: Screening, train: Sequence[Experiment]) -> Taken:
    """What was taken, its wins shared with the whole laws that it cannot be told from; arguments as `whole_laws`."""
    wholes = whole_laws(taken.judged.placed, final, closing, train)
    if not wholes:
        return taken
    share = taken.probability / (1 + len(wholes))
    others = tuple(r for r in taken.rivals if r.placed not in wholes)
    return replace(taken, probability=share, rivals=(*(RivalOdds(w, share, False) for w in wholes), *others))


def whole_laws(named: Placed, final: Fit, closing: Screening, train: Sequence[Experiment]) -> list[Placed]:
    """Friction laws at a named effect's joint that hold it and more, which could as well be there whole.

    Parameters
    ----------
    named : Placed
    final : Fit
        With it and all else that was named.
    closing : Screening
        Of what is left; its limits say what would have been seen beside all that.
    train : sequence of Experiment
    """
    if named.effect.family != "joint friction":
        return []
    height = _height(named, final, train)
    there = {p.effect.name for p in final.assembly.placed if p.at == named.at}
    found = []
    for whole in effects().values():
        others = [n for n in whole.contains if n not in there]
        if named.effect.name in whole.contains and whole.name not in there and others:
            limits = [_least_height(name, named.at, closing) for name in others]
            if min(limits) > height:
                found.append(Placed(whole, named.at))
    return found


def _height(named: Placed, final: Fit, train: Sequence[Experiment]) -> float:
    """Peak of what an effect makes of its joint's torque."""
    rest = without(final, named)
    c, theta = rest.joint_of(named), carry(final, rest)
    own = [final.assembly.torque(e, final.theta)[:, c] - rest.torque(e, theta)[:, c] for e in train]
    return float(np.max(np.abs(np.concatenate(own))))


def _least_height(name: str, at: str, closing: Screening) -> float:
    """Peak from which on an effect would have been seen; zero where that is not known."""
    own = [j for j in closing.judged if (j.placed.effect.name, j.placed.at) == (name, at)]
    limits = [x.value for x in closing.limits if (x.name, x.at) == (name, at)]
    if not own or not limits:
        return 0.0
    columns, *_ = own[0].everywhere(own[0].variant).values()  # of an axis the first joint's, as `_height` has it
    return min(limits) * float(np.max(np.abs(np.concatenate(columns))))
