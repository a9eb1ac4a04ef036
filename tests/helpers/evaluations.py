"""How often models are evaluated along recordings, told apart by everything that an evaluation depends on."""

from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager

import pytest

from snarelab.identification.fitting.assembly import TorqueModel


@contextmanager
def evaluations() -> Iterator[Counter]:
    """While this lasts, the number of evaluations of each model at each recording and parameters."""
    made, counted, kept = TorqueModel._evaluate, Counter(), []

    def evaluate(model, experiment, theta):
        kept.append(experiment)  # while it is there, no other has its number
        free = tuple(s.key for s in model.slots), theta.tobytes()
        effects = tuple(p.key for p in model.placed), tuple(model.values(theta).items())
        counted[effects, free, model.phi.tobytes(), id(experiment)] += 1
        return made(model, experiment, theta)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(TorqueModel, "_evaluate", evaluate)
        yield counted
