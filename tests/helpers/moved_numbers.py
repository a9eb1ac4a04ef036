"""A deciding number halved and doubled wherever it was imported to, and the smallest size that is named."""

import sys
from collections.abc import Callable
from typing import Any

import numpy as np
from explained import Explained, white

from snarelab.identification import deciding
from snarelab.identification.evidence.evidence import ResidualChannel
from snarelab.identification.evidence.prior import pool
from snarelab.identification.evidence.projected import ProjectedEvidence
from snarelab.identification.evidence.search import Search
from snarelab.identification.nuisance.rest import Zone
from snarelab.models.effects import get_effect
from snarelab.models.model import PlacedEffect

FACTORS = (0.5, 2.0)


def move(monkeypatch, name: str, factor: float) -> None:
    """A number times a factor wherever it was imported to."""
    value = getattr(deciding, name)
    moved: Any = (factor * np.array(value)).tolist() if isinstance(value, tuple) else factor * value
    put(monkeypatch, name, int(moved) if isinstance(value, int) else moved)


def put(monkeypatch, name: str, moved: Any) -> None:
    """A number wherever it was imported to."""
    for module in [m for n, m in sys.modules.items() if n.startswith("snarelab.identification")]:
        own = getattr(module, name, None)
        if own is not None:
            monkeypatch.setattr(module, name, _as(own, moved))


def _as(own: Any, moved: Any) -> Any:
    """A number as a module holds it: an array, one zone or several, or as it is."""
    if isinstance(own, Zone):
        return Zone(*moved)
    if isinstance(own, tuple):
        return tuple(_as(x, y) for x, y in zip(own, moved, strict=True))
    return np.array(moved) if isinstance(own, np.ndarray) else moved


def about(monkeypatch, name: str, value: Any, answer: Callable[[], float]) -> tuple[float, float, float]:
    """An answer at 0.7 times a number that is written in the test, as it is, and at 1.4 times that number.

    It lies between where the program has the test's number, and not where it has half or twice that.
    """
    found = [answer()]
    for factor in (0.7, 1.4):
        with monkeypatch.context() as patch:
            put(patch, name, (factor * np.array(value)).tolist())
            found.append(answer())
    return found[1], found[0], found[2]


def planted(size: float) -> Explained:
    """One of ten columns stands in the residual, with nothing else: its score is what noise leaves on average."""
    made = white(np.random.default_rng(0), 10, {})
    _, x = made.columns.of(0, 0)
    x[:] = np.linalg.qr(x)[0] * np.sqrt(len(x))
    own = made.pieces[0][0]
    made.pieces[0][0] = ResidualChannel(size * x[:, 0].astype(float), own.covariance, own.index, own.columns)
    return made


def smallest(named) -> float:
    """The smallest size that is named, by bisection."""
    low, high = 1e-3, 3.0
    assert named(high)
    assert not named(low)
    for _ in range(25):
        middle = np.sqrt(low * high)
        low, high = (low, middle) if named(middle) else (middle, high)
    return high


def searched(made: Explained, several) -> bool:
    return bool(Search(ProjectedEvidence(made.evidence(), (0,)), several).answer())


def odds_of(made: Explained):
    """The hypotheses as an arm has them: six effects, the first at five joints; four curves."""
    effects = ("viscous_friction",) * 5 + ("coulomb_friction",)
    placed = [PlacedEffect(get_effect(n), f"joint{k}") for k, n in enumerate(effects)]
    named = {p.key: (p, [x]) for p, x in zip(placed, made.items, strict=False)}
    return pool(named, {(0, f"curve {k}"): x for k, x in enumerate(made.items[6:])}, ())
