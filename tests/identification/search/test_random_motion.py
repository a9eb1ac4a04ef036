"""The next experiment's motions and pairs: limits of every joint, rest at either end, and which rivals to part."""

from types import SimpleNamespace as Made
from typing import Any

import numpy as np
import pytest
import xarray as xr

from snarelab.errors import InputError
from snarelab.identification.search import next_experiment as module
from snarelab.identification.search.next_experiment import NextExperiment, next_experiment, random_motion, rivals
from snarelab.models.effects import get_effect
from snarelab.models.model import PlacedEffect
from snarelab.models.tree import Joint

NAN = np.zeros(3)
TURNS = np.eye(3)


def joint(name="joint1", lower=-np.inf, upper=np.inf, speed=np.inf):
    return Joint(name, "revolute", np.array([0.0, 0.0, 1.0]), -1, TURNS, NAN, lower, upper, speed)


def trained(q=(-1.0, 3.0), qd=(-2.0, 1.0), qdd=None) -> Any:
    """Recordings of one joint, by what they have shown; accelerations 0 to 1000 in steps of 1 if none are given."""
    qdd = np.arange(1001.0) if qdd is None else np.array(qdd, float)
    parts = [np.resize(np.array(x, float), (len(qdd), 1)) for x in (q, qd)]
    return [Made(motion=Made(q=parts[0], qd=parts[1], qdd=qdd[:, None]))]


def drawn(joints, train, seed=0, duration=10.0, rate=50.0):
    return random_motion(joints, train, duration, rate, np.random.default_rng(seed))


def extremes(motion, name="joint1"):
    """Middle, travel from it, peak speed, and peak acceleration by differences."""
    time, q, qd = (motion[x].values for x in ("time", f"q.{name}", f"qd.{name}"))
    return q[0], np.abs(q - q[0]).max(), np.abs(qd).max(), np.abs(np.gradient(qd, time)).max()


@pytest.mark.parametrize("seed", range(12))
@pytest.mark.parametrize(
    ("limits", "shown", "low", "high", "speed", "acceleration"),
    [
        # Limits of the URDF, with half a second to full speed; what was shown is less than that.
        ((-0.5, 2.0, 3.0), {"qdd": (0.0, 1.0)}, -0.5, 2.0, 3.0, 6.0),
        # No limits: what was recorded, and the 995 thousandths' acceleration of 0 ... 1000.
        ((-np.inf, np.inf, np.inf), {}, -1.0, 3.0, 2.0, 995.0),
        ((-np.inf, np.inf, 0.0), {"qdd": (0.25, -0.25)}, -1.0, 3.0, 2.0, 0.25),  # a limit of 0 is none
        ((-np.inf, 2.5, 3.0), {"qdd": (-9.0, 9.0)}, -1.0, 2.5, 3.0, 9.0),
    ],
)
def test_a_motion_takes_up_nearly_all_or_a_third_of_what_its_tightest_limit_leaves(
    seed, limits, shown, low, high, speed, acceleration
):
    motion = drawn([joint("joint1", *limits)], trained(**shown), seed)
    middle, travel, fastest, hardest = extremes(motion)
    assert low + 0.35 * (high - low) <= middle <= low + 0.65 * (high - low)
    room = min(high - middle, middle - low)
    used = max(travel / room, fastest / speed, hardest / acceleration)
    assert min(abs(used - 0.3), abs(used - 0.95)) < 1e-9


def test_one_motion_in_three_is_small_and_middles_lie_all_over_the_middle_third():
    several = [extremes(drawn([joint("joint1", -1.0, 1.0)], trained(), seed, 4.0)) for seed in range(60)]
    middles = np.array([x[0] for x in several])
    assert middles.min() < -0.2
    assert middles.max() > 0.2
    used = [max(x[1] / (1 - abs(x[0])), x[2] / 2.0, x[3] / 995.0) for x in several]
    assert 8 <= sum(abs(u - 0.3) < 1e-9 for u in used) <= 32  # of 60, a third: 20 and three standard deviations


class Told:
    """Draws that are known: frequencies of 2 and 1 turns in the time, falling as 1/k, sines of harmonics alone."""

    def __init__(self, harmonics, turns=2.0, falling=1.0):
        self.harmonics, self.uniforms, self.ranges = harmonics, [turns, falling, 0.5], []

    def uniform(self, low, high):
        self.ranges.append((low, high))
        return self.uniforms.pop(0)

    def normal(self, size):
        part = np.zeros(size)
        part[0, self.harmonics] = 1.0
        part[1, 1] = 0.25
        return part

    def choice(self, _):
        return 0.95


def test_a_motion_is_a_fourier_series_under_a_ramp_of_least_jerk():
    """Sines of 2 and 6 turns, the latter a third as large, and an eighth of a cosine of 4; the ramp takes a second."""
    rng: Any = Told([0, 2])
    motion = random_motion([joint("joint1", -1.0, 1.0)], trained(qd=(-90.0, 90.0)), 8.0, 100.0, rng)
    time, q, qd = (motion[x].values for x in ("time", "q.joint1", "qd.joint1"))
    np.testing.assert_allclose(time, np.arange(800) / 100, atol=1e-12)
    turn = 2 * np.pi * time / 8.0
    wave = np.sin(2 * turn) + np.sin(6 * turn) / 3 + np.cos(4 * turn) / 8
    s = np.minimum(np.minimum(time, time[-1] - time), 1.0)
    wave = wave * (10 * s**3 - 15 * s**4 + 6 * s**5)  # Flash and Hogan (1985)
    size = np.abs(q).max() / np.abs(wave).max()
    np.testing.assert_allclose(q, size * wave, atol=1e-12)
    assert size * np.abs(wave).max() == pytest.approx(0.95, rel=1e-12)  # 1 rad either way; speed and ramp allow more
    np.testing.assert_allclose(qd, np.gradient(q, time) * (np.arange(800) % 799 > 0), atol=1e-12)
    assert motion.attrs == {"path": "next experiment", "notes": []}
    # One to three turns of the slowest; waves that fall with none to the square of their number; a middle place.
    assert rng.ranges == [(1.0, 3.0), (0, 2), (0.35, 0.65)]


def test_every_joint_has_its_own_recorded_range():
    q = np.stack([np.linspace(-1, 1, 9), np.linspace(5, 6, 9)], 1)
    train: Any = [Made(motion=Made(q=q[:5], qd=q[:5], qdd=99 * q[:5])), Made(motion=Made(q=q[5:], qd=q[5:], qdd=q[5:]))]
    motion = drawn([joint("joint1"), joint("joint2")], train, 3)
    for k, (low, high) in enumerate([(-1, 1), (5, 6)], 1):
        middle, travel, *_ = extremes(motion, f"joint{k}")
        assert low + 0.35 * (high - low) <= middle <= low + 0.65 * (high - low)
        assert travel <= 0.65 * (high - low)


def rival(name, at, probability, separable):
    return Made(name=name, at=at, probability=probability, separable=separable)


def finding(name, at, *others):
    return Made(name=name, at=at, rivals=others)


MODEL: Any = Made(
    path="arm.toml",
    system="arm",
    effects=(
        PlacedEffect(get_effect("viscous_friction"), "joint1"),
        PlacedEffect(get_effect("viscous_friction"), "joint2"),
        PlacedEffect(get_effect("sensor_gain"), "tau.joint1"),
    ),
    tree=Made(joints=()),
)


def pairs(*findings) -> list[Any]:
    diagnosis: Any = Made(effects=findings)
    return [(a.key, b.key) for a, b in rivals(MODEL, diagnosis)]


def test_rivals_that_cannot_be_parted_come_first_likeliest_first_and_three_at_most():
    names = ("rotor_inertia", "coulomb_friction", "harness_stiffness", "torque_ripple")
    others = [rival(name, "joint1", p, False) for name, p in zip(names, (0.1, 0.3, 0.2, 0.05), strict=True)]
    sure = rival("sensor_bias", "tau.joint1", 0.9, True)
    here = finding("viscous_friction", "joint1", *others, sure)
    assert pairs(here) == [("viscous_friction.joint1", f"{names[k]}.joint1") for k in (1, 2, 0)]
    there = finding("viscous_friction", "joint2", rival("rotor_inertia", "joint2", 0.01, False))
    assert pairs(there, here)[0] == ("viscous_friction.joint2", "rotor_inertia.joint2")


def test_where_all_can_be_parted_the_likeliest_alone_is_taken():
    sure = [rival("sensor_bias", "tau.joint1", 0.1, True), rival("sensor_drift", "tau.joint1", 0.2, True)]
    assert pairs(finding("sensor_gain", "tau.joint1", *sure)) == [("sensor_gain.tau.joint1", "sensor_drift.tau.joint1")]
    assert pairs(finding("sensor_gain", "tau.joint2", *sure)) == []  # the model does not have it there
    assert pairs(finding("viscous_friction", "joint1")) == []


def test_what_is_no_arm_or_has_no_rival_gets_no_motion():
    model: Any = Made(path="rig.toml", system="zero_g_rig")
    diagnosis: Any = Made(effects=())
    with pytest.raises(InputError, match=r"^rig\.toml: system 'zero_g_rig' has no motion of its own to plan"):
        next_experiment(model, diagnosis, [])
    assert next_experiment(MODEL, diagnosis, []) is None


def test_the_sentence_names_every_pair_and_what_it_promises():
    pair = ("spring at joint1", "payload at link1")
    one = NextExperiment(xr.Dataset(), (pair, ("a at b", "c at d")), 0.123, 4.56)
    assert one.sentence == (
        "Next experiment: the motion written parts spring at joint1 from payload at link1; a at b from c at d: they "
        "would differ by 4.6 times what is unexplained today, along the recordings so far by 0.12."
    )


@pytest.fixture
def designed(monkeypatch):
    """Two rivals of one effect, two channels; what each leaves of the truth along every motion comes from a table."""
    left = {"recorded": ((3.0, 4.0), (6.0, 8.0)), 0: ((3.0, 0.0), (9.0, 9.0)), 1: ((9.0, 9.0), (6.0, 8.0))}
    left[2] = ((1.0, 1.0), (50.0, 50.0))
    sigma = np.array([1.0, 2.0])
    drawn_motions = []

    class Model:
        def __init__(self, _tree, placed, *_):
            self.name = placed[-1].effect.name
            self.slots = (Made(key="a", start=5.0), Made(key="b", start=7.0))

        def torque(self, e, theta):
            assert theta.tolist() == [5.0, 8.0]  # the start where the model has no value
            return e.name

    def rms(assembly, several, _theta):
        first, second = left.get(several[0].name, (None, None))
        table = {"sensor_gain": sigma, "rotor_inertia": first, "harness_stiffness": second}
        return np.array(table[assembly.name]), None

    def motion(_joints, train, duration, rate, _rng):
        assert train == [recorded, other]
        assert (duration, rate) == (20.0, pytest.approx(10.0))
        drawn_motions.append(xr.Dataset(coords={"time": np.arange(3.0)}, attrs={"number": len(drawn_motions)}))
        return drawn_motions[-1]

    time = np.array([0.0, 0.1, 0.2, 5.0])
    recorded = Made(name="recorded", motion=Made(band=3.0, time=time), store={})
    other = Made(name="recorded", motion=Made(band=3.0, time=7 * time), store={})  # the first one's clock is taken
    parts = {
        "load_experiments": lambda *_: [recorded, other],
        "RigidBody": lambda tree: tree,
        "scales": lambda _: {},
        "TorqueModel": Model,
        "channel_rms": rms,
        "fit": lambda *_, **__: Made(theta=None),
        "replace": lambda x, **_: x,
        "random_motion": motion,
        "condition": lambda m, _joints, band: Made(number=m.attrs["number"], band=band),
        "Experiment": lambda m, _body: Made(name=m.number, motion=m, store={}),
    }
    for name, part in parts.items():
        monkeypatch.setattr(module, name, part)
    model: Any = Made(**vars(MODEL), inertia="fixed", values={"b": 8.0}, joints=("joint1",))
    both = [rival(name, "joint1", 0.5, False) for name in ("rotor_inertia", "harness_stiffness")]
    diagnosis: Any = Made(effects=(finding("viscous_friction", "joint1", *both),))

    def design(tries: int) -> Any:
        drawn_motions.clear()
        return next_experiment(model, diagnosis, [], tries=tries)

    return design


def test_the_motion_kept_parts_the_closest_pair_best(designed):
    """Of 1 and 2 unexplained: (3, 4) is √(9 + 4) and (6, 8) √(36 + 16); the closest pair counts, so of the motions
    drawn the first is worth 3 and the second √52."""
    found, first = designed(3), designed(1)
    assert found.now == pytest.approx(np.sqrt(13.0))
    assert found.then == pytest.approx(np.sqrt(52.0))
    assert found.motion.attrs["number"] == 1
    names = ("rotor_inertia at joint1", "harness_stiffness at joint1")
    assert found.pairs == tuple(("viscous_friction at joint1", name) for name in names)
    assert first.then == pytest.approx(3.0)
    with pytest.raises(ValueError, match="tries must be one at least"):
        designed(0)
