"""A recording beside its rigid body: bridges, what counts, scales, silence, tensions, and copies of a holdout."""

from dataclasses import replace
from functools import partial
from types import SimpleNamespace as Made
from typing import Any

import numpy as np
import pytest
import xarray as xr
from moving_arm import exact

from snarelab.errors import InputError
from snarelab.identification.fitting import experiment as module
from snarelab.identification.fitting import recorded
from snarelab.identification.fitting.experiment import (
    Bridge,
    Experiment,
    Scales,
    load_experiments,
    scales,
    with_silence,
    without_torque,
)
from snarelab.identification.fitting.held_out import demand_apart
from snarelab.identification.fitting.recorded import motion_signals
from snarelab.models.floating.tree import FloatingTree
from snarelab.models.regressor import Regressor
from snarelab.models.rig.rig import Rig
from snarelab.models.tree import Tree

N = 6


def run(tau, q=None, qd=None, body=None, first=3.0, **changed) -> Any:
    tau = np.array(tau, float)
    t = first + 0.5 * np.arange(len(tau))
    names = tuple(f"joint{k + 1}" for k in range(tau.shape[1]))
    q, qd = (0 * tau if x is None else np.array(x, float) for x in (q, qd))
    motion = replace(exact(names, 0.5, 1, (t, q, qd, 0 * tau, tau)), **changed)
    none: Any = None
    return Experiment(motion, body or none)


def test_a_bridge_leads_over_every_channel_of_what_it_is_given():
    """Sample 1 a quarter of the way from 0 to 4."""
    bridge = Bridge(np.array([1]), np.array([0]), np.array([4]), np.array([0.25]))
    x = np.arange(2.0 * N).reshape(N, 2) ** 2
    found = bridge(x)
    np.testing.assert_allclose(found[1], 0.75 * x[0] + 0.25 * x[4])
    np.testing.assert_array_equal(np.delete(found, 1, 0), np.delete(x, 1, 0))
    np.testing.assert_allclose(bridge(x[:, 0]), found[:, 0])
    deep = np.stack([x, 2 * x], 2)
    np.testing.assert_allclose(bridge(deep)[:, :, 1], 2 * found)


def test_a_bridge_of_several_samples_goes_a_part_of_the_way_at_each():
    """From 1 at sample 0 to 16 at sample 3 it is 5 a sample, in every column."""
    bridge = Bridge(np.array([1, 2]), np.array([0, 0]), np.array([3, 3]), np.array([1 / 3, 2 / 3]))
    x = np.arange(1.0, 5.0) ** 2
    np.testing.assert_allclose(bridge(x), [1, 6, 11, 16])
    np.testing.assert_allclose(bridge(np.stack([x, -x], 1)), np.stack([bridge(x), -bridge(x)], 1))
    np.testing.assert_allclose(bridge(x[:, None, None] * np.ones((2, 3)))[:, 1, 2], [1, 6, 11, 16])


def test_a_floating_bases_own_momentum_stands_on_the_measured_side():
    """The base is the sixth link, and the first six channels are its own: 2 there for a unit of each parameter."""
    tree: Any = Made(links=(*(5 * [None]), Made(phi=np.arange(1.0, 11.0)), None))
    tree.carried = partial(FloatingTree.carried, tree)
    moves = np.zeros((7, 7), bool)
    moves[:6, 5] = moves[:, 6] = True
    regressor = Regressor(np.full((N, 130), 99.0), moves)
    for _, columns in regressor.of_link(5):
        columns[:] = 2.0
    e = run(np.full((N, 7), 1000.0), body=Made(tree=tree))
    e.__dict__["regressor"] = regressor
    np.testing.assert_allclose(e.carried, np.tile([*(6 * [110.0]), 0.0], (N, 1)))
    np.testing.assert_allclose(module._balanced(e).motion.tau, 1000.0 - e.carried)


@pytest.mark.parametrize(("measured", "excess"), [({}, 0.0), ({"left": np.full(N, 450.0)}, 50.0)])
def test_slings_carry_the_weight_and_what_more_they_were_measured_to_pull(monkeypatch, measured, excess):
    """Weight asks 3 and 4; a newton of the left sling, in balance at 400, takes 0.5 off the first joint."""
    left = Made(name="left", tension=400.0, link=1, point=(0.0, 0.0, 0.1))
    tree: Any = Made(slings=(left, Made(name="right", tension=300.0, link=0, point=(0.0, 0.0, 0.2))))
    tree.carried = partial(Rig.carried, tree)

    def moved(_rig, link, point, q, qd):
        assert (link, point) == (left.link, left.point)
        return Made(jacobian=-np.tile(np.array([[9.0, 9.0], [9.0, 9.0], [0.5, 0.0]]), (len(q), 1, 1)))

    monkeypatch.setattr("snarelab.models.rig.rig.point_motion", moved)
    weight: Any = Made(tree=tree, torque=lambda q, qd, qdd: np.tile([3.0, 4.0], (len(q), 1)) + 7 * (qd + qdd))
    e = replace(run(np.ones((N, 2)), q=np.ones((N, 2)), qd=np.ones((N, 2)), body=weight), tension=measured)
    np.testing.assert_allclose(e.carried, np.tile([3.0 - 0.5 * excess, 4.0], (N, 1)))
    plain: Any = Made()
    plain.carried = partial(Tree.carried, plain)
    assert not run(np.ones((N, 2)), body=Made(tree=plain)).carried.any()


def test_bridges_and_samples_that_count_are_each_channels_own():
    e = run(np.arange(2.0 * N).reshape(N, 2) ** 2)
    bridges = tuple(Bridge(np.array([k]), np.array([0]), np.array([4]), np.array([0.5])) for k in (1, 2))
    kept = np.ones((N, 2), bool)
    kept[5, 0] = kept[0, 1] = kept[3, 1] = False
    half = replace(e, bridged=bridges, store={})
    some = replace(e, bridged=bridges, kept=kept, store={})
    x = e.motion.tau
    wanted = x.copy()
    wanted[1, 0], wanted[2, 1] = (x[0, 0] + x[4, 0]) / 2, (x[0, 1] + x[4, 1]) / 2
    np.testing.assert_allclose(half.measured, wanted)
    np.testing.assert_allclose(some.measured, wanted * kept)
    np.testing.assert_allclose(some.to_band(x[:, 1], 1), wanted[:, 1] * kept[:, 1])
    columns = some.to_band(np.stack([x[:, 0], 3 * x[:, 0]], 1), 0)
    np.testing.assert_allclose(columns[:, 1], 3 * wanted[:, 0] * kept[:, 0])
    np.testing.assert_array_equal(some.counted, [5, 4])
    np.testing.assert_array_equal(half.counted, [N, N])
    np.testing.assert_allclose(e.elapsed, 0.5 * np.arange(N))


def test_scales_are_peaks_over_all_recordings_and_never_zero():
    body: Any = Made(tree=Made(axes=()))
    first = run([[1.0, 0], [-7.0, 0]], [[-1.0, 0], [2.0, 0]], [[3.0, 0], [-4.0, 0]], body)
    second = run([[6.0, 0], [0.0, 0]], [[5.0, 0], [4.0, 0]], [[1.0, 0], [1.0, 0]])
    found = scales([first, second])
    assert found["joint1"] == Scales(speed=4.0, travel=6.0, torque=7.0, middle=2.0)
    assert found["joint2"] == Scales(1e-9, 1e-9, 1e-9)
    words = ("", "speed", "travel", "torque", "rate")
    assert [Scales(4.0, 5.0, 8.0).of(word) for word in words] == [1.0, 4.0, 5.0, 8.0, 1.6]
    moved = Scales(4.0, 5.0, 8.0, middle=3.0)
    assert [(moved.origin(word), moved.of(word)) for word in ("place", "travel")] == [(3.0, 5.0), (0.0, 5.0)]


def arm(modelled, n_joints=2, carriers=0) -> Any:
    """A body whose torque is the same at all times."""
    torque = np.tile(np.array(modelled, float), (N, 1))
    joints = tuple(Made(name=f"joint{k + 1}") for k in range(n_joints))
    return Made(tree=Made(joints=joints, carriers=carriers), torque=lambda *_: torque)


def silenced(torque, modelled, carried=0.0, carriers=0):
    e = run(np.tile(np.array(torque, float), (N, 1)), body=arm(modelled, carriers=carriers))
    e.__dict__["carried"] = np.full(e.motion.tau.shape, carried)
    (found,) = with_silence([e])
    return e, found


@pytest.mark.parametrize(
    ("second", "modelled", "carried"),
    [
        (0.0, 0.0, 0.0),
        (9.9e-10, 0.0, 0.0),  # 1e-10 of the 10 N·m on the first joint, and the model has nothing there either
        (0.0, 9e-6, 0.0),  # to a millionth
        (0.0, 3.0, 3.0),  # slings carry it
    ],
)
def test_a_torque_that_reads_nothing_where_there_is_none_gets_a_floor_of_noise(second, modelled, carried):
    e, found = silenced([10.0, second], [5.0, modelled], carried)
    assert found.motion.silent == (1,)
    np.testing.assert_array_equal(found.motion.tau[:, 0], 10.0)
    noise = found.motion.tau[:, 1] / 1e-5  # a millionth of 10
    assert 0.2 < np.std(noise) < 2.5
    assert len(np.unique(noise)) == N
    np.testing.assert_array_equal(e.motion.tau[:, 1], second)
    assert found.motion.notes == ("tau.joint2: zero in every row, as the model has it; nothing is judged there",)


@pytest.mark.parametrize(
    ("torque", "modelled", "carried", "joint"),
    [
        ([10.0, 0.0], [5.0, 1.1e-5], 0.0, "joint2"),
        ([10.0, 0.0], [5.0, 0.0], 3.0, "joint2"),
        ([0.0, 10.0], [-1.0, 0.0], 0.0, "joint1"),
        ([0.0, 0.0], [0.0, 0.0], 0.0, "joint1"),  # nothing was recorded at all
    ],
)
def test_a_torque_that_reads_nothing_where_the_model_has_some_was_not_recorded(torque, modelled, carried, joint):
    with pytest.raises(InputError, match=rf"^run\.csv: 'tau\.{joint}' is zero in every row"):
        silenced(torque, modelled, carried)


def test_a_torque_that_reads_anything_is_left_alone():
    e, found = silenced([10.0, 1.1e-9], [5.0, 5.0])
    assert found is e


def test_a_base_that_floats_in_a_plane_may_have_no_force():
    _, found = silenced([0.0, 10.0], [5.0, 10.0], carriers=1)
    assert found.motion.silent == (0,)
    with pytest.raises(InputError, match=r"'tau\.joint2' is zero"):
        silenced([10.0, 0.0], [5.0, 10.0], carriers=1)


def test_a_holdout_must_not_be_among_what_is_fitted(tmp_path):
    for name, text in (("one.csv", "a"), ("two.csv", "b"), ("copy.csv", "a")):
        (tmp_path / name).write_text(text)
    one, two, copy = (tmp_path / name for name in ("one.csv", "two.csv", "copy.csv"))
    demand_apart([one], two)
    demand_apart([], two)
    demand_apart([tmp_path / "gone.csv"], one)
    demand_apart([one], tmp_path / "gone.csv")
    with pytest.raises(InputError, match=r"is also a recording to fit; hold out one"):
        demand_apart([two, tmp_path / "." / "one.csv"], one)
    with pytest.raises(InputError, match=r"is also a recording to fit, byte for byte .*one\.csv; hold out"):
        demand_apart([two, one], copy)


def data(**columns):
    given = {name.replace("__", "."): ("time", np.array(x, float)) for name, x in columns.items()}
    return xr.Dataset(given, coords={"time": [0.0, 1.0, 2.0]})


def test_a_motion_that_is_only_followed_needs_no_torque():
    model: Any = Made(signals={"q.joint1": 1, "tau.joint1": 2, "pos.base.x": 3}, joints=("joint1", "joint2"))
    assert motion_signals(model) == {"q.joint1": 1, "pos.base.x": 3}
    found = without_torque(data(tau__joint1=[4, 5, 6], q__joint1=[0, 0, 0]), model)
    for name in ("tau.joint1", "tau.joint2"):
        np.testing.assert_array_equal(found[name].values, 1.0)


def test_a_sample_without_its_tension_is_left_out():
    model: Any = Made(tree=Made(tensions=("left", "right", "none")))
    run_of = data(q__joint1=[1, 2, 3], tau__joint1=[4, 5, 6], tension__left=[7, np.nan, 8], tension__right=[9, 9, 9])
    tensions = module._tensions(run_of, model)
    assert list(tensions) == ["left", "right"]
    np.testing.assert_array_equal(tensions["left"], [7, np.nan, 8])
    found = module._without_gaps_in(tensions, run_of)
    np.testing.assert_array_equal(found["q.joint1"].values, [1, np.nan, 3])
    np.testing.assert_array_equal(found["tau.joint1"].values, [4, 5, 6])
    assert module._without_gaps_in({}, run_of) is run_of


@pytest.mark.parametrize(
    ("bands", "again"),
    [((40.0, 40.3), False), ((40.0, 40.5), True), ((12.0, 12.0), False), ((30.0, 10.0), True)],  # a hundredth is none
)
def test_all_recordings_get_the_narrowest_band_of_them(monkeypatch, bands, again):
    asked = []

    def conditioned(dataset: Any, _joints: Any, band: Any, *, fitted: bool) -> Any:
        asked.append((band, fitted))
        still = np.zeros((dataset.sizes["time"], 1))
        motion = exact(("joint1",), 0.5, 1, (dataset["time"].values, still, still, still, still))
        return replace(motion, band=dataset.attrs["band"] if band is None else band)

    def read(path: Any, _signals: Any, kinds: Any) -> Any:
        assert kinds == {"joint1": "prismatic"}
        return data(q__joint1=[0, 0, 0]).assign_attrs(band=path)

    monkeypatch.setattr(module, "condition", conditioned)
    monkeypatch.setattr(recorded, "read_recording", read)
    tree = Made(joints=(Made(name="joint1", kind="prismatic"),), carriers=0, tensions=())
    model: Any = Made(tree=tree, signals={}, joints=("joint1",), bandwidth=None, cuts=lambda read: read)
    model.servo, model.transmission = {}, None
    body: Any = Made()
    found = load_experiments(model, bands, body)
    assert [e.motion.band for e in found] == (2 * [min(bands)] if again else list(bands))
    assert asked == 2 * [(None, True)] + (2 * [(min(bands), True)] if again else [])
    model.bandwidth = 7.0
    assert [e.motion.band for e in load_experiments(model, bands, body, torque=False)] == [7.0, 7.0]
    assert asked[-1] == (7.0, False)
    assert load_experiments(model, bands, body, 5.0)[0].motion.band == 5.0
    with pytest.raises(InputError, match="none is given; give one or more"):
        load_experiments(model, [], body)
