"""Real recordings, read in place: none of them is said to contradict its model."""

from pathlib import Path

import pytest
from real_recordings import real_recordings

import snarelab
from snarelab.studies import cart, tx40

STUDIES = Path(cart.__file__).parent

CURRENTS = ["shoulder_pan", "shoulder_lift", "elbow_flex", "wrist_flex", "wrist_roll", "gripper"]
MOTIONS = ["backlash_detection", "chirp_sweep", "friction_gravity", "large_amplitude", "multisine", "random_waypoints"]


def faults(model, runs):
    return [(f.name, f.at, f.message) for f in snarelab.check(model, runs).checks if f.fault]


def test_an_axis_of_a_test_bench():
    place = real_recordings("emps")
    for model in ("viscous.toml", "published.toml"):
        assert faults(STUDIES / "emps" / model, sorted(place.glob("*.mat"))) == []


def test_a_heavy_robot_with_two_encoders_a_joint():
    runs = sorted(real_recordings("kuka_kr300").glob("*.mat"))
    assert len(runs) == 3
    assert faults(STUDIES / "kuka" / "kr300.toml", runs) == []


@pytest.mark.parametrize("test", ["cartTest2", "cartTest3"])
def test_a_cart_on_a_belt(test):
    runs = sorted((real_recordings("cart") / test).glob("*.csv"))
    assert len(runs) == 7
    assert faults(STUDIES / "cart" / "cart.toml", runs) == []


@pytest.mark.parametrize("part", [tx40.TRAIN, tx40.HOLDOUT])
def test_a_robot_with_a_coupled_wrist(part):
    assert faults(STUDIES / "tx40" / "tx40.toml", [f"{real_recordings('tx40') / 'pos_read_data.csv'}@{part}"]) == []


@pytest.mark.parametrize(
    "motion", [x if x == "friction_gravity" else pytest.param(x, marks=pytest.mark.slow) for x in MOTIONS]
)
def test_a_hobby_arm_whose_currents_have_no_known_unit(tmp_path, motion):
    """Lists in cells, stamps in microseconds, currents with a constant that nobody states."""
    place = real_recordings("so101")
    lines = [f'urdf = "{(place / "so101.urdf").resolve()}"', 'effects = ["viscous_friction", "coulomb_friction"]']
    lines += ["[signals]", '"time" = { column = "timestamp", unit = "us" }']
    for k, joint in enumerate(CURRENTS):
        lines.append(f'"q.{joint}" = {{ column = "positions[{k}]", unit = "rad" }}')
        lines.append(f'"tau.{joint}" = {{ column = "torques[{k}]", gain = "free" }}')
    model = tmp_path / "so101.toml"
    model.write_text("\n".join(lines) + "\n")
    assert faults(model, [place / motion / "state_motor.csv"]) == []
