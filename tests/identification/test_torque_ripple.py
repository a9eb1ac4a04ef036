"""A ripple that MuJoCo's arm conceals is found at its own period, whatever the travel; an arm without one has none."""

import numpy as np
import pytest
from decided import decided, names
from rippled_arm import rippled, travel

from bench.parts import Ripple
from snarelab.identification.fitting.experiment import load_experiments, scales
from snarelab.identification.fitting.fit import fit
from snarelab.identification.search.refit import assemble
from snarelab.models.rigid_body import RigidBody

ORDER = 60.37
"""Waves a turn: no whole number of them in a turn, nor in the travel."""


def waves(found, key="torque_ripple.joint2.period"):
    """Waves a turn, of a fit."""
    return 2 * np.pi / found.theta[[s.key for s in found.assembly.slots].index(key)]


@pytest.mark.parametrize("order", [9.61, ORDER, 100.2])
def test_a_ripple_is_named_with_its_period(tmp_path, order):
    found = decided(rippled(tmp_path, 1, {"joint2": Ripple(1.0, order, 0.4)}), tmp_path)
    assert names(found) == ["torque_ripple.joint2"]
    # One element: a wave more in the travel.
    assert waves(found.best.fit) == pytest.approx(order, abs=2 * np.pi / travel(tmp_path))


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_an_arm_without_ripple_has_none(tmp_path, seed):
    found = decided(rippled(tmp_path, seed, {}), tmp_path)
    assert "torque_ripple" not in {n.placed.effect.name for n in found.best.names}


def test_a_fit_of_a_model_that_has_a_ripple_starts_from_the_periodogram(tmp_path):
    effects = ("viscous_friction", "coulomb_friction", "torque_ripple")
    model = rippled(tmp_path, 1, {"joint2": Ripple(1.0, ORDER, 0.4)}, effects)
    train = load_experiments(model, [tmp_path / "train.csv"], RigidBody(model.tree))
    found = fit(assemble(model, None, scales(train)), train)
    values = {s.key: v for s, v in zip(found.assembly.slots, found.theta, strict=True)}
    assert waves(found) == pytest.approx(ORDER, abs=0.1)
    size = np.hypot(*(values[f"torque_ripple.joint2.{x}"] for x in ("cosine", "sine")))
    assert size == pytest.approx(1.0, abs=0.1)
