"""Tolerances of the latch: where a case ends, fewer and coarser ways, and how failures are told."""

import re
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest

from snarelab.errors import InputError
from snarelab.models.hanging import CRADLE, CRADLE_DAMPING, hanging_wrench
from snarelab.models.snare.target import Target
from snarelab.tolerance import latched
from snarelab.tolerance.box import why_the_box_fails
from snarelab.tolerance.capture import Outcome, find_capture
from snarelab.tolerance.latched import ended_in
from snarelab.tolerance.rays import STAGE, ends, envelope, most_cases, next_cases, rays
from snarelab.tolerance.report import summarise
from snarelab.tolerance.results import Results
from snarelab.tolerance.study import load_study

STUDY = """
capture = "latched-hover"
sampling = "sobol"
cases = 4
[ranges]
radial_y = [-0.08, 0.08]
radial_z = [-0.08, 0.08]
pitch = [-0.08, 0.08]
friction = [0.0, 0.3]
[success]
latched = true
radial_error = 0.010
strength = 8000.0
[envelope]
"""


def study(tmp_path, envelope='axes = ["radial_y", "pitch"]\nsteps = 2\nexact = 8\n'):
    path = tmp_path / "study.toml"
    path.write_text(STUDY + envelope)
    return load_study(path)


def latching(values):
    """Latches within 33 mm in y."""
    return Outcome(True, 0.0, 7.0, 5.0, 1.0, latched=0.033 - abs(values["radial_y"]), state="LATCHED")


def walked(tmp_path, s):
    results, order = Results(tmp_path / "found", s), []
    while wanted := next_cases(s, results.table(STAGE)):
        order.append(len(wanted))
        for number, point in wanted.items():
            if not results.done(STAGE, number):
                results.add(STAGE, number, s.values(point), latching(s.values(point)))
    return results, order


def test_fewer_and_coarser_ways_hold_the_same_end(tmp_path):
    s = study(tmp_path)
    assert [ray.axes for ray in rays(s)] == [("radial_y",)] * 2 + [("pitch",)] * 2
    results, order = walked(tmp_path, s)
    limits = envelope(s, ends(s, results.table(STAGE)))
    assert set(limits) == {"radial_y", "pitch"}
    down, up = limits["radial_y"]
    assert (up.low, up.high) == pytest.approx((0.03, 0.04))  # an eighth of 80 mm
    assert (down.low, down.high) == pytest.approx((-0.03, -0.04))
    assert order[0] == 1
    assert len(results) <= most_cases(s) == 1 + 4 * (2 + 2)


def test_asking_for_more_keeps_the_cases(tmp_path):
    walked(tmp_path, study(tmp_path))
    finer = study(tmp_path, 'axes = ["radial_y", "pitch"]\nsteps = 2\nexact = 64\n')
    before = len(Results(tmp_path / "found", finer))
    results, _ = walked(tmp_path, finer)
    up = envelope(finer, ends(finer, results.table(STAGE)))["radial_y"][1]
    assert up.high - up.low == pytest.approx(0.08 / 64)
    assert up.low < 0.033 < up.high
    assert len(results) == before + 2 * 3


def test_asking_for_less_goes_on_from_the_cases_to_the_limit(tmp_path):
    s = study(tmp_path)
    results = Results(tmp_path / "found", s)
    for number in (0, 32):  # the nominal case, and half of the first way
        results.add(STAGE, number, s.values(next_cases(s, results.table(STAGE))[number]), latching({"radial_y": 0.0}))
    coarse = study(tmp_path, 'axes = ["radial_y", "pitch"]\nsteps = 1\nexact = 1\n')
    wanted = next_cases(coarse, Results(tmp_path / "found", coarse).table(STAGE))
    assert [number % 64 for number in wanted] == [0] * 4  # each way's last point
    assert np.all(np.abs(list(wanted.values())) <= 0.3)


@pytest.mark.parametrize(
    ("envelope", "words"),
    [
        ("axes = []", r"axes = \[\]; allowed is a list of names of \[ranges\]"),
        ('axes = ["yaw"]', r"axes has 'yaw'; allowed are radial_y, radial_z, pitch, friction"),
        ("steps = 3", "steps = 3; allowed are 1, 2, 4, 8, 16, 32, 64"),
        ("steps = true", "steps = True; allowed"),
        ("steps = 8\nexact = 4", "exact = 4 is below steps = 8; give as much or more"),
        ("step = 8", "unknown key 'step'"),
    ],
)
def test_a_mistake_in_the_envelope_is_named(tmp_path, envelope, words):
    with pytest.raises(InputError, match=words):
        study(tmp_path, envelope)


def test_failures_are_told_by_the_state_in_which_the_program_gave_up(tmp_path):
    s = study(tmp_path)
    base = {"reason": "", "enclosed": True, "first_contact": 7.0, "radial_error": 0.002, "peak_tension": 30.0}
    base |= dict.fromkeys(s.ranges, 0.0)
    rows = [base | {"state": "SEAT", "margin": -1.0}] * 2 + [base | {"state": "LATCHED", "margin": -0.2}]
    rows += [base | {"state": "LATCHED", "margin": 0.5}]
    words = why_the_box_fails(s, pd.DataFrame(rows))
    assert words.startswith("Of 4 cases of the box 3 do not succeed: 2 given up in SEAT, 1 latched outside its bars.")


def test_the_page_says_what_the_proxy_is_worth_and_how_sure_the_boundary_is(tmp_path):
    s = study(tmp_path)
    results, _ = walked(tmp_path, s)

    def run(y, radial):
        fine = abs(y) < 0.033
        return Outcome(True, radial, 7.0, 5.0, 1.0, latched=0.5 if fine else -1.0, state="LATCHED" if fine else "SEAT")

    for number, (y, radial) in enumerate([(0.01, 0.004), (0.02, 0.02), (0.06, 0.004), (-0.07, 0.02)]):
        results.add("space", number, s.values(np.array([y, 0.0, 0.0, 0.1])), run(y, radial))
    content = summarise(s, results)
    page = (results.folder / "report.html").read_text(encoding="utf-8")
    p = content["proxy"]
    walks = len(results) - 4
    # Of the walks all are on the axis; those beyond 33 mm ended with a margin below zero, in LATCHED by their state.
    beyond = sum(m <= 0 for m in results.table(STAGE)["margin"])
    assert (p["cases"], p["latched"]) == (walks + 4, walks - beyond + 2)
    assert (p["latched_against"], p["failed_against"]) == (1, beyond + 1)
    assert p["disagree"] == beyond + 2
    assert p["ends"] == {"LATCHED": beyond, "SEAT": 2}
    assert "What the proxy is worth" in page
    for name, row in (("within 10 mm", (walks - beyond + 1, beyond + 1)), ("beyond 10 mm", (1, 1))):
        cells = re.search(rf">{name}<.*?</tr>", page, re.S)
        assert cells
        assert re.findall(r">(\d+)</t", cells[0]) == [str(x) for x in row]
    assert (" % of the ranges undecided." in content["sentence"]) == (content["width"] > s.width)


class Gone:
    """A run by its phases."""

    def __init__(self, *states):
        self.phases = [(state, 0.0, 1.0) for state in states]
        self.final = states[-1]


def test_a_run_ended_in_the_last_state_before_the_way_out():
    assert ended_in(Gone("CLOSE", "SEAT", "LATCHED")) == "LATCHED"  # pyright: ignore[reportArgumentType]
    assert ended_in(Gone("CLOSE", "SEAT", "UNLOAD")) == "SEAT"  # pyright: ignore[reportArgumentType]
    assert ended_in(Gone("CLOSE", "OPEN")) == "CLOSE"  # pyright: ignore[reportArgumentType]


@pytest.mark.parametrize("state", ["CLOSE", "PRELOAD"])
def test_a_run_that_could_not_be_computed_is_no_failure_to_latch(monkeypatch, state):
    """In whichever state the solver gave up, nothing is known of the mechanism."""
    capture = find_capture("latched-ground")
    stopped = SimpleNamespace(fault="the solver did not converge", final=state)
    monkeypatch.setattr(latched, "co_simulate_whole", lambda *_, **__: stopped)
    found = capture.run({axis.name: axis.nominal for axis in capture.axes})
    assert found.reason == stopped.fault
    assert not found.state
    assert np.isnan(found.latched)


def test_every_latched_capture_is_built_in():
    for name in ("latched-ground", "latched-inspection", "latched-hover"):
        assert find_capture(name).axis("docking_friction").high == 0.4
    assert find_capture("latched-ground").version != find_capture("latched-hover").version


SIDE = [[0.7, 0, 0], [0, 0.7, 0], [0, 0, 0.7]]


def wrench(target, foot, turned, spin=(0.0, 0.0, 0.0)):
    import casadi as ca
    from scipy.spatial.transform import Rotation

    found = hanging_wrench(
        target, ca.SX(list(foot)), ca.SX(Rotation.from_rotvec(turned).as_matrix()), ca.SX(list(spin))
    )
    on, energy, power = (np.asarray(ca.DM(ca.evalf(x))).ravel() for x in found)
    return on, float(energy[0]), float(power[0])


def test_a_hung_target_rests_where_it_starts_and_is_drawn_back_by_its_spring():
    target = Target("spring", (0.2, 0.0, 0.0), (1, 0, 0, 0), inertia=SIDE, centre_of_mass=(0.2, 0, 0),
                    hang_point=(0.2, 0, 0))  # fmt: skip
    on, energy, power = wrench(target, (0.2, 0.0, 0.0), (0, 0, 0))
    np.testing.assert_allclose(on, 0.0, atol=1e-9)
    assert power == 0.0
    on, lower, _ = wrench(target, (0.1, 0.0, 0.0), (0, 0, 0))
    assert on[0] == pytest.approx(0.1 * target.stiffness)
    assert lower - energy == pytest.approx(0.5 * target.stiffness * 0.1**2)
    on, _, _ = wrench(target, (0.2, 0.01, 0.0), (0, 0, 0))
    assert on[1] == pytest.approx(-25 * 9.81 * 0.01 / 2.0, rel=1e-3)  # a pendulum of 2 m
    # Turned about its middle: the cradle alone, and its damping.
    on, turned, power = wrench(
        target, (0.2 + 0.2 * (1 - np.cos(0.03)), 0.0, 0.2 * np.sin(0.03)), (0, 0.03, 0), (0, 0.5, 0)
    )
    np.testing.assert_allclose(on, [0, 0, 0, 0, -CRADLE * 0.03 - CRADLE_DAMPING * 0.5, 0], atol=1e-6)
    assert turned - energy == pytest.approx(0.5 * CRADLE * 0.03**2, rel=1e-6)
    assert power == pytest.approx(CRADLE_DAMPING * 0.25)


def test_what_cannot_hang_is_refused():
    with pytest.raises(InputError, match=r"inertia None cannot find its seat on the ground; give support 'spring'"):
        wrench(Target("spring"), (0, 0, 0), (0, 0, 0))
    with pytest.raises(InputError, match=r"a hung target's damping is 5; give 0"):
        wrench(Target("spring", inertia=SIDE, damping=5.0), (0, 0, 0), (0, 0, 0))
