"""A problem's parameters and channels: grids of shapes, channels reached, and cutting into independent parts."""

from types import SimpleNamespace as Made
from typing import Any

import numpy as np
import pytest

from snarelab.identification.fitting import problem as module
from snarelab.identification.fitting.assembly import Block
from snarelab.identification.fitting.problem import Problem, reached, split
from snarelab.models.effects import get_effect
from snarelab.models.model import PlacedEffect

MOVES = np.array([[True, True, False], [False, True, False], [False, False, True]])
"""The second joint hangs from the first, and the third is on a branch of its own."""


def assembly(*placed, n_joints=3, blocks=()) -> Any:
    """Free parameters of effects one behind the other; scales are 2 a joint's number, by what they refer to."""
    slots, index = [], {}
    for p in placed:
        free = [x.name for x in p.effect.parameters if x.name not in p.hold]
        index[p.key] = np.arange(len(slots), len(slots) + len(free))
        slots += [Made(name=name) for name in free]
    return Made(
        placed=placed,
        slots=slots,
        index_of=lambda p: index[p.key],
        scale=lambda p, x: 2.0 * int(p.at[-1]) if x.relative_to else 1.0,
        origin=lambda p, x: 0.0,
        joint_of=lambda p: int(p.at[-1]) - 1,
        place_of=lambda p: Made(channels=np.array([0, 2] if p.at == "tie" else [int(p.at[-1]) - 1])),
        tree=Made(joints=range(n_joints), n_joints=n_joints, moves=MOVES, coupled=lambda c: (0, 1) if c < 2 else (2,)),
        evaluate=lambda *_: Made(blocks=list(blocks)),
        keep=lambda kept, theta: ("kept", [p.key for p in kept], theta),
    )


def placed(name, at, *hold):
    return PlacedEffect(get_effect(name), at, hold)


def test_shapes_have_the_grids_of_their_free_parameters_in_the_joints_scale():
    several = [
        placed("viscous_friction", "joint1"),  # 0
        placed("stribeck_friction", "joint2"),  # 1 level, 2 speed
        placed("joint_elasticity", "joint3", "stiffness"),  # 3 damping
        placed("stribeck_friction", "joint1", "speed"),  # 4 level
    ]
    problem = Problem(assembly(*several), (), np.arange(3), np.arange(5))
    (first,), (second,) = problem.grids
    assert (first[0], second[0]) == (2, 3)
    np.testing.assert_allclose(first[1], 4.0 * np.array([0.01, 0.03, 0.1, 0.3]))
    np.testing.assert_allclose(second[1], 6.0 * np.array([0.01, 0.1, 1.0]))
    assert problem.shapes.tolist() == [False, False, True, True, False]


@pytest.mark.parametrize(
    ("name", "at", "channels"),
    [
        ("viscous_friction", "joint2", (1,)),
        ("viscous_friction", "tie", (0, 2)),  # an axis of the first joint and the third
        ("sensor_gain", "tau.joint2", (1,)),
        ("joint_elasticity", "joint2", (0, 1)),  # all that feel the motion of the link behind it
        ("payload_mass", "link1", (0,)),
        ("payload_mass", "link2", (0, 1)),
        ("external_torque", "base", (3, 4, 5)),  # a moment, and no force
    ],
)
def test_channels_that_an_effect_can_change(name, at, channels):
    assert reached(assembly(), placed(name, at)) == channels


def block(channel, *index):
    return Block(channel, np.array(index, int), np.zeros((1, len(index))))


@pytest.mark.parametrize(
    ("blocks", "parts"),
    [
        ([block(0, 0), block(1, 1), block(2, 2)], [([0], [0]), ([1], [1]), ([2], [2])]),
        ([block(0, 0, 1), block(2, 2, 1)], [([0, 2], [0, 1, 2])]),  # they share a parameter
        ([block(0, 0), block(2, 2), block(0, 1), block(1, 2)], [([0], [0, 1]), ([1, 2], [2])]),
        # One after the other they are all tied to one another, whatever the order.
        ([block(2, 0), block(0, 1), block(1, 1), block(2, 1)], [([0, 1, 2], [0, 1])]),
        ([block(1, 0)], [([1], [0])]),  # channels without a parameter are left out
        ([block(1), block(2, 0)], [([2], [0])]),
        ([], []),
    ],
)
def test_channels_that_share_a_parameter_belong_together(monkeypatch, blocks, parts):
    monkeypatch.setattr(module, "_part", lambda _assembly, channels, _theta: ("part", channels.tolist()))
    n = 1 + max((int(i) for b in blocks for i in b.index), default=-1)
    whole = assembly(blocks=blocks)
    experiment: Any = Made()
    found = split(whole, [experiment], np.zeros(n))
    assert sorted((p.channels.tolist(), p.index.tolist()) for p in found) == parts
    for p in found:
        assert p.experiments == (experiment,)
        assert p.assembly is whole if len(p.index) == n else p.assembly == ("part", p.channels.tolist())


def test_a_part_has_the_effects_that_reach_its_channels():
    several = [placed("viscous_friction", f"joint{k}") for k in (1, 2, 3)] + [placed("sensor_gain", "tau.joint2")]
    theta = np.zeros(4)
    found: Any = module._part(assembly(*several), np.array([1, 2]), theta)
    assert found[1] == ["viscous_friction.joint2", "viscous_friction.joint3", "sensor_gain.tau.joint2"]
    assert found[2] is theta


def test_columns_that_never_change_are_brought_to_the_band_once():
    """A block with a key is filtered for the first evaluation, and found again for the next."""
    brought = []

    def to_band(x: Any, channel: int) -> Any:
        brought.append(channel)
        return x if x.ndim == 1 else 10.0 * x

    kept = Block(0, np.array([0]), np.array([[1.0], [2.0]]), "kept")
    fresh = Block(0, np.array([1]), np.array([[3.0], [4.0]]))
    tau = np.array([[1.0], [1.0]])
    own: Any = Made(evaluate=lambda *_: Made(blocks=[kept, fresh, block(0), block(1, 5)], tau=tau))
    e: Any = Made(store={}, to_band=to_band, measured=np.array([[5.0], [7.0]]))
    problem = Problem(own, (e,), np.array([0]), np.arange(2))
    for calls in (3, 2):  # two blocks and the torque; the second time one block less
        brought.clear()
        ((residual, index, columns),) = problem.channel_fits(e, np.zeros(2))
        assert len(brought) == calls
        np.testing.assert_array_equal(residual, [4.0, 6.0])
        assert index.tolist() == [0, 1]
        np.testing.assert_array_equal(columns, [[10.0, 30.0], [20.0, 40.0]])
