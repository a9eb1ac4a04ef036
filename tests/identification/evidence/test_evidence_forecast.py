"""What some recordings say of others, against the joint Gaussian density of all samples, in dense matrices."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from explained import explained
from scipy.stats import multivariate_normal

from snarelab.identification.deciding import TOLERANCES
from snarelab.identification.evidence import forecast as module
from snarelab.identification.evidence.forecast import forecast
from snarelab.identification.evidence.weighed import NuisanceColumns

HALF = 0.5 * np.log(2 * np.pi)


def weighed(made, tolerant: slice) -> Any:
    """Recordings with five columns beside, some of which are the masses' tolerance."""
    beside = NuisanceColumns([], 5, tolerant, [], np.array([2.0, 3.0]))
    return SimpleNamespace(evidence=made.evidence(), beside=beside)


def dense(made, own: set[int], weight) -> tuple[float, float]:
    """Log densities of both recordings together, and of the first; columns of ``own`` are each recording's anew."""
    blocks, residuals = [], []
    for i in (0, 1):
        r, k, a, _ = made.stacked((i,))
        residuals.append(r)
        blocks.append((k, a * weight))
    shared = [k for k in range(5) if k not in own]
    (k0, a0), (k1, a1) = blocks
    cross = a0[:, shared] @ a1[:, shared].T
    whole = np.block([[k0 + a0 @ a0.T, cross], [cross.T, k1 + a1 @ a1.T]])
    density: Any = multivariate_normal.logpdf
    joint = density(np.concatenate(residuals), np.zeros(len(whole)), whole)
    return float(joint), float(density(residuals[0], np.zeros(len(k0)), k0 + a0 @ a0.T))


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize(("fixed", "untold"), [((), ()), ((1,), ()), ((), (3, 4)), ((0,), (4,))])
@pytest.mark.parametrize("tolerant", [slice(0, 0), slice(2, 4)])
def test_a_forecast_is_the_density_of_all_over_that_of_the_training_recordings(seed, fixed, untold, tolerant):
    """Averaged over the tolerances: sum of p(both | tolerance) over sum of p(training | tolerance)."""
    made = explained(seed)
    found = forecast(weighed(made, tolerant), (0,), (1,), 2, fixed=fixed, untold=untold)
    pairs = []
    for tolerance in TOLERANCES:
        weight = np.ones(5)
        weight[tolerant] = tolerance
        weight[list(fixed)] = 0.0
        pairs.append(dense(made, set(untold), weight))
    both, first = (np.logaddexp.reduce(x) for x in zip(*pairs, strict=True))
    n = sum(len(own.residual) for own in made.pieces[1])
    assert found.density - n * HALF == pytest.approx(both - first, rel=1e-7)
    assert found.mean.shape == (2,)
    assert [bool(np.any(found.covariance[k])) for k in (0, 1)] == [k not in fixed for k in (0, 1)]


def test_masses_that_are_known_less_well_without_a_name_predict_as_well(monkeypatch):
    """Masses that are off by ten of the least tolerances, in both recordings: a name that tells it is missed by no more
    than three nats if masses may be known less well, and by thousands if they may not."""
    made = explained(0, sizes=((200, 200), (150, 150)))
    rng = np.random.default_rng(5)
    for row in made.pieces:
        for c, own in enumerate(row):
            own.columns[:] = 300 * rng.normal(size=own.columns.shape)
            noise = np.linalg.cholesky(own.covariance.dense()) @ rng.normal(size=len(own.residual))
            row[c] = type(own)(noise, own.covariance, own.index, own.columns)
    told = forecast(weighed(made, slice(0, 5)), (0,), (1,), 2).density
    for row in made.pieces:
        for own in row:
            own.residual[:] += 0.01 * own.columns.sum(axis=1)
    assert abs(told - forecast(weighed(made, slice(0, 5)), (0,), (1,), 2).density) < 3
    monkeypatch.setattr(module, "TOLERANCES", (1e-6,))
    assert told - forecast(weighed(made, slice(0, 5)), (0,), (1,), 2).density > 1000
