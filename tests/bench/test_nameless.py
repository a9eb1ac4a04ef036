"""Laws without a name hang on what they say, have their size, and their twins lack nothing else."""

import json

import numpy as np
import pytest

from bench.arm import random_arm
from bench.concealed import Planned
from bench.lugre import LuGre
from bench.motion import fourier_motion
from bench.nameless import KINDS, coordinates, on_played, seen, stepped, summary, told
from bench.nameless_laws import PLAYED, STEPPED
from proof.concealed import remainder
from proof.played.residuals import residuals
from proof.played.robots import published
from snarelab.identification.nuisance.curve import Coordinates, family

OF = {
    "position": "q",
    "speed": "qd",
    "load": "load",
    "time": "time",
    "position of other": "q_of",
    "speed of other": "qd_of",
    "load of other": "load_of",
}


def state(rng, n=400):
    found = {name: rng.normal(size=n) for name in OF.values()}
    found["time"] = np.linspace(0, 20, n)
    return found | {"direction": np.sign(found["qd"])}


def test_there_are_twenty_four_and_each_is_one_of_its_kind():
    assert len({k.name for k in KINDS}) == len(KINDS) == 24
    assert len(STEPPED) == len(PLAYED) == 12


@pytest.mark.parametrize("kind", KINDS, ids=lambda k: k.name)
def test_a_law_hangs_on_its_coordinates_and_no_other(kind):
    """Each signal in turn is drawn anew, with everything else as it was."""
    rng = np.random.default_rng(5)
    s = state(rng)
    law = kind.draw(s, rng)
    before, moved = law(s), set()
    for name, signal in OF.items():
        other = s | {signal: rng.permutation(s[signal])}
        if not np.array_equal(law(other), before):
            moved.add(name)
    assert moved == set(kind.over)


@pytest.mark.parametrize("kind", STEPPED, ids=lambda k: k.name)
def test_what_named_laws_leave_of_it_has_the_wanted_size(kind):
    """0.4 N·m beside a fit of a level, a drift, a spring, friction and inertia; direction is smooth where it acts."""
    rng = np.random.default_rng(11)
    arm = random_arm(rng, 3)
    motion = fourier_motion(arm, rng, 10.0)
    time = np.arange(0, 10, 0.01)
    q, qd, qdd = motion(time)
    made = stepped(kind)(Planned(arm, 1, LuGre(1.0), q, qd, qdd, 0.01), 0.4, rng)
    (law,) = made.plant["laws"]
    torque = np.array([law(t, a, b) for t, a, b in zip(time, q, qd, strict=True)])
    assert np.all(torque[:, [0, 2]] == 0)
    x, sign = torque[:, 1], np.sign(qd[:, 1])
    near = [np.ones_like(time), time, q[:, 1], qd[:, 1], qdd[:, 1], sign, qd[:, 1] * np.abs(qd[:, 1])]
    left = remainder(x, near)
    # Load by direction may take a little more.
    assert 0.38 < np.sqrt(np.mean(left**2)) < 0.6


@pytest.mark.skipif(not residuals() or not published(), reason="needs the shared recordings and example-robot-data")
def test_a_twin_is_the_same_arm_without_the_law(tmp_path):
    kind = next(k for k in PLAYED if k.name == "cam on the output")
    joint, channel = on_played(kind, 2.0, 7, 3, tmp_path / "case", tmp_path / "twin")
    assert channel == f"tau.joint{joint + 1}"
    for name in ("train", "hold", "third"):
        one, other = (
            np.genfromtxt(tmp_path / at / f"{name}.csv", delimiter=",", names=True) for at in ("case", "twin")
        )
        apart = {c for c in one.dtype.names or () if not np.array_equal(one[c], other[c])}
        assert apart == {channel.replace(".", "")}
    known = json.loads((tmp_path / "case" / "truth.json").read_text())
    assert known["effects"][0]["law"] == kind.name


def test_every_curve_of_the_family_has_its_coordinates_read():
    n = 50
    rng = np.random.default_rng(0)
    one = Coordinates(*(rng.normal(size=(n, 3)) for _ in range(2)), *(rng.normal(size=n) for _ in range(7)))
    words = {c.words for c in family(1, ("joint1", "joint2", "joint3"), [one], False)}
    own = {"position", "speed", "load", "time", "distance travelled", "distance since it turned"}
    other = {f"{x} of joint{k}" for x in ("position", "speed") for k in (1, 3)}
    assert {x for w in words for x in coordinates(w)} == own | other
    assert coordinates("position and position of joint3 by direction") == ["position", "position of joint3"]


def test_what_is_told_is_read_from_tables_and_words():
    found = {
        "verdict": "unknown_effect",
        "description": "on tau.joint2, a smooth curve over load by direction still explains 30 % of the residual; "
        "on tau.joint1, a smooth curve over speed still explains 9 % of it",
        "empirical": [{"at": "joint2", "coordinates": ["position", "position of joint3"]}],
    }
    assert told(found, "tau.joint2") == [("position", "position of joint3"), ("load",)]
    assert seen(found, "tau.joint1")
    assert not seen(found, "tau.joint3")


def test_the_table_counts_every_case():
    line = {"size": 2.0, "seen": True, "named": [], "told": [["load"]], "over": ["load"], "closure": 0.9, "gap": 1.5}
    line["background"] = ["payload_mass"]
    other = line | {"seen": False, "told": [], "named": [["sensor_gain", "tau.joint1"]], "closure": 0.0}
    wrong = line | {"told": [["position"]], "closure": 0.4, "named": [["payload_mass", "link2"]]}
    rows = {x[:46].strip(): x[46:].split() for x in summary([line, other, wrong, line]).splitlines()}
    assert rows["2x: seen"][:5] == ["85", "%", "75", "%", "4"]
    assert rows["2x: a wrong name"][:3] == ["25", "%", "4"]
    assert rows["coordinates right, of those with a curve"][2:5] == ["67", "%", "3"]
    assert rows["closure on the third recording, median"] == ["0.8", "0.90", "3"]
    assert rows["closure on the third recording, worst"] == ["0.5", "0.40", "3"]
