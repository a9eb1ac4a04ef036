"""A decision on recordings of a source, with the model as given beside it."""

from collections.abc import Callable
from dataclasses import dataclass

from ..decision.decide import Decision
from ..decision.decide import decide as decide_on
from .fit import residuals
from .kind import SourceFit, SourceRecordings
from .source import Linearisation, ModelPoint, Source


@dataclass(frozen=True)
class SourceDecision(Decision[SourceFit]):
    """A decision, the model as given, and the held-out recordings ``before`` anything was added to it."""

    given: ModelPoint
    before: Linearisation

    @property
    def train(self) -> Linearisation:
        """The training recordings under the confirmed model."""
        return self.best.last.train

    @property
    def held(self) -> Linearisation:
        """The held-out recordings under the confirmed model."""
        return self.best.last.held


def decide(source: Source, given: ModelPoint, progress: Callable[[str], None] = lambda _: None) -> SourceDecision:
    """Name what a model leaves out of some recordings."""
    made = decide_on(SourceRecordings(source, given), progress)
    at = source.settled(made.found.first.train.at, source.held)
    before = Linearisation(at, residuals(source, source.held, at), ())
    return SourceDecision(made.best, made.left, made.rejected, given, before)
