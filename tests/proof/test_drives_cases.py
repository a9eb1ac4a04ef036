"""Cases of the second proof: shares of the plan, the same for a seed, sizes as wanted, models as they should be."""

import json
from collections import Counter

import numpy as np
import pytest
from scipy.signal import butter, sosfiltfilt

from proof.drives import cases
from proof.drives.bodies import Bodies, torques
from proof.drives.cases import CLEAN, FAULTY, GROUPS, LAWLESS, PAIR, SINGLE, Plan, background, draw, planned
from proof.drives.concealed import LAWS, TooMuch
from proof.drives.faults import FAULTS
from proof.drives.laws import directions
from proof.drives.loop import TICK
from proof.drives.make import make, written
from proof.drives.motions import KINDS, STILL, WHITE
from proof.drives.nameless import NAMELESS, beside_names, lawless
from proof.drives.plant import Planned, Plant, rms
from proof.drives.springs import BAND, NAMES, SPRINGS, makers
from snarelab.models.effects import effects
from snarelab.models.model_file import load_model

SEED = 77


def test_plan_has_its_shares_and_goes_on_as_it_began():
    plans = planned(SEED, 150)
    assert Counter(p.group for p in plans) == {CLEAN: 75, SINGLE: 30, PAIR: 24, LAWLESS: 12, FAULTY: 9}
    assert Counter(p.disturbance for p in plans if p.group == CLEAN) == dict.fromkeys(KINDS, 25)
    assert plans[:20] == planned(SEED, 20)
    assert planned(SEED + 1, 20) != plans[:20]
    # No effect and size comes again before every other has.
    singles = [p.concealed for p in planned(SEED, 750) if p.group == SINGLE]
    assert len(set(singles[: 4 * len(NAMES)])) == 4 * len(NAMES)
    for p in plans:
        names = [name for name, _ in p.concealed]
        assert set(names) <= set({LAWLESS: NAMELESS, FAULTY: FAULTS}.get(p.group, NAMES))
        assert len(set(names)) == len(names)
        assert len(names) in ((0,), (1,), (2, 3, 4), (1,), (1,))[GROUPS.index(p.group)]
        assert len(set(SPRINGS) & set(names)) <= 1
    assert {len(p.concealed) for p in plans if p.group == PAIR} == {2, 3, 4}


def test_names_are_the_vocabularys():
    assert set(NAMES) <= set(effects())
    assert not set(NAMELESS) & set(effects())


@pytest.mark.slow
def test_a_case_follows_from_its_seed(tmp_path):
    plan = Plan(SINGLE, WHITE, (("payload_mass", 2.0),))
    first, again, other = draw(plan, SEED, 3), draw(plan, SEED, 3), draw(plan, SEED, 4)
    assert first.truth == again.truth
    assert first.truth != other.truth
    for name, columns in first.recordings.items():
        for key, column in columns.items():
            np.testing.assert_array_equal(column, again.recordings[name][key])
    for name, columns in first.twin.items():
        # The same motion, noise and errors of the URDF; 2 times the disturbance apart.
        own = first.recordings[name]
        np.testing.assert_array_equal(own["time"], columns["time"])
        assert rms(own["q.joint1"] - columns["q.joint1"]) < 0.05 * np.ptp(own["q.joint1"])
        effect = first.truth["effects"][0]
        apart = rms(own[effect["channel"]] - columns[effect["channel"]])
        assert apart > first.truth["disturbance_rms"][effect["channel"][4:]]
    assert set(first.twin) == {"train", "third"}
    first.write(tmp_path / "case")
    text = (tmp_path / "case" / "train.csv").read_text()
    again.write(tmp_path / "case")
    assert (tmp_path / "case" / "train.csv").read_text() == text
    model = load_model(tmp_path / "case" / "arm.toml")
    assert len(model.joints) == first.truth["joints"]
    assert json.loads((tmp_path / "case" / "truth.json").read_text()) == first.truth


def test_twin_has_the_cases_disturbance_noise_and_motion():
    """A sensor's bias moves nothing, so that all but its own channel are the same to the last digit."""
    case = draw(Plan(SINGLE, WHITE, (("sensor_bias", 2.0),)), SEED, 5)
    (effect,) = case.truth["effects"]
    for name, columns in case.twin.items():
        for key, twin in columns.items():
            apart = case.recordings[name][key] - twin
            if key == effect["channel"]:
                np.testing.assert_allclose(np.abs(apart), abs(effect["values"]["offset"]), rtol=1e-9)
            else:
                assert not apart.any(), key


def test_make_resumes_and_keeps_to_its_seed(tmp_path, monkeypatch):
    drawn = []

    class Drawn:
        def __init__(self, plan, seed, number):
            drawn.append(number)
            self.group = plan.group

        def write(self, folder):
            folder.mkdir(parents=True)
            (folder / "truth.json").write_text(json.dumps({"group": self.group}))

    monkeypatch.setattr("proof.drives.make.draw", Drawn)
    make(tmp_path, SEED, 10, tell=lambda _: None)
    make(tmp_path, SEED, 14, tell=lambda _: None)
    assert drawn == list(range(14))
    clean = [k for k, p in enumerate(planned(SEED, 14)) if p.group == CLEAN]
    assert [int(path.name) for path in written(tmp_path, CLEAN)] == clean
    with pytest.raises(ValueError, match="holds cases of seed 77"):
        make(tmp_path, SEED + 1, 10)
    with pytest.raises(ValueError, match="holds no cases"):
        written(tmp_path / "nowhere")


def bare(number):
    plant, motions = background(np.random.default_rng([SEED, number]))
    return plant, motions, Planned.of(plant, motions["train"])


def more(plant: Plant, changed: Plant, motion):
    """What the changed plant's motors give more than the bare plant's would, along what they do: (m, change)."""
    true = changed.simulate(motion, np.zeros_like(motion[0]))
    first = round(STILL / TICK)
    q, qd, qdd, torque = (np.ascontiguousarray(true[first::4, k]) for k in range(4))
    f = plant.friction
    rubbing = np.stack(
        [
            directions(f.kind[k], f.travel[k], f.lag[k], 4 * TICK, q[:, k].copy(), qd[:, k].copy())
            for k in range(q.shape[1])
        ],
        axis=1,
    )
    expected = torques(Bodies.of(plant.robot.model()), q, qd, qdd) + plant.rotor * qdd
    return Planned.along(plant, 4 * TICK, q, qd, qdd), torque - expected - f.level * rubbing - f.viscous * qd


@pytest.mark.parametrize(
    "name",
    [
        "quadratic_friction",
        "payload_mass",
        "com_offset",
        "harness_stiffness",
        "asymmetric_friction",
        pytest.param("joint_elasticity", marks=pytest.mark.slow),
    ],
)
def test_an_effect_is_as_large_in_the_closed_loop_as_wanted(name):
    """Sized along the asked motion; the arm itself moves a little otherwise."""
    rng = np.random.default_rng(5)
    for number in range(30):
        plant, motions, m = bare(number)
        wanted = 0.08 * rms(m.torque)
        try:
            made = makers(motions["train"])[name](m, 0, wanted, rng)
        except TooMuch:
            continue
        along, change = more(plant, made.plant, motions["train"])
        if name == "joint_elasticity":
            change = sosfiltfilt(butter(4, BAND, fs=0.25 / TICK, output="sos"), change, axis=0)
        found = rms(along.left(change)) / wanted
        assert found[made.channel] == pytest.approx(1.0, abs=0.15)
        return
    pytest.fail("no arm of thirty can have it")


def test_nameless_laws_are_sized_by_what_names_leave():
    rng, sized = np.random.default_rng(6), 0
    for name in NAMELESS:
        for number in range(20):
            _, motions, m = bare(number)
            wanted = 0.05 * float(rms(m.torque[:, 1]))
            try:
                made = lawless(motions["train"])[name](m, 1, wanted, rng)
            except TooMuch:
                continue
            assert len(made.plant.laws) == 1, name
            assert made.note, name
            assert made.raw >= 0.95 * wanted
            sized += 1
            break
    assert sized == len(NAMELESS)


def test_a_plain_law_leaves_nothing_beside_names():
    _, _, m = bare(0)
    own = 3.0 * np.sign(m.qd[:, 0]) + 0.4 * m.q[:, 0] + 0.1 * m.qdd[:, 0] + 2.0
    assert beside_names(m, 0, own) < 1e-9
    assert beside_names(m, 0, np.sin(30.0 * m.q[:, 0])) > 0.5


def test_urdf_is_off_by_one_to_three_per_cent():
    plant, _, _ = bare(2)
    for real, told in zip(plant.robot.links, plant.nominal.links, strict=True):
        off = np.concatenate([[told.mass / real.mass], told.com / real.com, [told.inertia[0, 0] / real.inertia[0, 0]]])
        assert np.all((np.abs(off - 1.0) >= 0.0099) & (np.abs(off - 1.0) <= 0.0301))


def test_laws_of_one_joint_take_its_power():
    """Friction that has no other purpose never drives: torque and speed have one sign on average."""
    rng = np.random.default_rng(7)
    for name in ("stribeck_friction", "load_dependent_friction", "quadratic_friction"):
        for number in range(20):
            _, motions, m = bare(number)
            try:
                made = LAWS[name](m, 0, 0.05 * rms(m.torque), rng)
            except TooMuch:
                continue
            along, change = more(m.plant, made.plant, motions["train"])
            assert np.mean(change[:, 0] * along.qd[:, 0]) > 0.0, name
            break
        else:
            pytest.fail(f"no arm of twenty can have {name}")


def test_sensors_faults_are_in_the_logged_channel_only():
    rng = np.random.default_rng(8)
    _, _, m = bare(3)
    for name, value in (("sensor_bias", "offset"), ("sensor_gain", "error"), ("sensor_delay", "delay")):
        made = LAWS[name](m, 1, 0.1 * rms(m.torque), rng)
        assert made.values[value] != 0.0
        assert made.at in ("tau.joint2", "q.joint2")
        assert made.plant.laws == ()
        assert made.plant.robot is m.plant.robot


def test_recordings_are_what_the_truth_says():
    case = draw(Plan(CLEAN, WHITE, ()), SEED, 9)
    train = case.recordings["train"]
    period = np.diff(train["time"])
    late = period * case.truth["rate"] - 1.0
    assert np.std(late) == pytest.approx(np.sqrt(2.0) * case.truth["jitter"], rel=0.05)
    ends = {name: x["time"][-1] for name, x in case.recordings.items()}
    assert ends == pytest.approx(cases.RECORDINGS, abs=0.2 / case.truth["rate"])
    step = 2.0 * np.pi / 2 ** case.truth["bits"]
    np.testing.assert_allclose(np.round(train["q.joint1"] / step) * step, train["q.joint1"], atol=1e-9)
    assert case.truth["limited"] < 0.01


@pytest.mark.parametrize("fault", FAULTS)
def test_a_fault_is_in_every_recording_and_in_its_channels_alone(fault):
    sound = draw(Plan(CLEAN, WHITE, ()), SEED, 11).recordings
    broken = draw(Plan(FAULTY, WHITE, ((fault, 0.0),)), SEED, 11)
    assert broken.truth["fault"] == fault
    assert broken.truth["effects"] == []
    assert not broken.twin
    for part, columns in broken.recordings.items():
        changed = {name for name, x in columns.items() if not np.array_equal(x, sound[part][name])}
        assert 1 <= len(changed) <= 4
        assert len({name for name in changed if not name.startswith("q")}) <= 1
