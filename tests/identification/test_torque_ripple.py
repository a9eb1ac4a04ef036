"""A ripple that MuJoCo's arm conceals is found at its own period, whatever the travel; an arm without one has none."""

from dataclasses import replace

import numpy as np
import pytest
from decided import decided, names
from rippled_arm import rippled, travel

from bench.parts import Ripple
from snarelab.identification.fitting.assembly import TorqueModel
from snarelab.identification.fitting.experiment import load_experiments, scales
from snarelab.identification.fitting.fit import fit
from snarelab.identification.search.refit import assemble
from snarelab.models.effects import get_effect
from snarelab.models.model import PlacedEffect
from snarelab.models.model_file import load_model
from snarelab.models.model_write import save_model
from snarelab.models.rigid_body import RigidBody

ORDER = 60.37
"""Waves a turn: no whole number of them in a turn, nor in the travel."""


def waves(found, key="torque_ripple.joint2.period"):
    """Waves a turn, of a fit."""
    return 2 * np.pi / found.theta[[s.key for s in found.assembly.slots].index(key)]


@pytest.mark.parametrize("order", [*(pytest.param(x, marks=pytest.mark.slow) for x in (9.61, 100.2)), ORDER])
def test_a_ripple_is_named_with_its_period(tmp_path, order):
    found = decided(rippled(tmp_path, 1, {"joint2": Ripple(1.0, order, 0.4)}), tmp_path)
    assert names(found) == ["torque_ripple.joint2"]
    # One element: a wave more in the travel.
    assert waves(found.best.last.fit) == pytest.approx(order, abs=2 * np.pi / travel(tmp_path))


@pytest.mark.slow
def test_two_ripples_at_one_joint_are_both_found(tmp_path):
    """A gear's teeth and a motor's poles."""
    both = Ripple(1.0, ORDER, 0.4), Ripple(0.6, 23.23, 1.1)
    found = decided(rippled(tmp_path, 1, {"joint2": both}), tmp_path)
    assert names(found) == ["torque_ripple.joint2", "torque_ripple_2.joint2"]
    element = 2 * np.pi / travel(tmp_path)
    orders = [waves(found.best.last.fit, f"{key}.period") for key in names(found)]
    assert sorted(orders) == [pytest.approx(x, abs=element) for x in (23.23, ORDER)]


def test_an_arm_without_ripple_has_none(tmp_path):
    """How often a clean arm is told a name is counted by the proof."""
    found = decided(rippled(tmp_path, 1, {}), tmp_path)
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


def test_a_further_ripple_is_written_read_and_simulated_like_the_first(tmp_path):
    """Torque along the recorded motion: that of the model without them, and both waves by hand."""
    model = rippled(tmp_path, 1, {}, seconds=(8.0, 8.0))
    names = ("torque_ripple", "torque_ripple_2")
    waves = {"torque_ripple": (0.4, -0.7, 0.1), "torque_ripple_2": (0.2, 0.5, 0.033)}
    values = {f"{n}.joint2.{x}": v for n in names for x, v in zip(("cosine", "sine", "period"), waves[n], strict=True)}
    usual = {"viscous_friction": ("coefficient", 2.0), "coulomb_friction": ("level", 3.0)}
    values |= {f"{n}.{at}.{x}": v for n, (x, v) in usual.items() for at in ("joint1", "joint2")}
    both = model.with_effects([PlacedEffect(get_effect(n), "joint2") for n in names], values)
    both = replace(both, values={**both.values, **{f"speed_scale.joint{k}": 1.0 for k in (1, 2)}})
    save_model(both, tmp_path / "both.toml", "both")
    read = load_model(tmp_path / "both.toml")
    assert [p.key for p in read.effects if p.effect.series] == [f"{n}.joint2" for n in names]
    (run,) = load_experiments(read, [tmp_path / "train.csv"], RigidBody(read.tree))
    q = run.motion.q[:, 1]
    wanted = sum(a * np.cos(2 * np.pi * q / x) + b * np.sin(2 * np.pi * q / x) for a, b, x in waves.values())
    with_it, without = (
        TorqueModel(read.tree, some, None, scales([run]), read.values) for some in (read.effects, model.effects)
    )
    added = with_it.torque(run, with_it.start) - without.torque(run, without.start)
    np.testing.assert_allclose(added[:, 1], wanted, atol=1e-9)
    assert not added[:, 0].any()
