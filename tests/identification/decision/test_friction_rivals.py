"""A whole friction law is told as another way to write the curve that two names of friction write together."""

from types import SimpleNamespace

import numpy as np
from explained import STEP, Explained

from snarelab.identification.decision import names
from snarelab.identification.evidence.evidence import ResidualChannel
from snarelab.identification.evidence.pool import CandidateColumns, Item
from snarelab.identification.evidence.prior import pool
from snarelab.identification.evidence.projected import ProjectedEvidence
from snarelab.identification.evidence.search import Search
from snarelab.identification.nuisance.covariance import Covariance
from snarelab.models.effects import get_effect
from snarelab.models.model import PlacedEffect

SPEED = np.sin(2 * np.pi * 3.3 * np.linspace(0, 1, 2000)) ** 3
"""As a share of its peak; a third of the time below a tenth of it."""
DRY = np.tanh(SPEED / 1e-3)
STRIBECK = DRY * np.exp(-((SPEED / 0.1) ** 2))
TORQUE = 3.0 * DRY + 2.0 * STRIBECK
TWO = ("coulomb_friction", "stribeck_friction")
WHOLE = 3
"""Number of the whole law in the pool."""


def makkar(fades: float) -> list[np.ndarray]:
    """Columns of the whole law: a bump between two hyperbolic tangents that fades over a speed, dry and viscous."""
    return [DRY - np.tanh(SPEED / fades), DRY, SPEED]


def searched(whole: list[np.ndarray], barred: bool = False) -> Search:
    """The laws of one joint as a diagnosis weighs them, on their torque and white noise of one."""
    laws = {"coulomb_friction": [DRY], "stribeck_friction": [STRIBECK], "viscous_friction": [SPEED]}
    columns, found = CandidateColumns([len(SPEED)]), {}
    for name, own in (laws | {"makkar_friction": whole}).items():
        k, placed = len(own), PlacedEffect(get_effect(name), "joint1")
        label = SimpleNamespace(amplitudes=list(range(k)), count=k)
        item = Item(columns.add({0: [np.stack(own, 1)]}), np.full(k, 4.0), np.ones(k, bool), False, label)
        found[placed.key] = placed, [item]
    white = Covariance(np.ones(len(SPEED)), [], None, STEP, (slice(0, len(SPEED)),))
    noise = np.random.default_rng(5).normal(size=len(SPEED))
    channel = ResidualChannel(TORQUE + noise, white, np.zeros(0, int), np.zeros((len(SPEED), 0)))
    made = Explained([[channel]], columns, [x for _, (x,) in found.values()], 0)
    return Search(ProjectedEvidence(made.evidence(), (0,)), pool(found, {}, ()), (WHOLE,) if barred else ())


def told(run: Search) -> dict[str, dict[str, bool]]:
    """Of each of two names that stand in a set, its rivals, and whether they can be told apart."""
    assert [x.key for x in run.pool[:2]] == [f"{name}.joint1" for name in TWO]
    first = run.take([], 0)
    taken, found = [first, run.take([first], 1)], {}
    for k, t in enumerate(taken):
        slot = run.slot(taken, k)
        assert slot.odds[WHOLE] == -np.inf  # no set has the whole law beside the other name: it has no share
        rivals = names.rivals(run, slot, run.members(taken).of(t.item))
        found[TWO[k]] = {r.placed.effect.name: r.separable for r in rivals}
    return found


def test_the_whole_law_is_a_rival_of_each_of_two_names_of_friction():
    assert told(searched(makkar(0.1))) == {name: {"makkar_friction": False} for name in TWO}


def test_a_whole_law_whose_bump_is_another_is_a_rival_of_coulomb_friction_alone():
    """Its bump fades over a tenth of the other's speed."""
    assert told(searched(makkar(0.01))) == {"coulomb_friction": {"makkar_friction": False}, "stribeck_friction": {}}


def test_a_whole_law_that_was_rejected_is_no_rival():
    assert told(searched(makkar(0.1), barred=True)) == {name: {} for name in TWO}
