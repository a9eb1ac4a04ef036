"""What the search chooses between: several local effects or one that reaches everywhere, and where a payload sits."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from bench.arm import random_arm
from bench.concealed_arm import run_case
from snarelab.identification.fitting.assembly import Assembly
from snarelab.identification.fitting.experiment import Scales
from snarelab.identification.search.candidates import Variant, variants
from snarelab.identification.search.choice import choose
from snarelab.identification.search.evidence import Channel, Evidence
from snarelab.models.effects import get_effect
from snarelab.models.model import Placed
from snarelab.models.urdf import load_urdf

N = 2000
FREE = np.full(1, -np.inf), np.full(1, np.inf)


def screening(rng: np.random.Generator, wide_size: float, local_size: float) -> tuple[Any, list[Any]]:
    """Two channels of white noise; a wide effect on both, and on each a local one that looks like it (cosine 0.9).

    The truth is ``wide_size`` times the wide effect and ``local_size`` times the local one of the second channel.
    """
    wide = {c: rng.normal(size=(N, 1)) for c in (0, 1)}
    local = {c: 0.9 * wide[c] + np.sqrt(1 - 0.81) * rng.normal(size=(N, 1)) for c in (0, 1)}
    channels = []
    for c in (0, 1):
        y = rng.normal(size=N) + wide_size * wide[c][:, 0] + local_size * c * local[c][:, 0]
        block = np.arange(N) * 10 // N
        channels.append(Channel(np.array([c]), rng.normal(size=(N, 1)), y, rng.normal(size=N), block))
    evidence = Evidence(channels, 2, 10)

    def judged(name: str, columns: dict[int, np.ndarray]) -> Any:
        gain = evidence.gain(evidence.products(list(columns.items())), *FREE)
        placed = SimpleNamespace(key=name, at="", effect=SimpleNamespace(contains=()))
        return SimpleNamespace(
            placed=placed,
            channels=tuple(columns),
            columns=columns,
            price=4.0,
            score=gain.total - 4.0,
            variant=SimpleNamespace(low=FREE[0], high=FREE[1]),
        )

    candidates = [judged("wide", wide), *(judged(f"local{c}", {c: local[c]}) for c in (0, 1))]
    threshold = {(0,): 5.0, (1,): 5.0, (0, 1): 5.0}
    return SimpleNamespace(evidence=evidence, threshold=threshold), sorted(candidates, key=lambda j: -j.score)


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize(
    ("wide", "local", "first", "never"),
    [
        (0.3, 0.0, "wide", "local"),  # one effect on both
        (0.0, 0.5, "local1", "wide"),  # one effect on one: the wide one only looks like it
        (0.3, 0.8, "local1", "local0"),  # both: a strong local effect is no reason against the wide one ...
    ],
)
def test_one_effect_on_all_channels_or_several_on_one_each(seed, wide, local, first, never):
    result, candidates = screening(np.random.default_rng(seed), wide, local)
    chosen = [j.placed.key for j in choose(result, candidates)]
    assert chosen[0] == first
    assert not any(key.startswith(never) for key in chosen)


def test_where_a_payload_sits_is_read_off_its_slopes(tmp_path):
    """A small mass near a link's end: to first order in its place, the amplitudes found are its mass and moments."""
    (tmp_path / "arm.urdf").write_text(random_arm(np.random.default_rng(3), 3).urdf())
    tree = load_urdf(tmp_path / "arm.urdf", (0.0, 0.0, -9.81))
    joints = {j.name: Scales(1.0, 1.0, 1.0) for j in tree.joints}
    assembly = Assembly(tree, (), None, joints, {})
    (variant,) = variants(assembly, Placed(get_effect("payload_mass"), tree.links[-1].name))
    assert [len(some) for some in variant.subsets()] == [1, 2, 2, 2, 3, 3, 3, 4]
    assert all(some[0] == 0 for some in variant.subsets())  # never a place without a mass
    (shift,) = variants(assembly, Placed(get_effect("com_offset"), tree.links[-1].name))
    assert [len(some) for some in shift.subsets()] == [1, 1, 1, 2, 2, 2, 3]
    np.testing.assert_allclose(variant.start(np.array([0.4, 0.008, 0.0, -0.02])), [0.4, 0.02, 0.0, -0.05])
    np.testing.assert_array_equal(variant.start(np.zeros(4)), np.zeros(4))


@pytest.mark.parametrize(
    ("effect", "at", "counted"),
    [
        ("com_offset", "link1", {1: 3, 2: 3, 3: 1}),  # a link's few columns: every set of them, 2³ - 1
        ("external_torque", "base", {1: 3, 3: 1}),  # as few, of no link
        ("inertia_error", "link1", {1: 10, 10: 1}),  # a link's, but too many for 2¹⁰ - 1
        ("harness_stiffness", "joint1", {1: 1, 2: 1}),  # a spring's rest torque alone would be a bias
    ],
)
def test_every_set_of_columns_is_tried_of_a_links_few_and_else_single_ones_and_all(effect, at, counted):
    placed = Placed(get_effect(effect), at)
    n = len(placed.effect.parameters)
    sets = Variant(placed, np.zeros(n), np.arange(n), np.zeros(n), np.ones(n)).subsets()
    sizes = [len(some) for some in sets]
    assert {size: sizes.count(size) for size in sizes} == counted
    assert len({tuple(some) for some in sets}) == len(sets)


def test_a_small_payload_of_which_one_joint_shows_little_is_named():
    """0.77 times the disturbance; the light last joint's residual must not drown what the others lose without it."""
    found = run_case(1, 28)
    assert found["outcome"] == "found", found["named"]
    assert 0.5 < found["named"][0]["parameters"]["mass"] / found["value"] < 2.0
