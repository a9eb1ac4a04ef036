"""The fits of a decision one after the other: as given, then with each effect more at all places where it was found."""

from .decide import SourceDecision
from .fit import fit, kept_columns, residuals
from .source import Linearisation, Source
from .weigh import covariances

Stage = tuple[str, Linearisation, Linearisation]
"""What was added, and the fit on the training and on the held-out recordings."""


def stages(source: Source, decided: SourceDecision, given: str = "model as given") -> list[Stage]:
    """Fits after each effect is added, every parameter fitted again; the first is called ``given``."""
    best = decided.best
    found = [(given, decided.found.first.train, decided.before)]
    names = list(dict.fromkeys(n.placed.effect.name for n in best.names))
    for k, name in enumerate(names):
        later = [n.placed.key for n in best.names if n.placed.effect.name in names[k + 1 :]]
        own, there = best.last.train, best.last.held
        if later:
            noise = covariances(decided.found.weighed)
            own = fit(source, decided.given, own.at.without(*later), noise, kept_columns(source, own))
            at = source.settled(own.at, source.held)
            there = Linearisation(at, residuals(source, source.held, at), ())
        places = [n.placed.at for n in best.names if n.placed.effect.name == name]
        found.append((f"+ {name} at {', '.join(places)}", own, there))
    return found
