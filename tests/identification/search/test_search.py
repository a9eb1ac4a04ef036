"""Sets of columns that a candidate is tried with, and where a payload sits."""

import numpy as np
import pytest

from bench.arm import random_arm
from snarelab.identification.fitting.assembly import TorqueModel
from snarelab.identification.fitting.experiment import Scales
from snarelab.identification.search.candidates import EffectVariant, variants
from snarelab.models.effects import get_effect
from snarelab.models.model import PlacedEffect
from snarelab.models.urdf import load_urdf


def test_where_a_payload_sits_is_read_off_its_slopes(tmp_path):
    """A small mass near a link's end: to first order in its place, the amplitudes found are its mass and moments."""
    (tmp_path / "arm.urdf").write_text(random_arm(np.random.default_rng(3), 3).urdf())
    tree = load_urdf(tmp_path / "arm.urdf", (0.0, 0.0, -9.81))
    joints = {j.name: Scales(1.0, 1.0, 1.0) for j in tree.joints}
    assembly = TorqueModel(tree, (), None, joints, {})
    (variant,) = variants(assembly, PlacedEffect(get_effect("payload_mass"), tree.links[-1].name))
    assert [len(some) for some in variant.subsets()] == [1, 2, 2, 2, 3, 3, 3, 4]
    assert all(some[0] == 0 for some in variant.subsets())  # never a place without a mass
    (shift,) = variants(assembly, PlacedEffect(get_effect("com_offset"), tree.links[-1].name))
    assert [len(some) for some in shift.subsets()] == [1, 1, 1, 2, 2, 2, 3]
    np.testing.assert_allclose(variant.start(np.array([0.4, 0.008, 0.0, -0.02])), [0.4, 0.02, 0.0, -0.05])
    np.testing.assert_array_equal(variant.start(np.zeros(4)), np.zeros(4))


@pytest.mark.parametrize(
    ("effect", "at", "counted"),
    [
        ("com_offset", "link1", {1: 3, 2: 3, 3: 1}),  # a link's few columns: every set of them, 2³ - 1
        ("external_torque", "base", {1: 3, 3: 1}),  # as few, of no link
        ("inertia_error", "link1", {1: 10, 3: 1, 6: 1, 10: 1}),  # too many for 2¹⁰ - 1: those of one unit
        ("harness_stiffness", "joint1", {1: 1, 2: 1}),  # a spring's rest torque alone would be a bias
    ],
)
def test_every_set_of_columns_is_tried_of_a_links_few_and_else_single_ones_and_all(effect, at, counted):
    placed = PlacedEffect(get_effect(effect), at)
    n = len(placed.effect.parameters)
    sets = EffectVariant(placed, np.zeros(n), np.arange(n), np.zeros(n), np.ones(n)).subsets()
    sizes = [len(some) for some in sets]
    assert {size: sizes.count(size) for size in sizes} == counted
    assert len({tuple(some) for some in sets}) == len(sets)
